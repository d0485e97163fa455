"""Sheets of drawn pictures, to be looked at: `python -m perception.training.wide.gallery --out DIR`."""

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from PIL import Image

from perception.perceive import COLORS
from perception.training.wide.backgrounds import load_backgrounds
from perception.training.wide.drawing import Artist

#: Pictures of a sheet across and down.
_ACROSS, _DOWN = 10, 10


def main(argv: Sequence[str] | None = None) -> int:
    """Write the pictures of the first hundred seeds, and beside them their classes; returns the exit code."""
    parser = argparse.ArgumentParser(prog="python -m perception.training.wide.gallery", description=__doc__)
    parser.add_argument("--out", type=Path, required=True, metavar="DIR", help="pictures.jpg and classes.png go here")
    parser.add_argument("--seed", type=int, default=0, help="of the first picture's row of seeds")
    parser.add_argument("--size", type=int, default=320, help="side of a picture (px)")
    parser.add_argument("--backgrounds", type=Path, metavar="DIR", help="real pictures without vines")
    words = parser.parse_args(argv)
    artist = Artist(words.size, tuple(each.picture for each in load_backgrounds(words.backgrounds)))
    palette = np.array([*COLORS, (120, 120, 120)], np.uint8)
    drawn = [artist.draw(words.seed, number) for number in range(_ACROSS * _DOWN)]
    words.out.mkdir(parents=True, exist_ok=True)
    for name, tiles in (
        ("pictures.jpg", [each.color for each in drawn]),
        ("classes.png", [palette[each.labels] for each in drawn]),
    ):
        rows = [np.hstack(tiles[row * _ACROSS : (row + 1) * _ACROSS]) for row in range(_DOWN)]
        Image.fromarray(np.vstack(rows)).save(words.out / name)
    return 0


if __name__ == "__main__":
    sys.exit(main())
