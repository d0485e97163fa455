"""Classes that a network proposes for a picture."""

import threading
from collections import OrderedDict
from pathlib import Path

import numpy as np
from PIL import Image

from labelling.pictures import packed
from perception.models.cards import Model, chosen, read_model, shipped
from perception.segmentation.network_segmenter import NetworkSegmenter
from perception.single_image import load_photograph, segment_photograph

_SHIPPED = "shipped"
#: Proposals in memory.
_KEPT = 8


def proposing_model(word: str | None, state: Path) -> Model:
    """The network that proposes: a file, the shipped one, or by default the one that perception uses.

    Raises:
        ConfigError: It cannot be read.
    """
    if word is None:
        return chosen(state) or shipped()
    return shipped() if word == _SHIPPED else read_model(Path(word))


class Proposals:
    """Proposals of one network. Any thread may ask; one picture is computed at a time."""

    def __init__(self, path: Path, title: str) -> None:
        """Load the network.

        Raises:
            ConfigError: It cannot be used.
        """
        self.title = title
        self._segmenter = NetworkSegmenter(path)
        self._lock = threading.Lock()
        self._kept: OrderedDict[Path, bytes] = OrderedDict()

    def of(self, picture: Path) -> bytes:
        """Class of each pixel, packed as masks are.

        Raises:
            InputError: The picture cannot be used.
        """
        with self._lock:
            if picture not in self._kept:
                photograph = load_photograph(picture)
                _, (labels, _) = segment_photograph(photograph, self._segmenter)
                whole = Image.fromarray(labels.astype(np.uint8)).resize(photograph.size, Image.Resampling.NEAREST)
                self._kept[picture] = packed(np.asarray(whole))
                while len(self._kept) > _KEPT:
                    self._kept.popitem(last=False)
            return self._kept[picture]
