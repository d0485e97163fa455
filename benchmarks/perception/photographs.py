"""`rolling-panda bench photographs DIR --masks DIR`: classes of photographs, compared with masks that people drew.

DIR holds photographs; the masks are PNG files of the same names and sizes, whose values are indices of --classes. Sizes
and tolerance are in pixels of the photograph; the network itself sees it as `perceive` does.
"""

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageOps
from scipy.ndimage import center_of_mass, distance_transform_edt, label
from skimage.color import rgb2lab
from skimage.filters import sato

from benchmarks.common.documents import bench_parser, write
from perception.arrays import Labels, Mask
from perception.config import PerceptionConfig
from perception.models.judge import SAME, TOGETHER, Agreement, compared, tell
from perception.pipeline import with_width_bias
from perception.segmentation.frame import CANE
from perception.segmentation.network_segmenter import PhotographSegmenter
from perception.segmentation.segmenter import PHOTOGRAPHS, SHIPPED
from perception.single_image import Photograph, find_cuts, load_photograph, segment_photograph
from rolling_panda.errors import InputError
from rolling_panda.resources import resource

#: The best share of a ridge filter's pixels, and the widths it looks for (px of the photograph).
_DECILE, _WIDTHS = 90.0, (2.0, 3.0, 4.0)
_SUFFIXES = (".jpg", ".jpeg", ".png", ".tif", ".tiff", ".webp", ".bmp")
#: Canes begin where their mask is so near to that of trunk or cordon (share of the photograph's width).
_TOUCHING = 0.004
#: Bases nearer to each other are one; a base is told by a point or a reason so near to it (share of the width).
_NEAR_BASE = 0.03
#: A point with more confidence than this must be on a cane.
_CONFIDENT = 0.8
#: Width of a picture in the gallery (px).
_SHOWN = 960


class Method(Protocol):
    """Tells classes of a photograph."""

    def __call__(self, path: Path) -> tuple[Labels, NDArray[np.float32] | None]:
        """H×W classes at the photograph's own size, and the probability of each pixel's class."""


def main(argv: Sequence[str] | None = None) -> int:
    """Run the command; returns the exit code."""
    parser = bench_parser("photographs", __doc__)
    parser.add_argument("photographs", type=Path, metavar="DIR", help="photographs")
    parser.add_argument("--masks", type=Path, required=True, metavar="DIR", help="a PNG for each, of the same name")
    parser.add_argument(
        "--classes",
        default="background,trunk,cane,cordon",
        help=f"names of the masks' values, from 0; compared are {', '.join(SAME)} (default: %(default)s)",
    )
    parser.add_argument("--weights", type=Path, metavar="FILE", help="your own network (default: as `perceive`)")
    parser.add_argument("--method", choices=("network", "ridge"), default="network", help="ridge: a filter, to beat")
    parser.add_argument("--tolerance", type=float, default=3.0, metavar="PX", help="(default: %(default)s)")
    parser.add_argument("--gallery", type=Path, metavar="FILE", help="write the photographs here, the worst first")
    words = parser.parse_args(argv)
    if not 0.0 <= words.tolerance <= 100.0:
        raise InputError(f"--tolerance {words.tolerance}: give 0 to 100 pixels")
    classes = tuple(name.strip() for name in words.classes.split(","))
    paths = [words.weights] if words.weights else [resource(SHIPPED), resource(PHOTOGRAPHS)]
    segmenter = None if words.method == "ridge" else PhotographSegmenter(*paths)
    method = ridge if segmenter is None else network(segmenter)
    totals = {name: Agreement() for name in (*SAME, *TOGETHER)}
    places = Places()
    results: list[dict[str, Any]] = []
    shown: list[tuple[float, NDArray[np.uint8]]] = []
    for path, mask_path in pairs(words.photographs, words.masks):
        truth = load_mask(mask_path, classes)
        told, likely = method(path)
        if told.shape != next(iter(truth.values())).shape:
            raise InputError(f"{mask_path} is not of the size of {path}, {told.shape[1]}×{told.shape[0]} pixels")
        own = {name: Agreement() for name in totals}
        for name, true, said in compared(truth, told):
            own[name].add(true, said, words.tolerance, likely)
            totals[name].add(true, said, words.tolerance, likely)
        if segmenter is not None:
            places.add(truth, load_photograph(path), segmenter, words.tolerance)
        results.append({"photograph": path.name, **{name: each.figures() for name, each in own.items()}})
        if words.gallery is not None:
            shown.append((own["wood"].figures()["f"] or 0.0, tile(path, truth, told)))
    for name, each in totals.items():
        print(line(name, each.figures()))
    if segmenter is not None:
        print(places.line())
    if words.gallery is not None:
        shown.sort(key=lambda entry: entry[0])
        words.gallery.parent.mkdir(parents=True, exist_ok=True)
        Image.fromarray(np.vstack([picture for _, picture in shown])).save(words.gallery)
    document = {
        "method": words.method,
        "weights": None if words.weights is None else words.weights.name,
        "tolerance_px": words.tolerance,
        "photographs": len(results),
        "summary": {name: each.figures() for name, each in totals.items()},
        "places": None if segmenter is None else asdict(places),
        "results": results,
    }
    write(words.json, document)
    return 0


