"""Others' controllers and planners, which `make peers` installs."""

import numpy as np
import pinocchio as pin
import pytest

from benchmarks.control import approach, reach
from benchmarks.control.plan_limits import plan_limits
from benchmarks.control.reach_run import DT, bench_config
from benchmarks.control.reach_targets import HOME, draw
from benchmarks.peers.predictive import Following, Predictive
from benchmarks.peers.reactive import reactive
from benchmarks.peers.sampling import OMPL, OmplPlanner
from controller.motion.follower import Follower, Measured
from controller.motion.tool_motion import Leg, ToolMotion
from controller.whole_body.actuation import Actuation
from controller.whole_body.collision import CollisionModel
from controller.whole_body.manipulability import arm_omega
from controller.whole_body.obstacle import Obstacle
from controller.whole_body.task import IkProblem, Posture, ToolTask
from rolling_panda.model.robot import ARM_Q, RobotModel

ROBOT = RobotModel()
LIMITS = plan_limits(ROBOT, 0.8, 0.6, clearance=0.005)
POST = Obstacle("post", "post", (0.55, 0.0, 0.0), (0.55, 0.0, 2.0), 0.05)
LEFT, RIGHT = np.array([1.0, 0.6, 0.0, -1.5, 0.0, 2.1, 0.8]), np.array([-1.0, 0.6, 0.0, -1.5, 0.0, 2.1, 0.8])


@pytest.mark.parametrize("name", ["pink", "mink", "holistic"])
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


@pytest.mark.long
def test_holistic_goes_towards_its_goal_within_the_limits_and_reaches_it():
    target = draw(41, 2, "none", goals="row")[1]
    (row,) = reach.run([target], "holistic", 0, 1)
    quality = row.quality
    assert quality.position_error < 0.02 and quality.rotation_error < np.radians(5.0)
    assert quality.violations.total == 0
    assert quality.margin_least > 0.09


def test_holistic_turns_the_base_to_face_the_tool():
    method = reactive("holistic", ROBOT, bench_config("holistic").whole_body, DT)
    q = draw(0, 1, "none")[0].q
    q[ARM_Q][0] = 0.8
    T = ROBOT.pose(q, ROBOT.tool_id)
    T.translation = T.translation + [0.0, 0.0, 0.1]
    method.aim(T, False)
    xi = np.zeros(9)
    for _ in range(20):
        xi = method.solve(IkProblem(q, ROBOT.kinematics(q), xi, ToolTask(np.zeros(6)), Posture(q))).xi
    assert Actuation(ROBOT.drive).nu(xi)[1] > 0.01


@pytest.mark.parametrize("frozen", [False, True])
def test_mpc_follows_a_motion_in_rows_with_the_base_where_it_should_be(frozen):
    config = bench_config("mpc")
    q, xi = draw(41, 1, "none", goals="row")[0].q, np.zeros(9)
    T, q_goal = ROBOT.pose(q, ROBOT.tool_id), q.copy()
    shift = np.array([0.0, 0.0, 0.08]) if frozen else 0.15 * np.array([np.cos(q[2]), np.sin(q[2]), 0.0])
    q_goal[:3] += 0.0 if frozen else shift
    leg = Leg(pin.SE3(T.rotation, T.translation + shift), q_goal, 0.3, frozen_within=9.0 if frozen else 0.0)
    motion = ToolMotion(config.motion, config.whole_body, T, q, [leg])
    follower, errors, begin = Follower(config.motion, Following(RobotModel(), config.whole_body, DT), DT), [], q[:2]
    for _ in range(int((motion.duration + 1.0) / DT)):
        tracking = follower.follow(motion, Measured(q, ROBOT.kinematics(q), xi))
        xi, q = tracking.xi, q.copy()
        errors.append(tracking.position_error)
        q[:3] = ROBOT.drive.integrate(q[:3], float(xi[0] * DT), float(xi[1] * DT))
        q[3:] += xi * DT
    assert max(errors) < 0.015
    assert errors[-1] < 2e-3 and tracking.rotation_error < np.radians(0.2)
    driven = float(np.linalg.norm(q[:2] - begin))
    assert driven == 0.0 if frozen else 0.1 < driven < 0.17


@pytest.mark.parametrize("follows", [False, True])
def test_the_costs_of_mpc_have_exact_derivatives(follows):
    method = Predictive(ROBOT, bench_config("mpc").whole_body, DT)
    target = draw(0, 1, "none")[0]
    method.aim(target.T_odom_goal, True)
    rng = np.random.default_rng(0)
    x = np.concatenate([target.q[:3], target.q[ARM_Q], np.zeros(9)]) + 0.1 * rng.normal(size=19)
    u = rng.normal(size=9)
    for knot in (method.running[0], method.last):
        knot.lean(1.0)
        if follows:
            knot.stay(x[:10] + 0.1 * rng.normal(size=10), True)
        data = knot.createData()
        knot.calc(data, x, u)
        knot.calcDiff(data, x, u)
        found, motion = np.array(data.Lx), np.array(data.Fx)
        step = 1e-6 * np.eye(19)
        costs, states = np.zeros((2, 19)), np.zeros((2, 19, 19))
        for side, sign in enumerate((1.0, -1.0)):
            for i in range(19):
                knot.calc(data, x + sign * step[i], u)
                costs[side, i], states[side, :, i] = data.cost, data.xnext
        np.testing.assert_allclose((costs[0] - costs[1]) / 2e-6, found, atol=1e-5 * np.abs(found).max())
        if knot is not method.last:
            np.testing.assert_allclose((states[0] - states[1]) / 2e-6, motion, atol=1e-7)
            assert np.abs(found[3:10]).min() > 0.0


@pytest.mark.long
def test_mpc_raises_the_mean_manipulability_on_the_way_to_a_goal():
    means = {}
    targets = draw(41, 2, "none", goals="row")
    for cost in (0.0, 3.0):
        method, omega = Predictive(RobotModel(), bench_config("mpc").whole_body, DT, manipulability=cost), []
        for target in targets:
            q, xi = target.q, np.zeros(9)
            method.aim(target.T_odom_goal, False)
            for _ in range(250):
                kinematics = ROBOT.kinematics(q)
                xi = method.solve(IkProblem(q, kinematics, xi, ToolTask(np.zeros(6)), Posture(q))).xi
                q[:3] = ROBOT.drive.integrate(q[:3], float(xi[0] * DT), float(xi[1] * DT))
                q[3:] += xi * DT
                omega.append(arm_omega(kinematics.J))
        means[cost] = np.mean(omega)
    assert means[3.0] > 1.1 * means[0.0]


@pytest.mark.long
@pytest.mark.parametrize("free_axis", ["none", "tool_y"])
def test_mpc_reaches_a_goal_within_velocities_and_accelerations(free_axis):
    target = draw(44, 1, free_axis, goals="row")[0]
    (row,) = reach.run([target], "mpc", 0, 1)
    assert row.quality.reached
    # It hovers about its goal, and the motion ends where it can stop.
    assert row.quality.violations.velocity == row.quality.violations.acceleration == 0
    assert row.quality.rolling < 1e-9
    assert len(row.steps_s) == pytest.approx(row.quality.duration / 0.05, abs=2)
