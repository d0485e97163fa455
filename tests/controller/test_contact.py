"""Contact detection: whether the arm touches something, where, and what it probably is."""

import itertools

import numpy as np
import pinocchio as pin
import pytest

from controller.config import ContactConfig, ControllerConfig
from controller.motion.contact import ContactMonitor, Spots
from controller.whole_body.obstacle import Obstacle
from rolling_panda import commands as intents
from rolling_panda import messages as m
from rolling_panda.messages.perception import Capsule
from rolling_panda.messages.supervision import TeleopTarget
from rolling_panda.model.robot import ARM_Q, RobotModel
from rolling_panda.model.wire_values import arm_torques, vector3
from tests.support.controller_at_work import entry, robot, run_until, working
from tests.support.points import point

ROBOT = RobotModel()
LIMITS = ContactConfig()
HOME = np.array([0.3, -0.2, 0.4, 0.0, 0.0, *ControllerConfig().work.home])
PUSH = (0.0, 0.0, 0.0, 9.0, 0.0, 0.0, 0.0)


class Arm:
    """An arm that tells torques of our choice, a control period apart."""

    def __init__(self, q=HOME):
        self.q, self.monitor, self.number = q, ContactMonitor(LIMITS, ROBOT), 0
        self.kinematics = ROBOT.kinematics(q)

    def tell(self, torque, periods=1, moves=True, velocity=(0.0,) * 9, obstacles=(), canes=()):
        for _ in range(periods):
            self.number += 1
            told = None if torque is None else arm_torques(np.asarray(torque, float))
            joints = m.JointState(
                header=m.Header(self.number / 100),
                sequence=self.number,
                position=tuple(self.q[3:].tolist()),
                velocity=velocity,
                external_torque=told,
            )
            self.monitor.update(joints, self.q, self.kinematics, moves, obstacles, lambda: canes)
        return self.monitor

    def by(self, force):
        """Torques of a force at the tool (3, N, odom)."""
        return self.kinematics.J[:3, ARM_Q].T @ np.asarray(force, float)


@pytest.mark.parametrize("force", [(0, 7, 0), (5, 0, 5), (-4, 0, -6)])
def test_a_light_push_at_the_tool_is_told_and_stops_nothing(force):
    arm = Arm()
    arm.tell(np.zeros(7), 50)
    found = arm.tell(arm.by(force), 20)
    assert found.force == pytest.approx(np.linalg.norm(force), rel=0.25)
    assert found.touch is None


@pytest.mark.parametrize("force", [(0, -40, 0), (35, 0, 10), (0, 0, 45)])
def test_a_push_beyond_the_limit_is_a_contact_of_that_force(force):
    arm = Arm()
    arm.tell(np.zeros(7), 50)
    touch = arm.tell(arm.by(force)).touch
    assert touch is not None and touch.part in ("blades", "cutter", "camera", "link7")
    assert touch.force == pytest.approx(np.array(force), abs=0.25 * np.linalg.norm(force))
    assert touch.reason.code == "touched_unknown"


def test_a_force_at_the_tool_beyond_its_limit_is_a_contact_where_no_joint_is_beyond_its_own():
    """The force's limit counts by itself: with a short lever about every joint the torques stay small."""
    limits, rng, tried = (
        np.array([LIMITS.stop_torque] * 4 + [LIMITS.stop_torque_wrist] * 3),
        np.random.default_rng(1),
        0,
    )
    for direction in rng.normal(size=(200, 3)):
        arm = Arm()
        torque = arm.by(1.15 * LIMITS.stop_force * direction / np.linalg.norm(direction))
        if (np.abs(torque) > 0.95 * limits).any():
            continue
        arm.tell(np.zeros(7), 5)
        found = arm.tell(torque)
        if found.force > LIMITS.stop_force:
            tried += 1
            assert found.touch is not None
    assert tried > 0


