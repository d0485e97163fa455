import msgspec
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from controller.config import ControllerConfig, HierarchyConfig
from controller.whole_body.hierarchy import Hierarchy
from controller.whole_body.saturation import Saturation
from controller.whole_body.task import ActuatorTask, IkProblem, Inequalities, Posture, ToolTask
from rolling_panda.model.robot import ARM_Q, ARM_XI, RobotModel
from tests.controller.test_follower import integrate
from tests.support.controller_config import controller_config

ROBOT, CONFIG, DT = RobotModel(), ControllerConfig(), 0.01
LIMITS = ROBOT.limits
BARE = controller_config(
    whole_body__hierarchy=HierarchyConfig(
        base_heading=0.0,
        base_place=0.0,
        arm_posture=0.0,
        manipulability=0.0,
        joint_centre=0.0,
        smoothness=0.0,
        damping=0.0,
    )
)
UNDAMPED = controller_config(whole_body__hierarchy=HierarchyConfig(damping=0.0))
METHOD = Hierarchy(ROBOT, CONFIG.whole_body, DT)
GATE = Saturation(ROBOT, CONFIG.whole_body, DT)
TWIST = np.array([0.05, 0.02, -0.03, 0.05, -0.1, 0.02])
MODES = ("row", "free", "transit", "frozen")
seeds = st.integers(0, 2**32 - 1)


def home():
    q = np.zeros(12)
    q[2] = 0.3
    q[ARM_Q] = CONFIG.work.home
    return q


def ik_problem(q, twist=TWIST, sent=None, arm=None, base="row", **changes):
    """A problem at q; the tool's options are keywords of `ToolTask`, the others of `IkProblem`."""
    tool = {name: changes.pop(name) for name in ("free_axis", "keep_path") if name in changes}
    reference = q.copy()
    if arm is not None:
        reference[ARM_Q] = arm
    sent = np.zeros(9) if sent is None else sent
    task = ToolTask(np.asarray(twist, dtype=float), **tool)
    return IkProblem(q, ROBOT.kinematics(q), sent, task, Posture(reference), base, **changes)


def settled(method, make, ticks=80):
    """The answer after the accelerations have died away, at a fixed configuration."""
    sent = np.zeros(9)
    for _ in range(ticks):
        out = method.solve(make(sent))
        sent = out.xi
    return out


@pytest.mark.parametrize("base", MODES)
def test_the_tool_moves_exactly_as_asked_whatever_the_posture_wants(base):
    q = home()
    J = ROBOT.kinematics(q).J_xi
    for arm in (CONFIG.work.home, CONFIG.work.reach):
        out = settled(METHOD, lambda sent, arm=arm: ik_problem(q, sent=sent, arm=arm, base=base))
        np.testing.assert_allclose(J @ out.xi, TWIST * out.scale, atol=1e-6)
        assert out.scale > 0.99 and out.feasible


def test_a_posture_moves_the_robot():
    q = home()
    still = settled(METHOD, lambda sent: ik_problem(q, 0 * TWIST, sent))
    moved = settled(METHOD, lambda sent: ik_problem(q, 0 * TWIST, sent, arm=CONFIG.work.reach))
    assert np.abs(still.xi).max() < 1e-2 < 0.1 < np.abs(moved.xi).max()


def test_with_one_velocity_for_every_twist_the_answer_is_the_closed_form():
    """Arm alone and bare of other tasks: the least velocity in shares of the limits, (J W⁻¹)⁺ in closed form."""
    q = home()
    J = ROBOT.kinematics(q).J_xi[:, ARM_XI]
    speed = LIMITS.velocity[ARM_XI] * CONFIG.whole_body.arm_velocity_scale
    closed = speed * (np.linalg.pinv(J * speed) @ TWIST)
    method = Hierarchy(ROBOT, BARE.whole_body, DT)
    out = settled(method, lambda sent: ik_problem(q, sent=sent, base="frozen"))
    np.testing.assert_allclose(out.xi[ARM_XI], closed, atol=1e-6)


def relaxed(seed):
    """A problem that no limit has anything to do with, as far as that can be told beforehand."""
    rng = np.random.default_rng(seed)
    q = home()
    q[:3] = rng.uniform(-3, 3, 3)
    q[ARM_Q] = rng.uniform(LIMITS.lower[ARM_Q] + 0.5, LIMITS.upper[ARM_Q] - 0.5)
    arm = np.clip(q[ARM_Q] + rng.normal(0, 0.005, 7), LIMITS.lower[ARM_Q], LIMITS.upper[ARM_Q])
    return ik_problem(q, rng.normal(0, 1e-4, 6), arm=arm, base=MODES[seed % 4], free_axis=bool(seed % 3))


