"""`rolling-panda bench familiarity`: whether pictures unlike those of the training are told from frames of vines.

Familiar are the survey's frames of rendered rows, with and without depth, frames of Guyot vines, and frames from nearer
and turned. Unfamiliar are the example pictures of scikit-image, noise, the same frames spoilt in several ways and
degrees, and the folders of --others, each a kind of its own. Photographs of --vines are of neither side. Told are the
area under the ROC curve, and how many of each kind are above the network's limit. --scores compares other scores.
"""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import skimage
from msgspec.structs import replace
from numpy.typing import NDArray
from PIL import Image, ImageDraw, ImageFilter
from scipy.spatial.transform import Rotation

from benchmarks.common.documents import bench_parser, write
from benchmarks.perception.familiarity_scores import Probe, Reading, scores
from bridge.sim.camera.config import CameraConfig
from bridge.sim.camera.frame import camera_pose, survey_place
from bridge.sim.camera.renderer import Camera
from bridge.sim.vineyard.config import VineyardConfig
from bridge.sim.vineyard.grow import grow
from perception.segmentation.frame import UnusablePictureError
from perception.segmentation.network_segmenter import NetworkSegmenter
from perception.segmentation.segmenter import SHIPPED
from perception.single_image import FIRST_WIDTH, load_photograph
from rolling_panda.errors import ConfigError, InputError
from rolling_panda.model.robot import RobotModel
from rolling_panda.resources import resource

#: Pictures that scikit-image carries: people, animals, things, writing, textures, sky, tissue.
_EXAMPLES = (
    "astronaut.png brick.png camera.png chelsea.png coffee.png coins.png grass.png gravel.png hubble_deep_field.jpg "
    "ihc.png moon.png motorcycle_left.png page.png retina.jpg rocket.jpg text.png"
).split()
_SUFFIXES = (".jpg", ".jpeg", ".png", ".webp", ".bmp")
#: Frames of each row, and of how many of them one is spoilt in each way; pictures of noise.
_FRAMES, _SPOILT, _NOISE = 20, 5, 8
#: A frame from nearer is so much nearer (m), and turned by so much (degrees, standard deviation about each axis).
_NEARER, _TURNED = (0.1, 0.4), (4.0, 8.0, 4.0)
#: Rows that training pictures are rendered of, for --scores; the first seed is that of `training.familiarity`.
_TRAINING_SEED, _TRAINING_ROWS = 8_500_000, 40
#: Of each way to spoil a frame, its degrees: factor, pixels, or share of the picture.
SPOILT: dict[str, tuple[float, ...]] = {
    "darker": (0.25, 0.06),
    "brighter": (2.0, 5.0),
    "out of focus": (2.0, 4.0, 12.0),
    "lens covered": (0.25, 0.5, 0.9),
    "green leaves": (0.1, 0.3, 0.6),
    "fog": (0.3, 0.6),
    "orange light": (1.3,),
    "upside down": (1.0,),
}

Picture = tuple[NDArray[np.uint8], NDArray[np.float32] | None]


