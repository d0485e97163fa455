"""An encoded camera frame: JPEG colour, deflated depth and labels."""

import io
import zlib
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from rolling_panda.messages.robot import Intrinsics

#: Depth of one count (m): 0.5 mm resolves the sensor's noise at 0.3 m and reaches 32 m.
DEPTH_UNIT = 0.0005
_FARTHEST = 65535 * DEPTH_UNIT
_JPEG_QUALITY = 80


@dataclass(frozen=True)
class Picture:
    """One RGB-D exposure, encoded as in `CameraFrame`.

    `taken_at` is the time of exposure (s, the machine's monotonic clock). None if the camera does not report it, or if
    it is the time of the request.
    """

    intrinsics: Intrinsics
    color_jpeg: bytes
    depth_zlib: bytes
    labels_zlib: bytes
    depth_unit: float = DEPTH_UNIT
    taken_at: float | None = None


def encode_picture(
    intrinsics: Intrinsics,
    color: NDArray[np.uint8],
    depth: NDArray[np.float32],
    labels: NDArray[np.uint8] | None,
) -> Picture:
    """Encode one exposure.

    Args:
        intrinsics: Of all images.
        color: H×W×3.
        depth: H×W (m); 0, negative, not finite or beyond the format's range become 0, no return.
        labels: H×W class indices, or None where there is no label camera.
    """
    jpeg = io.BytesIO()
    Image.fromarray(color).save(jpeg, "JPEG", quality=_JPEG_QUALITY)
    seen = np.isfinite(depth) & (depth > 0.0) & (depth < _FARTHEST)
    counts = np.rint(np.where(seen, depth, 0.0) / DEPTH_UNIT).astype("<u2")
    return Picture(
        intrinsics,
        jpeg.getvalue(),
        zlib.compress(counts.tobytes(), 1),
        b"" if labels is None else zlib.compress(labels.tobytes(), 1),
    )
