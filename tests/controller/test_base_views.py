"""The base drives and turns before the calibration's board: with the checks of any work, within half a metre."""

import math

import numpy as np
import pytest
from msgspec.structs import replace

from controller.work import base_views
from rolling_panda import commands as intents
from rolling_panda import messages as m
from rolling_panda import reasons
from rolling_panda.messages.perception import BASE, Capsule, CloseUpRequest, RobotCalibration
from rolling_panda.messages.robot import NO_OFFSETS, ArmCalibration, BaseCalibration, FrameTiming, UseCalibration
from rolling_panda.model.robot import ARM_Q
from tests.support.controller_at_work import CONFIG, finish, robot, run_until

OFFER = BaseCalibration(left=0.133, right=0.133, track=0.51, made_at=7.0)


def calibrating(finding="seen", arm=CONFIG.work.home, **changes):
    """A robot that calibrates its base, whose pictures end like this, or as this tells of the pictures before."""
    r = robot(**changes)
    r.q[ARM_Q] = arm
    pictures = []

    def close_up(request: CloseUpRequest):
        pictures.append((request.point_id, r.q.copy(), r.xi.copy()))
        return replace(found(request), finding=finding(pictures) if callable(finding) else finding)

    found, r.close_up = r.close_up, close_up
    r.step()
    r.show(())
    r.step()
    assert r.ask(intents.Arm(user="ada")).ok
    assert r.ask(intents.CalibrateBase(user="ada")).ok
    return r, pictures


@pytest.mark.long
def test_it_drives_and_turns_takes_pictures_at_rest_and_ends_where_it_began():
    r, pictures = calibrating()
    places = []
    run_until(r, lambda s: s is not None and s.mode == "AUTO", r.now + 1.0)
    assert r.state.phase == "CALIBRATION"
    while r.state.mode == "AUTO":
        places.append(r.q[:3].copy())
        assert r.now < 240.0 and np.abs(r.q[ARM_Q] - CONFIG.work.home).max() < 0.02
        r.step()
    assert r.state.mode == "READY" and r.state.reason == reasons.board_seen(33, 33)
    names = list(dict.fromkeys(name for name, _, _ in pictures))
    assert names == [f"{BASE}{number}" for number in range(1, 34)]
    assert all(np.abs(xi).max() < 0.005 for _, _, xi in pictures), "the robot is at rest"
    seen = np.array([q[:3] for _, q, _ in pictures])
    assert np.ptp(seen[:, 0]) > 0.5 and np.degrees(np.ptp(seen[:, 2])) > 40.0
    places = np.array(places)
    assert np.abs(places[:, 0]).max() < 0.35 and np.abs(places[:, 1]).max() < 0.02
    assert np.abs(np.degrees(places[:, 2])).max() < 31.0
    assert np.abs(r.q[:2]).max() < 0.01 and abs(r.q[2]) < 0.01 and not r.cuts


ASIDE = np.array(CONFIG.work.home) + [0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.15]


@pytest.mark.parametrize("arm", [CONFIG.work.home, ASIDE])
def test_without_the_board_in_the_first_picture_nothing_moves(arm):
    r, pictures = calibrating(finding="unseen", arm=arm)
    finish(r, r.now + 5.0)
    assert r.state.mode == "READY" and r.state.reason == reasons.board_not_ahead(reasons.board_not_in_picture())
    assert {name for name, _, _ in pictures} == {f"{BASE}1"}
    assert not np.any(r.record) and (r.q[ARM_Q] == arm).all() and not r.q[:3].any(), "nothing has moved"


def test_where_the_board_is_seen_from_another_posture_but_not_from_the_survey_posture_the_base_stays():
    r, pictures = calibrating(finding=lambda before: "seen" if len(before) == 1 else "unseen", arm=ASIDE)
    finish(r, r.now + 30.0)
    assert r.state.mode == "READY" and r.state.reason.code == "board_not_ahead"
    assert np.abs(pictures[-1][1][ARM_Q] - CONFIG.work.home).max() < 0.02
    assert {name for name, _, _ in pictures} == {f"{BASE}1"} and np.abs(r.q[:3]).max() < 1e-3


