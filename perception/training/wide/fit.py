"""Training loop. Every batch follows from the seed and the number of its step: a run can be resumed anywhere."""

import os
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor, nn

from perception.segmentation.frame import BACKGROUND, GROUND
from perception.segmentation.network_segmenter import network_input
from perception.training.scenes import Scenes
from perception.training.wide.drawing import FAR, Artist, Drawing, Scene
from perception.training.wide.network import PhotographNetwork, load_pretrained
from rolling_panda.messages.types import WOOD_CLASSES, WoodClass

#: Small things count for more than their pixels.
_HEAVIER: dict[WoodClass, float] = {
    "background": 0.4,
    "ground": 0.3,
    "post": 1.5,
    "trunk": 1.5,
    "cordon": 1.5,
    "spur": 2.0,
    "cane": 1.5,
    "node": 2.5,
    "wire": 1.5,
    "old cut": 2.0,
}
#: Of all classes in their order.
WEIGHTS = tuple(_HEAVIER.get(kind, 1.0) for kind in WOOD_CLASSES)
#: Drawn scenes a step, each photographed twice, and pictures of rendered rows a step where there are any.
_DRAWN, _RENDERED = 3, 2
#: Of each scene a picture and a mirrored one.
PICTURES_A_STEP = 2 * _DRAWN + _RENDERED
#: Rates of learning of decoder and encoder; the rate grows over the first steps and falls over the last share of them.
_RATE, _ENCODER_RATE, _WARM, _FALL = 2e-3, 6e-4, 100, 0.25
#: Of the running mean of the weights that is kept as the result.
_MEAN = 0.998


@dataclass(frozen=True)
class Progress:
    """Result of one step: its number from 1, and the loss."""

    step: int
    loss: float


class Trainer:
    """Weights, their running mean and the optimiser. It can be saved and resumed with the same result."""

    def __init__(
        self, seed: int, steps: int, artist: Artist, rows: Scenes | None = None, pretrained: bool = True
    ) -> None:
        """Begin.

        Args:
            seed: Of the decoder's weights and of all pictures.
            steps: Planned; the rate falls to zero over the last quarter of them. A resumed run may plan more.
            artist: Draws the pictures.
            rows: Rendered rows, a part of each batch; None for drawn pictures only.
            pretrained: Begin with the encoder of ImageNet.
        """
        torch.manual_seed(seed)
        self.network = PhotographNetwork(len(WOOD_CLASSES))
        if pretrained:
            load_pretrained(self.network.encoder)
        self.network.to(memory_format=torch.channels_last)
        self.mean = {name: value.clone() for name, value in self.network.state_dict().items()}
        encoder = set(self.network.encoder.parameters())
        self._optimiser = torch.optim.AdamW(
            [
                {"params": [p for p in self.network.parameters() if p not in encoder], "peak": _RATE},
                {"params": list(self.network.encoder.parameters()), "peak": _ENCODER_RATE},
            ],
            lr=_RATE,
            weight_decay=1e-3,
        )
        self._artist, self._rows = artist, rows
        self.seed, self.steps, self.step = seed, steps, 0

    def run(self, until: int) -> Iterator[Progress]:
        """Train up to a step."""
        self.network.train()
        while self.step < min(until, self.steps):
            images, labels = self._batch(np.random.default_rng([self.seed, self.step]))
            for group in self._optimiser.param_groups:
                group["lr"] = group["peak"] * _rate(self.step, self.steps)
            loss = weighted_loss(self.network(images), labels)
            self._optimiser.zero_grad()
            loss.backward()
            nn.utils.clip_grad_norm_(self.network.parameters(), 5.0)
            self._optimiser.step()
            self.step += 1
            self._average()
            yield Progress(self.step, float(loss.detach()))

    def averaged(self) -> PhotographNetwork:
        """A network with the running mean of the weights, for evaluation."""
        out = PhotographNetwork(len(WOOD_CLASSES))
        out.load_state_dict(self.mean)
        out.eval()
        return out

    def state(self) -> dict[str, object]:
        """Everything that `restore` needs."""
        return {
            "seed": self.seed,
            "step": self.step,
            "network": self.network.state_dict(),
            "mean": self.mean,
            "optimiser": self._optimiser.state_dict(),
        }

    def restore(self, state: Mapping[str, object]) -> None:
        """Go on from where `state` was taken.

        Raises:
            ValueError: It is of another seed.
        """
        step, mean = state["step"], state["mean"]
        if state["seed"] != self.seed:
            raise ValueError(f"the state is of seed {state['seed']}, not {self.seed}; give that seed or another --work")
        assert isinstance(step, int) and isinstance(mean, dict)
        self.step = step
        self.network.load_state_dict(state["network"])
        self.mean = {name: value.clone() for name, value in mean.items()}
        self._optimiser.load_state_dict(state["optimiser"])

    def _average(self) -> None:
        # In the first steps the mean is of few.
        keep = min(_MEAN, self.step / (self.step + 10.0))
        for name, value in self.network.state_dict().items():
            if value.is_floating_point():
                self.mean[name].lerp_(value, 1.0 - keep)
            else:
                self.mean[name].copy_(value)

    def _batch(self, rng: np.random.Generator) -> tuple[Tensor, Tensor]:
        drawings: list[Drawing] = []
        for number in range(_DRAWN):
            scene = self._artist.scene(self.seed, self.step, number)
            drawings += [scene.photograph(rng), mirrored(scene.photograph(rng))]
        if self._rows is not None:
            drawings += [_crop(self._rows, self._artist.size, rng) for _ in range(_RENDERED)]
        images = np.stack([network_input(each.color, each.depth) for each in drawings])
        labels = np.stack([each.labels for each in drawings]).astype(np.int64)
        return torch.from_numpy(images).to(memory_format=torch.channels_last), torch.from_numpy(labels)


