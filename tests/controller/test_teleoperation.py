import msgspec
import numpy as np
import pinocchio as pin
import pytest

from controller.config import ControllerConfig
from controller.core import Controller
from controller.motion.teleoperation import Teleoperation, latency_speed_scale
from rolling_panda import commands as intents
from rolling_panda.config import RobotConfig
from rolling_panda.messages.perception import Capsule
from rolling_panda.messages.supervision import BaseVelocity, TeleopTarget, ToolVelocity
from rolling_panda.model.robot import pose_message
from rolling_panda.reasons import text_of
from rolling_panda.transport.inbox import Received
from tests.support.controller_config import controller_config
from tests.support.worlds.kinematic_robot import KinematicRobot

CONFIG = ControllerConfig()


def robot(armed=True, method=CONFIG.whole_body.method):
    config = controller_config(CONFIG, whole_body__method=method)
    r = KinematicRobot(Controller(config, RobotConfig()), CONFIG.work.home)
    r.run(0.05)
    if armed:
        assert r.ask(intents.Arm(user="ada")).ok
        r.run(0.05)
    return r


def tool(r):
    return r.model.kinematics(r.q).T_odom_tool


def hold(r, target, held=True):
    r.teleop = TeleopTarget(sequence=1, hold=held, user="ada", target=pose_message(target))


def moved(T, x, y, z, turn=0.0):
    return pin.SE3(T.rotation @ pin.exp3(np.array([0, turn, 0])), T.translation + np.array([x, y, z]))


def test_tool_follows_the_gizmo_within_its_speed():
    r = robot()
    target = moved(tool(r), 0.3, 0.1, 0.1, 0.3)
    hold(r, target)
    fastest, before = 0.0, tool(r).translation
    for _ in range(800):
        r.step()
        after = tool(r).translation
        fastest, before = max(fastest, float(np.linalg.norm(after - before)) / r.dt), after
    assert r.state.mode == "TELEOP"
    assert np.linalg.norm(tool(r).translation - target.translation) < 0.002
    assert np.linalg.norm(pin.log3(tool(r).rotation.T @ target.rotation)) < 0.01
    # This base lags by less than the controller reckons with, so that the arm makes good too much for a moment.
    assert 0.1 < fastest <= 1.08 * CONFIG.teleoperation.speed


@pytest.mark.parametrize("about", [(1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)])
def test_tool_turns_with_the_gizmo_about_each_axis_and_stays_where_it_is(about):
    r = robot()
    start = tool(r)
    target = pin.SE3(start.rotation @ pin.exp3(0.35 * np.array(about)), start.translation)
    hold(r, target)
    r.run(6.0)
    assert np.linalg.norm(pin.log3(tool(r).rotation.T @ target.rotation)) < 0.01
    assert np.linalg.norm(tool(r).translation - target.translation) < 0.003


@pytest.mark.parametrize("speed_scale", [1.0, 0.3])
def test_the_tool_keeps_to_the_speed_scale(speed_scale):
    r = robot()
    hold(r, moved(tool(r), 0.6, 0.0, 0.0))
    r.teleop = msgspec.structs.replace(r.teleop, speed_scale=speed_scale)
    before = tool(r).translation
    r.run(1.5)
    way = float(np.linalg.norm(tool(r).translation - before))
    assert (
        0.6 * speed_scale * 1.5 * CONFIG.teleoperation.speed
        < way
        <= 1.08 * speed_scale * 1.5 * CONFIG.teleoperation.speed
    )


def test_a_hand_is_told_how_near_it_is_to_what_and_what_holds_it():
    r = robot()
    here = tool(r).translation
    hold(r, moved(tool(r), 0.0, 0.0, 0.0))
    r.run(0.2)
    assert r.state.proximity is None or r.state.proximity.distance > 0.03
    assert r.state.limited_by == ""
    ahead = here + tool(r).rotation @ np.array([0.0, 0.0, 0.25])
    bottom, top = ahead - [0.0, 0.0, 0.4], ahead + [0.0, 0.0, 0.4]
    r.obstacles = (Capsule("post", tuple(bottom.tolist()), tuple(top.tolist()), 0.04, 0.04),)
    target = pin.SE3(tool(r).rotation, tool(r).translation + tool(r).rotation @ np.array([0.0, 0.0, 0.3]))
    r.run(0.2)
    r.teleop = TeleopTarget(sequence=2, hold=True, user="ada", target=pose_message(target))
    r.run(3.0)
    assert r.state.mode == "TELEOP"
    assert "post 0" in r.state.proximity.what and 0.0 < r.state.proximity.distance < 0.05
    assert "post 0" in r.state.limited_by
    r.teleop = TeleopTarget(sequence=3, hold=False, user="ada")
    r.run(0.2)
    assert (r.state.proximity, r.state.limited_by) == (None, ""), "nothing is said of what nobody moves"


