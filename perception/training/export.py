"""Writes a trained network as ONNX with its classes as metadata, and its model card."""

import hashlib
import json
import warnings
from collections.abc import Mapping, Sequence
from io import BytesIO
from pathlib import Path

import onnx
import torch

from perception.models.cards import Card, Data, write_card
from perception.segmentation.network_segmenter import CHANNELS
from perception.training.compact import CompactLabeller
from perception.training.fit import BATCH, CROP, WEIGHTS, Trainer
from perception.training.network import Labeller
from perception.training.scenes import TRAINING_SEED, VALIDATION_SEED, VIEWS
from perception.training.score import Confusion
from rolling_panda.messages.types import WOOD_CLASSES

_OPSET = 17
#: Rows that no training has seen.
HELD_OUT_ROWS = 12


def write_network(path: Path, trainer: Trainer, scores: Mapping[str, Confusion], wider: float) -> None:
    """Write the network and its cards.

    Args:
        path: ONNX file; its cards are the same name with .md and .json.
        trainer: The trained network.
        scores: Its confusion matrix on held-out pictures, by what they are called.
        wider: Width bias of canes (px).
    """
    path.parent.mkdir(parents=True, exist_ok=True)
    buffer = BytesIO()
    labeller = CompactLabeller(Labeller(trainer.network, WEIGHTS)).eval()
    with warnings.catch_warnings():
        # The newer exporter needs one more package and gives the same graph.
        warnings.simplefilter("ignore", DeprecationWarning)
        torch.onnx.export(
            labeller,
            (torch.zeros(1, CHANNELS, 64, 64),),
            buffer,
            input_names=["image"],
            output_names=["classes"],
            dynamic_axes={"image": {2: "height", 3: "width"}, "classes": {1: "height", 2: "width"}},
            opset_version=_OPSET,
            dynamo=False,
        )
    model = onnx.load_from_string(buffer.getvalue())
    onnx.helper.set_model_props(model, {"classes": json.dumps(list(WOOD_CLASSES)), "widening": f"{wider:.2f}"})
    onnx.checker.check_model(model)
    onnx.save(model, str(path))
    commands = _commands(path, trainer)
    write_card(
        path,
        Card(
            sha256=hashlib.sha256(path.read_bytes()).hexdigest(),
            data=(Data(f"rendered rows, {_seeds(trainer)}; no photograph", "BSD-3-Clause", _rows(trainer) * VIEWS),),
            command=", then ".join(commands),
            figures={of: _figures(score) for of, score in scores.items()},
        ),
    )
    card = _card(path, trainer, commands, scores, wider)
    path.with_suffix(".md").write_text(card, encoding="utf-8")


def _rows(trainer: Trainer) -> int:
    return max(run.rows for run in trainer.runs)


def _seeds(trainer: Trainer) -> str:
    return f"seeds {TRAINING_SEED} to {TRAINING_SEED + _rows(trainer) - 1}"


def _commands(path: Path, trainer: Trainer) -> list[str]:
    told, start = [], ""
    for run in trainer.runs:
        until = f" --until {run.until}" if run.until < run.steps else ""
        options = f"--seed {run.seed} --rows {run.rows} --steps {run.steps}{until}{start}"
        told.append(f"python -m perception.training {options} --out {path.name}")
        start = f" --start build/training/state_{run.seed}_{run.steps}.pt"
    return told


def _figures(score: Confusion) -> dict[str, dict[str, float | None]]:
    overlap, found = score.overlap(), score.found()
    return {name: {"iou": overlap[name], "recall": found[name]} for name in overlap}


def _table(scores: Mapping[str, Confusion]) -> str:
    columns = {of: _figures(score) for of, score in scores.items()}
    told = [
        f"| {name} | "
        + " | ".join(f"{c[name]['iou']:.3f}, {c[name]['recall']:.3f}" if name in c else "–" for c in columns.values())
        + " |"
        for name in WOOD_CLASSES
    ]
    return "\n".join([f"| class | {' | '.join(columns)} |", "|---" * (1 + len(columns)) + "|", *told])


def _card(path: Path, trainer: Trainer, commands: Sequence[str], scores: Mapping[str, Confusion], wider: float) -> str:
    parameters, rows = sum(weight.numel() for weight in trainer.network.parameters()), _rows(trainer)
    steps = sum(run.until for run in trainer.runs)
    told = ", then\n  ".join(f"`{command}`" for command in commands)
    return f"""# {path.name}

Tells the class of every pixel of a picture of a vine in winter, for `perception`.

- Input: `image`, 1×{CHANNELS}×H×W, H and W multiples of 16: red, green, blue from -1 to 1, and 0.2 m / depth, 0 without
  depth.
- Output: `classes`, 1×H×W, indices in this order:
  {", ".join(WOOD_CLASSES)}.
- Size: {parameters:,} parameters, {path.stat().st_size / 1024:.0f} KiB.
- Data: {rows * VIEWS} pictures of {rows} rendered rows ({_seeds(trainer)}); no photograph. Half of the
  rows stand in low sun or wet, with laterals, tendrils, old leaves and drooping canes. Of four pictures two are of a
  survey, two from 0.12 to 0.6 m with the camera turned.
- Training: {steps} steps of {BATCH} crops of {CROP}×{CROP} pixels, one thread.
- Command: {told}.

Scores on pictures of {HELD_OUT_ROWS} other rows (seeds from {VALIDATION_SEED}): intersection over union, then
the share of the class's pixels that were given it.

{_table(scores)}

On average canes are drawn {abs(wider):.2f} pixels {"wider" if wider > 0 else "narrower"} than they are.
Measured widths are corrected by that.

Limits: all that it has seen was rendered. Weeds, snow, people and machines were not in it. It has not been scored on
photographs.
"""