class Resumable(Protocol):
    """A training that can be saved."""

    def state(self) -> dict[str, object]:
        """Everything that going on needs."""


def keep(trainer: Resumable, path: Path) -> None:
    """Replace the kept state in one go, so that a kill at any moment leaves a whole one."""
    new = path.with_suffix(".new")
    with new.open("wb") as file:
        torch.save(trainer.state(), file)
        file.flush()
        os.fsync(file.fileno())
    new.replace(path)


def weighted_loss(logits: Tensor, labels: Tensor) -> Tensor:
    """Cross entropy; a pixel that is `FAR` may be background or ground.

    Args:
        logits: N×classes×H×W.
        labels: N×H×W.
    """
    told = torch.log_softmax(logits, dim=1)
    far = labels == FAR
    right = told.gather(1, labels.masked_fill(far, BACKGROUND)[:, None])[:, 0]
    either = torch.logaddexp(told[:, BACKGROUND], told[:, GROUND])
    heavy = torch.tensor([*WEIGHTS, WEIGHTS[BACKGROUND]])[labels]
    return -(heavy * torch.where(far, either, right)).sum() / heavy.sum()


def mirrored(drawing: Drawing) -> Drawing:
    """Left and right exchanged."""
    depth = None if drawing.depth is None else drawing.depth[:, ::-1]
    return Drawing(drawing.color[:, ::-1], depth, drawing.labels[:, ::-1])


def _rate(step: int, steps: int) -> float:
    fall = max(1.0, _FALL * steps)
    warm = max(1.0, min(_WARM, 0.1 * steps))
    return min((step + 1) / warm, 1.0, max(0.01, (steps - step) / fall))


def _crop(rows: Scenes, size: int, rng: np.random.Generator) -> Drawing:
    """A part of a rendered picture, photographed anew, with its depth in most cases."""
    count, height, width = rows.labels.shape
    n, y, x = int(rng.integers(count)), int(rng.integers(height - size + 1)), int(rng.integers(width - size + 1))
    window = (n, slice(y, y + size), slice(x, x + size))
    depth: NDArray[np.float32] = rows.depth[window].astype(np.float32)
    if rng.random() < 0.5:
        again = Scene(rows.color[window].astype(np.float32), depth, rows.labels[window]).photograph(rng)
        out = Drawing(again.color, None if again.depth is None else depth, again.labels)
    else:
        out = Drawing(rows.color[window], depth, rows.labels[window])
    return mirrored(out) if rng.random() < 0.5 else out
