import numpy as np
import pytest

from controller.config import ControllerConfig
from controller.work.posture_search import CutClearance, CutPlan, PostureSearch, Unreachable
from rolling_panda import reasons
from rolling_panda.model.robot import ARM_Q, RobotModel
from tests.support.points import point

ROBOT, CONFIG = RobotModel(), ControllerConfig()
CLEARANCE = CutClearance(RobotModel(), CONFIG.whole_body.hierarchy)
SEARCH = PostureSearch(RobotModel(), CONFIG.work, CONFIG.whole_body.joint_margin, CLEARANCE)
UP = np.array([0.0, 0.0, 1.0])


def find(position, tangent=UP, lateral=0.0):
    q = np.zeros(12)
    q[1] = lateral
    q[ARM_Q] = CONFIG.work.home
    search, steps = SEARCH.find(point("p1", position, tuple(tangent)), q), 0
    while True:
        try:
            next(search)
            steps += 1
        except StopIteration as end:
            return end.value, steps


@pytest.mark.parametrize("height", [0.95, 1.05, 1.15])
def test_plan_reaches_all_three_poses_with_the_base_at_one_place(height):
    plan, steps = find((1.0, 0.85, height))
    assert isinstance(plan, CutPlan)
    assert steps < 200
    for q, pose in (
        (plan.q_clear, plan.poses.clear),
        (plan.q_stand_off, plan.poses.stand_off),
        (plan.q_cut, plan.poses.cut),
    ):
        T = ROBOT.pose(q, ROBOT.tool_id)
        assert np.linalg.norm(T.translation - pose.translation) < 5e-4
        np.testing.assert_allclose(T.rotation, pose.rotation, atol=5e-3)
        np.testing.assert_array_equal(q[:3], plan.q_cut[:3])
        margin = np.minimum(q[ARM_Q] - ROBOT.limits.lower[ARM_Q], ROBOT.limits.upper[ARM_Q] - q[ARM_Q]).min()
        assert margin >= plan.joint_margin - 1e-9 > 0.05
    assert plan.q_cut[1] == 0.0 and plan.q_cut[2] == 0.0
    assert plan.manipulability > 0.01


def test_the_base_keeps_its_distance_to_the_row():
    plan, _ = find((1.0, 0.80, 1.0), lateral=-0.04)
    assert plan.q_cut[1] == pytest.approx(-0.04)


def test_what_is_too_far_is_refused_in_words():
    plan, steps = find((1.0, 1.6, 1.0))
    assert isinstance(plan, Unreachable)
    assert plan.reason.code == "out_of_reach" and dict(plan.reason.values)["distance"] == pytest.approx(1.6, abs=0.005)
    assert steps < 20, "no posture is tried"


def test_a_cane_that_points_at_the_robot_is_refused():
    plan, _ = find((1.0, 0.85, 1.0), np.array([0.0, 1.0, 0.0]))
    assert isinstance(plan, Unreachable)
    assert plan.reason == reasons.no_square_approach()
