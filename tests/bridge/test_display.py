"""The true row for the 3-D view: canes that wind and arm displace are told, and a calm row tells nothing."""

from pathlib import Path

import numpy as np
import pytest
from msgspec.structs import replace

from bridge.config import BridgeConfig
from bridge.core.interface import Setpoint
from bridge.sim.build import simulated_bridge
from bridge.sim.robot.model import STEP_S
from bridge.sim.robot.robot import SimulatedRobot
from bridge.sim.vineyard.config import VineyardConfig
from bridge.sim.vineyard.grow import grow
from bridge.sim.vineyard.row import Rod, Row
from bridge.sim.world.canes import Canes
from bridge.sim.world.config import CALM, WorldConfig
from bridge.sim.world.display import RowMotion, capsules
from bridge.sim.world.wind import Wind
from rolling_panda.config import load_section
from rolling_panda.messages.perception import Capsule, MovedCapsule
from rolling_panda.resources import resource
from rolling_panda.transport.codec import encode
from tests.support.cameras import Blind

CONFIG = load_section(resource("assets/config/sim.toml"), "bridge", BridgeConfig)
ROW = grow(VineyardConfig(vines=2), 4)
TOOL = np.array([0.5, 0.3, 1.0])


def drawn(row: Row, moved: tuple[MovedCapsule, ...] | None) -> np.ndarray:
    """Both ends of every displayed capsule (n×6, m) with the displaced ones moved."""
    ends = np.array([(*each.start, *each.end) for each in capsules(row)])
    for each in moved or ():
        ends[each.index] = (*each.start, *each.end)
    return ends


def ends(row: Row) -> np.ndarray:
    return drawn(row, ())


def test_canes_near_the_tool_are_told_where_the_wind_has_them_and_the_others_not_at_all() -> None:
    wind = Wind(ROW, 0.02, 4)
    motion, at = RowMotion(ROW, Wind(ROW, 0.02, 4), None), 1.3
    moved = motion.changed(ROW, TOOL, at)
    kinds = [each.kind for each in capsules(ROW)]
    assert moved is not None and {kinds[each.index] for each in moved} == {"cane", "node"}
    shown, true, rest = drawn(ROW, moved), ends(wind.blown(ROW, at)), ends(ROW)
    near = np.abs(rest[:, 0] - TOOL[0]) < 0.3
    assert np.abs(shown - true)[near].max() < 0.003 < np.abs(rest - true)[near].max()
    far = np.abs(rest[:, 0] - TOOL[0]) > 1.2
    assert far.any() and np.array_equal(shown[far], rest[far])
    there = motion.changed(ROW, TOOL + (1.8, 0.0, 0.0), at)
    assert there and {each.index for each in there}.isdisjoint(each.index for each in moved)


def test_a_motion_is_told_once_and_again_when_a_cane_has_moved_by_3_mm() -> None:
    motion = RowMotion(ROW, Wind(ROW, 0.02, 4), None)
    first = motion.changed(ROW, TOOL, 1.0)
    assert first and motion.changed(ROW, TOOL, 1.0) is None and motion.changed(ROW, TOOL, 1.001) is None
    later = motion.changed(ROW, TOOL, 1.2)
    assert later is not None and [each.index for each in later] == [each.index for each in first]
    assert np.abs(drawn(ROW, later) - drawn(ROW, first)).max() > 0.003


def test_after_a_cut_the_capsules_of_the_new_row_are_told() -> None:
    motion, wind = RowMotion(ROW, Wind(ROW, 0.02, 4), None), Wind(ROW, 0.02, 4)
    before = motion.changed(ROW, TOOL, 1.0)
    swaying = [index for index, rod in ROW.standing() if rod.cane >= 0 and abs(rod.start[0] - TOOL[0]) < 0.2]
    for hangs in (None, np.array([0.02, 0.0, -0.02])):
        row = ROW.sever(swaying[5], 0.5, hangs)
        after = motion.changed(row, TOOL, 1.0)
        assert before is not None and after is not None
        near = np.abs(ends(row)[:, 0] - TOOL[0]) < 0.3
        assert np.abs(drawn(row, after) - ends(wind.blown(row, 1.0)))[near].max() < 0.003
        assert len(after) < len(before) or hangs is not None
        motion = RowMotion(ROW, Wind(ROW, 0.02, 4), None)


def test_after_a_cut_elsewhere_the_displaced_capsules_are_told_again_for_the_new_revision() -> None:
    """The row is then drawn anew, at rest."""
    motion = RowMotion(ROW, Wind(ROW, 0.02, 4), None)
    before = motion.changed(ROW, TOOL, 1.0)
    far = max(ROW.standing(), key=lambda each: abs(each[1].start[0] - TOOL[0]) if each[1].cane >= 0 else 0.0)[0]
    row = ROW.sever(far, 0.5, None)
    after = motion.changed(row, TOOL, 1.0)
    assert before and after and len(after) == len(before)
    assert motion.changed(row, TOOL, 1.0) is None


