"""Writes a trained network as ONNX with its classes as metadata, and its model card."""

import json
import warnings
from io import BytesIO
from pathlib import Path

import onnx
import torch

from perception.segmentation.network_segmenter import CHANNELS
from perception.training.compact import CompactLabeller
from perception.training.fit import BATCH, CROP, WEIGHTS, Trainer
from perception.training.network import Labeller
from perception.training.scenes import TRAINING_SEED, VALIDATION_SEED, VIEWS
from perception.training.score import Confusion
from rolling_panda.messages.types import WOOD_CLASSES

_OPSET = 17


def write_network(path: Path, trainer: Trainer, with_depth: Confusion, without: Confusion, wider: float) -> None:
    """Write the network and its card.

    Args:
        path: ONNX file; the card is the same name with .md.
        trainer: The trained network.
        with_depth: Its confusion matrix on held-out rows.
        without: The same without depth.
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
    path.with_suffix(".md").write_text(_card(path, trainer, with_depth, without, wider), encoding="utf-8")


def _card(path: Path, trainer: Trainer, with_depth: Confusion, without: Confusion, wider: float) -> str:
    parameters = sum(weight.numel() for weight in trainer.network.parameters())
    overlap, found, blind = with_depth.overlap(), with_depth.found(), without.overlap()
    table = "\n".join(f"| {name} | {overlap[name]:.3f} | {found[name]:.3f} | {blind[name]:.3f} |" for name in overlap)
    rows = max(run.rows for run in trainer.runs)
    seeds = f"seeds {TRAINING_SEED} to {TRAINING_SEED + rows - 1}"
    told, start = [], ""
    for run in trainer.runs:
        until = f" --until {run.until}" if run.until < run.steps else ""
        options = f"--seed {run.seed} --rows {run.rows} --steps {run.steps}{until}{start}"
        told.append(f"`python -m perception.training {options} --out {path.name}`")
        start = f" --start build/training/state_{run.seed}_{run.steps}.pt"
    commands = ", then\n  ".join(told)
    steps = sum(run.until for run in trainer.runs)
    return f"""# {path.name}

Tells the class of every pixel of a picture of a vine in winter, for `perception`.

- Input: `image`, 1×{CHANNELS}×H×W, H and W multiples of 16: red, green, blue from -1 to 1, and 0.2 m / depth, 0 without
  depth.
- Output: `classes`, 1×H×W, indices in this order:
  {", ".join(WOOD_CLASSES)}.
- Size: {parameters:,} parameters, {path.stat().st_size / 1024:.0f} KiB.
- Data: {rows * VIEWS} pictures of {rows} rendered rows ({seeds}); no photograph.
- Training: {steps} steps of {BATCH} crops of {CROP}×{CROP} pixels, one thread.
- Command: {commands}.

Scores on {VIEWS * 6} pictures of 6 other rows (seeds from {VALIDATION_SEED}). Overlap is intersection over
union, found is the share of the class's pixels that were given it.

| class | overlap | found | overlap without depth |
|---|---|---|---|
{table}

Canes come out {wider:.2f} pixels too wide on average, which is subtracted when they are measured.

Limits: all that it has seen was rendered. Leaves, weeds, snow, wet bark, people and machines were not in it. It has not
been scored on photographs.
"""
