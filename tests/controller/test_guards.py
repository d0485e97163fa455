"""Collisions and tipping in the method: the robot stops before things and stays on its wheels."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from controller.config import ControllerConfig
from controller.whole_body.collision import CollisionModel
from controller.whole_body.guards.collision import CollisionGuard
from controller.whole_body.guards.tipping import TippingGuard
from controller.whole_body.hierarchy import Hierarchy
from controller.whole_body.obstacle import Obstacle
from controller.whole_body.saturation import Saturation
from controller.whole_body.task import IkProblem, Posture, ToolTask
from controller.whole_body.tipping import Tipping
from rolling_panda.model.robot import ARM_Q, RobotModel
from tests.support.controller_config import controller_config

ROBOT, CONFIG, DT = RobotModel(), ControllerConfig(), 0.01
SETTINGS = CONFIG.whole_body.hierarchy
COLLISION = CollisionModel(ROBOT)
GUARDED = Hierarchy(ROBOT, CONFIG.whole_body, DT, (CollisionGuard(COLLISION, SETTINGS, DT),))
BLIND = Hierarchy(ROBOT, CONFIG.whole_body, DT)
GATE = Saturation(ROBOT, CONFIG.whole_body, DT)
#: Full rated base, as the vendor allows it, and the arm stretched forward: what tips.
FAST = controller_config(
    whole_body__base_speed=1.5,
    whole_body__base_acceleration=2.4,
    whole_body__base_braking=2.4,
    whole_body__base_yaw_rate=1.0,
)
STRETCHED = (0.0, 0.9, 0.0, -0.5, 0.0, 1.6, 0.0)


def lead(method, twist, seconds, base="row", keep_path=True, arm=CONFIG.work.home):
    """Ask for one twist all the time; configurations and answers on the way."""
    q, sent, scale, way = np.zeros(12), np.zeros(9), 1.0, []
    q[ARM_Q] = arm
    for _ in range(round(seconds / DT)):
        posture = q.copy()
        posture[ARM_Q] = CONFIG.work.home
        out = method.solve(
            IkProblem(
                q,
                ROBOT.kinematics(q),
                sent,
                ToolTask(np.array(twist, dtype=float), keep_path=keep_path),
                Posture(posture),
                base,
                0.4,
                scale,
            )
        )
        assert GATE.admits(out.xi, sent)
        sent, scale = out.xi, out.scale
        q = q.copy()
        q[:3] = ROBOT.drive.integrate(q[:3], sent[0] * DT, sent[1] * DT)
        q[3:] += sent * DT
        way.append((q, out))
    return way


def least_share(q):
    """The least distance between any two parts as a share of what is kept between them."""
    near = COLLISION.distances(q, 0.1)
    kept = [SETTINGS.kept(pair) for pair in near.pairs]
    return min((d / k for d, k in zip(near.distance, kept, strict=True)), default=100.0)


@pytest.fixture
def post():
    COLLISION.set_obstacles([Obstacle("post 1", "post", (0.5, 0.75, 0.0), (0.5, 0.75, 1.8), 0.05)])
    yield
    COLLISION.set_obstacles(())


@pytest.mark.parametrize("keep_path", [True, False])
def test_a_tool_led_into_a_post_stops_before_it(post, keep_path):
    way = lead(GUARDED, [0, 0.3, 0, 0, 0, 0], 4.0, keep_path=keep_path)
    assert min(least_share(q) for q, _ in way[::5]) > 0.8
    assert COLLISION.least(way[-1][0]).distance < SETTINGS.collision_influence
    assert all(out.feasible or "post 1" in out.reason for _, out in way)
    blind = lead(BLIND, [0, 0.3, 0, 0, 0, 0], 4.0, keep_path=keep_path)
    assert min(COLLISION.least(q).distance for q, _ in blind[::5]) < -0.01


def test_what_holds_the_tool_before_a_post_is_named(post):
    last = lead(GUARDED, [0, 0.3, 0, 0, 0, 0], 4.0)[-1][1]
    assert not last.feasible and "post 1" in last.reason and last.scale < 0.01


def test_a_tool_led_into_its_own_base_stops_before_it():
    way = lead(GUARDED, [-0.1, 0, -0.3, 0, 0, 0], 6.0, base="frozen", keep_path=False)
    assert min(least_share(q) for q, _ in way[::5]) > 0.8
    blind = lead(BLIND, [-0.1, 0, -0.3, 0, 0, 0], 6.0, base="frozen", keep_path=False)
    assert min(COLLISION.least(q).distance for q, _ in blind[::5]) < 0.0


def test_a_robot_that_something_was_put_upon_moves_out_of_it():
    """An obstacle appears inside the distance that is kept: the pair parts, without any problem."""
    q = np.zeros(12)
    q[ARM_Q] = CONFIG.work.home
    tool = ROBOT.pose(q, ROBOT.tool_id).translation
    perch = tuple(tool + [0.005, 0, 0])
    COLLISION.set_obstacles([Obstacle("bird", "cane", perch, perch, 0.01)])
    try:
        assert least_share(q) < 1.0
        way = lead(GUARDED, np.zeros(6), 2.0, base="frozen")
        assert least_share(way[-1][0]) > 0.9
    finally:
        COLLISION.set_obstacles(())


@settings(max_examples=8)
@given(st.integers(0, 2**32 - 1))
def test_wherever_a_hand_leads_the_tool_nothing_is_touched(seed):
    """Posts, wires and the robot itself; random twists for three seconds."""
    rng = np.random.default_rng(seed)
    COLLISION.set_obstacles(
        [Obstacle(f"wire {i}", "wire", (-3.0, 0.75, z), (3.0, 0.75, z), 0.003) for i, z in enumerate((0.6, 1.2))]
        + [Obstacle("post", "post", (0.6, 0.75, 0.0), (0.6, 0.75, 1.8), 0.05)]
    )
    try:
        q, sent = np.zeros(12), np.zeros(9)
        q[ARM_Q] = CONFIG.work.home
        for i in range(300):
            if i % 75 == 0:
                twist = np.concatenate([rng.normal(0, 0.25, 3), rng.normal(0, 0.6, 3)])
            task = ToolTask(twist, keep_path=False)
            out = GUARDED.solve(IkProblem(q, ROBOT.kinematics(q), sent, task, Posture(q), "free"))
            assert GATE.admits(out.xi, sent)
            sent = out.xi
            q = q.copy()
            q[:3] = ROBOT.drive.integrate(q[:3], sent[0] * DT, sent[1] * DT)
            q[3:] += sent * DT
            if i % 10 == 0:
                assert COLLISION.least(q).distance > 0.0
    finally:
        COLLISION.set_obstacles(())


def stop(method, tipping):
    """Drive ahead at 1.2 m/s with the arm stretched forward, then ask for standstill; least stability on the way."""
    q = np.zeros(12)
    q[ARM_Q] = STRETCHED
    sent = np.zeros(9)
    sent[:2] = ROBOT.drive.wheels(1.2, 0.0)
    stability = []
    for _ in range(200):
        k = ROBOT.kinematics(q)
        out = method.solve(IkProblem(q, k, sent, ToolTask(np.zeros(6)), Posture(q), "row"))
        stability.append(tipping.stability(q, sent, (out.xi - sent) / DT))
        sent = out.xi
        q = q.copy()
        q[:3] = ROBOT.drive.integrate(q[:3], sent[0] * DT, sent[1] * DT)
        q[3:] += sent * DT
    return min(stability), q, sent


def test_stopping_with_the_arm_stretched_forward_keeps_the_caster_on_the_ground():
    tipping = Tipping(ROBOT)
    tipped, _, _ = stop(Hierarchy(ROBOT, FAST.whole_body, DT), tipping)
    kept, q, sent = stop(Hierarchy(ROBOT, FAST.whole_body, DT, (TippingGuard(tipping, DT),)), tipping)
    assert tipped < 0.0 < kept
    # It does stop, only later.
    assert np.abs(sent[:2]).max() < 0.05 and q[0] < 2.0
