"""Lateral shoots, tendrils, old leaves and drooping canes: from the seed, seen, felt, and gone with their cane."""

from pathlib import Path

import numpy as np
import pytest
from msgspec.structs import replace as changed

from bridge.sim.build import simulated_robot
from bridge.sim.camera.config import CameraConfig
from bridge.sim.camera.renderer import Camera
from bridge.sim.robot.model import STEP_S
from bridge.sim.vineyard.config import VineyardConfig
from bridge.sim.vineyard.grow import grow
from bridge.sim.vineyard.row import Rod, Row
from bridge.sim.vineyard.truth import judge, judge_guyot, staying_rods
from bridge.sim.world.canes import Canes
from bridge.sim.world.config import CALM, PRESETS, only
from bridge.sim.world.growth import overgrown
from bridge.sim.world.wind import Wind
from rolling_panda.config import load_section
from rolling_panda.messages.types import WOOD_CLASSES
from rolling_panda.resources import resource
from tests.support.cameras import looking_left

ONE = VineyardConfig(vines=1)
ORGANS = ("laterals", "tendrils", "leaves")
ALL = changed(CALM, laterals=1.0, tendrils=1.0, leaves=1.0)


def told(rods: list[Rod | None] | tuple[Rod | None, ...]) -> list[object]:
    return [rod and (rod.kind, rod.start.tolist(), rod.end.tolist(), rod.parent, rod.organ) for rod in rods]


def organs(row: Row) -> list[tuple[int, Rod]]:
    return [(index, rod) for index, rod in row.standing() if rod.organ >= 0]


def carriers(row: Row) -> set[int]:
    """Rods of canes that carry something."""
    return {rod.parent for _, rod in organs(row) if row.rods[rod.parent].organ < 0}


def test_in_calm_nothing_grows_and_canes_stand_as_they_did() -> None:
    row = grow(ONE, 3)
    assert told(overgrown(row, CALM, 3).rods) == told(row.rods)
    robot = simulated_robot(resource("assets/config/sim.toml"), 3, None, "inline")
    assert told(robot.row.rods) == told(
        grow(load_section(resource("assets/config/sim.toml"), "vineyard", VineyardConfig), 3).rods
    )
    robot.close()


def test_the_simulated_row_has_what_is_configured(tmp_path: Path) -> None:
    path = tmp_path / "sim.toml"
    path.write_text(
        resource("assets/config/sim.toml").read_text().replace('preset = "calm"', 'preset = "field"\nleaves = 0.5')
    )
    robot = simulated_robot(path, 3, None, "inline")
    leaves = sum(robot.row.rods[index].kind == "node" for index in carriers(robot.row))
    assert leaves > 0.4 * sum(rod.kind == "node" for _, rod in robot.row.standing())
    robot.close()


def test_the_same_seed_gives_the_same_growth_and_a_longer_row_begins_like_a_shorter_one() -> None:
    storm = PRESETS["storm"]
    short, again, other = (overgrown(grow(ONE, seed), storm, seed) for seed in (3, 3, 4))
    assert told(short.rods) == told(again.rods) != told(other.rods)
    long = overgrown(grow(VineyardConfig(vines=2), 3), storm, 3)
    # At the end of the shorter row its wires end.
    near = [
        [(rod.kind, rod.start.tolist()) for _, rod in organs(row) if rod.vine == 0 and rod.start[0] < 1.1]
        for row in (short, long)
    ]
    assert near[0] == near[1]


@pytest.mark.long
@pytest.mark.parametrize("knob", ORGANS)
def test_as_many_nodes_carry_something_as_the_share_says_whatever_else_grows(knob: str) -> None:
    row = grow(VineyardConfig(), 5)
    canes = sum(rod.kind == "node" and rod.parent >= 0 for _, rod in row.standing())
    for preset in ("field", "storm"):
        share = getattr(PRESETS[preset], knob)
        grown = overgrown(row, only((knob,), preset), 5)
        # One node of each cane, the basal bud, carries nothing.
        assert len(carriers(grown)) / canes == pytest.approx(share, rel=0.25)
        both = overgrown(row, changed(only((knob,), preset), leaves=1.0, laterals=1.0), 5)
        assert {tuple(rod.end) for _, rod in organs(grown)} <= {tuple(rod.end) for _, rod in organs(both)}


