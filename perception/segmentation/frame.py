"""Decoded camera frames with their camera pose in odom."""

import io
import math
import zlib
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from perception.arrays import Array, Index, Labels
from rolling_panda import reasons
from rolling_panda.errors import InputError, MessageError
from rolling_panda.messages.robot import CameraFrame, Intrinsics
from rolling_panda.messages.types import WOOD_CLASSES, Reason
from rolling_panda.model.base_attitude import camera_in_odom
from rolling_panda.model.robot import RobotModel
from rolling_panda.reasons import text_of

#: Class indices, in the order of `WOOD_CLASSES`.
BACKGROUND, GROUND, POST, TRUNK, CORDON, SPUR, CANE, NODE, WIRE, HOSE, OLD_CUT = range(len(WOOD_CLASSES))
#: Classes of wood of the vine.
ANY_WOOD = (TRUNK, CORDON, SPUR, CANE, NODE, OLD_CUT)
#: Largest depth of one count (m).
_MAX_DEPTH_UNIT = 0.01


class CorruptFrameError(MessageError):
    """A frame is corrupt; `reason` says how."""

    def __init__(self, reason: Reason) -> None:
        """Store the reason."""
        super().__init__(text_of(reason))
        self.reason = reason


class UnusablePictureError(InputError):
    """A frame cannot be segmented; `reason` says why."""

    def __init__(self, reason: Reason) -> None:
        """Store the reason."""
        super().__init__(text_of(reason))
        self.reason = reason


@dataclass(frozen=True)
class View:
    """One decoded RGB-D frame.

    Attributes:
        sequence: Number of the frame.
        stamp: Time of exposure (s, sender's clock).
        intrinsics: Of all images; pixel centres have integer coordinates.
        depth: H×W, along the optical axis (m); 0 = invalid.
        labels: H×W class indices; None without a label image.
        color_jpeg: The compressed colour image.
        R: Rotation of the camera in odom (3×3).
        t: Position of the camera in odom (3, m).
    """

    sequence: int
    stamp: float
    intrinsics: Intrinsics
    depth: NDArray[np.float32]
    labels: Labels | None
    color_jpeg: bytes
    R: Array
    t: Array

    def points(self, rows: Any, cols: Any, depth: Any) -> Array:
        """Positions in odom (N×3, m) of pixels (fractions allowed) at `depth` (N, m)."""
        k = self.intrinsics
        x = (np.asarray(cols, float) - k.cx) / k.fx * depth
        y = (np.asarray(rows, float) - k.cy) / k.fy * depth
        out: Array = np.stack([x, y, np.asarray(depth, float)], axis=-1) @ self.R.T + self.t
        return out

    def pixels(self, points: Array) -> Array:
        """Columns, rows (px) and depth (m) of `points` (N×3, odom), as N×3; depth ≤ 0 is behind the camera."""
        camera = (np.atleast_2d(points) - self.t) @ self.R
        k = self.intrinsics
        z = camera[:, 2]
        safe = np.where(np.abs(z) < 1e-9, 1e-9, z)
        return np.stack([k.fx * camera[:, 0] / safe + k.cx, k.fy * camera[:, 1] / safe + k.cy, z], axis=1)

    def part(self, rows: slice, cols: slice) -> "View":
        """A window of the frame as a frame of its own, clipped to the image.

        Raises:
            CorruptFrameError: The colour image is no JPEG of the right size.
        """
        k = self.intrinsics
        top, bottom = max(0, rows.start), min(k.height, rows.stop)
        left, right = max(0, cols.start), min(k.width, cols.stop)
        window = slice(top, bottom), slice(left, right)
        jpeg = b""
        if self.color_jpeg:
            out = io.BytesIO()
            Image.fromarray(self.color()[window]).save(out, "JPEG", quality=98, subsampling=0)
            jpeg = out.getvalue()
        return replace(
            self,
            intrinsics=Intrinsics(right - left, bottom - top, k.fx, k.fy, k.cx - left, k.cy - top),
            depth=self.depth[window],
            labels=None if self.labels is None else self.labels[window],
            color_jpeg=jpeg,
        )

    def color(self) -> NDArray[np.uint8]:
        """The colour image, H×W×3, RGB.

        Raises:
            CorruptFrameError: It is not a JPEG of the size of the intrinsics.
        """
        k = self.intrinsics
        try:
            with Image.open(io.BytesIO(self.color_jpeg), formats=("JPEG",)) as image:
                if image.size != (k.width, k.height):
                    raise CorruptFrameError(reasons.colour_size_wrong(self.sequence, *image.size, k.width, k.height))
                return np.asarray(image.convert("RGB"), dtype=np.uint8)
        except (OSError, SyntaxError) as error:
            raise CorruptFrameError(reasons.colour_not_jpeg(self.sequence, str(error))) from error


