"""`rolling-panda bench familiarity`: whether pictures unlike those of the training are told from frames of vines.

Familiar are the survey's frames of rendered rows, with and without depth, and the photographs of --vines. Unfamiliar
are the example pictures of scikit-image, the same frames at night, overexposed and out of focus, and the folders of
--others. Told are the area under the ROC curve, and of each kind how many the network's limit calls unfamiliar.
"""

from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np
import skimage
from numpy.typing import NDArray
from PIL import Image, ImageFilter

from benchmarks.common.documents import bench_parser, write
from bridge.sim.camera.config import CameraConfig
from bridge.sim.camera.frame import camera_pose, survey_place
from bridge.sim.camera.renderer import Camera
from bridge.sim.vineyard.config import VineyardConfig
from bridge.sim.vineyard.grow import grow
from perception.segmentation.frame import UnusablePictureError
from perception.segmentation.network_segmenter import NetworkSegmenter
from perception.segmentation.segmenter import SHIPPED
from perception.single_image import load_photograph, segment_photograph
from rolling_panda.errors import ConfigError, InputError
from rolling_panda.model.robot import RobotModel
from rolling_panda.resources import resource

#: Pictures that scikit-image carries: people, animals, things, writing, textures, sky, tissue.
_EXAMPLES = (
    "astronaut.png brick.png camera.png chelsea.png coffee.png coins.png grass.png gravel.png hubble_deep_field.jpg "
    "ihc.png moon.png motorcycle_left.png page.png retina.jpg rocket.jpg text.png"
).split()
_SUFFIXES = (".jpg", ".jpeg", ".png", ".webp", ".bmp")
#: Frames of each row, and of how many of them one is spoilt in each way.
_FRAMES, _SPOILT = 20, 5

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
    words = parser.parse_args(argv)
    if not 1 <= words.rows <= 1000:
        raise InputError(f"--rows {words.rows}: give 1 to 1000")
    segmenter = NetworkSegmenter(words.weights or resource(SHIPPED))
    frames = list(_frames(words.seed, words.rows))
    familiar = {
        "survey frames": [_strangeness(segmenter, color, depth) for color, depth in frames],
        "the same without depth": [_strangeness(segmenter, color, None) for color, _ in frames[::2]],
        **{folder.name: _of_folder(segmenter, folder) for folder in words.vines},
    }
    examples = Path(skimage.__file__).parent / "data"
    others = {
        "examples of scikit-image": [_of_photograph(segmenter, examples / name) for name in _EXAMPLES],
        **{folder.name: _of_folder(segmenter, folder) for folder in words.others},
        **{
            kind: [_strangeness(segmenter, spoilt(color, kind), None) for color, _ in frames[::_SPOILT]]
            for kind in ("night", "overexposed", "out of focus")
        },
    }
    limit = segmenter.familiar
    assert limit is not None
    known, strange = (np.concatenate([np.array(v) for v in kinds.values()]) for kinds in (familiar, others))
    print(f"area under the ROC curve {area(known, strange):.3f}; limit {limit:.2f}")
    summary = {name: share(values, limit) for name, values in (familiar | others).items()}
    for name, each in summary.items():
        print(f"{name:28} unfamiliar {each['unfamiliar']:4.0f} of {each['n']:4.0f}   median {each['median']:.2f}")
    write(words.json, {"weights": segmenter.name, "limit": limit, "area": area(known, strange), "summary": summary})
    return 0


def _frames(seed: int, rows: int) -> Iterator[Picture]:
    model = RobotModel()
    for number in range(seed, seed + rows):
        config = VineyardConfig(vines=3)
        row, camera = grow(config, number), Camera(CameraConfig(), number)
        length = config.vines * config.vine_spacing
        for sequence, x in enumerate(np.linspace(0.0, length, _FRAMES) + config.first_vine_x - config.vine_spacing):
            image = camera.render(row, camera_pose(model, *survey_place(float(x))), sequence)
            yield image.color, image.depth


def spoilt(color: NDArray[np.uint8], kind: str) -> NDArray[np.uint8]:
    """A colour image (H×W×3) at night, overexposed or out of focus."""
    if kind == "out of focus":
        return np.asarray(Image.fromarray(color).filter(ImageFilter.GaussianBlur(12.0)))
    noise = np.random.default_rng(0).normal(0.0, 3.0, color.shape)
    return np.clip(color * (0.06 if kind == "night" else 5.0) + noise, 0.0, 255.0).astype(np.uint8)


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


def _of_folder(segmenter: NetworkSegmenter, folder: Path) -> list[float]:
    found = sorted(path for path in folder.rglob("*") if path.suffix.lower() in _SUFFIXES)
    if not found:
        raise InputError(f"{folder} holds no photograph; give a folder with {', '.join(_SUFFIXES)} files")
    return [_of_photograph(segmenter, path) for path in found]


def _of_photograph(segmenter: NetworkSegmenter, path: Path) -> float:
    """As `perceive` sees it."""
    try:
        segment_photograph(load_photograph(path), segmenter)
    except UnusablePictureError:
        # A blank picture is refused before the network sees it.
        return float("inf")
    return _told(segmenter)


def _strangeness(segmenter: NetworkSegmenter, color: NDArray[np.uint8], depth: NDArray[np.float32] | None) -> float:
    try:
        segmenter.classify(color, depth)
    except UnusablePictureError:
        return float("inf")
    return _told(segmenter)


def _told(segmenter: NetworkSegmenter) -> float:
    if segmenter.strangeness is None or segmenter.familiar is None:
        raise ConfigError(f"{segmenter.name} does not tell how strange a picture is")
    return segmenter.strangeness