def pairs(photographs: Path, masks: Path) -> list[tuple[Path, Path]]:
    """Photographs of a folder with their masks, by name.

    Raises:
        InputError: There is no photograph, or one without a mask.
    """
    if not photographs.is_dir():
        raise InputError(f"{photographs} is no folder")
    found = sorted(path for path in photographs.iterdir() if path.suffix.lower() in _SUFFIXES)
    if not found:
        raise InputError(f"{photographs} holds no photograph; give a folder with {', '.join(_SUFFIXES)} files")
    out = [(path, masks / f"{path.stem}.png") for path in found]
    for path, mask in out:
        if not mask.is_file():
            raise InputError(f"{path} has no mask; {mask} is wanted")
    return out


def load_mask(path: Path, classes: Sequence[str]) -> dict[str, Mask]:
    """The masks of `SAME`'s classes (H×W each).

    Args:
        path: An image with one channel or a palette, whose values are indices of the classes.
        classes: Their names from 0.

    Raises:
        InputError: It cannot be read, is in colour, or has a value without a class.
    """
    try:
        with Image.open(path) as image:
            if image.mode not in ("1", "L", "P", "I", "I;16"):
                raise InputError(f"{path} has mode {image.mode}; give class indices in one channel or with a palette")
            values = np.asarray(image).astype(np.int64)
    except (OSError, SyntaxError, ValueError, Image.DecompressionBombError) as error:
        raise InputError(f"cannot read the mask {path}: {error}") from error
    if values.max(initial=0) >= len(classes):
        raise InputError(f"{path} holds the value {values.max()}; --classes names {len(classes)}: {', '.join(classes)}")
    return {name: np.isin(values, [k for k, each in enumerate(classes) if each == name]) for name in SAME}