def decode_frame(frame: CameraFrame, model: RobotModel) -> View:
    """Decode a frame; its camera pose follows from the measured joint positions by forward kinematics.

    Args:
        frame: As received.
        model: The robot; its `data` is overwritten.

    Raises:
        CorruptFrameError: An image is corrupt or of the wrong size, a class is unknown, or a number is not finite.
    """
    k = frame.intrinsics
    posture = (frame.base.x, frame.base.y, frame.base.phi, *frame.position)
    if len(frame.position) != 9 or not all(math.isfinite(value) for value in posture):
        raise CorruptFrameError(reasons.frame_posture_invalid(frame.sequence))
    if not (k.fx > 0.0 and k.fy > 0.0 and all(math.isfinite(value) for value in (k.fx, k.fy, k.cx, k.cy))):
        raise CorruptFrameError(reasons.frame_intrinsics_invalid(frame.sequence, k.fx, k.fy, k.cx, k.cy))
    if not 0.0 < frame.depth_unit <= _MAX_DEPTH_UNIT:
        raise CorruptFrameError(reasons.frame_depth_unit_invalid(frame.sequence, frame.depth_unit, _MAX_DEPTH_UNIT))
    counts = _image(frame.depth_zlib, k, "<u2", "depth", frame.sequence)
    labels = None
    if frame.labels_zlib:
        labels = _image(frame.labels_zlib, k, "u1", "label", frame.sequence)
        if labels.max(initial=0) >= len(WOOD_CLASSES):
            raise CorruptFrameError(reasons.frame_class_unknown(frame.sequence, float(labels.max()), len(WOOD_CLASSES)))
    T_odom_camera = camera_in_odom(frame, model)
    return View(
        sequence=frame.sequence,
        stamp=frame.header.stamp,
        intrinsics=model.lens(k),
        depth=counts.astype(np.float32) * np.float32(frame.depth_unit),
        labels=labels,
        color_jpeg=frame.color_jpeg,
        R=np.array(T_odom_camera.rotation),
        t=np.array(T_odom_camera.translation),
    )


def _image(data: bytes, k: Intrinsics, kind: str, name: str, sequence: int) -> NDArray[Any]:
    expected = k.width * k.height * np.dtype(kind).itemsize
    unpack = zlib.decompressobj()
    try:
        # One byte more than expected detects a longer stream and bounds the memory that a hostile one can use.
        raw = unpack.decompress(data, expected + 1)
    except zlib.error as error:
        raise CorruptFrameError(reasons.frame_image_corrupt(sequence, name, str(error))) from error
    if len(raw) != expected or not unpack.eof:
        raise CorruptFrameError(reasons.frame_image_size_wrong(sequence, name, k.width, k.height))
    return np.frombuffer(raw, dtype=kind).reshape(k.height, k.width)


def class_pixels(labels: Labels, classes: tuple[int, ...]) -> tuple[Index, Index]:
    """Rows and columns of all pixels of some classes, row by row.

    Args:
        labels: H×W class indices.
        classes: At least one class.
    """
    mask = labels == classes[0]
    for each in classes[1:]:
        mask |= labels == each
    rows, cols = np.divmod(np.flatnonzero(mask), labels.shape[1])
    return rows, cols
