"""Which right cuts the blades cannot come to."""

from dataclasses import replace

import numpy as np
import pytest

from benchmarks.perception.blocked import CANE_ROOM, WIRE_ROOM, blocked_by
from bridge.sim.vineyard.row import Rod, Row
from bridge.sim.vineyard.truth import right_cut

#: An upright internode of 80 mm; the cut is right over 20 mm of it.
CANE = Rod("cane", np.zeros(3), np.array([0.0, 0.0, 0.08]), 0.004, 0.004, vine=0, spur=1, cane=0)
CUT = right_cut(0, CANE, 0.030, 0.040, 0.050)
RADIUS = 0.0015


def beside(kind, aside, height=0.04, lying=False, **names) -> Row:
    """The internode with something `aside` of it: parallel and a little longer, or lying square to both."""
    middle = np.array([aside, 0.0, height])
    along = np.array([0.0, 0.1, 0.0]) if lying else np.array([0.0, 0.0, 0.1])
    return Row((CANE, Rod(kind, middle - along, middle + along, RADIUS, RADIUS, **names)))


@pytest.mark.parametrize(("aside", "what"), [(CANE_ROOM - 0.001, "cane"), (CANE_ROOM + 0.001, "")])
def test_another_cane_between_the_blades_all_along_is_in_the_way(aside, what):
    assert blocked_by(beside("cane", aside, vine=0, spur=1, cane=1), CUT) == what
    assert blocked_by(beside("node", aside, vine=0, spur=2, cane=0), CUT) == what


@pytest.mark.parametrize(("aside", "what"), [(WIRE_ROOM + RADIUS - 0.001, "wire"), (WIRE_ROOM + RADIUS + 0.001, "")])
def test_a_wire_is_in_the_way_by_its_surface(aside, what):
    assert blocked_by(beside("wire", aside), CUT) == what
    assert blocked_by(beside("hose", aside), CUT) == what
    assert blocked_by(beside("post", aside), CUT) == what.replace("wire", "post")


@pytest.mark.parametrize("kind", ["wire", "cane"])
def test_what_only_crosses_one_end_of_the_stretch_leaves_room_at_the_other(kind):
    assert blocked_by(beside(kind, 0.008, height=0.028, lying=True, vine=3, spur=3, cane=3), CUT) == ""
    assert blocked_by(beside(kind, 0.008, height=0.040, lying=True, vine=3, spur=3, cane=3), CUT) == kind


def test_the_cane_itself_and_what_is_neither_cane_nor_wire_are_not_in_the_way():
    assert blocked_by(beside("node", 0.005, vine=0, spur=1, cane=0), CUT) == ""
    assert blocked_by(beside("spur", 0.005, vine=0, spur=1), CUT) == ""


def test_a_wire_far_away_is_not_what_is_in_the_way():
    far_wire = replace(CANE, kind="wire", start=np.array([1.0, 0.0, 0.0]), end=np.array([1.0, 0.0, 1.0]))
    both = Row((*beside("cane", 0.010, vine=0, spur=2, cane=0).rods, far_wire))
    assert blocked_by(both, CUT) == "cane"
