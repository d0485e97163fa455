"""A photograph, and the depth and intrinsics that may come with it, read from files and checked."""

from dataclasses import dataclass
from pathlib import Path

import msgspec
import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageOps

from perception.segmentation.frame import View
from rolling_panda.errors import InputError
from rolling_panda.messages.robot import Intrinsics

#: Wider photographs are made smaller to this, which is what the network is used to (px).
WIDEST, _SMALLEST = 848, 64
#: Horizontal field of view that is assumed where nobody says (degrees): a RealSense D435i's colour camera.
_ASSUMED_VIEW = 69.0
#: Where most of a depth image lies outside of this, its unit is wrong (m).
_PLAUSIBLE = (0.1, 20.0)
#: Level camera: x right, y down, z forward become x right, y forward, z up.
R_LEVEL = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]])


@dataclass(frozen=True)
class Photograph:
    """A photograph as perception works on it.

    Attributes:
        color: H×W×3, RGB, made smaller where it was wide.
        depth: H×W (m), 0 = none; or None.
        intrinsics: Of these images.
        assumed: Whether the intrinsics are a guess.
        size: Width and height of the file's image (px).
    """

    color: NDArray[np.uint8]
    depth: NDArray[np.float32] | None
    intrinsics: Intrinsics
    assumed: bool
    size: tuple[int, int]

    def view(self, depth: NDArray[np.float32]) -> View:
        """A frame of a level camera at the origin, with this depth."""
        return View(0, 0.0, self.intrinsics, depth, None, b"", R_LEVEL, np.zeros(3))


def load_photograph(
    image: Path, depth: Path | None = None, intrinsics: Path | None = None, depth_unit: float = 0.001
) -> Photograph:
    """Read the files of one photograph.

    Args:
        image: Anything that Pillow reads.
        depth: 16-bit PNG or TIFF in counts, or .npy in counts (whole numbers) or metres (fractions).
        intrinsics: JSON with width, height, fx, fy, cx, cy of the image.
        depth_unit: Metres a count.

    Raises:
        InputError: A file cannot be read, sizes differ, or the depth cannot be in this unit.
    """
    color = _color(image)
    size = (color.shape[1], color.shape[0])
    if min(size) < _SMALLEST:
        raise InputError(f"{image} is {size[0]}×{size[1]} pixels; at least {_SMALLEST}×{_SMALLEST} are needed")
    metres = None if depth is None else _depth(depth, size, depth_unit)
    k = _assumed(size) if intrinsics is None else _intrinsics(intrinsics, size)
    if size[0] > WIDEST:
        share = WIDEST / size[0]
        height = round(size[1] * share)
        color = np.asarray(Image.fromarray(color).resize((WIDEST, height), Image.Resampling.BOX))
        if metres is not None:
            # Depth is taken, not averaged: between a cane and the hill behind it there is nothing.
            rows = ((np.arange(height) + 0.5) / share).astype(int).clip(max=size[1] - 1)
            cols = ((np.arange(WIDEST) + 0.5) / share).astype(int)
            metres = np.ascontiguousarray(metres[rows][:, cols])
        k = Intrinsics(
            WIDEST, height, k.fx * share, k.fy * share, (k.cx + 0.5) * share - 0.5, (k.cy + 0.5) * share - 0.5
        )
    return Photograph(color, metres, k, intrinsics is None, size)


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
        raise InputError(f"{path} holds {values.dtype}; depth is whole counts or metres with fractions")
    metres = values.astype(np.float32) * (unit if np.issubdtype(values.dtype, np.integer) else 1.0)
    metres = np.where(np.isfinite(metres) & (metres > 0.0), metres, np.float32(0.0)).astype(np.float32)
    seen = metres[metres > 0.0]
    if not len(seen):
        raise InputError(f"{path} has no depth at all: every value is 0, negative or not a number")
    middle = float(np.median(seen))
    if not _PLAUSIBLE[0] <= middle <= _PLAUSIBLE[1]:
        raise InputError(
            f"{path}: half of the depths are beyond {middle:.4g} m; "
            f"give the metres a count with --depth-unit (now {unit:g})"
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


def _assumed(size: tuple[int, int]) -> Intrinsics:
    focal = max(size) / 2 / float(np.tan(np.radians(_ASSUMED_VIEW) / 2))
    return Intrinsics(size[0], size[1], focal, focal, (size[0] - 1) / 2, (size[1] - 1) / 2)
