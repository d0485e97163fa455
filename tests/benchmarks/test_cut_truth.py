"""What was severed is judged by the simulator's truth, not by where the program wanted to cut."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from benchmarks.control.cut_truth import true_cut, wanted_cuts
from bridge.config import BridgeConfig
from bridge.core.interface import Setpoint
from bridge.sim.robot import trace
from bridge.sim.robot.robot import SimulatedRobot
from bridge.sim.vineyard.config import VineyardConfig
from bridge.sim.vineyard.grow import grow
from bridge.sim.vineyard.row import Array, Rod, Row
from bridge.sim.vineyard.truth import judge
from rolling_panda.config import load_section
from rolling_panda.resources import resource
from tests.support.cameras import Blind

ROW = grow(VineyardConfig(vines=1), 11)
TRUTHS, WANTED = judge(ROW), wanted_cuts(ROW)
WITH_RENEWAL = next(truth for truth in TRUTHS if truth.cut is not None and truth.renewal is not None)


def piece(truth, kind, point, cane=-1):
    return {"vine": truth.vine, "spur": truth.spur, "cane": cane, "kind": kind, "point": list(map(float, point))}


@pytest.mark.parametrize(("along", "right", "harm"), [(0.0, True, False), (-0.06, False, True), (0.3, False, False)])
def test_a_cut_on_the_cane_that_stays(along, right, harm):
    cut = WITH_RENEWAL.cut
    result = true_cut(WANTED, [piece(WITH_RENEWAL, "cane", cut.best + along * cut.tangent, WITH_RENEWAL.keeper)])
    assert (result.right, bool(result.harm)) == (right, harm)


def test_the_stub_beyond_the_cane_that_stays_may_go_and_below_it_not():
    cut = WITH_RENEWAL.renewal
    assert true_cut(WANTED, [piece(WITH_RENEWAL, "spur", cut.best)]).right
    below = true_cut(WANTED, [piece(WITH_RENEWAL, "spur", cut.least - 0.01 * cut.tangent)])
    assert not below.right and "stays" in below.harm


def test_another_cane_is_neither_right_nor_harm_and_one_harm_outweighs_what_is_right():
    cut, other = WITH_RENEWAL.cut, WITH_RENEWAL.keeper + 50
    assert true_cut(WANTED, [piece(WITH_RENEWAL, "cane", cut.best, other)]) == true_cut(WANTED, [])
    both = [piece(WITH_RENEWAL, "cane", cut.best + np.array(d) * cut.tangent, WITH_RENEWAL.keeper) for d in (0, -0.06)]
    result = true_cut(WANTED, both)
    assert not result.right and result.harm


def before_the_tool(rods: tuple[Rod | None, ...], place: Array, along: Array, tool: Array) -> Row:
    """The wood of vines' spurs, moved so that the place is between the blades, square to them."""
    across = np.cross(along, [0.0, 1.0, 0.0])
    across /= np.linalg.norm(across)
    R = tool[:3, :3] @ np.column_stack([across, along, np.cross(across, along)]).T
    at = tool[:3, 3]

    def moved(rod: Rod) -> Rod:
        return replace(rod, start=at + R @ (rod.start - place), end=at + R @ (rod.end - place))

    return Row(tuple(moved(rod) if rod is not None and rod.spur >= 0 else None for rod in rods))


@pytest.mark.parametrize(("aside", "right"), [(0.0, True), (0.03, False)])
def test_to_cut_a_lateral_along_with_its_cane_is_right_and_by_itself_neither_right_nor_harm(
    aside: float, right: bool, tmp_path: Path
) -> None:
    config = load_section(resource("assets/config/sim.toml"), "bridge", BridgeConfig)
    spur = WITH_RENEWAL
    cut, node = spur.cut, ROW.rods[spur.cut.rod - 1]
    side = np.cross(cut.tangent, [0.0, 1.0, 0.0])
    side /= np.linalg.norm(side)
    # From the last node that stays, past the blades.
    start, end = node.at(0.5)[0], cut.best + aside * side + 0.01 * cut.tangent
    lateral = Rod("cane", start, end, 0.0015, 0.001, cut.rod - 1, spur.vine, spur.spur, spur.keeper, organ=0)
    tool = SimulatedRobot(config, Row(()), Blind()).true_tool()
    between = cut.best + aside * side
    standing = before_the_tool((*ROW.rods, lateral), between, cut.tangent, tool)
    wanted = wanted_cuts(standing)
    sim = SimulatedRobot(config, standing, Blind(), trace.TraceWriter(tmp_path / "trace"))
    sim.cut("c1", "p1")
    for _ in range(700):
        sim.write(Setpoint(np.zeros(9), True, 1, 1, 0.0))
    sim.close()
    (bite,) = [event for event in trace.read(tmp_path / "trace").events if event["event"] == "cut"]
    result = true_cut(wanted, bite["severed"])
    assert (result.right, result.harm) == (right, "")
    left = sim.row.rods[len(ROW.rods)]
    assert left is not None and np.linalg.norm(left.end - left.start) < np.linalg.norm(end - start) - 0.005
    assert (sim.row.rods[cut.rod + 1] is None) == right
