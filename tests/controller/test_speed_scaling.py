"""A method that knows no inequalities stops before contact, says before what, and goes on when that leads away."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from controller.whole_body.collision import CollisionModel
from controller.whole_body.guards.collision import CollisionGuard
from controller.whole_body.nullspace import Nullspace
from controller.whole_body.obstacle import Obstacle
from controller.whole_body.registry import SpeedScaling, allowed_speed_scale, make_method
from controller.whole_body.saturation import Saturation
from controller.whole_body.task import IkProblem, Inequalities, Posture, ToolTask
from rolling_panda.model.robot import ARM_Q, RobotModel
from tests.support.controller_config import controller_config

ROBOT, CONFIG, DT = RobotModel(), controller_config(whole_body__method="nullspace"), 0.01
COLLISION = CollisionModel(ROBOT)
GATE = Saturation(ROBOT, CONFIG.whole_body, DT)
NUMBERS = st.floats(-2.0, 2.0)


@given(
    st.integers(1, 6).flatmap(lambda k: arrays(float, (k, 10), elements=NUMBERS)), arrays(float, 9, elements=NUMBERS)
)
def test_the_share_is_the_largest_that_every_row_allows(numbers, xi):
    A, lower = numbers[:, :9], numbers[:, 9]
    rows = Inequalities(A, lower, tuple(f"row {i}" for i in range(len(lower))))
    share, what = allowed_speed_scale(rows, xi)
    needed = np.minimum(lower, 0.0)
    assert 0.0 <= share <= 1.0
    assert (A @ (share * xi) >= needed - 1e-9).all()
    if share < 1.0:
        assert what in rows.names
        assert not (A @ (min(1.0, share + 1e-3) * xi) >= needed).all()
    else:
        assert what == ""


def lead(method, twist, seconds, q=None, sent=None):
    """Ask for one twist all the time; where that leads, and the answers."""
    if q is None:
        q = np.zeros(12)
        q[ARM_Q] = CONFIG.work.home
    sent, answers = np.zeros(9) if sent is None else sent, []
    for _ in range(round(seconds / DT)):
        problem = IkProblem(q, ROBOT.kinematics(q), sent, ToolTask(np.array(twist)), Posture(q.copy()), "free")
        out = method.solve(problem)
        assert GATE.admits(out.xi, sent)
        sent, q = out.xi, q.copy()
        q[:3] = ROBOT.drive.integrate(q[:3], sent[0] * DT, sent[1] * DT)
        q[3:] += sent * DT
        answers.append(out)
    return q, sent, answers


@pytest.fixture
def post():
    q = np.zeros(12)
    q[ARM_Q] = CONFIG.work.home
    x, y, _ = ROBOT.pose(q, ROBOT.tool_id).translation.tolist()
    COLLISION.set_obstacles([Obstacle("post 1", "post", (x, y + 0.25, 0.0), (x, y + 0.25, 2.0), 0.04)])
    yield
    COLLISION.set_obstacles([])


def test_it_stops_before_what_is_in_the_way_says_so_and_gets_away_again(post):
    towards = (0.0, 0.2, 0.0, 0.0, 0.0, 0.0)
    blind, _, _ = lead(make_method(ROBOT, CONFIG.whole_body, DT), towards, 2.0)
    assert COLLISION.least(blind).distance < 0.0
    braked = make_method(ROBOT, CONFIG.whole_body, DT, COLLISION)
    assert isinstance(braked, SpeedScaling) and braked.name == "nullspace" and braked.flows
    q, sent, answers = lead(braked, towards, 3.0)
    assert 0.0 < COLLISION.least(q).distance < 0.05
    assert np.abs(sent).max() < 0.02 and "post 1" in answers[-1].reason
    assert answers[-1].reason and answers[-1].scale < 0.1
    assert not answers[0].reason
    back, _, answers = lead(braked, (0.0, -0.2, 0.0, 0.0, 0.0, 0.0), 1.0, q, sent)
    assert ROBOT.pose(back, ROBOT.tool_id).translation[1] < ROBOT.pose(q, ROBOT.tool_id).translation[1] - 0.1
    assert not answers[-1].reason


def test_where_nothing_is_near_the_answer_is_the_methods_own():
    own = Nullspace(ROBOT, CONFIG.whole_body, DT)
    _, _, free = lead(own, (0.1, 0.0, 0.05, 0.0, 0.0, 0.0), 0.3)
    _, _, guarded = lead(make_method(ROBOT, CONFIG.whole_body, DT, COLLISION), (0.1, 0.0, 0.05, 0.0, 0.0, 0.0), 0.3)
    assert all(np.array_equal(a.xi, b.xi) for a, b in zip(free, guarded, strict=True))


def test_numbers_that_are_not_finite_brake(post):
    braked = SpeedScaling(
        Nullspace(ROBOT, CONFIG.whole_body, DT), CollisionGuard(COLLISION, CONFIG.whole_body.hierarchy, DT), GATE
    )
    q = np.zeros(12)
    problem = IkProblem(q, ROBOT.kinematics(q), np.full(9, 0.1), ToolTask(np.full(6, np.nan)), Posture(q), "free")
    out = braked.solve(problem)
    assert not out.feasible and (np.abs(out.xi) < 0.1).all()