def main(argv: Sequence[str] | None = None) -> int:
    """Run the command; returns the exit code."""
    parser = bench_parser("familiarity", __doc__)
    parser.add_argument("--seed", type=int, default=3000, help="of the first row (default: %(default)s)")
    parser.add_argument("--rows", type=int, default=10, help="rendered rows (default: %(default)s)")
    parser.add_argument(
        "--vines", type=Path, nargs="*", default=[], metavar="DIR", help="photographs of vines in winter"
    )
    parser.add_argument("--others", type=Path, nargs="*", default=[], metavar="DIR", help="photographs of other things")
    parser.add_argument("--weights", type=Path, metavar="FILE", help="your own network (default: the shipped one)")
    parser.add_argument("--scores", action="store_true", help="compare other scores; needs `make training`")
    words = parser.parse_args(argv)
    if not 1 <= words.rows <= 1000:
        raise InputError(f"--rows {words.rows}: give 1 to 1000")
    path = words.weights or resource(SHIPPED)
    segmenter = NetworkSegmenter(path)
    frames = _frames(words.seed, words.rows)
    rng = np.random.default_rng(0)
    familiar: dict[str, list[Picture]] = {
        "survey frames": frames["survey"],
        "the same without depth": [(color, None) for color, _ in frames["survey"][::2]],
        "nearer and turned": frames["nearer"],
        "Guyot": frames["guyot"],
    }
    examples = Path(skimage.__file__).parent / "data"
    others: dict[str, list[Picture]] = {
        "examples of scikit-image": [_photograph(examples / name) for name in _EXAMPLES],
        **{folder.name: _of_folder(folder) for folder in words.others},
        "noise": [(rng.integers(0, 256, (480, 848, 3)).astype(np.uint8), None) for _ in range(_NOISE)],
        **{
            f"{kind} {degree:g}": [spoilt(picture, kind, degree, rng) for picture in frames["survey"][::_SPOILT]]
            for kind, degrees in SPOILT.items()
            for degree in degrees
        },
    }
    # Photographs of vines are of neither side: only some networks have learned their like.
    vines = {folder.name: _of_folder(folder) for folder in words.vines}
    told = {name: [_strangeness(segmenter, *each) for each in all] for name, all in (familiar | others | vines).items()}
    limit = segmenter.familiar
    assert limit is not None
    known, strange = (np.concatenate([np.array(told[name]) for name in kinds]) for kinds in (familiar, others))
    print(f"area under the ROC curve {area(known, strange):.3f}; limit {limit:.2f}")
    summary = {
        name: share(values, limit) | ({} if name in familiar else {"area": area(known, np.array(values))})
        for name, values in told.items()
    }
    for name, each in summary.items():
        wide = f"   area {each['area']:.3f}" if "area" in each else ""
        print(f"{name:28} unfamiliar {each['unfamiliar']:4.0f} of {each['n']:4.0f}   median {each['median']:.2f}{wide}")
    document: dict[str, Any] = {
        "weights": segmenter.name,
        "limit": limit,
        "area": area(known, strange),
        "summary": summary,
    }
    if words.scores:
        document["scores"] = _compare(Probe(path), familiar, others, vines)
    write(words.json, document)
    return 0


def _compare(
    probe: Probe,
    familiar: dict[str, list[Picture]],
    others: dict[str, list[Picture]],
    vines: dict[str, list[Picture]],
) -> dict[str, dict[str, Any]]:
    """Of each score: areas under the ROC curve, and the shares above its limit by kind."""
    from perception.training.scenes import SURVEY_VIEWS, render_scenes

    scenes = render_scenes(_TRAINING_SEED, _TRAINING_ROWS).of_views(SURVEY_VIEWS)
    training = [
        # As in training, a third is without depth.
        probe.read(color, None if number % 3 == 2 else depth.astype(np.float32))
        for number, (color, depth) in enumerate(zip(scenes.color, scenes.depth, strict=True))
    ]
    readings: dict[str, list[Reading]] = {
        name: [probe.read(*each) for each in all] for name, all in (familiar | others | vines).items()
    }
    out: dict[str, dict[str, Any]] = {}
    for name, (score, limit) in scores(training).items():
        values = {kind: score(all) for kind, all in readings.items()}
        known, strange = (np.concatenate([values[kind] for kind in kinds]) for kinds in (familiar, others))
        out[name] = {
            "limit": limit,
            "area": area(known, strange),
            "false_alarms": float((known > limit).mean()),
            "found": float((strange > limit).mean()),
            "by_kind": {kind: float((each > limit).mean()) for kind, each in values.items()},
        }
        print(
            f"{name:24} area {out[name]['area']:.3f}   unfamiliar: {out[name]['false_alarms']:.1%} of familiar, "
            f"{out[name]['found']:.1%} of the others"
        )
    return out