def test_every_node_but_the_basal_bud_can_carry_something() -> None:
    row = overgrown(grow(ONE, 3), ALL, 3)
    nodes: dict[tuple[int, int, int], list[int]] = {}
    for index, rod in row.standing():
        if rod.kind == "node":
            nodes.setdefault((rod.vine, rod.spur, rod.cane), []).append(index)
    assert carriers(row) == {index for own in nodes.values() for index in own[1:]}


def test_rods_of_the_row_keep_their_indices_and_all_that_grows_comes_after_them() -> None:
    row = grow(ONE, 3)
    grown = overgrown(row, PRESETS["storm"], 3)
    assert min(index for index, _ in organs(grown)) == len(row.rods)
    for index, rod in organs(grown):
        carrier = grown.rods[rod.parent]
        assert rod.parent < index and (rod.vine, rod.spur, rod.cane) == (carrier.vine, carrier.spur, carrier.cane)
    for before, after in zip(row.rods, grown.rods, strict=False):
        assert np.linalg.norm(before.end - before.start) == pytest.approx(np.linalg.norm(after.end - after.start))
        assert (before.kind, before.parent) == (after.kind, after.parent)


def test_vines_with_many_laterals_have_them_in_any_world_and_no_fewer_in_a_rougher_one() -> None:
    row = grow(ONE, 3)
    own = told(overgrown(row, changed(CALM, laterals=0.2), 3).rods)
    assert told(overgrown(row, CALM, 3, laterals=0.2).rods) == own != told(row.rods)
    assert told(overgrown(row, changed(CALM, laterals=0.2), 3, laterals=0.1).rods) == own


def test_laterals_are_thin_and_short_canes_and_tendrils_hold_wires() -> None:
    row = overgrown(grow(ONE, 3), changed(CALM, laterals=1.0), 3)
    lengths: dict[tuple[int, ...], float] = {}
    for _, rod in organs(row):
        assert rod.kind == "cane" and rod.start_radius <= 0.0025
        name = rod.vine, rod.spur, rod.cane, rod.organ
        lengths[name] = lengths.get(name, 0.0) + float(np.linalg.norm(rod.end - rod.start))
    assert 0.029 < min(lengths.values()) and max(lengths.values()) < 0.301
    assert np.median(list(lengths.values())) < 0.12
    row = overgrown(grow(ONE, 3), changed(CALM, tendrils=1.0), 3)
    heights = [rod.start[2] for _, rod in row.standing() if rod.kind == "wire" and np.ptp([rod.start, rod.end]) > 1.0]
    on_wire = [any(abs(rod.end[2] - z) < 1e-6 for z in heights) for _, rod in organs(row)]
    assert 0.1 < np.mean(on_wire) < 0.9


def test_drooping_canes_bend_down_over_others_and_keep_their_foot_and_their_right_cut() -> None:
    row = grow(ONE, 3)
    bent = overgrown(row, changed(CALM, drooping=1.0), 3)
    tips = {(rod.vine, rod.spur, rod.cane): k for k, rod in row.standing() if rod.cane >= 0}
    lower = [row.rods[k].end[2] - bent.rods[k].end[2] for k in tips.values()]
    aside = [np.linalg.norm((row.rods[k].end - bent.rods[k].end)[:2]) for k in tips.values()]
    assert min(lower) > 0.02 and np.mean(aside) > 0.2
    some = overgrown(row, PRESETS["storm"], 3)
    moved = np.mean([not np.array_equal(row.rods[k].end, some.rods[k].end) for k in tips.values()])
    assert moved == pytest.approx(PRESETS["storm"].drooping, abs=0.15)
    for before, after in zip(judge(row), judge(bent), strict=True):
        assert (before.keeper, len(before.nodes)) == (after.keeper, len(after.nodes))
        assert before.cut is not None and after.cut is not None
        assert before.cut.rod == after.cut.rod and np.linalg.norm(before.cut.best - after.cut.best) < 0.03