@settings(max_examples=150)
@given(seeds)
def test_no_lower_task_ever_reaches_the_tool(seed):
    """‖J ξ̇(with) − J ξ̇(without)‖ < 1e-8 wherever no limit slows the tool itself."""
    problem = relaxed(seed)
    outs = [Hierarchy(ROBOT, config.whole_body, DT).solve(problem) for config in (UNDAMPED, BARE)]
    answers = [out.xi for out in outs]
    J = problem.kinematics.J_xi
    if problem.tool.free_axis:
        R = problem.kinematics.T_odom_tool.rotation
        J = np.vstack([J[:3], (R.T @ J[3:])[[0, 2]]])
    if min(out.scale for out in outs) > 1.0 - 1e-9:
        assert np.linalg.norm(J @ (answers[0] - answers[1])) < 1e-8
    assert np.linalg.norm(answers[0] - answers[1]) > 0.0


def test_the_tool_is_rarely_slowed_there():
    """So that the property above is not true of nothing."""
    scales = [Hierarchy(ROBOT, UNDAMPED.whole_body, DT).solve(relaxed(seed)).scale for seed in range(60)]
    assert np.mean(np.array(scales) > 1.0 - 1e-9) > 0.8


@settings(max_examples=40)
@given(seeds)
def test_whatever_is_asked_from_wherever_no_limit_is_broken(seed):
    """Random problems, modes, options and postures for two seconds from a random state, integrated."""
    rng = np.random.default_rng(seed)
    method = Hierarchy(ROBOT, CONFIG.whole_body, DT, guards=(_Random(rng),))
    q, sent = home(), np.zeros(9)
    q[ARM_Q] = rng.uniform(LIMITS.lower[ARM_Q] + 0.04, LIMITS.upper[ARM_Q] - 0.04)
    scale, make = 1.0, {}
    for i in range(200):
        if i % 25 == 0:
            make = {
                "twist": rng.normal(0, 1, 6) * rng.choice([0.01, 0.3, 10.0]),
                "arm": rng.uniform(LIMITS.lower[ARM_Q], LIMITS.upper[ARM_Q]),
                "base": str(rng.choice(MODES)),
                "free_axis": bool(rng.integers(2)),
                "keep_path": bool(rng.integers(2)),
                "speed_cap": float(rng.choice([0.05, 0.3, np.inf])),
            }
        out = method.solve(ik_problem(q, sent=sent, scale=scale, **make))
        assert np.isfinite(out.xi).all() and 0.0 <= out.scale <= 1.0
        assert GATE.admits(out.xi, sent)
        assert (np.abs(out.xi - sent) <= LIMITS.acceleration * DT + 1e-9).all()
        v, omega = ROBOT.drive.twist(out.xi[0], out.xi[1])
        assert abs(v) <= CONFIG.whole_body.base_speed + 1e-9 and abs(omega) <= CONFIG.whole_body.base_yaw_rate + 1e-9
        assert not make["keep_path"] or out.scale <= scale + CONFIG.whole_body.hierarchy.clock_rise * DT + 1e-9
        sent, scale = out.xi, out.scale
        q = integrate(q, sent)
        assert (q[ARM_Q] >= LIMITS.lower[ARM_Q]).all() and (q[ARM_Q] <= LIMITS.upper[ARM_Q]).all()


class _Random:
    """Rows at random, most of them impossible together."""

    name = "random"

    def __init__(self, rng):
        self._rng = rng

    def rows(self, problem):
        k = int(self._rng.integers(0, 5))
        return Inequalities(self._rng.normal(size=(k, 9)), self._rng.normal(size=k), tuple(map(str, range(k))))


@settings(max_examples=100)
@given(seeds)
def test_any_numbers_at_all_get_an_answer_that_may_be_sent(seed):
    """Joints beyond limits, velocities beyond limits, and what is not a number."""
    rng = np.random.default_rng(seed)
    q, sent = home(), rng.normal(0, 3, 9)
    q[ARM_Q] = rng.uniform(LIMITS.lower[ARM_Q] - 0.5, LIMITS.upper[ARM_Q] + 0.5)
    problem = ik_problem(q, rng.normal(0, 5, 6), sent, rng.normal(0, 3, 7), base=str(rng.choice(MODES)))
    broken = rng.integers(0, 6)
    bad = float(rng.choice([np.nan, np.inf, -np.inf]))
    if broken == 1:
        problem.tool.twist[3] = bad
    elif broken == 2:
        problem.posture.q[7] = bad
    elif broken == 3:
        problem.kinematics.J[2, 6] = bad
    elif broken == 4:
        problem = msgspec.structs.replace(problem, speed_cap=np.nan)
    out = METHOD.solve(problem)
    assert np.isfinite(out.xi).all() and 0.0 <= out.scale <= 1.0
    assert (np.abs(out.xi - sent) <= LIMITS.acceleration * DT + 1e-9).all()
    if broken in (1, 2, 3, 4):
        assert not out.feasible and "not finite" in out.reason and out.scale == 0.0
        assert (np.abs(out.xi) <= np.abs(sent)).all()