def test_base_comes_along_when_the_gizmo_goes_far_and_stays_parallel_to_the_row():
    r = robot()
    target = moved(tool(r), 1.2, 0.1, 0.05)
    hold(r, target)
    r.run(15.0)
    assert np.linalg.norm(tool(r).translation - target.translation) < 0.005
    assert r.q[0] > 0.5
    assert abs(r.q[2]) < 0.1


def test_letting_go_stops_at_once_and_a_new_hold_goes_on():
    r = robot()
    target = moved(tool(r), 0.5, 0, 0)
    hold(r, target)
    r.run(1.0)
    assert np.abs(r.xi).max() > 0.1
    hold(r, target, held=False)
    r.run(0.06)
    assert r.state.mode == "READY"
    r.run(0.29)
    assert np.abs(r.xi).max() < 1e-2
    hold(r, target)
    r.run(0.2)
    assert r.state.mode == "TELEOP"


def test_silence_ends_the_hold():
    r = robot()
    hold(r, moved(tool(r), 0.5, 0, 0))
    r.run(1.0)
    # The newest target stays what it is; only its age grows.
    r.deaf.add(TeleopTarget)
    r.run(0.5)
    assert r.state.mode == "READY"
    assert np.abs(r.xi).max() < 1e-3


def test_a_demand_that_comes_late_or_twice_counts_for_nothing():
    teleoperation, age = (
        Teleoperation(CONFIG.teleoperation, CONFIG.work, None, None, 0.01, lambda *_: None, lambda *_: None),
        CONFIG.teleoperation.hold_max_age_s,
    )

    def holding(sequence, at, hold=True, now=None):
        message = TeleopTarget(sequence=sequence, hold=hold, user="ada", base=BaseVelocity(0.1, 0.0))
        return teleoperation.holding(Received(message, at), at if now is None else now)

    assert holding(5, 1.0)
    assert not holding(6, 1.0 + 0.2 * age, hold=False)
    assert not holding(5, 1.0 + 0.3 * age), "older than the release"
    assert not holding(6, 1.0 + 0.4 * age), "of the same number as the release"
    assert holding(7, 2.0)
    assert holding(7, 2.0 + 0.9 * age)
    assert not holding(7, 2.0 + 0.9 * age, now=2.0 + 1.1 * age), "a repetition keeps nothing alive"
    assert holding(1, 3.0), "the server has started again"


def test_a_hold_from_before_arming_moves_nothing():
    r = robot(armed=False)
    hold(r, moved(tool(r), 0.5, 0, 0))
    r.run(0.2)
    assert r.ask(intents.Arm(user="ada")).ok
    r.run(0.5)
    assert r.state.mode == "READY"
    assert not np.any(r.record)


def test_without_the_server_there_is_no_teleoperation():
    r = robot()
    hold(r, moved(tool(r), 0.5, 0, 0))
    r.run(1.0)
    r.server = False
    r.run(0.4)
    assert r.state.mode == "PAUSED" and "server" in text_of(r.state.reason)
    assert np.abs(r.xi).max() < 1e-2


def test_joint_limits_hold_when_the_gizmo_is_out_of_reach():
    r = robot()
    hold(r, moved(tool(r), 0.0, 0.9, 1.5))
    r.run(12.0)
    arm = r.q[5:]
    limits = r.model.limits
    assert (arm > limits.lower[5:]).all() and (arm < limits.upper[5:]).all()
    xi, every = np.array(r.record), CONFIG.base_every
    assert (np.abs(np.diff(xi, axis=0))[:, 2:] <= limits.acceleration[2:] * r.dt + 1e-9).all()
    # The base is told something new once in its own period.
    assert (np.abs(xi[every:, :2] - xi[:-every, :2]) <= limits.acceleration[:2] * r.dt * every + 1e-9).all()


def held(r, **wanted):
    r.teleop = TeleopTarget(sequence=1, hold=True, user="ada", **wanted)


