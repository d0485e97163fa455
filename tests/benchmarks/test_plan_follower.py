import numpy as np
import pinocchio as pin
import pytest

from benchmarks.control.goal_planner import GoalPlanner
from benchmarks.control.plan_follower import PlanFollower
from benchmarks.control.plan_limits import plan_limits
from controller.whole_body.collision import CollisionModel
from controller.whole_body.task import Solution
from rolling_panda.model.robot import ARM_Q, RobotModel

ROBOT = RobotModel()
LIMITS = plan_limits(ROBOT, base_speed=0.8, base_yaw_rate=0.6)
Q = np.zeros(12)
Q[ARM_Q] = (-0.2784, -0.1128, -0.0354, -2.0055, 1.6759, 1.2124, -0.269)
GOAL = pin.SE3(pin.rpy.rpyToMatrix(0.0, np.pi / 2, 0.3), np.array([2.0, 1.0, 0.9]))
_PLANNING = RobotModel()
PLAN = GoalPlanner(_PLANNING, CollisionModel(_PLANNING), LIMITS).plan(Q, GOAL).plan


class Recorder:
    """A method that moves as the posture's rate says, at a share of it, and keeps what it was asked."""

    name = "recorder"

    def __init__(self, scale=1.0):
        self.scale, self.problems = scale, []

    def solve(self, problem):
        self.problems.append(problem)
        xi = self.scale * np.concatenate([problem.posture.rate[3:5], problem.posture.rate[ARM_Q]])
        return Solution(xi, self.scale, 0.1)


def follow(method, q=Q, **options):
    follower, q, xi, rows = PlanFollower(ROBOT, method, PLAN, **options), q.copy(), np.zeros(9), 0
    while not follower.done and rows < 5000:
        xi = follower.step(q, ROBOT.kinematics(q), xi).xi
        q[:3] = ROBOT.drive.integrate(q[:3], xi[0] * LIMITS.dt, xi[1] * LIMITS.dt)
        q[3:] += xi * LIMITS.dt
        rows += 1
    return q, rows


def test_a_method_that_does_as_the_plan_says_ends_where_the_plan_ends():
    method = Recorder()
    q, rows = follow(method)
    assert rows == len(PLAN.t) - 1
    np.testing.assert_allclose(q, PLAN.q[-1], atol=1e-9)
    for row, problem in enumerate(method.problems):
        # Where there is no error, what is asked of the tool is what the plan's velocities do.
        np.testing.assert_allclose(problem.tool.twist, problem.kinematics.J_xi @ PLAN.xi[row], atol=1e-6)


def test_where_a_limit_slows_the_tool_the_plan_waits_and_the_way_stays_the_same():
    q, rows = follow(Recorder(scale=0.4))
    assert rows == pytest.approx((len(PLAN.t) - 1) / 0.4, abs=2)
    np.testing.assert_allclose(q, PLAN.q[-1], atol=1e-3)


def test_an_error_of_the_tool_is_fed_back():
    method, off = Recorder(), Q.copy()
    off[0] += 0.01
    PlanFollower(ROBOT, method, PLAN, gain=3.0).step(off, ROBOT.kinematics(off), np.zeros(9))
    (problem,) = method.problems
    np.testing.assert_allclose(
        problem.tool.twist[:3] - (problem.kinematics.J_xi @ PLAN.xi[0])[:3], [-0.03, 0, 0], atol=1e-6
    )


@pytest.mark.parametrize(("fixed", "mode"), [(True, "frozen"), (False, "row")])
def test_what_is_free_and_what_is_fixed_is_passed_on(fixed, mode):
    method = Recorder()
    PlanFollower(ROBOT, method, PLAN, free_axis=True, base_fixed=fixed).step(Q, ROBOT.kinematics(Q), np.zeros(9))
    assert method.problems[0].base == mode and method.problems[0].tool.free_axis