def test_at_rest_the_robot_is_touched_but_touches_nothing_and_what_presses_then_counts_as_none():
    arm = Arm()
    arm.tell(np.zeros(7), 50)
    assert arm.tell(arm.by((0, -60, 0)), 100, moves=False).touch is None
    assert arm.tell(arm.by((0, -60, 0)), 10).touch is None
    assert arm.tell(np.zeros(7)).touch is not None, "what pressed is gone, and something pushes the other way"


def test_offsets_of_the_estimate_are_no_touch():
    arm, offset = Arm(), np.array([4.0, -5.0, 3.0, 5.0, 1.0, -1.0, 1.0])
    arm.tell(offset, 100, moves=False)
    found = arm.tell(offset + [0.5, 0.5, -0.5, 0.5, 0.2, 0.1, 0.1], 200)
    assert found.touch is None and found.force < 1.0


def test_the_acceleration_of_the_base_is_no_touch():
    """The arm's own estimate takes it for a force of tens of newtons."""
    arm, speed = Arm(), 0.0
    c, s = np.cos(HOME[2]), np.sin(HOME[2])
    M = pin.crba(ROBOT.model, ROBOT.model.createData(), HOME)
    arm.tell(np.zeros(7), 50)
    felt = np.zeros(7)
    for _ in range(20):
        speed += 1.5 * 0.01
        # Of an arm with a filter of 10 ms.
        felt += (1 - np.exp(-1.0)) * (-M[:2, ARM_Q].T @ [1.5 * c, 1.5 * s] - felt)
        wheels = ROBOT.drive.wheels(speed, 0.0)
        found = arm.tell(felt, velocity=(*wheels, *(0.0,) * 7))
        assert found.force < 2.0 and found.touch is None
    assert np.abs(felt).max() > 4.0


def places(rng, count=60):
    """Postures with a spot of the arm that something pushes hard from a direction that the arm feels."""
    spots = Spots(ROBOT)
    far = [k for k, part in enumerate(spots.parts) if part not in ("link1", "link2", "link3")]
    for _ in range(count):
        q = HOME.copy()
        q[ARM_Q] = np.clip(q[ARM_Q] + rng.uniform(-0.6, 0.6, 7), ROBOT.limits.lower[ARM_Q], ROBOT.limits.upper[ARM_Q])
        where, velocities = spots.at(q)
        spot = int(rng.choice(far))
        force = 60.0 * (lambda v: v / np.linalg.norm(v))(rng.normal(size=3))
        yield q, where[spot] - spots.radii[spot] * force / 60.0, force, velocities[spot] @ force


@pytest.mark.parametrize("kind", ["post", "wire", "cordon", "trunk", "cane"])
def test_it_names_the_obstacle_that_is_where_a_single_force_explains_all_torques(kind):
    rng = np.random.default_rng(len(kind))
    right = wrong = contacts = 0
    for q, place, force, torque in places(rng):
        across = np.cross(force, rng.normal(size=3))
        half = 0.5 * across / np.linalg.norm(across)
        away = -force / np.linalg.norm(force)
        # Seen 15 mm too far away; another obstacle stands behind the robot.
        axis, behind = place + 0.035 * away, place - 0.3 * away
        around = (
            Obstacle(f"{kind} 4", kind, vector3(axis - half), vector3(axis + half), 0.02),
            Obstacle("post 9", "post", vector3(behind - half), vector3(behind + half), 0.02),
        )
        arm = Arm(q)
        arm.tell(np.zeros(7), 50)
        touch = arm.tell(torque + rng.normal(0.0, 0.1, 7), 3, obstacles=around).touch
        if touch is not None:
            contacts += 1
            right += touch.obstacle == f"{kind} 4"
            wrong += touch.obstacle == "post 9"
    assert contacts > 50
    assert right / contacts > 0.85 and wrong / contacts < 0.1, (right, wrong, contacts)