@pytest.mark.long
@pytest.mark.parametrize("method", ["hierarchy", "nullspace"])
def test_joints_are_turned_alone_and_stop_before_their_limits(method):
    r = robot(method=method)
    before = r.q.copy()
    held(r, joints=(0.0, 0.0, 0.0, 0.0, 0.0, 0.3, 0.0))
    r.run(1.0)
    turned = r.q - before
    assert 0.2 < turned[10] < 0.3
    assert np.abs(np.delete(turned, 10)).max() < 1e-6
    r.run(20.0)
    assert r.q[10] < r.model.limits.upper[10]
    assert r.state.mode == "TELEOP"


def test_a_joint_velocity_beyond_the_limits_is_slowed_not_refused():
    r = robot()
    held(r, joints=(0.0, 0.0, 0.0, 0.0, 9.0, 0.0, 9.0))
    r.run(0.5)
    fastest = np.abs(np.array(r.record)).max(axis=0)
    assert (fastest <= r.model.limits.velocity + 1e-9).all()
    assert fastest[8] > 0.5 and np.isclose(fastest[6], fastest[8], rtol=0.05), "both slowed alike"


def test_the_base_is_driven_with_the_arm_still():
    r = robot()
    arm = r.q[5:].copy()
    held(r, base=BaseVelocity(0.2, 0.0))
    r.run(2.0)
    assert 0.25 < r.q[0] < 0.42
    assert np.abs(r.q[5:] - arm).max() < 1e-6
    held(r, base=BaseVelocity(0.0, 0.15))
    r.run(2.0)
    assert 0.15 < r.q[2] < 0.31


@pytest.mark.long
def test_the_base_moves_under_a_tool_that_stays():
    r = robot()
    start = tool(r)
    held(r, target=pose_message(start), base=BaseVelocity(-0.1, 0.0))
    r.run(1.5)
    assert r.q[0] < -0.08
    assert np.linalg.norm(tool(r).translation - start.translation) < 0.003
    assert np.linalg.norm(pin.log3(tool(r).rotation.T @ start.rotation)) < 0.01
    # As far as the arm allows: the tool comes first.
    r.run(20.0)
    assert np.linalg.norm(tool(r).translation - start.translation) < 0.01


def test_a_demand_for_nothing_or_for_two_things_moves_nothing():
    for wanted in ({}, {"joints": (0.2,) * 7, "base": BaseVelocity(0.1, 0.0)}):
        r = robot()
        held(r, **wanted)
        r.run(0.3)
        assert r.state.mode == "READY" and not np.any(r.record)


def test_who_sees_the_robot_late_moves_it_slowly():
    assert [latency_speed_scale(late) for late in (0.0, 0.25, 0.5, 9.0)] == [1.0, 1.0, 0.25, 0.25]
    assert latency_speed_scale(0.375) == pytest.approx(0.625)
    speeds = []
    for late in (0.1, 0.6):
        r = robot()
        goal = pose_message(moved(tool(r), 0.5, 0, 0))
        r.teleop = TeleopTarget(sequence=1, hold=True, user="ada", target=goal, round_trip_s=late)
        before = tool(r).translation.copy()
        r.run(1.5)
        speeds.append(np.linalg.norm(tool(r).translation - before) / 1.5)
        r.teleop = TeleopTarget(sequence=1, hold=True, user="ada", base=BaseVelocity(0.14, 0.0), round_trip_s=late)
        r.run(1.0)
        speeds.append(abs(r.xi[0]) * r.model.drive.wheel_radius)
    assert speeds[2] < 0.35 * speeds[0]
    assert speeds[1] == pytest.approx(0.14, rel=0.05) and speeds[3] == pytest.approx(0.035, rel=0.05)


def test_the_base_is_driven_no_faster_than_it_comes_to_rest_from_in_time():
    for base in (BaseVelocity(0.3, 0.0), BaseVelocity(-2.0, 0.0), BaseVelocity(0.2, 0.2)):
        r = robot()
        held(r, base=base)
        r.run(1.5)
        wheels = np.abs(r.xi[:2]) * r.model.drive.wheel_radius
        assert wheels.max() == pytest.approx(CONFIG.teleoperation.base_speed, rel=0.02)
        v, omega = r.model.drive.twist(*r.xi[:2])
        assert v * base.angular == pytest.approx(omega * base.linear, abs=1e-3), "slowed alike"


def test_a_tool_that_is_led_along_the_row_takes_the_base_no_faster_than_that():
    r = robot()
    held(r, target=pose_message(moved(tool(r), 2.0, 0, 0)))
    fastest = 0.0
    for _ in range(400):
        r.step()
        fastest = max(fastest, np.abs(r.xi[:2]).max() * r.model.drive.wheel_radius)
    assert fastest == pytest.approx(CONFIG.teleoperation.base_speed, rel=0.02)
    assert r.q[0] > 0.3, "and it does take it along"


