"""Pruning points of a single photograph, without a robot: with depth in metres, without depth in pixels."""

from dataclasses import dataclass
from dataclasses import replace as replace_field
from pathlib import Path
from typing import Protocol

import msgspec
import numpy as np
from msgspec.structs import replace
from numpy.typing import NDArray
from PIL import Image, ImageOps
from scipy.ndimage import center_of_mass, distance_transform_edt, label
from skimage.morphology import skeletonize

from perception.arrays import Labels, Mask
from perception.config import PerceptionConfig
from perception.rules.keep_out import frame_keep_out
from perception.rules.pruning import Cut, apply_rule
from perception.segmentation.frame import CANE, CORDON, NODE, TRUNK, View
from perception.skeleton.topology import perceive_plant
from rolling_panda import reasons
from rolling_panda.errors import InputError
from rolling_panda.messages.robot import Intrinsics
from rolling_panda.messages.types import Reason

#: Width at which canes are first looked for, the width of the training images; greatest width that is segmented;
#: smallest width and height (px).
FIRST_WIDTH, _MAX_WIDTH, _MIN_SIZE = 848, 1920, 64
#: Median width of canes up to which a larger image shows more (px).
_WIDE_CANE = 12.0
#: Without depth, canes narrower than this are enlarged to the second width (px), and a photograph at most so often.
_NARROW_CANE, _ENLARGED_CANE, _ENLARGE = 4.0, 6.0, 2.0
#: Horizontal field of view without intrinsics (degrees): the colour camera of a RealSense D435i.
_DEFAULT_FIELD_OF_VIEW = 69.0
#: Plausible median depth (m).
_PLAUSIBLE_DEPTH = (0.1, 20.0)
#: Diameter of a common cane (m): the scale of a photograph without depth.
_COMMON_DIAMETER = 0.008
#: Smallest width of canes, and smallest number of cane pixels (px).
_MIN_CANE_WIDTH, _MIN_CANE_PIXELS = 2.0, 40
#: Without depth all lengths are uncertain by this factor: a common cane is 5 to 13 mm thick.
_SCALE_UNCERTAINTY = 1.6
#: A second image point of a cut is this far along the wood (m).
_ALONG = 0.02
#: Canes begin so near to trunk or cordon, and bases nearer to each other are one (widths of a cane).
_BASE_GAP, _SAME_BASE = 3.0, 8.0
#: Least size of a cane that begins there and of a part of trunk or cordon, in squares of a cane's width: not a speck.
_LEAST_CANE, _LEAST_OLD_WOOD = 20.0, 40.0
_EIGHT = np.ones((3, 3))
#: Rotation of a level camera: x right, y down, z forward become x right, y forward, z up.
R_LEVEL = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]])


@dataclass(frozen=True)
class Photograph:
    """A photograph, as its file has it or scaled for the network.

    Attributes:
        color: H×W×3, RGB.
        depth: H×W (m), 0 = invalid; or None.
        intrinsics: Of these images.
        assumed: Whether the intrinsics are a default.
        size: Width and height of the file's image (px).
    """

    color: NDArray[np.uint8]
    depth: NDArray[np.float32] | None
    intrinsics: Intrinsics
    assumed: bool
    size: tuple[int, int]

    def scaled(self, width: int) -> "Photograph":
        """The photograph scaled to a width (px)."""
        own_height, own_width = self.color.shape[:2]
        if own_width == width:
            return self
        scale = width / own_width
        height = round(own_height * scale)
        filtered = Image.Resampling.BOX if scale < 1.0 else Image.Resampling.BICUBIC
        color = np.asarray(Image.fromarray(self.color).resize((width, height), filtered))
        depth = self.depth
        if depth is not None:
            # Nearest neighbour: a mean of foreground and background depth is meaningless.
            rows = ((np.arange(height) + 0.5) / scale).astype(int).clip(max=own_height - 1)
            cols = ((np.arange(width) + 0.5) / scale).astype(int)
            depth = np.ascontiguousarray(depth[rows][:, cols])
        k = self.intrinsics
        k = Intrinsics(
            width, height, k.fx * scale, k.fy * scale, (k.cx + 0.5) * scale - 0.5, (k.cy + 0.5) * scale - 0.5
        )
        return replace_field(self, color=color, depth=depth, intrinsics=k)

    def view(self, depth: NDArray[np.float32]) -> View:
        """As a frame of a level camera at the origin, with the given depth."""
        return View(0, 0.0, self.intrinsics, depth, None, b"", R_LEVEL, np.zeros(3))


