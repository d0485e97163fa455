"""Image crops of pruning points: for each spur the image in which it is nearest to the centre."""

import dataclasses
import io

import numpy as np
from PIL import Image

from perception.arrays import Array
from perception.plant.model import Plant
from perception.plant.numbering import SpurNumber
from perception.segmentation.frame import View
from rolling_panda.messages.perception import CROP_BYTES

#: Size of a crop (px), at the resolution of the image.
_WIDTH, _HEIGHT = 240, 180
_JPEG_QUALITIES = (82, 70, 55, 40, 25)
_NO_DEPTH = np.zeros((0, 0), np.float32)


@dataclasses.dataclass(frozen=True)
class Crop:
    """A crop, and the number of its frame."""

    sequence: int
    jpeg: bytes


class CropCache:
    """At most one image for each spur."""

    def __init__(self) -> None:
        """Start empty."""
        self._best: dict[SpurNumber, tuple[float, View]] = {}

    def add(self, view: View, plant: Plant, numbers: tuple[SpurNumber, ...]) -> None:
        """Store the image for those spurs that no other image shows nearer to its centre.

        Args:
            view: The frame.
            plant: Plant of the frame.
            numbers: Of its spurs, in their order.
        """
        image = dataclasses.replace(view, depth=_NO_DEPTH, labels=None)
        k = view.intrinsics
        for spur, number in zip(plant.spurs, numbers, strict=True):
            u, v, z = view.pixels(spur.position)[0]
            off = float(np.hypot(u - k.width / 2, v - k.height / 2))
            known = self._best.get(number)
            if z > 0.0 and (known is None or off < known[0]):
                self._best[number] = (off, image)

    def crop(self, number: SpurNumber, position: Array) -> Crop | None:
        """A crop centred on a position (3, m, odom) at a spur; None where no image shows that position.

        Raises:
            CorruptFrameError: The image is corrupt.
        """
        known = self._best.get(number)
        if known is None:
            return None
        view = known[1]
        u, v, z = view.pixels(position)[0]
        k = view.intrinsics
        if z <= 0.0 or not (0 <= u < k.width and 0 <= v < k.height):
            return None
        left, top = round(u) - _WIDTH // 2, round(v) - _HEIGHT // 2
        picture = Image.fromarray(view.color()).crop((left, top, left + _WIDTH, top + _HEIGHT))
        for quality in _JPEG_QUALITIES:
            out = io.BytesIO()
            picture.save(out, "JPEG", quality=quality)
            if out.tell() <= CROP_BYTES:
                return Crop(view.sequence, out.getvalue())
        return None