def test_an_obstacle_far_from_where_it_pushes_is_not_blamed():
    arm = Arm()
    arm.tell(np.zeros(7), 50)
    tool = arm.kinematics.T_odom_tool.translation
    far = Obstacle("post 1", "post", (tool[0], tool[1] + 0.3, 0.0), (tool[0], tool[1] + 0.3, 2.0), 0.04)
    touch = arm.tell(arm.by((0, -60, 0)), obstacles=(far,)).touch
    assert touch is not None and touch.obstacle == ""


def test_without_an_estimate_nothing_is_felt_and_an_estimate_that_ends_is_noticed():
    arm = Arm()
    found = arm.tell(None, 10)
    assert found.force is None and not found.lost
    arm.tell(np.zeros(7), 10)
    found = arm.tell(None)
    assert found.force is None and found.lost
    found = arm.tell(np.zeros(7))
    assert found.force == pytest.approx(0.0, abs=1e-9) and not found.lost


def test_the_same_joint_state_twice_is_one():
    arm = Arm()
    arm.tell(np.zeros(7), 10)
    arm.tell(arm.by((0, 6, 0)))
    force = arm.monitor.force
    arm.number -= 1
    assert arm.tell(arm.by((0, -60, 0))).force == force


# --- canes ------------------------------------------------------------------------------------------------------------


def among_canes():
    """An arm at work among canes, one of which is 30 mm before the blades, and a push of it by so many newtons."""
    arm = Arm()
    arm.tell(np.zeros(7), 50)
    arm.monitor.gives_way = True
    tool, ahead = arm.kinematics.T_odom_tool.translation, arm.kinematics.T_odom_tool.rotation[:, 2]
    at = tool + 0.03 * ahead
    cane = Obstacle("cane", "cane", tuple(at - [0.0, 0.0, 0.2]), tuple(at + [0.0, 0.0, 0.2]), 0.005)
    return arm, cane, lambda newtons: arm.by(-newtons * ahead)


def test_a_known_cane_that_pushes_is_no_contact_but_a_hard_push_of_it_is():
    arm, cane, push = among_canes()
    found = arm.tell(push(24.0), canes=(cane,))
    assert found.beyond and found.touch is None and found.push is not None and found.push.obstacle == "cane"
    found = arm.tell(push(45.0), canes=(cane,))
    assert found.touch is not None, "what it gives way to now pushes too hard"


@pytest.mark.parametrize("what", ["not at work", "unknown", "a wire"])
def test_what_is_no_cane_that_is_known_or_pushes_a_robot_that_is_not_at_work_is_a_contact(what):
    arm, cane, push = among_canes()
    arm.monitor.gives_way = what != "not at work"
    wire = Obstacle("wire 1", "wire", cane.start, cane.end, cane.radius)
    around = {"not at work": (cane,), "unknown": (), "a wire": ()}[what]
    found = arm.tell(push(24.0), obstacles=(wire,) if what == "a wire" else (), canes=around)
    assert found.push is None and found.touch is not None


def test_among_canes_a_push_that_grows_slowly_is_felt_and_nothing_is_felt_once_it_ends():
    """A cane that leans on the blades for seconds pushes by as much as it does, and not back when they leave."""
    arm, _, push = among_canes()
    arm.monitor.among = True
    for newtons in np.linspace(0.0, 15.0, 400):
        found = arm.tell(push(newtons))
    assert found.force == pytest.approx(15.0, rel=0.25)
    assert arm.tell(push(15.0), 100, moves=False).force == pytest.approx(15.0, rel=0.25), "while the blades close"
    assert arm.tell(np.zeros(7)).force < 1.0
    arm.monitor.among = False
    assert arm.tell(push(6.0), 400).force < 1.0, "elsewhere it is an offset of the estimate"


def test_what_stopped_the_robot_and_pressed_at_rest_is_no_push_the_other_way_once_it_is_gone():
    arm, _, push = among_canes()
    assert arm.tell(push(24.0)).touch is not None
    arm.monitor.clear()
    arm.tell(push(24.0), 100, moves=False)
    found = arm.tell(push(24.0), 10)
    assert found.touch is None and found.force < 1.0, "what presses may be led away from"
    found = arm.tell(np.zeros(7), 10)
    assert found.touch is None and found.force < 1.0, "and it is gone"
    assert arm.tell(push(24.0)).touch is not None, "here it is again"