def test_from_a_velocity_that_is_not_a_number_it_rests():
    sent = np.zeros(9)
    sent[3] = np.nan
    out = METHOD.solve(ik_problem(home(), sent=sent))
    assert not out.xi.any() and not out.feasible


@pytest.mark.parametrize("joint", range(7))
def test_a_start_outside_a_joint_limit_moves_back_inside(joint):
    q, sent = home(), np.zeros(9)
    q[5 + joint] = LIMITS.upper[5 + joint] + 0.08
    for _ in range(400):
        out = METHOD.solve(ik_problem(q, 0 * TWIST, sent))
        sent = out.xi
        q = integrate(q, sent)
    assert LIMITS.lower[5 + joint] < q[5 + joint] < LIMITS.upper[5 + joint]


def test_too_much_is_answered_with_less_of_the_same():
    q = home()
    J = ROBOT.kinematics(q).J_xi
    out = settled(METHOD, lambda sent: ik_problem(q, 40 * TWIST, sent))
    got = J @ out.xi
    assert 0.02 < out.scale < 0.9 and out.feasible
    np.testing.assert_allclose(got, 40 * TWIST * out.scale, atol=0.01 * np.linalg.norm(got))


def test_a_clock_that_stood_starts_again_gently():
    out = METHOD.solve(ik_problem(home(), 0.01 * TWIST, scale=0.0))
    assert out.scale == pytest.approx(CONFIG.whole_body.hierarchy.clock_rise * DT, rel=1e-3)


def test_the_speed_cap_holds_the_tool_back_and_the_clock_with_it():
    q = home()
    twist = np.array([0.2, 0.0, 0.0, 0.0, 0.0, 0.0])
    out = settled(METHOD, lambda sent: ik_problem(q, twist, sent, speed_cap=0.05))
    assert np.linalg.norm((ROBOT.kinematics(q).J_xi @ out.xi)[:3]) == pytest.approx(0.05, rel=1e-3)
    assert out.scale == pytest.approx(0.25, rel=1e-3)


def test_a_free_axis_leaves_the_turn_about_the_cane_to_the_posture():
    q = home()
    k = ROBOT.kinematics(q)
    R = k.T_odom_tool.rotation
    arm = np.array(CONFIG.work.home)
    arm[6] += 0.5
    turns = []
    for free in (False, True):
        out = settled(
            METHOD, lambda sent, free=free: ik_problem(q, 0 * TWIST, sent, arm=arm, base="frozen", free_axis=free)
        )
        twist = k.J_xi @ out.xi
        turns.append((R.T @ twist[3:])[1])
        np.testing.assert_allclose(twist[:3], 0, atol=1e-8)
        np.testing.assert_allclose((R.T @ twist[3:])[[0, 2]], 0, atol=1e-8)
    assert abs(turns[0]) < 1e-8
    assert abs(turns[1]) > 1e-3


class _Wall:
    """The tool may not move along +x faster than `speed`."""

    name = "wall"

    def __init__(self, speed):
        self._speed = speed

    def rows(self, problem):
        return Inequalities(-problem.kinematics.J_xi[:1], np.array([-self._speed]), ("blades and post 3",))


def test_a_guard_comes_before_the_tool():
    q = home()
    J = ROBOT.kinematics(q).J_xi
    method = Hierarchy(ROBOT, CONFIG.whole_body, DT, guards=(_Wall(0.01),))
    out = settled(method, lambda sent: ik_problem(q, sent=sent))
    assert (J @ out.xi)[0] <= 0.01 + 1e-8
    assert 0.1 < out.scale < 0.3
    assert out.feasible


def test_a_guard_that_cannot_be_kept_is_named_and_given_way_to_as_little_as_possible():
    """The wall comes at the robot at 5 m/s: everything flees within its limits, and says why."""
    method = Hierarchy(ROBOT, CONFIG.whole_body, DT, guards=(_Wall(-5.0),))
    q = home()
    sent = np.zeros(9)
    for _ in range(50):
        out = method.solve(ik_problem(q, sent=sent))
        assert GATE.admits(out.xi, sent)
        assert not out.feasible and "blades and post 3" in out.reason
        sent = out.xi
    best = -np.abs(ROBOT.kinematics(q).J_xi[0, ARM_XI]) @ (
        LIMITS.velocity[ARM_XI] * CONFIG.whole_body.arm_velocity_scale
    )
    assert (ROBOT.kinematics(q).J_xi @ out.xi)[0] < 0.9 * best


