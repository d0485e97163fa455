import numpy as np

from benchmarks.control.cane_touches import CaneTouches
from bridge.sim.vineyard.config import VineyardConfig
from bridge.sim.vineyard.grow import grow
from bridge.sim.vineyard.row import Rod
from bridge.sim.vineyard.truth import judge, staying_rods
from controller.config import ControllerConfig
from rolling_panda.model.robot import ARM_Q, RobotModel

ROBOT = RobotModel()


def reaching():
    q = np.zeros(12)
    q[ARM_Q] = ControllerConfig().work.reach
    return q


def rod(middle, kind="cane", cane=0):
    up = np.array([0.0, 0.0, 0.3])
    return Rod(kind, middle - up, middle + up, 0.004, 0.004, vine=1, spur=2, cane=cane)


def test_the_cutters_body_counts_the_blades_do_not_and_only_canes_are_looked_at():
    q = reaching()
    tool = ROBOT.pose(q, ROBOT.tool_id)
    at_blades, at_body = tool.translation, tool.act(np.array([0.0, 0.0, -0.1]))
    touches = CaneTouches()
    touches.look(q, [(0, rod(at_blades + 0.012 * tool.rotation[:, 2])), (1, rod(at_body, "wire", 1))], 0)
    assert touches.touched == {}
    touches.look(q, [(0, rod(at_blades)), (1, rod(at_body, cane=3))], 1)
    assert touches.touched[(1, 2, 3)] == {"cutter"}


def test_the_row_is_read_anew_only_when_it_has_changed():
    q, touches = reaching(), CaneTouches()
    body = ROBOT.pose(q, ROBOT.tool_id).act(np.array([0.0, 0.0, -0.1]))
    touches.look(q, [], 0)
    touches.look(q, [(0, rod(body))], 0)
    assert touches.touched == {}
    touches.look(q, [(0, rod(body))], 1)
    assert (1, 2, 0) in touches.touched


def test_what_stays_is_told_apart_from_what_goes():
    q = reaching()
    body = ROBOT.pose(q, ROBOT.tool_id).act(np.array([0.0, 0.0, -0.1]))
    touches = CaneTouches(staying={1})
    touches.look(q, [(1, rod(body, cane=1)), (2, rod(body, cane=2))], 0)
    assert set(touches.touched) == {(1, 2, 1), (1, 2, 2)}
    assert touches.touched_staying == {(1, 2, 1): {"cutter"}}


def test_rods_that_stay_are_the_keepers_up_to_its_cut():
    row = grow(VineyardConfig(), 3)
    staying, spurs = staying_rods(row), judge(row)
    for spur in spurs:
        chain = [
            (index, rod)
            for index, rod in row.standing()
            if (rod.vine, rod.spur) == (spur.vine, spur.spur) and rod.cane >= 0
        ]
        kept = [rod for index, rod in chain if index in staying]
        assert {rod.cane for rod in kept} == {spur.keeper}
        assert spur.cut is not None and len([rod for rod in kept if rod.kind == "node"]) == 3, "two and the basal bud"
        assert all((rod.end - spur.cut.best) @ spur.cut.tangent < 0.0 for rod in kept)