def test_the_truth_is_that_of_the_canes_whatever_grows_on_them() -> None:
    row = grow(ONE, 3)
    grown = overgrown(row, ALL, 3)
    assert repr(judge(grown)) == repr(judge(row)) and staying_rods(grown) == staying_rods(row)
    guyot = grow(VineyardConfig(vines=1, training="guyot"), 3)
    assert repr(judge_guyot(overgrown(guyot, ALL, 3))) == repr(judge_guyot(guyot))


def test_the_camera_sees_laterals_as_canes_and_tendrils_and_leaves_as_no_wood() -> None:
    lens = CameraConfig(width=424, height=240).ideal()
    row, place = grow(ONE, 3), looking_left(0.5, 0.1, 1.2)
    bare = Camera(lens, 3).render(row, place)
    for knob, label in (("laterals", "cane"), ("tendrils", "background"), ("leaves", "background")):
        grown = overgrown(row, changed(CALM, **{knob: 1.0}), 3)
        image = Camera(lens, 3).render(grown, place)
        seen = image.rods >= len(row.rods)
        assert np.count_nonzero(seen) > 200, knob
        assert set(image.labels[seen].tolist()) == {WOOD_CLASSES.index(label)}
        behind = seen & (bare.rods < 0)
        assert np.all(np.abs(image.depth[behind] - 0.65) < 0.35), "as near as the row"
        differs = np.abs(image.color[behind].astype(int) - bare.color[behind]).max(axis=1)
        assert np.mean(differs > 20) > 0.8, knob


def test_a_cut_takes_what_grows_beyond_it_and_leaves_what_grows_below() -> None:
    row = overgrown(grow(ONE, 3), ALL, 3)
    spur = next(truth for truth in judge(row) if truth.cut is not None)
    own = [(k, rod) for k, rod in organs(row) if (rod.spur, rod.cane) == (spur.spur, spur.keeper)]

    def foot(index: int) -> int:
        return index if row.rods[index].organ < 0 else foot(row.rods[index].parent)

    beyond = {k for k, _ in own if foot(k) > spur.cut.rod}
    below = {k for k, _ in own} - beyond
    assert beyond and below
    fallen = row.sever(spur.cut.rod, 0.5)
    assert {k for k, rod in enumerate(fallen.rods) if rod is None and row.rods[k].organ >= 0} == beyond
    hangs = np.array([0.02, 0.0, -0.02])
    hanging = row.sever(spur.cut.rod, 0.5, hangs)
    for k, rod in own:
        assert hanging.rods[k].end == pytest.approx(rod.end + hangs * (k in beyond))


def test_laterals_push_back_as_thin_as_they_are_and_leaves_and_tendrils_not_at_all() -> None:
    foot = [
        Rod("cane", np.array([0.0, 0.0, k / 10]), np.array([0.0, 0.0, (k + 1) / 10]), 0.004, 0.004, k - 1, 0, 0, 0)
        for k in range(5)
    ]

    def pushed(kind: str, radius: float) -> float:
        organ = Rod(kind, np.array([0.0, 0.0, 0.3]), np.array([0.2, 0.0, 0.3]), radius, radius, 2, 0, 0, 0, organ=0)
        canes, row = Canes(6.5e9, np.array([0.02]), STEP_S), Row((*foot, organ))
        forces = [canes.push(row, np.array([[0.1, 0.0, 0.35 - 0.04 * k / 300]])) for k in range(300)]
        return max(sum(float(np.linalg.norm(push.force)) for push in each) for each in forces)

    assert pushed("background", 0.0015) == 0.0
    thin, thick = pushed("cane", 0.0012), pushed("cane", 0.0024)
    assert thin < 1.0 and thick == pytest.approx(16 * thin, rel=0.3)
    assert 1.0 < thick < 20.0


def test_what_grows_on_a_cane_sways_with_it() -> None:
    row = overgrown(grow(ONE, 3), ALL, 3)
    wind = Wind(row, 0.02, 3)
    apart, moved = [], []
    for at in np.arange(0.0, 3.0, 0.2):
        blown = wind.blown(row, at)
        for index, rod in organs(blown):
            carrier = blown.rods[rod.parent]
            moved.append(np.linalg.norm(rod.end - row.rods[index].end))
            apart.append(np.linalg.norm(rod.start - (carrier.at(0.5)[0] if carrier.organ < 0 else carrier.end)))
    assert max(apart) < 0.002 and 0.02 < max(moved) < 0.05
