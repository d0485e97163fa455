"""How a segmenter confuses classes."""

from dataclasses import replace

import numpy as np

from benchmarks.perception.confusion import Confusion, no_counts, shares
from perception.segmentation.frame import View
from perception.segmentation.segmenter import LabelImageSegmenter
from rolling_panda.messages.robot import Intrinsics
from rolling_panda.messages.types import WOOD_CLASSES

CANE, NODE, WIRE = (WOOD_CLASSES.index(name) for name in ("cane", "node", "wire"))
LENS = Intrinsics(width=8, height=16, fx=10.0, fy=10.0, cx=4.0, cy=8.0)
TRUE = np.full((16, 8), CANE, dtype=np.uint8)
TRUE[:, 6:] = NODE


class Half:
    """Takes the right half of every picture for wire."""

    name, width_bias = "half", 0.7

    def segment(self, view: View):
        told = np.array(view.labels if view.labels is not None else TRUE)
        told[:, 4:] = WIRE
        return told


def view(labels) -> View:
    return View(0, 0.0, LENS, np.ones(TRUE.shape, dtype=np.float32), labels, b"", np.eye(3), np.zeros(3))


def test_each_class_is_told_by_what_its_pixels_were_taken_for():
    counts = no_counts()
    watched = Confusion(Half(), counts)
    for _ in range(2):
        told = watched.segment(view(TRUE))
        assert (told == Half().segment(view(TRUE))).all()
    table = shares(counts)
    assert table.keys() == {"cane", "node"}
    assert table["cane"]["cane"] == 0.6667 and table["cane"]["wire"] == 0.3333 and table["node"]["wire"] == 1.0
    assert (watched.name, watched.width_bias) == ("half", 0.7)


def test_what_cannot_be_compared_is_not_counted():
    counts = no_counts()
    watched = Confusion(Half(), counts)
    watched.segment(replace(view(TRUE), labels=None))
    assert not counts.any() and shares(counts) == {}
    Confusion(LabelImageSegmenter(), counts).segment(view(TRUE))
    assert shares(counts)["node"]["node"] == 1.0
