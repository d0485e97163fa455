"""Segmenters by name."""

from pathlib import Path

from perception.segmentation.network_segmenter import NetworkSegmenter, NoSegmenter
from perception.segmentation.segmenter import LabelImageSegmenter, Segmenter
from rolling_panda.errors import ConfigError, ModelError
from rolling_panda.resources import resource

SEGMENTERS = ("network", "labels")
#: Weights that are shipped.
SHIPPED = "assets/network/vine.onnx"


def choose_segmenter(name: str, weights: Path | None = None, threads: int = 2) -> Segmenter:
    """The segmenter of a name.

    Args:
        name: One of `SEGMENTERS`.
        weights: ONNX file for the network; None takes the one that is shipped.
        threads: Of the network.

    Raises:
        ConfigError: There is no such segmenter, or the user's own weights do not fit.
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
        # Whoever named a file wants that file; without the shipped one the program still runs, and says what it lacks.
        return NoSegmenter(f"nothing is recognised without the network's weights: {error}")