def test_how_often_a_board_was_seen_that_leaves_the_picture_is_told(monkeypatch):
    monkeypatch.setattr(base_views, "ROUNDS", (((0.05, 0.0), (-5.0, 0.0)),))
    r, _ = calibrating(finding=lambda before: "seen" if before[-1][0] == f"{BASE}1" else "unseen")
    finish(r, 600.0)
    assert r.state.mode == "READY" and r.state.reason == reasons.board_seen(1, 5)


def test_a_base_that_something_holds_back_pauses_and_says_so():
    wall = tuple(Capsule("post", (0.42, y, 0.0), (0.42, y, 2.0), 0.05, 0.05) for y in (-0.25, 0.0, 0.25))
    r, pictures = calibrating(obstacles=wall)
    finish(r, 120.0)
    assert r.state.mode == "PAUSED" and r.state.reason.code in ("base_blocked", "calibration_blocked"), r.state.reason
    assert len(pictures) < 33 and r.q[0] < 0.2


def test_a_pause_ends_it_and_nothing_begins_it_again():
    r, pictures = calibrating()
    run_until(r, lambda s: len(pictures) > 2, 60.0)
    assert r.ask(intents.Pause(user="ada")).ok
    r.run(1.0)
    before = len(pictures)
    assert r.state.mode == "PAUSED" and r.ask(intents.Resume(user="ada")).ok
    r.run(3.0)
    assert r.state.mode == "READY" and len(pictures) == before and np.abs(r.xi).max() < 1e-3


def test_it_needs_what_automatic_work_needs():
    r = robot()
    r.step()
    assert not r.ask(intents.CalibrateBase(user="ada")).ok, "not before Arm"
    r.ask(intents.Arm(user="ada"))
    r.watching = False
    r.run(3.0)
    refused = r.ask(intents.CalibrateBase(user="ada"))
    assert not refused.ok and math.isfinite(r.q[0])


def sent(r):
    return [message for message in r.step() if isinstance(message, UseCalibration)]


def test_the_calibration_that_was_seen_goes_to_the_bridge_once_and_no_other():
    r = robot()
    r.step()
    assert r.ask(intents.UseBase(user="ada", made_at=7.0)).reason.code == "no_base_offered"
    r.hear(RobotCalibration(header=m.Header(), base=OFFER))
    r.step()
    assert r.ask(intents.UseBase(user="ada", made_at=6.0)).reason.code == "no_base_offered"
    assert not sent(r)
    assert r.ask(intents.UseBase(user="ada", made_at=7.0)).ok
    assert sent(r) == [UseCalibration(user="ada", base=OFFER)]
    assert not sent(r)
    assert r.ask(intents.UseArm(user="ada", made_at=7.0)).reason.code == "no_arm_offered"
    arm = ArmCalibration(offsets=NO_OFFSETS, made_at=8.0)
    r.hear(RobotCalibration(header=m.Header(), base=OFFER, arm=arm))
    r.step()
    assert r.ask(intents.UseArm(user="ada", made_at=7.0)).reason.code == "no_arm_offered"
    assert r.ask(intents.UseArm(user="ada", made_at=8.0)).ok
    assert sent(r) == [UseCalibration(user="ada", arm=arm)]
    assert r.ask(intents.UseTiming(user="ada", made_at=9.0)).reason.code == "no_timing_offered"
    timing = FrameTiming(delay=0.04, made_at=9.0)
    r.hear(RobotCalibration(header=m.Header(), base=OFFER, arm=arm, timing=timing))
    r.step()
    assert r.ask(intents.UseTiming(user="ada", made_at=8.0)).reason.code == "no_timing_offered"
    assert r.ask(intents.UseTiming(user="ada", made_at=9.0)).ok
    assert sent(r) == [UseCalibration(user="ada", timing=timing)]
    r.ask(intents.Arm(user="ada"))
    r.ask(intents.CalibrateBase(user="ada"))
    r.run(0.5)
    assert r.ask(intents.UseBase(user="ada", made_at=7.0)).reason.code == "wrong_mode"
