"""How well a network tells the classes apart, on pictures that it was not trained on."""

from dataclasses import dataclass

import numpy as np
import torch
from numpy.typing import NDArray

from perception.network_input import network_input
from perception.training.network import Network
from perception.training.scenes import Scenes
from rolling_panda.messages import WOOD_CLASSES


@dataclass(frozen=True)
class Confusion:
    """Counts of pixels: row = what it is, column = what the network says."""

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


def confusion(network: Network, scenes: Scenes, with_depth: bool = True) -> Confusion:
    """Run a network over whole pictures.

    Args:
        network: With any weights; put into evaluation mode.
        scenes: Pictures whose sides are multiples of what the network needs.
        with_depth: False to take the depth away.
    """
    network.eval()
    size = len(WOOD_CLASSES)
    counts = np.zeros(size * size, np.int64)
    with torch.inference_mode():
        for color, depth, labels in zip(scenes.color, scenes.depth, scenes.labels, strict=True):
            image = network_input(color, depth.astype(np.float32) if with_depth else None)
            said = network(torch.from_numpy(image)[None])[0].argmax(dim=0).numpy()
            counts += np.bincount(labels.astype(np.int64).ravel() * size + said.ravel(), minlength=size * size)
    return Confusion(counts.reshape(size, size))