def test_of_a_known_cane_the_force_counts_and_not_the_torque_of_a_long_lever():
    arm = Arm(np.array([0.3, -0.2, 0.4, 0.0, 0.0, 0.0, 0.6, 0.0, -1.2, 0.0, 1.8, 0.0]))
    arm.tell(np.zeros(7), 50)
    arm.monitor.gives_way = True
    tool, J = arm.kinematics.T_odom_tool.translation, arm.kinematics.J[:3, ARM_Q]
    strongest = np.linalg.svd(J)[0][:, 0]
    across = np.cross(strongest, [1.0, 0.0, 0.0])
    beside = Obstacle(
        "cane", "cane", tuple(tool - 0.03 * strongest - across), tuple(tool - 0.03 * strongest + across), 0.005
    )
    torque = arm.by(18.0 * strongest)
    assert np.abs(torque[:4]).max() > LIMITS.stop_torque
    found = arm.tell(torque, canes=(beside,))
    assert found.beyond and found.touch is None and found.push is None
    assert arm.tell(torque).touch is not None, "of something unknown"


def test_a_cane_that_still_pushes_after_the_robot_has_given_way_is_a_contact():
    arm, cane, push = among_canes()
    arm.tell(push(24.0), canes=(cane,))
    arm.monitor.gave_way(free=False)
    assert arm.monitor.push is None and arm.monitor.touch is not None and arm.monitor.touch.obstacle == "cane"


# --- the robot's reaction ---------------------------------------------------------------------------------------------


def held(**motion):
    return TeleopTarget(sequence=1, hold=True, user="ada", **motion)


def led():
    """A robot that is led by hand: joint 1 turns."""
    r = robot(external_torque=(0.0,) * 7)
    r.step()
    assert r.ask(intents.Arm(user="ada")).ok
    r.run(0.1)
    r.teleop = held(joints=(0.3, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0))
    r.run(1.0)
    assert r.state.mode == "TELEOP"
    return r


