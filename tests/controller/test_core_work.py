"""The controller with a robot that has no mass: accepted points are reached and cut, inside every limit."""

import numpy as np
import pytest

from controller.config import ControllerConfig
from rolling_panda import commands as intents
from rolling_panda import messages as m
from rolling_panda import reasons
from rolling_panda.commands import COMMANDS
from rolling_panda.model.robot import ARM_Q, ARM_XI, RobotModel
from rolling_panda.reasons import text_of
from tests.support.controller_at_work import CONFIG, entry, finish, robot, run_until, working
from tests.support.controller_config import controller_config
from tests.support.points import point
from tests.support.sent import newest

LIMITS = RobotModel().limits


def points(count, seed):
    """Points in front of the row, canes up to 25° from the vertical."""
    rng = np.random.default_rng(seed)
    out = []
    for i in range(count):
        turn, lean = rng.uniform(0, 2 * np.pi), np.radians(rng.uniform(0, 25))
        tangent = (
            float(np.sin(lean) * np.cos(turn)),
            float(np.sin(lean) * np.sin(turn)),
            float(np.cos(lean)),
        )
        position = (
            float(rng.uniform(-0.8, 2.0)),
            float(0.75 + rng.uniform(-0.06, 0.06)),
            float(rng.uniform(0.95, 1.15)),
        )
        out.append(point(f"p{i}", position, tangent))
    return tuple(out)


def assert_limits_kept(r):
    xi = np.array(r.record)
    dt = r.dt
    assert (np.abs(xi) <= LIMITS.velocity + 1e-9).all()
    arm, every = xi[:, ARM_XI], r.every
    assert (np.abs(np.diff(arm, axis=0)) <= LIMITS.acceleration[ARM_XI] * dt + 1e-9).all()
    assert (np.abs(np.diff(arm, 2, axis=0)) <= LIMITS.jerk[ARM_XI] * dt**2 + 1e-9).all()
    # The base is told something new once in its own period.
    assert (np.abs(xi[every:, :2] - xi[:-every, :2]) <= LIMITS.acceleration[:2] * dt * every + 1e-9).all()
    speed = np.abs(xi[:, :2].sum(axis=1)) / 2 * r.model.drive.wheel_radius
    assert speed.max() <= 0.3 + 1e-6


def test_random_points_before_the_row_are_reached_and_cut_within_the_limits():
    shown = points(20, seed=3)
    r = working(shown)
    finish(r, 20 * 20.0)
    done = [e for e in r.state.queue if e.state == "DONE"]
    assert len(done) >= 0.95 * len(shown)
    assert all(e.reason.code == "not_reachable" for e in r.state.queue if e.state != "DONE")
    assert_limits_kept(r)
    at, leans = {p.point_id: p for p in shown}, []
    for point_id, T in r.cuts:
        assert np.linalg.norm(T[:3, 3] - at[point_id].position) < 0.0015
        leans.append(np.degrees(np.arccos(min(abs(T[:3, 1] @ np.array(at[point_id].tangent)), 1.0))))
    # Square to the cane within 1°, or tilted by 11.5° on purpose where nothing else reaches.
    assert np.mean(np.array(leans) < 1.0) >= 0.9
    assert max(leans) < 12.5
    margin = np.minimum(r.q[ARM_Q] - LIMITS.lower[ARM_Q], LIMITS.upper[ARM_Q] - r.q[ARM_Q])
    assert margin.min() > 0


@pytest.mark.long
def test_at_a_thousand_hertz_and_fifty_the_cuts_are_made_within_the_limits():
    shown = (point("a", (0.4, 0.75, 1.0)), point("b", (0.7, 0.75, 1.1)))
    r = working(shown, config=ControllerConfig(rate_hz=1000.0, base_rate_hz=50.0))
    finish(r, 40.0)
    assert [e.state for e in r.state.queue] == ["DONE", "DONE"]
    for (_, T), p in zip(r.cuts, shown, strict=True):
        assert np.linalg.norm(T[:3, 3] - p.position) < 0.0015
    assert_limits_kept(r)


def test_tool_goes_in_slowly_and_never_sweeps_through_the_canes():
    shown = (point("a", (0.4, 0.75, 1.0)), point("b", (0.9, 0.75, 1.1)))
    r = working(shown)
    deepest_away, fastest_near = 0.0, 0.0
    while r.state is None or r.state.mode == "AUTO" or r.now < 1.0:
        before = r.model.kinematics(r.q).T_odom_tool.translation
        r.step()
        after = r.model.kinematics(r.q).T_odom_tool.translation
        off = min(np.hypot(after[0] - p.position[0], after[2] - p.position[2]) for p in shown)
        if off > 0.02:
            deepest_away = max(deepest_away, after[1])
        if 0.75 - after[1] < 0.02 and after[1] > before[1]:
            fastest_near = max(fastest_near, np.linalg.norm(after - before) / r.dt)
        assert r.now < 60
    assert deepest_away < 0.75 - 0.2
    # The base may still bring in some millimetres a second.
    assert 0 < fastest_near < CONFIG.motion.cut_speed * 1.15
    assert entry(r, "a").state == entry(r, "b").state == "DONE"


