import numpy as np
import pytest

from controller.config import ControllerConfig
from controller.whole_body.guards.axle import AxleAhead
from controller.whole_body.hierarchy import Hierarchy
from controller.whole_body.task import IkProblem, Posture, ToolTask
from rolling_panda.model.robot import ARM_Q, RobotModel

ROBOT, CONFIG, DT = RobotModel(), ControllerConfig(), 0.01
METHOD = Hierarchy(ROBOT, CONFIG.whole_body, DT)
AHEAD = CONFIG.whole_body.hierarchy.axle_ahead
#: The arm in front of the base, tool downwards.
FRONT = np.array([0.0, -0.3, 0.0, -2.0, 0.0, 1.9, 0.0])


def start():
    q = np.zeros(12)
    q[ARM_Q] = FRONT
    return q


def ahead(q):
    T = ROBOT.pose(q, ROBOT.tool_id).translation
    return np.cos(q[2]) * (T[0] - q[0]) + np.sin(q[2]) * (T[1] - q[1])


def drive(q, twist, seconds, base):
    """Ask for one twist all the time; the configurations on the way."""
    sent, scale, way = np.zeros(9), 1.0, [q]
    for _ in range(round(seconds / DT)):
        posture = q.copy()
        posture[ARM_Q] = FRONT
        out = METHOD.solve(
            IkProblem(
                q, ROBOT.kinematics(q), sent, ToolTask(np.array(twist, dtype=float)), Posture(posture), base, 0.3, scale
            )
        )
        sent, scale = out.xi, out.scale
        q = q.copy()
        q[:3] = ROBOT.drive.integrate(q[:3], sent[0] * DT, sent[1] * DT)
        q[3:] += sent * DT
        way.append(q)
    return way


def test_the_row_is_the_rate_of_the_tool_s_place_ahead_of_the_axle():
    guard, rng = AxleAhead(0.25, 2.0), np.random.default_rng(1)
    for _ in range(20):
        q, xi = start(), rng.normal(0, 1, 9)
        q[:3] = rng.uniform(-2, 2, 3)
        q[ARM_Q] += rng.uniform(-0.3, 0.3, 7)
        rows = guard.rows(IkProblem(q, ROBOT.kinematics(q), xi, ToolTask(np.zeros(6)), Posture(q), "transit"))
        dt = 1e-6
        moved = q.copy()
        moved[:3] = ROBOT.drive.integrate(q[:3], xi[0] * dt, xi[1] * dt)
        moved[3:] += xi * dt
        assert rows.A[0] @ xi == pytest.approx((ahead(moved) - ahead(q)) / dt, abs=1e-4)
        assert rows.lower[0] == pytest.approx(min(-2.0 * (ahead(q) - 0.25), 0.1))


def test_there_is_no_row_beside_the_vines():
    problem = IkProblem(start(), ROBOT.kinematics(start()), np.zeros(9), ToolTask(np.zeros(6)), Posture(start()))
    assert len(AxleAhead(0.25, 2.0).rows(problem).lower) == 0


def test_a_tool_led_sideways_turns_the_base_after_it():
    way = drive(start(), [0.0, 0.15, 0, 0, 0, 0], 12.0, "transit")
    T = ROBOT.pose(way[-1], ROBOT.tool_id).translation
    assert T[1] > 1.0
    # The base points along the way and follows.
    assert 1.0 < way[-1][2] < 2.0
    assert min(ahead(q) for q in way) > AHEAD - 0.01


def test_a_tool_led_backwards_does_not_pass_the_axle():
    """The tool is led back through the base: it stays ahead of the axle and the base reverses, straight."""
    way = drive(start(), [-0.15, 0.01, 0, 0, 0, 0], 8.0, "transit")
    assert min(ahead(q) for q in way) > AHEAD - 0.01
    assert way[-1][0] < -0.5
    assert abs(way[-1][2]) < 0.6


def test_a_tool_behind_the_axle_is_brought_ahead_of_it():
    q = start()
    q[5] = 2.2
    assert ahead(q) < 0.1
    # Nothing else is asked for: the tool's own place may give way.
    way = drive(q, np.zeros(6), 6.0, "transit")
    assert ahead(way[-1]) > ahead(q) + 0.1
