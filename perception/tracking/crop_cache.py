"""Keeps, of each spur, the camera's image that shows it best, and cuts pictures of pruning points out of it."""

import dataclasses
import io

import numpy as np
from PIL import Image

from perception.plant.model import Array, Plant
from perception.plant.numbering import SpurNumber
from perception.segmentation.frame import View
from rolling_panda.messages.perception import CROP_BYTES

#: Size of a picture (px), out of as many pixels of the image.
_WIDTH, _HEIGHT = 240, 180
_QUALITIES = (82, 70, 55, 40, 25)
_NOTHING = np.zeros((0, 0), np.float32)


@dataclasses.dataclass(frozen=True)
class Crop:
    """A picture and the frame that it is from."""

    sequence: int
    jpeg: bytes


class CropCache:
    """Images of spurs. What it holds grows with the spurs seen, one image each at most."""

    def __init__(self) -> None:
        """Empty."""
        self._best: dict[SpurNumber, tuple[float, View]] = {}

    def add(self, view: View, plant: Plant, numbers: tuple[SpurNumber, ...]) -> None:
        """Keep the image for the spurs that it shows nearer to its middle than any before.

        Args:
            view: The frame.
            plant: As perceived in it.
            numbers: Of its spurs, in their order.
        """
        kept = dataclasses.replace(view, depth=_NOTHING, labels=None)
        k = view.intrinsics
        for spur, number in zip(plant.spurs, numbers, strict=True):
            u, v, z = view.pixels(spur.position)[0]
            off = float(np.hypot(u - k.width / 2, v - k.height / 2))
            known = self._best.get(number)
            if z > 0.0 and (known is None or off < known[0]):
                self._best[number] = (off, kept)

    def crop(self, number: SpurNumber, position: Array) -> Crop | None:
        """What was seen of a spur, with a place (3, m, odom) in the middle; None where no image shows that place.

        Raises:
            MessageError: The image is no JPEG.
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
        for quality in _QUALITIES:
            out = io.BytesIO()
            picture.save(out, "JPEG", quality=quality)
            if out.tell() <= CROP_BYTES:
                return Crop(view.sequence, out.getvalue())
        return None
