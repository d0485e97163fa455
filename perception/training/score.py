"""Evaluation of a network on pictures that it was not trained on."""

from dataclasses import dataclass

import numpy as np
import torch
from numpy.typing import NDArray

from perception.segmentation.network_segmenter import network_input
from perception.training.network import Labeller
from perception.training.scenes import Scenes
from rolling_panda.messages.types import WOOD_CLASSES

_CANE = (WOOD_CLASSES.index("cane"), WOOD_CLASSES.index("node"))
#: Stride of the evaluated lines; wider stretches are canes side by side (px).
_EVERY, _ALONE = 4, 9


@dataclass(frozen=True)
class Confusion:
    """Confusion matrix in pixels: row = true class, column = predicted class."""

    counts: NDArray[np.int64]

    def overlap(self) -> dict[str, float]:
        """Intersection over union of each class that occurs."""
        true, said, both = self.counts.sum(axis=1), self.counts.sum(axis=0), np.diag(self.counts)
        return {
            name: round(float(both[k] / (true[k] + said[k] - both[k])), 3)
            for k, name in enumerate(WOOD_CLASSES)
            if true[k]
        }

    def found(self) -> dict[str, float]:
        """Share of each class's pixels that are given it."""
        true = self.counts.sum(axis=1)
        return {name: round(float(self.counts[k, k] / true[k]), 3) for k, name in enumerate(WOOD_CLASSES) if true[k]}


def widening(labeller: Labeller, scenes: Scenes) -> float:
    """Mean width bias of isolated canes (px).

    Args:
        labeller: With any weights; put into evaluation mode.
        scenes: Pictures whose sides are multiples of what the network needs.
    """
    labeller.eval()
    more: list[int] = []
    with torch.inference_mode():
        for color, depth, labels in zip(scenes.color, scenes.depth, scenes.labels, strict=True):
            image = network_input(color, depth.astype(np.float32))
            said = labeller(torch.from_numpy(image)[None])[0].numpy()
            for row in range(0, len(labels), _EVERY):
                true, seen = _runs(labels[row]), _runs(said[row])
                for middle, width in true.items():
                    near = [seen[middle + off] - width for off in (0, -1, 1, -2, 2) if middle + off in seen]
                    if near and width < _ALONE:
                        more.append(near[0])
    return float(np.mean(more)) if more else 0.0


def _runs(line: NDArray[np.integer]) -> dict[int, int]:
    """Widths of the stretches of cane in one line of an image, by their middles."""
    edges = np.flatnonzero(np.diff(np.concatenate([[0], np.isin(line, _CANE).astype(int), [0]])))
    return {int(a + b) // 2: int(b - a) for a, b in zip(edges[::2], edges[1::2], strict=True)}


def confusion(labeller: Labeller, scenes: Scenes, with_depth: bool = True) -> Confusion:
    """Run a network over whole pictures.

    Args:
        labeller: With any weights; put into evaluation mode.
        scenes: Pictures whose sides are multiples of what the network needs.
        with_depth: False to take the depth away.
    """
    labeller.eval()
    size = len(WOOD_CLASSES)
    counts = np.zeros(size * size, np.int64)
    with torch.inference_mode():
        for color, depth, labels in zip(scenes.color, scenes.depth, scenes.labels, strict=True):
            image = network_input(color, depth.astype(np.float32) if with_depth else None)
            said = labeller(torch.from_numpy(image)[None])[0].numpy()
            counts += np.bincount(labels.astype(np.int64).ravel() * size + said.ravel(), minlength=size * size)
    return Confusion(counts.reshape(size, size))