def test_led_by_hand_it_stops_goes_back_and_waits_for_a_person():
    r = led()
    there, since = r.model.kinematics(r.q).T_odom_tool.translation, r.now
    r.external_torque = (20.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    run_until(r, lambda s: s.mode == "PROTECTIVE_STOP", since + 0.2)
    assert r.state.reason.code == "touched_unknown"
    assert not r.ask(intents.Acknowledge(user="ada")).ok, "it has not gone back yet"
    run_until(r, lambda s: not np.any(r.xi.round(3)), since + 0.5)
    farthest = r.q.copy()
    r.external_torque = (0.0,) * 7
    r.run(3.0)
    assert r.q[5] < farthest[5] - 0.05, "back along the way it came"
    assert np.linalg.norm(r.model.kinematics(r.q).T_odom_tool.translation - there) < 0.08
    assert r.state.mode == "PROTECTIVE_STOP" and r.state.reason.code == "touched_unknown"
    still = r.q.copy()
    r.run(1.0)
    assert np.allclose(r.q, still, atol=1e-6), "the held control moves it no more"
    assert r.ask(intents.Acknowledge(user="ada")).ok
    r.run(0.1)
    assert r.state.mode == "PAUSED"


def test_what_still_pushes_ends_the_way_back_and_after_a_look_the_robot_can_be_led_away():
    r = led()
    r.external_torque = PUSH[:3] + (25.0,) + PUSH[4:]
    r.run(1.0)
    assert r.state.mode == "PROTECTIVE_STOP"
    r.teleop = None
    r.run(3.0)
    assert any("could not go back" in line for line in r.events)
    assert not np.any(r.xi.round(3))
    assert r.ask(intents.Acknowledge(user="ada")).ok
    assert r.ask(intents.Resume(user="ada")).ok
    r.run(0.1)
    r.teleop = held(joints=(-0.3, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0))
    r.run(0.5)
    assert r.state.mode == "TELEOP", r.state.reason


@pytest.mark.parametrize("ends", [0, 35])
def test_a_contact_that_eases_is_gone_back_from_and_one_that_no_longer_does_ends_the_way_back(ends):
    r = led()
    r.external_torque = (60.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    r.run(0.4)
    assert r.state.mode == "PROTECTIVE_STOP"
    # After a second of the way back it is still beyond the limit of 10 N·m.
    for left in range(50, ends, -1):
        r.external_torque = (float(left), 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
        r.run(0.03)
    r.run(1.0)
    told = "has gone back a little" if ends == 0 else "could not go back"
    assert [told in line for line in r.events if "After the contact" in line] == [True], r.events
    assert not np.any(r.xi.round(3))


def test_a_stop_during_the_way_back_ends_it():
    r = led()
    r.external_torque = (20.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    r.run(0.6)
    r.external_torque = (0.0,) * 7
    assert r.xi[2] < -0.01, "on the way back"
    r.stop()
    r.run(0.4)
    assert r.state.mode == "ESTOP_LATCHED" and not np.any(r.xi.round(3))


def test_without_fresh_joint_states_it_does_not_go_on_back():
    r = led()
    r.external_torque = (20.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    r.run(0.5)
    r.external_torque = (0.0,) * 7
    r.frozen_sensors = True
    r.run(0.6)
    assert r.state.mode == "PROTECTIVE_STOP" and r.state.reason.code == "joints_stale"
    r.frozen_sensors = False
    before = r.q.copy()
    r.run(2.0)
    assert np.allclose(r.q, before, atol=1e-6)


def test_in_automatic_work_the_accepted_point_stays_accepted():
    r = working((point("a", (2.0, 0.75, 1.0)),), external_torque=(0.0,) * 7)
    r.run(2.0)
    assert r.state.mode == "AUTO"
    r.external_torque = PUSH[:3] + (30.0,) + PUSH[4:]
    r.run(0.5)
    r.external_torque = (0.0,) * 7
    r.run(3.0)
    assert r.state.mode == "PROTECTIVE_STOP" and r.state.interrupted == "work"
    assert [entry.state for entry in r.state.queue] == ["ACCEPTED"]
    assert r.state.tool_force is not None


#: Points, and the canes that they are on.
PLACES = {"a": 0.45, "b": 0.9, "c": 1.35, "d": 1.8}
CANES = tuple(
    Capsule("cane", (x, 0.75, 0.9), (x, 0.75, 1.09), 0.004, 0.004, 1, k) for k, x in enumerate(PLACES.values())
)
CUTS = tuple(point(name, (x, 0.75, 1.1), spur=k) for k, (name, x) in enumerate(PLACES.items()))


class Pushed:
    """A robot at work that a cane pushes back by a force (N), so many times, where it is on this stretch near a cut."""

    def __init__(self, force, phase, count=2, lasts=0.3, most=1, obstacles=CANES):
        self.r = working(CUTS[:count], obstacles=obstacles, external_torque=(0.0,) * 7)
        self.force, self.phase, self.lasts, self.left, self.since = force, phase, lasts, most, None
        #: The tool at each push (pin.SE3).
        self.met = []

    def run(self, until, limit_s=60.0):
        r = self.r
        while not until(r.state):
            tool = r.model.kinematics(r.q)
            at = tool.T_odom_tool.translation
            near = min(float(np.linalg.norm(at - cut.position)) for cut in CUTS) < 0.04
            if self.since is None and near and self.left and r.state.mode == "AUTO" and r.state.phase == self.phase:
                self.since, self.left = r.now, self.left - 1
                self.met.append(tool.T_odom_tool.copy())
            if self.since is not None and r.now > self.since + self.lasts:
                self.since = None
            force = 0.0 if self.since is None else self.force
            r.external_torque = arm_torques(tool.J[:3, ARM_Q].T @ np.array([0.0, -force, 0.0]))
            r.step()
            assert r.now < limit_s, (r.state.mode, r.state.phase, r.state.reason)
        return r


def done(state):
    """All cuts have ended."""
    return state is not None and state.mode == "READY" and any(e.state == "DONE" for e in state.queue)


def ended(state):
    return state is not None and state.mode in ("PAUSED", "PROTECTIVE_STOP", "FAULT")


def turn(one, other):
    """Angle between two poses of the tool (rad): its rotation (3×3) each."""
    return float(np.linalg.norm(pin.log3(one.T @ other)))


@pytest.mark.long
def test_a_cut_that_a_cane_is_in_the_way_of_is_made_after_the_others_from_elsewhere():
    pushed = Pushed(28.0, "ADVANCE")
    r = pushed.run(lambda s: s is not None and any(e.state == "DONE" for e in s.queue))
    a = entry(r, "a")
    assert (a.state, entry(r, "b").state) == ("ACCEPTED", "DONE") and a.reason.code == "cane_met", a.reason
    assert dict(a.reason.values)["other"].startswith("cane") and 20.0 < dict(a.reason.values)["force_n"] < 32.0
    pushed.run(done)
    assert [cut[0] for cut in r.cuts] == ["b", "a"] and entry(r, "a").state == "DONE"
    assert turn(pushed.met[0].rotation, r.cuts[1][1][:3, :3]) > 0.15
    assert turn(pushed.met[0].rotation, r.cuts[0][1][:3, :3]) < 0.05, "the other cut was made as any"
    assert not any("PROTECTIVE_STOP" in text for text in r.events)


def test_a_cut_that_canes_are_in_the_way_of_from_everywhere_is_given_up_and_says_after_how_many_tries():
    pushed = Pushed(28.0, "ADVANCE", count=1, most=4)
    r = pushed.run(lambda s: s is not None and s.mode != "AUTO" and pushed.r.now > 1.0)
    a = entry(r, "a")
    assert r.cuts == [] and a.state == "FAILED_NOT_CUT" and a.reason.code == "given_up_after", a.reason
    told = dict(a.reason.values)
    assert told["tries"] == len(pushed.met) == 3 and told["why"].code == "cane_in_way"
    assert r.state.mode == "READY"
    ways = [each.rotation for each in pushed.met]
    assert min(turn(one, other) for one, other in itertools.combinations(ways, 2)) > 0.15, "each try is another one"


def test_a_cut_that_has_no_other_way_after_a_push_says_so_and_that_it_was_tried():
    pushed = Pushed(28.0, "ADVANCE", count=1)
    r = pushed.run(lambda s: s is not None and any(e.reason is not None for e in s.queue))
    assert entry(r, "a").reason.code == "cane_met"
    pushed.run(lambda _: r.model.pose(r.q, r.model.tool_id).translation[1] < 0.58)
    fence = (Capsule("cane", (0.03 * k, 0.68, 0.9), (0.03 * k, 0.68, 1.4), 0.004, 0.004, 1, 9 + k) for k in range(30))
    r.obstacles = (*CANES, *fence)
    pushed.run(lambda s: s.mode != "AUTO")
    told = dict(entry(r, "a").reason.values)
    assert entry(r, "a").state == "FAILED_NOT_CUT" and told["tries"] == 1 and told["why"].code == "not_reachable"


def test_a_given_up_cut_that_is_accepted_again_is_tried_anew():
    pushed = Pushed(28.0, "ADVANCE", count=1, most=3)
    r = pushed.run(lambda s: s is not None and s.mode == "READY" and pushed.r.now > 1.0)
    assert entry(r, "a").state == "FAILED_NOT_CUT"
    assert r.ask(intents.AcceptPoint(user="ada", point_id="a", revision=1)).ok
    assert r.ask(intents.Start(user="ada")).ok
    pushed.run(done)
    assert entry(r, "a").state == "DONE"
    assert turn(pushed.met[0].rotation, r.cuts[0][1][:3, :3]) < 0.05, "as the first time"


def test_on_the_way_out_of_a_cut_it_goes_on_though_a_cane_pushes_and_says_so_once():
    r = Pushed(28.0, "RETREAT").run(done)
    assert [cut[0] for cut in r.cuts] == ["a", "b"] and entry(r, "a").state == entry(r, "b").state == "DONE"
    assert sum("A cane pushes on the way out" in text for text in r.events) == 1
    assert not any("PROTECTIVE_STOP" in text for text in r.events)


@pytest.mark.parametrize(("phase", "state"), [("ADVANCE", "ACCEPTED"), ("RETREAT", "CUTTING")])
def test_a_hard_push_of_a_cane_stops_it_for_a_person(phase, state):
    r = Pushed(60.0, phase).run(ended)
    assert r.state.mode == "PROTECTIVE_STOP" and r.state.reason.code == "touched"
    assert entry(r, "a").state == state, "after a cut its last close-up is still to come"


def go_on(pushed):
    """A person goes on after a contact, once the robot has gone back."""
    r = pushed.r
    pushed.run(lambda s: s.mode == "PROTECTIVE_STOP" and r.ask(intents.Acknowledge(user="ada")).ok)
    r.run(0.1)
    assert r.ask(intents.Resume(user="ada")).ok
    r.run(0.1)
    assert r.ask(intents.Start(user="ada")).ok
    r.run(0.1)


def test_a_cut_that_a_contact_stopped_on_the_way_is_made_after_the_others_from_elsewhere():
    pushed = Pushed(60.0, "ADVANCE", lasts=0.3)
    r = pushed.run(ended)
    a = entry(r, "a")
    assert (r.state.mode, a.state, a.reason.code) == ("PROTECTIVE_STOP", "ACCEPTED", "missed_once")
    go_on(pushed)
    pushed.run(done)
    assert [cut[0] for cut in r.cuts] == ["b", "a"]
    assert turn(pushed.met[0].rotation, r.cuts[1][1][:3, :3]) > 0.15


def test_a_cut_that_contacts_stop_on_the_way_from_everywhere_is_given_up():
    pushed = Pushed(60.0, "ADVANCE", count=1, most=9, lasts=0.3)
    for _ in range(2):
        pushed.run(ended, 200.0)
        go_on(pushed)
    r = pushed.run(ended, 200.0)
    a = entry(r, "a")
    told = dict(a.reason.values)
    assert (r.cuts, a.state, told["tries"], told["why"].code) == ([], "FAILED_NOT_CUT", 3, "touched")


def test_a_cane_that_goes_on_pushing_stops_it_for_a_person():
    r = Pushed(28.0, "ADVANCE", lasts=30.0).run(ended)
    assert r.state.mode == "PROTECTIVE_STOP" and r.state.reason.code == "touched"
    assert entry(r, "b").state == "ACCEPTED"


@pytest.mark.long
def test_canes_that_push_again_and_again_stop_it_for_a_person():
    r = Pushed(28.0, "ADVANCE", count=4, most=4).run(ended)
    assert r.state.mode == "PROTECTIVE_STOP"
    assert len(r.cuts) == 0 and {entry(r, name).state for name in PLACES} == {"ACCEPTED"}


def test_an_estimate_that_ends_stops_the_robot_until_it_is_back():
    r = led()
    r.external_torque = None
    r.run(0.3)
    assert r.state.mode == "PROTECTIVE_STOP" and r.state.reason.code == "touch_unfelt"
    r.run(2.0)
    assert not r.ask(intents.Acknowledge(user="ada")).ok
    r.external_torque = (0.0,) * 7
    r.run(1.2)
    assert r.ask(intents.Acknowledge(user="ada")).ok


def test_a_robot_without_an_estimate_works_and_says_that_it_feels_nothing():
    r = working((point("a", (0.45, 0.75, 1.0)),))
    r.run(1.0)
    assert r.state.mode == "AUTO" and r.state.tool_force is None
    assert any("reports no external torques" in line for line in r.events)
