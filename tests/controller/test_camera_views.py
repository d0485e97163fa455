"""The arm looks at the calibration's board from all around: the base stands still, each picture is taken at rest."""

import dataclasses

import numpy as np
import pytest
from msgspec.structs import replace

from controller.work import movement
from controller.work.camera_views import BOARD
from rolling_panda import commands as intents
from rolling_panda import reasons
from rolling_panda.messages.perception import ARM, CALIBRATION, CHECK, Capsule, CloseUpRequest
from rolling_panda.model.robot import ARM_Q, RobotModel
from tests.support.controller_at_work import CONFIG, finish, robot, run_until

MODEL = RobotModel()


def calibrating(finding="seen", command=intents.CalibrateCamera, arm=CONFIG.work.home, reason=None, **changes):
    """A robot that looks at the board, or at the row, whose pictures end like this, or as this tells of the robot."""
    r = robot(**changes)
    r.q[ARM_Q] = arm
    pictures = []

    def close_up(request: CloseUpRequest):
        pictures.append((request.point_id, r.q.copy(), r.xi.copy()))
        told = finding(r) if callable(finding) else finding
        return None if told is None else replace(found(request), finding=told, reason=reason)

    found, r.close_up = r.close_up, close_up
    r.step()
    r.show(())
    r.step()
    assert r.ask(intents.Arm(user="ada")).ok
    assert r.ask(command(user="ada")).ok
    return r, pictures


def taken_at_rest(pictures):
    """Names of the pictures and postures of the arm; nothing may move meanwhile."""
    assert all(np.abs(xi).max() < 0.01 for _, _, xi in pictures), "the camera is at rest"
    assert np.abs([q[:3] for _, q, _ in pictures]).max() < 1e-3, "the base stands still"
    return list(dict.fromkeys(name for name, _, _ in pictures)), np.array([q[ARM_Q] for _, q, _ in pictures])


@pytest.mark.long
def test_it_takes_pictures_at_rest_from_many_directions_and_comes_home_and_leaves_out_those_among_obstacles():
    r, pictures = calibrating()
    run_until(r, lambda s: s is not None and s.mode == "AUTO", r.now + 1.0)
    assert r.state.phase == "CALIBRATION"
    finish(r, 240.0)
    assert r.state.mode == "READY" and r.state.reason.code == "board_seen", r.state.reason
    names, places = taken_at_rest(pictures)
    assert len(names) >= 15 and names[0] == f"{CALIBRATION}1"
    assert np.ptp(places, axis=0).max() > 0.8
    assert np.abs(r.q[ARM_Q] - CONFIG.work.home).max() < 0.02 and not r.cuts
    post = Capsule("post", (0.75, 0.28, 0.0), (0.75, 0.28, 2.0), 0.05, 0.05)
    r, fewer = calibrating(obstacles=(post,))
    finish(r, 240.0)
    assert len({name for name, _, _ in fewer}) < len(names)


@pytest.mark.long
def test_for_its_joints_the_arm_swings_its_elbow_too_and_looks_at_the_board_as_well():
    r, pictures = calibrating(command=intents.CalibrateArm)
    finish(r, 240.0)
    assert r.state.mode == "READY" and r.state.reason.code == "board_seen", r.state.reason
    names, places = taken_at_rest(pictures)
    assert len(names) >= 20 and names[0] == f"{ARM}1"
    assert np.ptp(places, axis=0).min() > 1.0, "every joint takes part"
    home = np.zeros(12)
    home[ARM_Q] = CONFIG.work.home
    ahead = MODEL.pose(home, MODEL.camera_id)
    board = ahead.translation + 0.45 * ahead.rotation[:, 2]
    for _, q, _ in pictures:
        camera = MODEL.pose(q, MODEL.camera_id)
        assert (board - camera.translation) @ camera.rotation[:, 2] > 0.95 * np.linalg.norm(board - camera.translation)
    assert np.abs(r.q[ARM_Q] - CONFIG.work.home).max() < 0.02 and not r.cuts


ASIDE = np.array(CONFIG.work.home) + [0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.15]


