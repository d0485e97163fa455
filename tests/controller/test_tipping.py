import msgspec
import numpy as np
import pinocchio as pin
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from bridge.config import BridgeConfig
from bridge.core.interface import Setpoint
from bridge.sim.robot.robot import SimulatedRobot
from bridge.sim.vineyard.row import Row
from controller.whole_body.tipping import MARGIN, Tipping
from rolling_panda.model.robot import ARM_Q, RobotModel
from tests.support.cameras import Blind

ROBOT = RobotModel()
TIPPING = Tipping(ROBOT)
AT_REST = np.zeros(9)
#: The tool 0.8 m ahead of the axle, as far as the arm reaches at this height.
FORWARD = (0.0, 1.2, 0.0, -0.6, 0.0, 1.8, 0.0)
RATED = 2.4
seeds = st.integers(0, 2**32 - 1)


def at(arm, phi=0.0):
    return np.array([0.3, -0.2, phi, 0.0, 0.0, *arm])


def driving(v, omega=0.0):
    return np.array([*ROBOT.drive.wheels(v, omega), *np.zeros(7)])


def hardest(rows, direction):
    """How far along a direction of ξ̈ the rows let it go."""
    along = rows.matrix @ direction
    limits = [bound / step for step, bound in zip(along, rows.bound, strict=True) if step < 0.0]
    return min(limits, default=np.inf)


def state(seed):
    rng = np.random.default_rng(seed)
    arm = rng.uniform(ROBOT.limits.lower[ARM_Q], ROBOT.limits.upper[ARM_Q])
    xi = np.concatenate([rng.uniform(-5, 5, 2), rng.uniform(-1, 1, 7)])
    return rng, at(arm, rng.uniform(-3, 3)), xi


@settings(max_examples=40)
@given(seeds)
def test_at_rest_the_zero_moment_point_is_below_the_center_of_mass(seed):
    _, q, _ = state(seed)
    com = pin.centerOfMass(ROBOT.model, ROBOT.data, q)
    c, s = np.cos(q[2]), np.sin(q[2])
    expected = np.array([[c, s], [-s, c]]) @ (com[:2] - q[:2])
    np.testing.assert_allclose(TIPPING.zero_moment_point(q, AT_REST, AT_REST), expected, atol=1e-9)


@settings(max_examples=60)
@given(seeds)
def test_at_a_row_the_zero_moment_point_is_at_the_margin_of_that_edge(seed):
    rng, q, xi = state(seed)
    rows = TIPPING.rows(q, xi)
    direction = rng.uniform(-1, 1, 9)
    for edge in range(3):
        if rows.bound[edge] == 0.0 or rows.matrix[edge] @ direction == 0.0:
            continue
        acceleration = direction * rows.bound[edge] / (rows.matrix[edge] @ direction)
        zmp = TIPPING.zero_moment_point(q, xi, acceleration)
        assert TIPPING.normals[edge] @ (zmp - TIPPING.points[edge]) == pytest.approx(MARGIN, abs=1e-6)


def test_triangle_is_inside_the_real_one_wherever_the_caster_points():
    rng = np.random.default_rng(2)
    left, right = np.array([0.0, 0.2535]), np.array([0.0, -0.2535])
    points = rng.uniform([-0.5, -0.3], [0.05, 0.3], (4000, 2))
    inside = [p for p in points if ((TIPPING.normals * (p - TIPPING.points)).sum(axis=1) > 0).all()]
    assert len(inside) > 500
    for direction in np.linspace(0, 2 * np.pi, 37):
        caster = np.array([-0.43, 0.0]) + 0.06 * np.array([np.cos(direction), np.sin(direction)])
        corners = [left, caster, right]
        for a, b in zip(corners, [*corners[1:], corners[0]], strict=True):
            edge = b - a
            assert all(edge[0] * (p - a)[1] - edge[1] * (p - a)[0] > -1e-9 for p in inside)


def test_rated_braking_tips_the_stretched_arm_and_the_bound_forbids_it():
    q, xi = at(FORWARD), driving(1.0)
    assert TIPPING.stability(q, xi, AT_REST) > MARGIN
    assert TIPPING.stability(q, xi, driving(-RATED)) < 0.0
    allowed = hardest(TIPPING.rows(q, xi, 0.01), driving(-1.0))
    # Estimate for the arm stretched forward: tips at 0.7 to 1.7 m/s².
    assert 0.5 < allowed < 1.7
    assert TIPPING.stability(q, xi, driving(-allowed)) == pytest.approx(MARGIN, abs=1e-6)
    # With the arm folded over the base the same braking is harmless.
    folded = at((0.0, -0.785, 0.0, -2.356, 0.0, 1.57, 0.785))
    assert hardest(TIPPING.rows(folded, xi, 0.01), driving(-1.0)) > RATED


