import numpy as np
import pytest

from bridge.config import BridgeConfig
from bridge.sim.robot.cutter import Cutter, close_blades
from bridge.sim.vineyard.row import Rod, Row
from rolling_panda import reasons
from rolling_panda.messages.types import Reason, WoodClass
from rolling_panda.reasons import text_of

CONFIG = BridgeConfig()
# Blades 1 m up, approaching along world y; the tool's y points down, so upright canes pass the blade plane squarely.
TOOL = np.array([[1.0, 0, 0, 0.0], [0, 0, 1, 0.0], [0, -1, 0, 1.0], [0, 0, 0, 1]])


def upright(x: float = 0.0, y: float = 0.0, radius: float = 0.004, kind: WoodClass = "cane", parent: int = -1) -> Rod:
    return Rod(kind, np.array([x, y, 0.8]), np.array([x, y, 1.4]), radius, radius, parent)


def along_row(kind: WoodClass, z: float, radius: float) -> Rod:
    return Rod(kind, np.array([-1.0, 0.0, z]), np.array([1.0, 0.0, z]), radius, radius)


def test_a_cane_between_the_blades_is_severed_at_the_blade_plane() -> None:
    bud = Rod("node", np.array([0, 0, 1.2]), np.array([0, 0, 1.21]), 0.005, 0.005, parent=0)
    result = close_blades(Row((upright(), bud)), TOOL, CONFIG)
    assert [item.index for item in result.severed] == [0]
    assert result.severed[0].point == pytest.approx([0.0, 0.0, 1.0])
    row = result.applied(Row((upright(), bud)))
    cane = row.rods[0]
    assert cane is not None
    assert cane.end[2] == pytest.approx(1.0)
    assert row.rods[1] is None
    assert row.revision == 1


@pytest.mark.parametrize(
    ("x", "y", "cut"),
    [(0.014, 0.0, True), (0.016, 0.0, False), (-0.016, 0.0, False), (0.0, 0.017, True), (0.0, 0.019, False)],
)
def test_only_what_is_within_the_opening_and_the_blades_reach(x: float, y: float, cut: bool) -> None:
    result = close_blades(Row((upright(x, y),)), TOOL, CONFIG)
    assert bool(result.severed) == cut
    assert result.detail == (reasons.wood_severed("cane") if cut else reasons.nothing_between_blades())
    assert not result.jammed


def test_a_cane_that_ends_below_the_blades_is_not_cut() -> None:
    short = Rod("cane", np.array([0, 0, 0.8]), np.array([0, 0, 0.999]), 0.004, 0.004)
    assert close_blades(Row((short,)), TOOL, CONFIG).severed == ()


def test_two_canes_are_both_severed_and_both_reported() -> None:
    row = Row((upright(-0.01), upright(0.01), upright(0.3)))
    result = close_blades(row, TOOL, CONFIG)
    assert [item.index for item in result.severed] == [0, 1]
    assert result.applied(row).rods[2] is row.rods[2]
    assert result.detail == reasons.wood_severed("cane, cane")


@pytest.mark.parametrize(
    ("hard", "why"),
    [
        (along_row("wire", 1.0, 0.00125), reasons.blades_on_hard_part("wire")),
        (along_row("cordon", 1.01, 0.015), reasons.blades_on_hard_part("cordon")),
        (upright(kind="post", radius=0.038, x=0.04), reasons.blades_on_hard_part("post")),
        (upright(radius=0.013), reasons.wood_beyond_blades("cane", 26.0)),
    ],
)
def test_wire_post_and_thick_wood_jam_the_blades_and_nothing_is_severed(hard: Rod, why: Reason) -> None:
    row = Row((upright(0.005), hard))
    result = close_blades(row, TOOL, CONFIG)
    assert result.jammed
    assert text_of(result.detail) == text_of(why)
    assert result.severed == ()
    assert result.applied(row) is row


@pytest.mark.parametrize("spur", [0, -1])
def test_last_years_cane_of_a_guyot_vine_is_severed_and_a_permanent_cordon_jams(spur: int) -> None:
    """They have the same class; last year's cane has the number of the spur beside it."""
    old = Rod("cordon", np.array([0, 0, 0.9]), np.array([0, 0, 1.06]), 0.007, 0.0065, -1, 1, spur)
    beyond = Rod("cordon", old.end, np.array([0.1, 0, 1.06]), 0.0065, 0.006, 0, 1, spur)
    row = Row((old, beyond))
    result = close_blades(row, TOOL, CONFIG)
    assert result.jammed == (spur < 0)
    assert [item.index for item in result.severed] == ([] if spur < 0 else [0])
    left = result.applied(row).rods
    assert (left[1] is None) == (spur >= 0) and left[0] is not None
    assert left[0].end[2] == pytest.approx(1.06 if spur < 0 else 1.0)


def test_too_thick_a_cane_of_last_year_jams() -> None:
    old = Rod("cordon", np.array([0, 0, 0.9]), np.array([0, 0, 1.1]), 0.013, 0.013, -1, 1, 0)
    result = close_blades(Row((old,)), TOOL, CONFIG)
    assert result.jammed and result.detail == reasons.wood_beyond_blades("cordon", 26.0)


def test_a_wire_beside_the_blade_plane_does_not_jam() -> None:
    assert not close_blades(Row((upright(), along_row("wire", 1.01, 0.00125))), TOOL, CONFIG).jammed


@pytest.mark.parametrize(("gap", "jams"), [(0.002, False), (-0.002, True)])
def test_a_post_beside_a_corner_of_the_blades_jams_them_only_where_it_reaches_it(gap: float, jams: bool) -> None:
    corner = np.array([CONFIG.opening / 2, CONFIG.blade_half_length])
    x, y = corner + (0.038 + gap) * np.sqrt(0.5)
    result = close_blades(Row((upright(), upright(x, y, 0.038, "post"))), TOOL, CONFIG)
    assert result.jammed == jams
    assert bool(result.severed) != jams


def test_nothing_at_all_is_nothing() -> None:
    assert close_blades(Row(()), TOOL, CONFIG).detail == reasons.nothing_between_blades()


def test_the_blades_meet_after_the_closing_time_and_open_as_long() -> None:
    cutter = Cutter(CONFIG)
    cutter.start("c1", "p1")
    steps = 0
    while not cutter.step(0.001, True):
        steps += 1
        assert cutter.state == "closing"
    assert steps + 1 == 300
    cutter.finish("DONE", reasons.wood_severed("cane"), jammed=False)
    for _ in range(299):
        cutter.step(0.001, True)
        assert cutter.state == "opening"
    cutter.step(0.001, True)
    assert cutter.state == "open"
    assert cutter.outcome == "DONE"


def test_an_inhibited_cutter_opens_without_cutting() -> None:
    cutter = Cutter(CONFIG)
    cutter.start("c1", "p1")
    assert not cutter.step(0.001, True)
    assert not cutter.step(0.001, False)
    assert (cutter.state, cutter.outcome) == ("opening", "FAILED_NOT_CUT")
    assert cutter.detail == reasons.inhibited_while_closing()
    assert not any(cutter.step(0.001, True) for _ in range(1000))
