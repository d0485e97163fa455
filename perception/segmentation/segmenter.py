"""Segmenters: the interface, the simulated camera's label image, and the choice by name."""

from pathlib import Path
from typing import Protocol

from perception.arrays import Labels
from perception.segmentation.frame import UnusablePictureError, View
from perception.segmentation.network_segmenter import NetworkSegmenter
from rolling_panda import reasons
from rolling_panda.errors import ConfigError, ModelError
from rolling_panda.messages.types import Reason
from rolling_panda.resources import resource

SEGMENTERS = ("network", "labels")
#: The shipped networks: of rendered rows, which robots use unless another is chosen, and of drawn photographs.
SHIPPED, PHOTOGRAPHS = "assets/network/vine.onnx", "assets/network/photographs.onnx"


class Segmenter(Protocol):
    """Semantic segmentation of a frame."""

    @property
    def name(self) -> str:
        """Name for people."""

    @property
    def width_bias(self) -> float:
        """By how much it draws canes too wide, on average (px)."""

    @property
    def unfamiliar(self) -> Reason | None:
        """Why the last frame is unlike all that it was trained on; None if it is not, or nobody knows."""

    def segment(self, view: View) -> Labels:
        """H×W indices into `WOOD_CLASSES`.

        Raises:
            UnusablePictureError: It cannot work on this frame.
        """


class LabelImageSegmenter:
    """Returns the label image of the simulated camera."""

    name = "simulator labels"
    width_bias = 0.0
    unfamiliar: Reason | None = None

    def segment(self, view: View) -> Labels:
        """The frame's own label image.

        Raises:
            UnusablePictureError: The frame has none, as on a real robot.
        """
        if view.labels is None:
            raise UnusablePictureError(reasons.frame_without_labels(self.name))
        return view.labels


class NoSegmenter:
    """Rejects every frame, for a program without network weights."""

    name = "none"
    width_bias = 0.0
    unfamiliar: Reason | None = None

    def __init__(self, reason: Reason) -> None:
        """Store the reason given for every frame."""
        self._reason = reason

    def segment(self, view: View) -> Labels:
        """Never returns.

        Raises:
            UnusablePictureError: Always.
        """
        raise UnusablePictureError(self._reason)


def choose_segmenter(name: str, weights: Path | None = None, threads: int = 2) -> Segmenter:
    """The segmenter of a name.

    Args:
        name: One of `SEGMENTERS`.
        weights: ONNX file of the network; None for the shipped one.
        threads: Threads of the network.

    Raises:
        ConfigError: There is no such segmenter, or the given weights do not fit.
    """
    if name == "labels":
        return LabelImageSegmenter()
    if name != "network":
        raise ConfigError(f"no segmenter {name!r}; choose one of {', '.join(SEGMENTERS)}")
    if weights is not None:
        return NetworkSegmenter(weights, threads)
    try:
        return NetworkSegmenter(resource(SHIPPED), threads)
    except ModelError as error:
        # Without the shipped file the program still runs, and every frame reports the missing file.
        return NoSegmenter(reasons.network_missing(str(error)))