class SureSegmenter(Protocol):
    """Tells classes and how sure they are; `NetworkSegmenter` does."""

    def classify_surely(
        self, color: NDArray[np.uint8], depth: NDArray[np.float32] | None
    ) -> tuple[Labels, NDArray[np.float32] | None]:
        """H×W classes of a colour image (H×W×3) with depth (H×W, m) or without, and their probabilities or None."""


def load_photograph(
    image: Path, depth: Path | None = None, intrinsics: Path | None = None, depth_unit: float = 0.001
) -> Photograph:
    """Read and check the files of one photograph.

    Args:
        image: Anything that Pillow reads.
        depth: 16-bit PNG or TIFF with integer counts, or .npy with integer counts or floating-point metres.
        intrinsics: JSON with width, height, fx, fy, cx, cy of the image.
        depth_unit: Metres a count.

    Raises:
        InputError: A file cannot be read, sizes differ, or the depth cannot be in this unit.
    """
    color = _color(image)
    size = (color.shape[1], color.shape[0])
    if min(size) < _MIN_SIZE:
        raise InputError(f"{image} is {size[0]}×{size[1]} pixels; at least {_MIN_SIZE}×{_MIN_SIZE} are needed")
    metres = None if depth is None else _depth(depth, size, depth_unit)
    k = _default_intrinsics(size) if intrinsics is None else _intrinsics(intrinsics, size)
    return Photograph(color, metres, k, intrinsics is None, size)


def segment_photograph(
    photograph: Photograph, segmenter: SureSegmenter
) -> tuple[Photograph, tuple[Labels, NDArray[np.float32] | None]]:
    """Segment a photograph at the scale that suits its canes: the largest at which they are not wide.

    A photograph without depth is enlarged where its canes are narrow.

    Args:
        photograph: As `load_photograph` gives it.
        segmenter: The network.

    Returns:
        The scaled photograph, and the classes of its pixels (H×W) with their probabilities (H×W or None).

    Raises:
        InputError: The image is blank.
    """
    own = photograph.color.shape[1]
    scaled = photograph.scaled(min(own, FIRST_WIDTH))
    found = segmenter.classify_surely(scaled.color, scaled.depth)
    wanted = _suitable_width(own, found[0], enlarge=photograph.depth is None)
    if wanted == scaled.color.shape[1]:
        return scaled, found
    scaled = photograph.scaled(wanted)
    return scaled, segmenter.classify_surely(scaled.color, scaled.depth)


def photograph_width(own: int, labels: Labels) -> int:
    """Width (px) at which `segment_photograph` would segment a photograph whose classes are known.

    Args:
        own: Width of the photograph (px).
        labels: H×W, at any scale.
    """
    width = min(own, FIRST_WIDTH)
    height = max(1, round(labels.shape[0] * width / labels.shape[1]))
    first = Image.fromarray(labels).resize((width, height), Image.Resampling.NEAREST)
    return _suitable_width(own, np.asarray(first), enlarge=True)


def _suitable_width(own: int, labels: Labels, enlarge: bool) -> int:
    """Width (px) at which canes are neither wide nor narrow, from classes at the first width."""
    first: int = labels.shape[1]
    width = cane_width(labels)
    own_width = 0.0 if width is None else width * own / first
    if enlarge and own_width < _NARROW_CANE:
        wanted = own * _ENLARGED_CANE / max(own_width, 1.0)
        return int(min(_MAX_WIDTH, _ENLARGE * own, wanted))
    wanted = _MAX_WIDTH if width is None else int(first * _WIDE_CANE / width)
    return min(own, max(first, min(_MAX_WIDTH, wanted)))


def cane_width(labels: Labels) -> float | None:
    """Width of the cane at the median cane pixel (px); None where too few pixels are of canes.

    So many specks and canes of rows behind, which have more length than pixels, do not decide.
    """
    wood = _cane_mask(labels)
    if np.count_nonzero(wood) < _MIN_CANE_PIXELS:
        return None
    widths = np.sort(2.0 * distance_transform_edt(wood)[skeletonize(wood)] - 1.0)
    pixels = np.cumsum(widths)
    return float(widths[np.searchsorted(pixels, pixels[-1] / 2.0)])