def _frames(seed: int, rows: int) -> dict[str, list[Picture]]:
    model = RobotModel()
    out: dict[str, list[Picture]] = {"survey": [], "nearer": [], "guyot": []}
    for number in range(seed, seed + rows):
        config, rng = VineyardConfig(vines=3), np.random.default_rng(number)
        row, camera = grow(config, number), Camera(CameraConfig(), number)
        guyot = grow(replace(config, training="guyot"), number)
        length = config.vines * config.vine_spacing
        for sequence, x in enumerate(np.linspace(0.0, length, _FRAMES) + config.first_vine_x - config.vine_spacing):
            place = camera_pose(model, *survey_place(float(x)))
            image = camera.render(row, place, sequence)
            out["survey"].append((image.color, image.depth))
            if sequence % _SPOILT == 0:
                image = camera.render(guyot, place, sequence)
                out["guyot"].append((image.color, image.depth))
                nearer = place.copy()
                nearer[:3, 3] += rng.uniform(*_NEARER) * place[:3, 2]
                nearer[:3, :3] = place[:3, :3] @ Rotation.from_rotvec(rng.normal(0.0, np.radians(_TURNED))).as_matrix()
                image = camera.render(row, nearer, sequence)
                out["nearer"].append((image.color, image.depth))
    return out


def spoilt(picture: Picture, kind: str, degree: float, rng: np.random.Generator) -> Picture:
    """A picture spoilt in one of the ways of `SPOILT`; its depth stays what it was."""
    color, depth = picture
    height, width = color.shape[:2]
    noise = rng.normal(0.0, 3.0, color.shape)
    if kind == "upside down":
        return np.ascontiguousarray(color[::-1]), None if depth is None else np.ascontiguousarray(depth[::-1])
    if kind == "out of focus":
        return np.asarray(Image.fromarray(color).filter(ImageFilter.GaussianBlur(degree))), depth
    out = color.astype(float)
    if kind == "lens covered":
        covered = slice(0, round(degree * width))
        out[:, covered] = np.array([60.0, 35.0, 28.0]) + noise[:, covered]
    elif kind == "green leaves":
        leaves = Image.fromarray(color)
        draw, grown = ImageDraw.Draw(leaves), 0.0
        while grown < degree * width * height:
            x, y, r = rng.uniform(0.0, width), rng.uniform(0.0, height), rng.uniform(12.0, 45.0)
            green = tuple(int(value) for value in np.array([70.0, 130.0, 45.0]) * rng.uniform(0.5, 1.4))
            draw.ellipse((x - r, y - 0.8 * r, x + r, y + 0.8 * r), fill=green)
            grown += 0.8 * np.pi * r * r
        out = np.asarray(leaves).astype(float)
    elif kind == "fog":
        out = (1.0 - degree) * out + degree * 225.0
    elif kind == "orange light":
        out *= np.array([degree, 0.9, 0.6])
    else:
        out = degree * out + noise
    return np.clip(out, 0.0, 255.0).astype(np.uint8), depth


def area(familiar: NDArray[np.float64], strange: NDArray[np.float64]) -> float:
    """Area under the ROC curve: the probability that the strange one of two pictures is the stranger."""
    return float((familiar[:, None] < strange).mean() + 0.5 * (familiar[:, None] == strange).mean())


def share(values: Sequence[float], limit: float) -> dict[str, float]:
    """How many pictures are above the limit, of how many, and their median."""
    return {
        "unfamiliar": float(np.sum(np.array(values) > limit)),
        "n": float(len(values)),
        "median": float(np.median(values)),
    }


def _of_folder(folder: Path) -> list[Picture]:
    found = sorted(path for path in folder.rglob("*") if path.suffix.lower() in _SUFFIXES)
    if not found:
        raise InputError(f"{folder} holds no photograph; give a folder with {', '.join(_SUFFIXES)} files")
    return [_photograph(path) for path in found]


def _photograph(path: Path) -> Picture:
    """At the width at which `perceive` first looks at it."""
    return load_photograph(path).scaled(FIRST_WIDTH).color, None


def _strangeness(segmenter: NetworkSegmenter, color: NDArray[np.uint8], depth: NDArray[np.float32] | None) -> float:
    try:
        segmenter.classify(color, depth)
    except UnusablePictureError:
        # A blank picture is refused before the network sees it.
        return float("inf")
    if segmenter.strangeness is None or segmenter.familiar is None:
        raise ConfigError(f"{segmenter.name} does not tell how strange a picture is")
    return segmenter.strangeness