# --- along an axis, and to a posture ----------------------------------------------------------------------------------


def lead(r, sequence=1, **wanted):
    r.teleop = TeleopTarget(sequence=sequence, hold=True, user="ada", **wanted)


def test_a_held_arrow_moves_the_tool_straight_along_its_axis_and_release_ends_it():
    r = robot()
    start = tool(r)
    lead(r, along=ToolVelocity((0.0, 0.0, 0.08), (0.0, 0.0, 0.0), "world"))
    r.run(2.0)
    way = tool(r).translation - start.translation
    assert way[2] == pytest.approx(0.16, abs=0.04) and np.abs(way[:2]).max() < 0.005
    assert np.linalg.norm(pin.log3(start.rotation.T @ tool(r).rotation)) < 0.02
    r.teleop = TeleopTarget(sequence=2, hold=False, user="ada")
    r.run(0.3)
    rest = tool(r).translation
    r.run(0.5)
    assert tool(r).translation == pytest.approx(rest, abs=1e-4) and r.state.mode == "READY"


@pytest.mark.parametrize(("axes", "direction"), [("tool", None), ("world", (0.0, 1.0, 0.0))])
def test_a_step_is_as_long_as_it_says_however_long_it_is_held(axes, direction):
    r = robot()
    start = tool(r)
    lead(r, along=ToolVelocity((0.0, 0.05, 0.0), (0.0, 0.0, 0.0), axes, duration_s=0.4))
    r.run(4.0)
    along = start.rotation[:, 1] if direction is None else np.array(direction)
    assert tool(r).translation - start.translation == pytest.approx(0.02 * along, abs=0.002)
    assert r.state.mode == "TELEOP", "it is still held"


def test_a_held_arc_turns_the_tool_about_its_axis_in_place():
    r = robot()
    start = tool(r)
    lead(r, along=ToolVelocity((0.0, 0.0, 0.0), (0.0, 0.0, 0.3), "tool", duration_s=0.5))
    r.run(4.0)
    assert pin.log3(start.rotation.T @ tool(r).rotation) == pytest.approx([0.0, 0.0, 0.15], abs=0.01)
    assert np.linalg.norm(tool(r).translation - start.translation) < 0.003


def test_each_press_of_a_step_begins_anew_where_the_tool_is():
    r = robot()
    start = tool(r)
    step = ToolVelocity((0.0, 0.0, 0.05), (0.0, 0.0, 0.0), "world", duration_s=0.2)
    for press in range(3):
        lead(r, 2 * press + 1, along=step)
        r.run(2.0)
        r.teleop = TeleopTarget(sequence=2 * press + 2, hold=False, user="ada")
        r.run(0.3)
    assert tool(r).translation[2] - start.translation[2] == pytest.approx(0.03, abs=0.002)


def test_the_arm_goes_to_a_posture_while_it_is_held_and_the_base_rests():
    r = robot()
    goal = tuple(angle + 0.25 * way for angle, way in zip(CONFIG.work.home, (1, 0, -1, 0, 1, 0, 1), strict=True))
    before = r.q.copy()
    lead(r, posture=goal)
    r.run(0.3)
    r.teleop = TeleopTarget(sequence=2, hold=False, user="ada")
    r.run(0.5)
    part = r.q[5:].copy()
    assert 0.0 < np.abs(part - before[5:]).max() < 0.2, "it goes no further than it is held"
    lead(r, 3, posture=goal)
    fastest = 0.0
    for _ in range(400):
        then = r.q[5:].copy()
        r.step()
        fastest = max(fastest, float(np.abs(r.q[5:] - then).max()) / r.dt)
    assert r.q[5:] == pytest.approx(goal, abs=0.01) and r.q[:3] == pytest.approx(before[:3], abs=1e-3)
    assert fastest <= 1.1 * CONFIG.teleoperation.joint_speed