def _color(path: Path) -> NDArray[np.uint8]:
    try:
        with Image.open(path) as image:
            return np.asarray(ImageOps.exif_transpose(image).convert("RGB"), dtype=np.uint8)
    except (OSError, SyntaxError, ValueError, Image.DecompressionBombError) as error:
        raise InputError(f"cannot read the image {path}: {error}") from error


def _depth(path: Path, size: tuple[int, int], unit: float) -> NDArray[np.float32]:
    try:
        if path.suffix == ".npy":
            values = np.load(path, allow_pickle=False)
        else:
            with Image.open(path) as image:
                values = np.asarray(image)
    except (OSError, SyntaxError, ValueError) as error:
        raise InputError(f"cannot read the depth {path}: {error}") from error
    if values.shape != (size[1], size[0]):
        raise InputError(
            f"{path} has the shape {values.shape}; the image needs {(size[1], size[0])}, one value a pixel"
        )
    if not (np.issubdtype(values.dtype, np.integer) or np.issubdtype(values.dtype, np.floating)):
        raise InputError(f"{path} holds {values.dtype}; depth is integer counts or floating-point metres")
    metres = values.astype(np.float32) * (unit if np.issubdtype(values.dtype, np.integer) else 1.0)
    metres = np.where(np.isfinite(metres) & (metres > 0.0), metres, np.float32(0.0)).astype(np.float32)
    valid = metres[metres > 0.0]
    if not len(valid):
        raise InputError(f"{path} has no depth at all: every value is 0, negative or not a number")
    middle = float(np.median(valid))
    if not _PLAUSIBLE_DEPTH[0] <= middle <= _PLAUSIBLE_DEPTH[1]:
        raise InputError(
            f"{path}: the median depth is {middle:.4g} m; give the metres a count with --depth-unit (now {unit:g})"
        )
    return metres


def _intrinsics(path: Path, size: tuple[int, int]) -> Intrinsics:
    try:
        k = msgspec.json.decode(path.read_bytes(), type=Intrinsics)
    except (OSError, msgspec.MsgspecError) as error:
        raise InputError(
            f"cannot read the intrinsics {path}: {error}; it needs width, height, fx, fy, cx, cy"
        ) from error
    if (k.width, k.height) != size:
        raise InputError(f"{path} is for {k.width}×{k.height} pixels; the image has {size[0]}×{size[1]}")
    if k.fx <= 0.0 or k.fy <= 0.0:
        raise InputError(f"{path}: focal lengths must be positive, got {k.fx} and {k.fy}")
    return k


def _default_intrinsics(size: tuple[int, int]) -> Intrinsics:
    focal = max(size) / 2 / float(np.tan(np.radians(_DEFAULT_FIELD_OF_VIEW) / 2))
    return Intrinsics(size[0], size[1], focal, focal, (size[0] - 1) / 2, (size[1] - 1) / 2)


@dataclass(frozen=True)
class ImageCut:
    """A cut in a photograph, with pixels of the scaled image.

    Attributes:
        cut: In the frame of a level camera at the origin (x right, y forward, z up).
        pixel: Column and row.
        beyond: Column and row of a point farther along the wood.
        spur: Number along the cordon, from 1.
    """

    cut: Cut
    pixel: tuple[float, float]
    beyond: tuple[float, float]
    spur: int


@dataclass(frozen=True)
class Undecided:
    """A place without a cut, or a photograph without any.

    Attributes:
        reason: Reason.
        pixel: Column and row in the scaled image; None where it is about the whole of it.
    """

    reason: Reason
    pixel: tuple[float, float] | None = None


@dataclass(frozen=True)
class ImageResult:
    """Cuts in one photograph.

    Attributes:
        cuts: Proposed cuts.
        undecided: What is undecided, and why.
        spurs: Number of spurs.
        canes: Number of canes rooted at a spur.
        scale: Source of the scale, as text.
    """

    cuts: tuple[ImageCut, ...]
    undecided: tuple[Undecided, ...]
    spurs: int
    canes: int
    scale: str