@pytest.mark.parametrize(("speed", "told"), [(0.0015, "blades and post 3"), (0.01, "")])
def test_what_slows_a_motion_to_a_crawl_is_told(speed, told):
    q = home()
    method = Hierarchy(ROBOT, CONFIG.whole_body, DT, guards=(_Wall(speed),))
    out = settled(method, lambda sent: ik_problem(q, sent=sent))
    assert out.scale == pytest.approx(speed / 0.05, rel=0.1) and out.feasible
    assert out.reason == told


def test_before_a_wall_a_path_is_kept_and_says_what_holds_it_while_a_hand_slides_along():
    q = home()
    J = ROBOT.kinematics(q).J_xi
    twist = np.array([0.05, 0.05, 0.0, 0.0, 0.0, 0.0])
    method = Hierarchy(ROBOT, CONFIG.whole_body, DT, guards=(_Wall(0.0),))
    kept = settled(method, lambda sent: ik_problem(q, twist, sent))
    assert np.abs(J @ kept.xi).max() < 5e-4 and kept.scale < 1e-2
    assert not kept.feasible and kept.reason == "blades and post 3"
    slid = settled(method, lambda sent: ik_problem(q, twist, sent, keep_path=False))
    np.testing.assert_allclose((J @ slid.xi)[:3], [0.0, 0.05, 0.0], atol=1e-3)
    assert slid.scale == 1.0 and slid.feasible
    assert slid.reason == "blades and post 3"


def test_switching_the_base_s_mode_never_jerks_and_never_moves_the_tool_from_its_path():
    q, sent, scale = home(), np.zeros(9), 1.0
    q[2] = 0.0
    twist = np.array([0.08, 0.02, 0.0, 0.0, 0.0, 0.1])
    for i in range(240):
        base = ("row", "transit", "free")[i // 40 % 3]
        out = METHOD.solve(ik_problem(q, twist, sent, base=base, scale=scale))
        assert GATE.admits(out.xi, sent)
        if i > 20:
            got = ROBOT.kinematics(q).J_xi @ out.xi
            np.testing.assert_allclose(got, twist * out.scale, atol=1e-4)
            assert out.scale > 0.9
        sent, scale = out.xi, out.scale
        q = integrate(q, sent)


def test_frozen_while_driving_the_base_brakes_and_the_arm_makes_good_for_it():
    q = home()
    driving = np.array([1.5, 1.5, *[0.0] * 7])
    k = ROBOT.kinematics(q)
    carried = k.J_xi @ driving
    sent = driving
    out = METHOD.solve(ik_problem(q, carried, sent, base="frozen"))
    assert 0.0 < out.xi[0] < 1.5 and out.xi[0] == pytest.approx(out.xi[1])
    for _ in range(60):
        out = METHOD.solve(ik_problem(q, 0 * TWIST, out.xi, base="frozen"))
    assert not out.xi[:2].any()


def test_near_a_singularity_the_velocity_stays_moderate_and_the_tool_goes_on():
    """The arm stretched out towards the goal, base still: no limit is broken and nothing chatters."""
    q, sent, scale = home(), np.zeros(9), 1.0
    q[ARM_Q] = [0.0, 0.6, 0.0, -0.5, 0.0, 1.2, 0.0]
    twist = np.concatenate([0.1 * np.array([np.cos(0.3), np.sin(0.3), 0.0]), np.zeros(3)])
    changes = []
    for _ in range(300):
        out = METHOD.solve(ik_problem(q, twist, sent, arm=q[ARM_Q], base="frozen", scale=scale))
        changes.append(np.abs(out.xi - sent).max() / DT)
        sent, scale = out.xi, out.scale
        q = integrate(q, sent)
    assert (LIMITS.upper[ARM_Q] > q[ARM_Q]).all()
    # Once it stands at the end of its reach it stands still.
    assert np.abs(out.xi).max() < 0.05
    assert max(changes[-50:]) < 0.5


def test_jerk_of_the_arm_is_inside_the_data_sheet_at_the_control_rate():
    """A change of acceleration takes at most from one limit to the other: 2 a/dt, below 500 a, which is rated."""
    rated = 500.0 * LIMITS.acceleration[ARM_XI]
    assert (2.0 * LIMITS.acceleration[ARM_XI] / DT <= rated).all()


@pytest.mark.parametrize("base", MODES)
def test_velocities_of_the_actuators_are_sent_as_asked_except_to_a_frozen_base(base):
    q = home()
    wanted = np.array([0.4, 0.5, 0.1, -0.1, 0.2, 0.0, 0.3, 0.0, -0.1])

    def make(sent):
        return msgspec.structs.replace(ik_problem(q, sent=sent, base=base), tool=ActuatorTask(wanted))

    out = settled(METHOD, make)
    np.testing.assert_allclose(out.xi[ARM_XI], wanted[ARM_XI], atol=1e-6)
    np.testing.assert_allclose(out.xi[:2], 0.0 if base == "frozen" else wanted[:2], atol=1e-6)
