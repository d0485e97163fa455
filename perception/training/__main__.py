"""Train the segmentation network: `python -m perception.training --out FILE.onnx`.

It renders its own pictures, trains on one thread with a fixed seed, evaluates the result on other rows and writes the
network with its card. A run that was interrupted, or stopped with --until, continues where it stopped. With --start a
new run starts from those weights.
"""

import argparse
import sys
import time
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import torch

from perception.training.export import HELD_OUT_ROWS, write_network
from perception.training.fit import WEIGHTS, Trainer
from perception.training.network import Labeller
from perception.training.scenes import (
    NEAR_VIEWS,
    SURVEY_VIEWS,
    TRAINING_SEED,
    VALIDATION_SEED,
    Scenes,
    render_scenes,
)
from perception.training.score import confusion, widening

_TELL_EVERY, _KEEP_EVERY = 50, 250


def main(argv: Sequence[str] | None = None) -> int:
    """Run the command; returns the exit code."""
    parser = argparse.ArgumentParser(prog="python -m perception.training", description=__doc__)
    parser.add_argument("--out", type=Path, required=True, help="ONNX file to write; its card goes beside it")
    parser.add_argument("--work", type=Path, default=Path("build/training"), help="pictures and state are kept here")
    parser.add_argument("--seed", type=int, default=1, help="of weights and crops")
    parser.add_argument("--rows", type=int, default=90, help="rows to render for training")
    parser.add_argument("--steps", type=int, default=2400, help="steps of training in all")
    parser.add_argument("--until", type=int, help="stop after this step of them and keep the state")
    parser.add_argument("--start", type=Path, metavar="STATE", help="train what another run has kept in this file")
    words = parser.parse_args(argv)
    torch.set_num_threads(1)
    words.work.mkdir(parents=True, exist_ok=True)
    scenes = _scenes(words.work / f"training_{words.rows}.npz", TRAINING_SEED, words.rows)
    start = None if words.start is None else torch.load(words.start, weights_only=True)
    trainer = Trainer(words.seed, words.steps, words.rows, start)
    kept = words.work / f"state_{words.seed}_{words.steps}.pt"
    if kept.exists():
        trainer.restore(torch.load(kept, weights_only=True))
    begin, losses = time.process_time(), []
    for progress in trainer.run(scenes, words.until or words.steps):
        losses.append(progress.loss)
        if progress.step % _TELL_EVERY == 0:
            each = (time.process_time() - begin) / len(losses)
            mean = np.mean(losses[-_TELL_EVERY:])
            print(f"step {progress.step:>5}  loss {mean:.4f}  {each:.2f} s a step", flush=True)
        if progress.step % _KEEP_EVERY == 0:
            torch.save(trainer.state(), kept)
    torch.save(trainer.state(), kept)
    if trainer.step < trainer.steps:
        return 0
    held_out = _scenes(words.work / "validation.npz", VALIDATION_SEED, HELD_OUT_ROWS)
    labeller = Labeller(trainer.network, WEIGHTS)
    survey, near = held_out.of_views(SURVEY_VIEWS), held_out.of_views(NEAR_VIEWS)
    scores = {
        "survey": confusion(labeller, survey),
        "survey without depth": confusion(labeller, survey, with_depth=False),
        "near and turned": confusion(labeller, near),
    }
    write_network(words.out, trainer, scores, widening(labeller, held_out))
    print(words.out.with_suffix(".md").read_text(encoding="utf-8"))
    return 0


def _scenes(path: Path, seed: int, rows: int) -> Scenes:
    if not path.exists():
        scenes = render_scenes(seed, rows)
        np.savez(path, color=scenes.color, depth=scenes.depth, labels=scenes.labels)
    with np.load(path) as file:
        return Scenes(file["color"], file["depth"], file["labels"])


if __name__ == "__main__":
    sys.exit(main())
