"""Which pixel shows what: the interface, and the one that takes the simulated camera's own labels."""

from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from perception.segmentation.frame import View
from rolling_panda.errors import InputError


class Segmenter(Protocol):
    """Turns a frame into a class image."""

    @property
    def name(self) -> str:
        """What stands behind the classes, for people."""

    @property
    def widening(self) -> float:
        """How much wider than they are it draws canes, on average (px)."""

    def segment(self, view: View) -> NDArray[np.uint8]:
        """H×W indices into `WOOD_CLASSES`.

        Raises:
            InputError: This segmenter cannot work on such a frame; the text says why.
        """


class LabelImageSegmenter:
    """Takes the label image that a simulated camera sends along. It segments nothing itself."""

    @property
    def name(self) -> str:
        """It says where the classes come from."""
        return "simulator labels"

    @property
    def widening(self) -> float:
        """Nothing: it is what the camera rendered."""
        return 0.0

    def segment(self, view: View) -> NDArray[np.uint8]:
        """The frame's own label image.

        Raises:
            InputError: The frame has none, as on a real robot.
        """
        if view.labels is None:
            raise InputError(
                "this frame has no label image, and the segmenter 'simulator labels' needs one: "
                "only the simulated camera sends it"
            )
        return view.labels