@dataclass
class Places:
    """Where canes begin, in the masks and as `perceive` tells them.

    Attributes:
        bases: Places in the masks where a cane meets trunk or cordon.
        told: Of these, with a point or a reason near.
        reasons: Points and reasons with a place.
        at_base: Of these, near a base.
        points: Points.
        wrong: Points of high confidence on no cane.
    """

    bases: int = 0
    told: int = 0
    reasons: int = 0
    at_base: int = 0
    points: int = 0
    wrong: int = 0

    def add(self, truth: dict[str, Mask], whole: Photograph, segmenter: PhotographSegmenter, tolerance: float) -> None:
        """Count one photograph."""
        photograph, (labels, _) = segment_photograph(whole, segmenter)
        result = find_cuts(photograph, labels, with_width_bias(PerceptionConfig(), segmenter.used.width_bias))
        scale = whole.size[0] / labels.shape[1]
        located = [cut.pixel for cut in result.cuts]
        located += [each.pixel for each in result.undecided if each.pixel is not None]
        said = (np.array(located).reshape(-1, 2) + 0.5) * scale - 0.5
        true, near = bases(truth), _NEAR_BASE * whole.size[0]
        gaps = np.hypot(*(true[:, None] - said[None]).transpose(2, 0, 1))
        self.bases += len(true)
        self.told += int((gaps.min(axis=1, initial=np.inf) <= near).sum())
        self.reasons += len(said)
        self.at_base += int((gaps.min(axis=0, initial=np.inf) <= near).sum())
        self.points += len(result.cuts)
        off = distance_transform_edt(~truth["cane"])
        for (u, v), cut in zip(said, result.cuts, strict=False):
            self.wrong += bool(cut.cut.confidence > _CONFIDENT and off[round(v), round(u)] > tolerance)

    def line(self) -> str:
        """For people."""
        return (
            f"canes begin at {self.bases} places: {self.told} have a point or a reason; of {self.reasons} points and "
            f"reasons {self.at_base} are at such a place; {self.points} points, {self.wrong} sure but on no cane"
        )


def bases(truth: dict[str, Mask]) -> NDArray[np.float64]:
    """Columns and rows of the places where the mask of canes meets trunk or cordon (N×2)."""
    old_wood = truth["trunk"] | truth["cordon"]
    contact = truth["cane"] & (distance_transform_edt(~old_wood) <= _TOUCHING * old_wood.shape[1])
    if not (contact.any() and old_wood.any()):
        return np.empty((0, 2))
    # What is nearer to each other than that is one part after it was widened by half of it.
    wide = distance_transform_edt(~contact) <= _NEAR_BASE / 2 * old_wood.shape[1]
    parts, count = label(wide, np.ones((3, 3)))
    middles = center_of_mass(contact, parts, range(1, count + 1))
    return np.array(middles, float).reshape(-1, 2)[:, ::-1]


def network(segmenter: PhotographSegmenter) -> Method:
    """The network as `perceive` uses it."""
    return lambda path: tell(load_photograph(path), segmenter)


def ridge(path: Path) -> tuple[Labels, None]:
    """Canes by a ridge filter on the blue-yellow channel: what a network must beat."""
    response = sato(rgb2lab(_color(path))[..., 2], sigmas=_WIDTHS, black_ridges=False)
    return np.where(response > np.percentile(response, _DECILE), CANE, 0).astype(np.uint8), None


def tile(path: Path, truth: dict[str, Mask], told: Labels) -> NDArray[np.uint8]:
    """The photograph, and beside it where wood was found (green), missed (red) and told wrongly (blue)."""
    color = _color(path)
    true = np.any(list(truth.values()), axis=0)
    said = np.isin(told, [k for same in SAME.values() for k in same])
    marked = (color * 0.5).astype(np.uint8)
    for where, paint in ((true & said, (40, 220, 60)), (true & ~said, (240, 40, 40)), (said & ~true, (70, 110, 255))):
        marked[where] = paint
    both = Image.fromarray(np.hstack([color, marked]))
    out: NDArray[np.uint8] = np.asarray(both.resize((2 * _SHOWN, round(_SHOWN * color.shape[0] / color.shape[1]))))
    return out


def _color(path: Path) -> NDArray[np.uint8]:
    try:
        with Image.open(path) as image:
            return np.asarray(ImageOps.exif_transpose(image).convert("RGB"), dtype=np.uint8)
    except (OSError, SyntaxError, ValueError, Image.DecompressionBombError) as error:
        raise InputError(f"cannot read the photograph {path}: {error}") from error


def line(name: str, figures: dict[str, float | None]) -> str:
    """One class's figures for people."""
    return f"{name:18}" + "  ".join(f"{key} {'–' if v is None else format(v, '.3f'):>5}" for key, v in figures.items())