def test_stopping_in_reverse_and_starting_off_are_bounded_with_the_arm_behind():
    q = at((2.8, 1.2, 0.0, -0.6, 0.0, 1.8, 0.0))
    off = hardest(TIPPING.rows(q, AT_REST), driving(1.0))
    assert TIPPING.stability(q, AT_REST, driving(off)) == pytest.approx(MARGIN, abs=1e-6)
    assert off < hardest(TIPPING.rows(q, AT_REST), driving(-1.0))


def test_a_fast_bend_presses_outwards_and_the_yaw_is_bounded():
    q = at((-1.57, 1.2, 0.0, -0.6, 0.0, 1.8, 0.0))
    bend = driving(1.3, 0.4)
    # The arm is stretched to the right and the bend is to the left: every bit of speed less is an improvement.
    assert TIPPING.stability(q, bend, AT_REST) < TIPPING.stability(q, AT_REST, AT_REST) - 0.01
    tighter = driving(0.0, 1.0)
    now = hardest(TIPPING.rows(q, bend, 0.1), tighter)
    assert TIPPING.stability(q, bend + 0.1 * now * tighter, now * tighter) == pytest.approx(MARGIN, abs=2e-3)


def ride(seed, bounded):
    """Least distance (m) of the zero-moment point from an edge while base and arm are asked for all they can."""
    rng, q, _ = state(seed)
    xi, dt, least = np.zeros(9), 0.01, np.inf
    rate = np.array([*[RATED / 0.13375] * 2, *[4.0] * 7])
    q[ARM_Q] = np.clip(q[ARM_Q], ROBOT.limits.lower[ARM_Q] + 0.4, ROBOT.limits.upper[ARM_Q] - 0.4)
    for tick in range(150):
        if tick % 25 == 0:
            # Full speed of the base either way, the vendor's planner's yaw rate, and the arm at what it likes.
            wish = driving(rng.choice([-1.5, 1.5]), rng.choice([-0.6, 0.6])) + [0.0, 0.0, *rng.uniform(-0.8, 0.8, 7)]
        wanted = np.clip((wish - xi) / dt, -rate, rate)
        share = min(1.0, hardest(TIPPING.rows(q, xi, dt), wanted)) if bounded else 1.0
        least = min(least, TIPPING.stability(q, xi, share * wanted), TIPPING.stability(q, xi, AT_REST))
        xi = xi + dt * share * wanted
        q = q + dt * (ROBOT.drive.basis(q[2]) @ xi)
        q[ARM_Q] = np.clip(q[ARM_Q], ROBOT.limits.lower[ARM_Q], ROBOT.limits.upper[ARM_Q])
    return least


@settings(max_examples=15)
@given(seeds)
def test_whatever_is_asked_for_the_bound_keeps_the_robot_on_its_wheels(seed):
    assert ride(seed, bounded=True) > 0.5 * MARGIN


def test_without_the_bound_the_same_rides_tip_the_robot():
    assert min(ride(seed, bounded=False) for seed in range(10)) < 0.0


def base_tilt(sim):
    """Forward tilt (rad) of the simulated base: what the tool is turned by and the arm's encoders do not explain."""
    arm = sim.read().position[2:]
    T_level_tool = ROBOT.pose(np.array([0.0, 0.0, sim.true_base().pose[2], 0.0, 0.0, *arm]), ROBOT.tool_id)
    return float(pin.log3(sim.true_tool()[:3, :3] @ T_level_tool.rotation.T)[1])


def tilt_when_braking(deceleration):
    """Largest forward tilt (rad) of the simulated base, stopping from 0.9 m/s with the arm stretched forward."""
    sim = SimulatedRobot(msgspec.structs.replace(BridgeConfig(), start_arm=FORWARD), Row(()), Blind())
    speeds = [*np.arange(0.0, 0.9, 0.0005), *np.arange(0.9, 0.0, -deceleration * 0.001), *[0.0] * 300]
    worst = 0.0
    for v in speeds:
        sim.write(Setpoint(driving(v), True, 1, 1, 0.0))
        worst = max(worst, base_tilt(sim))
    sim.close()
    return worst


def test_in_the_simulation_too_the_base_tips_at_the_rated_braking_and_not_at_the_bound():
    allowed = hardest(TIPPING.rows(at(FORWARD), driving(0.9)), driving(-1.0))
    assert tilt_when_braking(allowed) < np.radians(0.3)
    assert tilt_when_braking(RATED) > np.radians(1.0)
