"""Train the network for photographs: `python -m perception.training.wide --out FILE.onnx`.

It draws its own pictures, trains on one thread with a fixed seed, and writes the network with its card. A run that was
interrupted continues where it stopped; with more --steps a finished one goes on.
"""

import argparse
import sys
import time
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import torch

from perception.training.scenes import TRAINING_SEED, Scenes, render_scenes
from perception.training.wide.backgrounds import load_backgrounds
from perception.training.wide.drawing import Artist
from perception.training.wide.export import write_network
from perception.training.wide.fit import Trainer, keep
from rolling_panda.errors import InputError

_TELL_EVERY, _KEEP_EVERY = 25, 100


def main(argv: Sequence[str] | None = None) -> int:
    """Run the command; returns the exit code."""
    parser = argparse.ArgumentParser(prog="python -m perception.training.wide", description=__doc__)
    parser.add_argument("--out", type=Path, required=True, help="ONNX file to write; its card goes beside it")
    parser.add_argument("--work", type=Path, default=Path("build/photographs"), help="pictures and state are kept here")
    parser.add_argument("--seed", type=int, default=1, help="of weights and pictures")
    parser.add_argument("--steps", type=int, default=6000, help="steps of training in all")
    parser.add_argument("--until", type=int, help="stop after this step of them, keep the state and export")
    parser.add_argument("--size", type=int, default=320, help="side of the drawn pictures (px, a multiple of 32)")
    parser.add_argument("--rows", type=int, default=40, help="rendered rows to train on besides; 0 for none")
    parser.add_argument(
        "--backgrounds", type=Path, metavar="DIR", help="real pictures without vines, to stand behind, and LICENCES.txt"
    )
    words = parser.parse_args(argv)
    if words.size % 32 or words.size < 64:
        parser.error(f"--size {words.size}: give a multiple of 32 from 64")
    torch.set_num_threads(1)
    words.work.mkdir(parents=True, exist_ok=True)
    try:
        backgrounds = load_backgrounds(words.backgrounds)
        artist = Artist(words.size, tuple(each.picture for each in backgrounds))
        trainer = Trainer(words.seed, words.steps, artist, _rows(words.work, words.rows) if words.rows else None)
        kept = words.work / f"state_{words.seed}.pt"
        if kept.exists():
            trainer.restore(torch.load(kept, weights_only=True))
    except (InputError, ValueError) as error:
        print(f"python -m perception.training.wide: {error}", file=sys.stderr)
        return 1
    begin, losses = time.monotonic(), []
    until = min(words.until or words.steps, words.steps)
    for progress in trainer.run(until):
        losses.append(progress.loss)
        if progress.step % _TELL_EVERY == 0:
            each = (time.monotonic() - begin) / len(losses)
            mean = float(np.mean(losses[-_TELL_EVERY:]))
            left = each * (until - progress.step) / 60.0
            print(f"step {progress.step:>6}  loss {mean:.4f}  {each:.2f} s a step, {left:.0f} min left", flush=True)
            with (words.work / f"curve_{words.seed}.csv").open("a", encoding="utf-8") as file:
                file.write(f"{progress.step},{mean:.5f}\n")
        if progress.step % _KEEP_EVERY == 0:
            keep(trainer, kept)
    keep(trainer, kept)
    credits = [f"{each.name}: {each.credit}" for each in backgrounds]
    write_network(words.out, trainer, artist, sys.argv[1:] if argv is None else list(argv), credits)
    return 0


def _rows(work: Path, count: int) -> Scenes:
    path = work / f"rows_{count}.npz"
    if not path.exists():
        scenes = render_scenes(TRAINING_SEED, count)
        new = path.with_suffix(".new.npz")
        np.savez(new, color=scenes.color, depth=scenes.depth, labels=scenes.labels)
        new.replace(path)
    with np.load(path) as file:
        return Scenes(file["color"], file["depth"], file["labels"])


if __name__ == "__main__":
    sys.exit(main())
