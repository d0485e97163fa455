"""Others' controllers and planners, which `make peers` installs."""

import numpy as np
import pytest

from benchmarks.control import approach
from benchmarks.control.plan_limits import plan_limits
from benchmarks.control.reach_run import bench_config
from benchmarks.control.reach_targets import HOME, draw
from benchmarks.peers.reactive import reactive
from benchmarks.peers.sampling import OMPL, OmplPlanner
from controller.whole_body.collision import CollisionModel
from controller.whole_body.obstacle import Obstacle
from controller.whole_body.task import IkProblem, Posture, ToolTask
from rolling_panda.model.robot import ARM_Q, RobotModel

ROBOT = RobotModel()
LIMITS = plan_limits(ROBOT, 0.8, 0.6, clearance=0.005)
POST = Obstacle("post", "post", (0.55, 0.0, 0.0), (0.55, 0.0, 2.0), 0.05)
LEFT, RIGHT = np.array([1.0, 0.6, 0.0, -1.5, 0.0, 2.1, 0.8]), np.array([-1.0, 0.6, 0.0, -1.5, 0.0, 2.1, 0.8])


@pytest.mark.parametrize("name", ["pink", "mink"])
def test_a_peer_follows_a_twist_within_the_limits_and_leaves_frozen_wheels_alone(name):
    config = bench_config("hierarchy").whole_body
    method = reactive(name, ROBOT, config, 0.01)
    q = draw(0, 1, "none")[0].q
    kinematics = ROBOT.kinematics(q)
    twist = np.array([0.0, 0.05, 0.0, 0.0, 0.0, 0.0])
    xi = np.zeros(9)
    for _ in range(30):
        problem = IkProblem(q, kinematics, xi, ToolTask(twist), Posture(q), base="frozen")
        xi = method.solve(problem).xi
    assert np.abs(xi[:2]).max() < 1e-6
    np.testing.assert_allclose(kinematics.J_xi @ xi, twist, atol=2e-3)


@pytest.mark.parametrize("name", OMPL)
def test_a_planner_of_ompl_goes_round_a_post_and_takes_the_straight_line_where_it_is_free(name):
    collision = CollisionModel(RobotModel())
    planner = OmplPlanner(name, collision, LIMITS, seconds=2.0)
    q = np.zeros(12)
    q[ARM_Q] = HOME
    straight = planner.find(q, LEFT)
    assert straight is not None and len(straight.postures) == 2
    collision.set_obstacles([POST])
    q[ARM_Q] = LEFT
    around = planner.find(q, RIGHT)
    assert around is not None and len(around.postures) > 2
    np.testing.assert_allclose(around.postures[[0, -1]], [LEFT, RIGHT])
    judged = approach.way(approach.Task(0, q, RIGHT, (POST,)), name, LIMITS, 2.0)
    assert judged.found and judged.clearance > -0.02