def test_a_point_out_of_reach_fails_with_a_reason_and_the_next_is_cut():
    r = working((point("high", (0.3, 0.75, 2.3)), point("low", (0.6, 0.75, 1.0))))
    finish(r, 40.0)
    assert entry(r, "high").state == "FAILED_NOT_CUT"
    assert entry(r, "high").reason.code == "not_reachable"
    assert entry(r, "low").state == "DONE"


def test_a_point_that_turns_out_to_be_on_another_cane_is_not_cut():
    r = working((point("a", (0.4, 0.75, 1.0)),))
    r.run(1.0)
    r.show((point("a", (0.4, 0.752, 1.0), revision=2, cane=1),))
    finish(r, 20.0)
    assert r.cuts == []
    assert entry(r, "a").state == "PROPOSED"
    assert entry(r, "a").reason == reasons.acceptance_void(reasons.other_cane())


def test_an_unknown_cut_pauses_after_the_retreat_and_is_not_retried():
    r = working((point("a", (0.4, 0.75, 1.0)), point("b", (0.6, 0.75, 1.0))), outcome="UNKNOWN")
    finish(r, 40.0)
    assert r.state.mode == "PAUSED" and "unknown" in text_of(r.state.reason)
    assert r.model.kinematics(r.q).T_odom_tool.translation[1] < 0.7
    assert len(r.cuts) == 1
    assert entry(r, "b").state == "ACCEPTED"


def test_a_cutter_that_never_answers_is_unknown():
    r = working((point("a", (0.4, 0.75, 1.0)),), outcome="")
    finish(r, 40.0)
    assert entry(r, "a").state == "UNKNOWN"
    assert r.state.mode == "PAUSED"


@pytest.mark.parametrize("who", ["server", "perception"])
def test_losing_a_supervisor_stops_the_robot_and_it_stays_stopped(who):
    r = working((point("a", (2.0, 0.75, 1.0)),))
    r.run(3.0)
    assert np.abs(r.xi).max() > 0.1
    setattr(r, who, False)
    r.run(0.4)
    assert np.abs(r.xi).max() < 2e-3
    assert r.state.mode == "PAUSED" and who in text_of(r.state.reason)
    setattr(r, who, True)
    r.run(2.0)
    assert r.state.mode == "PAUSED" and np.abs(r.xi).max() < 1e-6


def test_stop_ends_motion_latches_and_the_reset_moves_nothing():
    r = working((point("a", (2.0, 0.75, 1.0)),))
    r.run(3.0)
    r.stop()
    r.run(0.5)
    assert np.abs(r.xi).max() < 1e-3
    assert r.state.mode == "ESTOP_LATCHED"
    assert "ada" in text_of(r.state.reason)
    assert not r.ask(intents.Arm(user="ada")).ok
    assert r.ask(intents.Reset(user="ada", role="supervisor", reason="looked at it")).ok
    q = r.q.copy()
    r.run(1.0)
    assert r.state.mode == "IDLE"
    np.testing.assert_allclose(r.q, q, atol=1e-4)
    assert_limits_kept(r)


def test_stale_sensors_stop_and_need_an_acknowledgement_after_the_cause_is_gone():
    r = working((point("a", (2.0, 0.75, 1.0)),))
    r.run(3.0)
    r.frozen_sensors = True
    r.run(0.5)
    assert r.state.mode == "PROTECTIVE_STOP" and "Joint states" in text_of(r.state.reason)
    assert np.abs(r.record[-1]).max() == 0.0
    assert r.ask(intents.Acknowledge(user="ada")).reason.code == "cause_remains"
    r.frozen_sensors = False
    r.run(0.5)
    assert not r.ask(intents.Acknowledge(user="ada")).ok
    r.run(0.8)
    assert r.ask(intents.Acknowledge(user="ada")).ok
    r.run(0.1)
    assert r.state.mode == "PAUSED"


def test_pause_and_resume_in_the_canes_first_retreats():
    r = working((point("a", (0.5, 0.75, 1.0)),))
    run_until(r, lambda s: s is not None and s.phase == "ADVANCE", 20.0)
    r.run(1.5)
    assert r.ask(intents.Pause(user="ada")).ok
    r.run(0.5)
    assert np.abs(r.xi).max() < 1e-3
    assert r.ask(intents.Resume(user="ada")).ok
    assert r.ask(intents.Start(user="ada")).ok
    run_until(r, lambda s: s.phase == "RETREAT", r.now + 1.0)
    finish(r, r.now + 30.0)
    assert entry(r, "a").state == "DONE"