@pytest.mark.parametrize("arm", [CONFIG.work.home, ASIDE])
@pytest.mark.parametrize(("command", "name"), [(intents.CalibrateCamera, CALIBRATION), (intents.CalibrateArm, ARM)])
def test_without_the_board_in_the_first_picture_nothing_moves_and_what_was_seen_is_told(command, name, arm):
    cut_off = reasons.board_in_part(7, 12)
    r, pictures = calibrating(finding="unseen", command=command, arm=arm, reason=cut_off)
    finish(r, r.now + 5.0)
    assert r.state.mode == "READY" and r.state.reason == reasons.board_not_ahead(cut_off)
    assert {each for each, _, _ in pictures} == {f"{name}1"}
    assert not np.any(r.record) and (r.q[ARM_Q] == arm).all(), "nothing has moved"


def test_without_a_picture_nothing_moves_and_the_camera_is_named():
    r, pictures = calibrating(finding=lambda _: None)
    finish(r, r.now + CONFIG.work.close_up_timeout_s + 2.0)
    assert r.state.mode == "READY" and r.state.reason.code == "board_without_picture"
    assert dict(r.state.reason.values)["cause"].code == "no_close_up"
    assert pictures and not np.any(r.record), "nothing has moved"


def test_where_the_board_is_seen_from_another_posture_but_not_from_the_survey_posture_the_arm_stays_there():
    r, pictures = calibrating(finding=lambda r: "seen" if r.q[ARM_Q][6] > ASIDE[6] - 0.01 else "unseen", arm=ASIDE)
    finish(r, r.now + 30.0)
    assert r.state.mode == "READY" and r.state.reason.code == "board_not_ahead"
    names, places = taken_at_rest(pictures)
    assert names == [f"{CALIBRATION}1"] and np.abs(places[-1] - CONFIG.work.home).max() < 0.02
    assert np.abs(r.q[ARM_Q] - CONFIG.work.home).max() < 0.02


@pytest.mark.long
def test_a_board_that_only_the_first_picture_shows_is_told(monkeypatch):
    monkeypatch.setattr(movement, "BOARD", dataclasses.replace(BOARD, count=8))
    at_home = []
    r, pictures = calibrating(finding=lambda _: "unseen" if at_home else (at_home.append(1) or "seen"))
    finish(r, 120.0)
    assert r.state.mode == "READY" and r.state.reason.code == "board_unseen"
    names, _ = taken_at_rest(pictures)
    assert dict(r.state.reason.values)["places"] == len(names) >= 4
    assert np.abs(r.q[ARM_Q] - CONFIG.work.home).max() < 0.02


def test_the_row_is_looked_at_from_a_few_places_with_the_image_upright():
    r, pictures = calibrating(command=intents.CheckCamera)
    finish(r, 120.0)
    names = list(dict.fromkeys(name for name, _, _ in pictures))
    assert r.state.reason.code == "row_looked_at" and len(names) >= 6 and names[0].startswith(CHECK)
    assert np.abs([q[:3] for _, q, _ in pictures]).max() < 1e-3
    poses = [MODEL.pose(q, MODEL.camera_id) for _, q, _ in pictures]
    assert all(-pose.rotation[2, 1] > 0.85 for pose in poses), "the network knows upright pictures alone"
    assert all(MODEL.pose(q, MODEL.tool_id).translation[1] < 0.53 for _, q, _ in pictures), "clear of the canes"
    assert np.ptp([pose.translation for pose in poses], axis=0).max() > 0.2


def test_a_pause_ends_it_and_nothing_begins_it_again():
    r, pictures = calibrating()
    run_until(r, lambda s: len(pictures) > 3, 60.0)
    assert r.ask(intents.Pause(user="ada")).ok
    r.run(1.0)
    assert r.state.mode == "PAUSED" and r.state.interrupted == ""
    before = len(pictures)
    assert r.ask(intents.Resume(user="ada")).ok
    r.run(3.0)
    assert r.state.mode == "READY" and len(pictures) == before and np.abs(r.xi).max() < 1e-3


def test_it_needs_what_automatic_work_needs():
    r = robot()
    r.step()
    assert not r.ask(intents.CalibrateCamera(user="ada")).ok, "not before Arm"
    r.ask(intents.Arm(user="ada"))
    r.perception = False
    r.step()
    refused = r.ask(intents.CalibrateCamera(user="ada"))
    assert not refused.ok and refused.reason.code in ("process_silent", "process_gone")
