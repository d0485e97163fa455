import numpy as np

from benchmarks.cane_touches import CaneTouches
from bridge.sim.row import Rod
from controller.config import ControllerConfig
from rolling_panda.robot_model import ARM_Q, RobotModel

ROBOT = RobotModel()


def reaching():
    q = np.zeros(12)
    q[ARM_Q] = ControllerConfig().reach
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