def test_home_brings_the_arm_back_with_the_base_still():
    r = working((point("a", (0.5, 0.75, 1.0)),))
    finish(r, 30.0)
    base = r.q[:5].copy()
    assert r.ask(intents.Home(user="ada")).ok
    assert (newest(r.step(), m.ControllerState) or r.state).allowed["Start"] is not None
    r.run(10.0)
    np.testing.assert_allclose(r.q[ARM_Q], CONFIG.work.home, atol=0.011)
    np.testing.assert_allclose(r.q[:5], base, atol=1e-3)
    assert_limits_kept(r)


def test_refusals_say_why_and_allowed_agrees_with_them():
    r = robot()
    r.run(0.1)
    idle = reasons.impossible_in_idle("start")
    assert r.ask(intents.Start(user="ada")).reason == r.state.allowed["Start"] == idle
    about_points = {"AcceptPoint", "RejectPoint", "ReconsiderPoint", "ResolvePoint", "JudgeCut"}
    about_points |= {"MoveInQueue", "SetApproach"}
    possible = {name for name, reason in r.state.allowed.items() if reason is None}
    postures = {"SavePosture", "DeletePosture", "CheckPosture"}
    calibrations = {"UseArm", "UseBase", "UseCamera", "UseTiming"}
    assert possible == {"Arm", "RequirePreview"} | calibrations | postures | about_points
    told = {command.name for command in COMMANDS if command.process == "controller" and command.tag != "control"}
    told.add("UseCamera")
    assert set(r.state.allowed) == told | {"Teleoperation"}
    assert r.ask(intents.Arm(user="ada")).ok
    assert r.ask(intents.Start(user="ada")).reason == reasons.none_accepted()
    assert r.ask(intents.Resume(user="ada")).reason == reasons.impossible_in_ready("resume")


@pytest.mark.parametrize("phase", ["APPROACH", "ADVANCE"])
def test_a_point_that_perception_refines_on_the_way_is_cut_where_it_is_now(phase):
    before = point("a", (0.5, 0.75, 1.0))
    r = working((before,), config=controller_config(CONFIG, work__pre_cut_check=phase == "APPROACH"))
    run_until(r, lambda s: s.phase == phase and s.mode == "AUTO", 20.0)
    for _ in range(40):
        r.step()
    refined = point("a", (0.5023, 0.748, 1.0015), revision=2)
    r.show((refined,))
    finish(r, 30.0)
    assert entry(r, "a").state == "DONE"
    assert np.linalg.norm(r.cuts[0][1][:3, 3] - refined.position) < 0.0015
    assert_limits_kept(r)


def test_a_point_that_becomes_another_cut_before_the_blades_is_not_cut():
    """With the tool already on the last way in."""
    r = working((point("a", (0.5, 0.75, 1.0)), point("b", (0.8, 0.75, 1.0))))
    run_until(r, lambda s: s.phase == "ADVANCE", 20.0)
    r.show((point("a", (0.5, 0.75, 1.012), revision=2, nodes_kept=3), point("b", (0.8, 0.75, 1.0))))
    r.step()
    run_until(r, lambda s: s.phase == "RETREAT", r.now + 0.2)
    finish(r, 30.0)
    assert entry(r, "a").state == "PROPOSED"
    assert entry(r, "a").reason == reasons.acceptance_void(reasons.other_nodes_kept(2, 3))
    assert [point_id for point_id, _ in r.cuts] == ["b"]
    assert any("a was left: The acceptance is void: It left 2 buds" in text for text in r.events)
    assert_limits_kept(r)


def test_a_rule_that_is_taken_back_brings_its_acceptances_and_the_log_says_so():
    usual, short = m.PruningRule(), m.PruningRule(nodes_kept=1)
    high, low = point("a", (0.5, 0.75, 1.0)), point("a", (0.5, 0.75, 0.95), revision=2)
    r = robot()
    r.step()
    r.show((high,), usual)
    r.step()
    assert r.ask(intents.AcceptAll(user="ada")).ok
    r.show((low,), short)
    r.run(0.1)
    assert entry(r, "a").state == "PROPOSED" and "cuts 50 mm away" in text_of(entry(r, "a").reason)
    assert any("a: The acceptance is void: The rule is now: Spur, buds kept: 1" in text for text in r.events)
    assert r.ask(intents.RestoreAccepted(user="eve", rule=usual)).reason == reasons.nothing_to_restore()
    assert r.ask(intents.RestoreAccepted(user="eve", rule=short)).ok
    r.show((high,), usual)
    r.run(0.1)
    assert (entry(r, "a").state, entry(r, "a").user) == ("ACCEPTED", "ada")
    assert text_of(reasons.acceptances_restored("a")) in r.events
    assert text_of(reasons.rule_undone("eve")) in r.events