def find_cuts(photograph: Photograph, labels: Labels, config: PerceptionConfig) -> ImageResult:
    """Apply plant model and rule to a photograph.

    Args:
        photograph: The photograph.
        labels: H×W class indices.
        config: Section `[perception]`.
    """
    if photograph.depth is None:
        assumed = _assumed_depth(photograph, labels)
        if isinstance(assumed, Reason):
            return ImageResult((), (Undecided(assumed),), 0, 0, "none")
        depth = np.full(labels.shape, assumed, np.float32)
        config = _with_scale_uncertainty(config)
        scale = f"no depth: the median cane is taken to be {1000 * _COMMON_DIAMETER:.0f} mm thick"
    else:
        depth, scale = photograph.depth, "depth image"
        if np.count_nonzero(_cane_mask(labels) & (depth > 0.0)) < _MIN_CANE_PIXELS:
            return ImageResult((), (Undecided(reasons.no_cane_with_depth()),), 0, 0, scale)
    view = photograph.view(depth)
    plant = perceive_plant(view, labels, config.skeleton)
    cuts: list[ImageCut] = []
    undecided: list[Undecided] = []
    places: list[tuple[float, float]] = []
    keep_out = frame_keep_out(view, labels, (), config.rule)
    for number, spur in enumerate(plant.spurs, 1):
        decision = apply_rule(spur, config.rule, plant.other_canes(spur), keep_out)
        places.append(_pixel(view, spur.position))
        undecided += [Undecided(reasons.spur_left(number, reason), places[-1]) for reason in decision.undecided]
        for cut in decision.cuts:
            beyond = _pixel(view, cut.position + _ALONG * cut.tangent)
            cuts.append(ImageCut(cut, _pixel(view, cut.position), beyond, number))
    undecided += [Undecided(reasons.cane_without_spur(), base) for base in _bases(labels, places)]
    if not plant.spurs:
        undecided.append(Undecided(reasons.no_spur_recognised()))
    return ImageResult(tuple(cuts), tuple(undecided), len(plant.spurs), sum(len(s.canes) for s in plant.spurs), scale)


def _pixel(view: View, point: NDArray[np.float64]) -> tuple[float, float]:
    u, v, _ = view.pixels(point)[0]
    return float(u), float(v)


def _bases(labels: Labels, known: list[tuple[float, float]]) -> list[tuple[float, float]]:
    """Where canes begin at trunk or cordon, far from places that are known (pixels)."""
    width = cane_width(labels)
    if width is None:
        return []
    canes = _large(_cane_mask(labels), _LEAST_CANE * width**2)
    old_wood = _large(np.isin(labels, (TRUNK, CORDON)), _LEAST_OLD_WOOD * width**2)
    if not old_wood.any():
        return []
    contact, count = label(canes & (distance_transform_edt(~old_wood) <= _BASE_GAP * width), _EIGHT)
    out: list[tuple[float, float]] = []
    for row, column in center_of_mass(contact, contact, range(1, count + 1)):
        if all(np.hypot(column - u, row - v) > _SAME_BASE * width for u, v in (*known, *out)):
            out.append((float(column), float(row)))
    return out


def _large(mask: Mask, pixels: float) -> Mask:
    """The connected parts of a mask with more than so many pixels."""
    parts, _ = label(mask, _EIGHT)
    large = np.bincount(parts.ravel()) > pixels
    large[0] = False
    out: Mask = large[parts]
    return out


def _with_scale_uncertainty(config: PerceptionConfig) -> PerceptionConfig:
    """Any distance, and wider limits of plausible internodes, for lengths of uncertain scale."""
    rule = replace(
        config.rule,
        min_node_distance=config.rule.min_node_distance / _SCALE_UNCERTAINTY,
        min_internode=config.rule.min_internode / _SCALE_UNCERTAINTY,
        max_internode=config.rule.max_internode * _SCALE_UNCERTAINTY,
    )
    return replace(config, rule=rule, skeleton=replace(config.skeleton, min_depth=0.0, max_depth=np.inf))


def _cane_mask(labels: Labels) -> Mask:
    return np.isin(labels, (CANE, NODE))


def _assumed_depth(photograph: Photograph, labels: Labels) -> float | Reason:
    """Depth at which the visible canes would have a common thickness (m), or the reason why there is none."""
    width = cane_width(labels)
    if width is None:
        return reasons.no_cane_recognised()
    if width < _MIN_CANE_WIDTH:
        return reasons.canes_too_narrow(width, _MIN_CANE_WIDTH)
    return photograph.intrinsics.fx * _COMMON_DIAMETER / width
