"""How a segmenter confuses classes, counted beside its work."""

import numpy as np
from numpy.typing import NDArray

from perception.segmentation.frame import View
from perception.segmentation.segmenter import Segmenter
from rolling_panda.messages.types import WOOD_CLASSES, Reason

#: One line of pixels in so many is counted, which costs a frame less than a millisecond.
_EVERY = 4


class Confusion:
    """A segmenter whose classes are compared with the simulated camera's own."""

    def __init__(self, segmenter: Segmenter, counts: NDArray[np.int64]) -> None:
        """Watch a segmenter.

        Args:
            segmenter: Does the work.
            counts: Pixels by true class and by the class told, C×C; they are added to.
        """
        self._segmenter, self._counts = segmenter, counts

    @property
    def name(self) -> str:
        """As the segmenter's."""
        return self._segmenter.name

    @property
    def width_bias(self) -> float:
        """As the segmenter's."""
        return self._segmenter.width_bias

    @property
    def unfamiliar(self) -> Reason | None:
        """As the segmenter's."""
        return self._segmenter.unfamiliar

    def segment(self, view: View) -> NDArray[np.uint8]:
        """As the segmenter's."""
        told = self._segmenter.segment(view)
        if view.labels is not None:
            size = len(WOOD_CLASSES)
            pairs = size * view.labels[::_EVERY].astype(np.intp) + told[::_EVERY]
            self._counts += np.bincount(pairs.ravel(), minlength=size * size).reshape(size, size)
        return told


def no_counts() -> NDArray[np.int64]:
    """Nothing has been compared yet."""
    return np.zeros((len(WOOD_CLASSES), len(WOOD_CLASSES)), dtype=np.int64)


def shares(counts: NDArray[np.int64]) -> dict[str, dict[str, float]]:
    """Share of each class's pixels that were told as each class, for the classes that were in view."""
    return {
        name: {other: round(float(n / row.sum()), 4) for other, n in zip(WOOD_CLASSES, row, strict=True)}
        for name, row in zip(WOOD_CLASSES, counts, strict=True)
        if row.sum()
    }