def upright(x: float, lateral: bool = False) -> list[Rod]:
    """A cane of ten rods on a spur of its own, and a lateral that grows on its fifth rod."""
    z = np.linspace(0.5, 1.5, 11)
    rods = [Rod("cane", np.array([x, 0, a]), np.array([x, 0, b]), 0.004, 0.004, k - 1, 0, 0, 0) for k, (a, b) in
            enumerate(zip(z, z[1:], strict=False))]  # fmt: skip
    if lateral:
        start, end = np.array([x, 0.0, 0.95]), np.array([x, 0.1, 0.95])
        rods.append(Rod("cane", start, end, 0.002, 0.001, 4, 0, 0, 0, organ=0))
    return rods


def test_a_cane_that_the_arm_bends_is_told_bent_from_its_foot_and_straight_again_when_it_is_let_go() -> None:
    row, canes = Row(tuple(upright(0.0, lateral=True))), Canes(6.5e9, np.array([0.02]), STEP_S)
    motion = RowMotion(row, None, canes)
    assert motion.changed(row, TOOL, 0.0) is None
    for x in np.linspace(-0.03, 0.0, 200):
        canes.push(row, np.array([[x, 0.0, 1.0]]))
    moved = motion.changed(row, TOOL, 0.2)
    assert moved is not None and [each.index for each in moved] == list(range(11))
    starts = [each.start[0] for each in moved]
    pushed = canes.bends()[0, 0, 0, -1][0][0]
    assert pushed == pytest.approx(0.024, abs=1e-4)
    assert starts[0] == 0.0 and starts[5] == pytest.approx(pushed) and moved[4].end[0] == starts[5]
    assert starts[:10] == sorted(starts[:10]) and starts[9] < 2.0 * pushed
    lateral = moved[10]
    assert lateral.start[0] == lateral.end[0] == starts[4], "it goes with what it grows on"
    for _ in range(400):
        canes.push(row, np.array([[-0.5, 0.0, 1.0]]))
    back = motion.changed(row, TOOL, 0.6)
    assert back is not None and np.abs(drawn(row, back) - ends(row)).max() < 1e-3
    assert motion.changed(row, TOOL, 0.8) is None
    assert motion.changed(row, TOOL + 1.0, 1.0) == () and motion.changed(row, TOOL + 1.0, 1.2) is None


def test_a_lateral_that_is_pushed_bends_alone() -> None:
    row, canes = Row(tuple(upright(0.0, lateral=True))), Canes(6.5e9, np.array([0.02]), STEP_S)
    for x in np.linspace(-0.05, -0.01, 200):
        canes.push(row, np.array([[x, 0.08, 0.95]]))
    moved = RowMotion(row, None, canes).changed(row, TOOL, 0.2)
    assert moved is not None
    assert np.abs(drawn(row, moved) - ends(row))[:10].max() == 0.0
    assert moved[10].start[0] == 0.0 and moved[10].end[0] > 0.01


def told(world: WorldConfig, seconds: float = 1.0) -> list[tuple[MovedCapsule, ...]]:
    """What the robot tells beside the row while it stands, asked every 0.1 s."""
    sim, out = SimulatedRobot(CONFIG, ROW, Blind(), None, world, 3), []
    for step in range(round(1000 * seconds)):
        sim.write(Setpoint(np.zeros(9), True, 1, 1, 0.0))
        if step % 100 == 0 and (motion := sim.scenery_motion()) is not None:
            assert motion[0] == sim.scenery()[0]
            out.append(motion[1])
    return out


def test_a_calm_robot_tells_no_motion_and_the_same_seed_tells_the_same() -> None:
    assert told(CALM) == [] == told(replace(CALM, cane_modulus=6.5))
    windy = replace(CALM, sway=0.02)
    first = told(windy)
    assert len(first) >= 8 and told(windy) == first


def of(preset: str, tmp_path: Path) -> Path:
    text = resource("assets/config/sim.toml").read_text().replace("width = 848", "width = 64")
    path = tmp_path / f"{preset}.toml"
    path.write_text(text.replace("height = 480", "height = 48").replace('"calm"', f'"{preset}"'))
    return path


@pytest.mark.parametrize(("preset", "messages"), [("calm", 0), ("field", 5)])
def test_the_bridge_sends_motion_five_times_a_second_in_wind_and_never_in_the_calm(
    preset: str, messages: int, tmp_path: Path
) -> None:
    core = simulated_bridge(of(preset, tmp_path), 1)
    out = [core.step(tick * 1e-3) for tick in range(1, 1001)]
    core.robot.close()
    motions = [each.scenery_motion for each in out if each.scenery_motion is not None]
    (scenery,) = [each.scenery for each in out if each.scenery is not None]
    assert len(motions) == messages
    for motion in motions:
        assert motion.header.frame_id == "map" and motion.revision == scenery.revision
        assert len(encode(motion)) < 64_000
        assert all(isinstance(scenery.capsules[each.index], Capsule) for each in motion.moved)
    assert not motions or motions[0] in next(each for each in out if each.scenery_motion).messages
