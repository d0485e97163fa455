"""Training loop: augmented crops of the pictures, in a fixed order for a given seed."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor, nn

from perception.segmentation.network_segmenter import CHANNELS, network_input
from perception.training.network import Network
from perception.training.scenes import Scenes
from rolling_panda.messages.types import WOOD_CLASSES, WoodClass

#: Side of a crop and crops a step.
CROP, BATCH = 256, 8
#: Highest rate of learning of fresh weights, and of weights that were trained before.
_PEAK_RATE, _AGAIN_RATE = 3e-3, 2e-3
#: Small things count for more than their pixels.
_HEAVIER: dict[WoodClass, float] = {
    "background": 0.4,
    "ground": 0.3,
    "spur": 2.0,
    "cane": 1.5,
    "node": 3.0,
    "wire": 1.5,
    "old cut": 2.0,
}
#: Of all classes in their order.
WEIGHTS = tuple(_HEAVIER.get(kind, 1.0) for kind in WOOD_CLASSES)


@dataclass(frozen=True)
class Progress:
    """Result of one step: its number from 1, and the loss."""

    step: int
    loss: float


class Run(NamedTuple):
    """One training run: seed, rendered rows, planned steps and executed steps."""

    seed: int
    rows: int
    steps: int
    until: int


Runs = tuple[Run, ...]


class Trainer:
    """Weights, optimiser and random state. It can be saved and resumed with the same result."""

    def __init__(self, seed: int, steps: int, rows: int, start: Mapping[str, object] | None = None) -> None:
        """Fresh weights, or those of an earlier training.

        Args:
            seed: Random seed of weights, crops and augmentation.
            steps: Number of steps; the learning rate decays to zero over them.
            rows: Number of rendered rows.
            start: `state` of another trainer.
        """
        torch.manual_seed(seed)
        self.network = Network(CHANNELS, len(WOOD_CLASSES)).to(memory_format=torch.channels_last)
        self._before: Runs = ()
        rate = _PEAK_RATE
        if start is not None:
            rate = _AGAIN_RATE
            self.network.load_state_dict(start["network"])
            runs = start["runs"]
            assert isinstance(runs, list)
            self._before = tuple(Run(*run) for run in runs)
        self._optimiser = torch.optim.AdamW(self.network.parameters(), rate, weight_decay=1e-4)
        self._schedule = torch.optim.lr_scheduler.OneCycleLR(self._optimiser, rate, total_steps=steps)
        self._loss = nn.CrossEntropyLoss(torch.tensor(WEIGHTS))
        self.seed, self.rows = seed, rows
        self.steps, self.step = steps, 0

    @property
    def runs(self) -> Runs:
        """Every training that these weights have seen, this one last."""
        return (*self._before, Run(self.seed, self.rows, self.steps, self.step))

    def run(self, scenes: Scenes, until: int) -> Iterator[Progress]:
        """Train up to a step."""
        self.network.train()
        while self.step < min(until, self.steps):
            images, labels = _batch(scenes, np.random.default_rng([self.seed, self.step]))
            loss: Tensor = self._loss(self.network(images), labels)
            self._optimiser.zero_grad()
            loss.backward()
            self._optimiser.step()
            self._schedule.step()
            self.step += 1
            yield Progress(self.step, float(loss.detach()))

    def state(self) -> dict[str, object]:
        """Everything that `restore` needs."""
        return {
            "step": self.step,
            "runs": [tuple(run) for run in self.runs],
            "network": self.network.state_dict(),
            "optimiser": self._optimiser.state_dict(),
            "schedule": self._schedule.state_dict(),
        }

    def restore(self, state: dict[str, object]) -> None:
        """Go on from where `state` was taken; seed and steps must be the same as then."""
        step = state["step"]
        assert isinstance(step, int)
        self.step = step
        self.network.load_state_dict(state["network"])
        self._optimiser.load_state_dict(state["optimiser"])
        self._schedule.load_state_dict(state["schedule"])


def _batch(scenes: Scenes, rng: np.random.Generator) -> tuple[Tensor, Tensor]:
    images, labels = [], []
    count, height, width = scenes.labels.shape
    for _ in range(BATCH):
        n = int(rng.integers(count))
        y, x = int(rng.integers(height - CROP + 1)), int(rng.integers(width - CROP + 1))
        window = (n, slice(y, y + CROP), slice(x, x + CROP))
        color, depth, truth = scenes.color[window], scenes.depth[window], scenes.labels[window]
        images.append(_varied(color, depth, rng))
        labels.append(truth)
        if rng.random() < 0.5:
            images[-1], labels[-1] = images[-1][:, :, ::-1], labels[-1][:, ::-1]
    stacked = torch.from_numpy(np.ascontiguousarray(np.stack(images))).to(memory_format=torch.channels_last)
    return stacked, torch.from_numpy(np.stack(labels).astype(np.int64))


def _varied(color: NDArray[np.uint8], depth: NDArray[np.float16], rng: np.random.Generator) -> NDArray[np.float32]:
    """Another exposure, white balance, contrast and saturation; sometimes no depth at all, or depth a little off."""
    bright = color.astype(np.float32) * np.exp(rng.normal(0.0, 0.2) + rng.normal(0.0, 0.06, 3)).astype(np.float32)
    grey = bright.mean(axis=2, keepdims=True)
    bright = grey + np.float32(rng.uniform(0.4, 1.3)) * (bright - grey)
    bright = (bright - 110.0) * np.float32(rng.uniform(0.7, 1.3)) + 110.0
    image = network_input(
        np.clip(bright, 0.0, 255.0).astype(np.uint8), None if rng.random() < 0.12 else depth.astype(np.float32)
    )
    image[3] *= np.float32(np.exp(rng.normal(0.0, 0.05)))
    return image