@pytest.mark.parametrize(
    ("joint", "angle", "code"), [(4, 0.5, "posture_out_of_range"), (1, -9.0, None), (2, 1.7, "posture_touches")]
)
def test_a_posture_that_the_arm_cannot_take_moves_nothing_and_says_why(joint, angle, code):
    r = robot()
    goal = list(CONFIG.work.home)
    goal[joint - 1] = angle
    if code is None:
        with pytest.raises(msgspec.ValidationError):
            msgspec.convert({"angles": goal, "user": "ada"}, intents.CheckPosture)
        return
    before = r.q.copy()
    answer = r.ask(intents.CheckPosture(user="ada", angles=tuple(goal)))
    assert not answer.ok and answer.reason.code == code
    if code == "posture_out_of_range":
        upper = r.model.limits.upper[4 + joint]
        assert dict(answer.reason.values)["high_deg"] == pytest.approx(np.degrees(upper - r.state.kept_margin))
    lead(r, posture=tuple(goal))
    r.run(0.5)
    assert r.q == pytest.approx(before, abs=1e-6) and r.state.mode == "READY"
    assert any(text_of(answer.reason) in event for event in r.events)


def test_a_posture_beside_wood_is_refused_and_one_in_the_open_is_not():
    r = robot()
    assert r.ask(intents.CheckPosture(user="ada", angles=CONFIG.work.home)).ok
    here = tool(r).translation
    r.obstacles = (Capsule("post", (here[0], here[1], 0.0), (here[0], here[1], 2.0), 0.04, 0.04),)
    r.run(0.2)
    answer = r.ask(intents.CheckPosture(user="ada", angles=CONFIG.work.home))
    assert not answer.ok and answer.reason.code == "posture_touches" and "post 0" in text_of(answer.reason)


@pytest.mark.parametrize(("lift", "other"), [(-1.0, "ground"), (0.0, "post 0")])
def test_a_hold_that_begins_with_the_tool_inside_something_moves_nothing_and_says_why(lift, other):
    r = robot()
    x, y, z = tool(r).translation
    r.obstacles = (Capsule("post", (x + 0.4, y, 0.0), (x + 0.4, y, 2.0), 0.04, 0.04),)
    r.run(0.2)
    before = r.q.copy()
    hold(r, moved(tool(r), 0.4 if lift == 0.0 else 0.1, 0.0, lift))
    r.run(0.5)
    assert r.q == pytest.approx(before, abs=1e-6) and r.state.mode == "READY"
    (why,) = [event for event in r.events if "inside" in event]
    assert other in why


def test_a_tool_led_on_into_a_post_slides_and_one_that_stands_in_something_may_leave_it():
    r = robot()
    x, y, z = tool(r).translation
    r.obstacles = (Capsule("post", (x + 0.4, y, 0.0), (x + 0.4, y, 2.0), 0.04, 0.04),)
    r.run(0.2)
    hold(r, moved(tool(r), 0.1, 0.0, 0.0))
    r.run(0.3)
    hold(r, moved(tool(r), 0.4, 0.0, 0.0))
    r.run(0.5)
    assert r.state.mode == "TELEOP"
    r.teleop = None
    r.run(0.5)
    x, y, z = tool(r).translation
    r.obstacles = (Capsule("post", (x + 0.01, y, 0.0), (x + 0.01, y, 2.0), 0.04, 0.04),)
    r.run(0.2)
    hold(r, moved(tool(r), -0.2, 0.0, 0.0))
    r.run(0.5)
    assert r.state.mode == "TELEOP"


@pytest.mark.parametrize("asked", [intents.Home(user="ada"), intents.Survey(user="ada", distance=1.0)])
def test_a_survey_posture_inside_a_post_is_refused_before_anything_moves(asked):
    r = KinematicRobot(Controller(CONFIG, RobotConfig()), CONFIG.work.folded)
    at_home = np.concatenate([np.zeros(5), CONFIG.work.home])
    x, y, _ = r.model.kinematics(at_home).T_odom_tool.translation
    r.obstacles = (Capsule("post", (x, y, 0.0), (x, y, 2.0), 0.04, 0.04),)
    r.run(0.2)
    assert r.ask(intents.Arm(user="ada")).ok
    r.run(0.1)
    before = r.q.copy()
    answer = r.ask(asked)
    assert not answer.ok and answer.reason.code == "posture_touches" and "post 0" in text_of(answer.reason)
    r.run(1.0)
    assert r.q == pytest.approx(before, abs=1e-6) and r.state.mode == "READY"


def test_the_programs_own_postures_can_be_taken_and_reached():
    r = robot()
    for posture in r.state.postures:
        assert posture.user == "" and r.ask(intents.CheckPosture(user="ada", angles=posture.angles)).ok, posture.name
    folded = next(each.angles for each in r.state.postures if each.name == "folded")
    lead(r, posture=folded)
    r.run(8.0)
    assert r.q[5:] == pytest.approx(folded, abs=0.01)
