"""The arm looks at the calibration's board from all around: the base stands still, each picture is taken at rest."""

import numpy as np
import pytest
from msgspec.structs import replace

from rolling_panda import commands as intents
from rolling_panda.messages.perception import ARM, CALIBRATION, CHECK, Capsule, CloseUpRequest
from rolling_panda.model.robot import ARM_Q, RobotModel
from tests.support.controller_at_work import CONFIG, finish, robot, run_until

MODEL = RobotModel()


def calibrating(finding="seen", command=intents.CalibrateCamera, **changes):
    """A robot that looks at the board, or at the row, whose pictures end like this."""
    r = robot(**changes)
    pictures = []

    def close_up(request: CloseUpRequest):
        pictures.append((request.point_id, r.q.copy(), r.xi.copy()))
        return replace(found(request), finding=finding)

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


@pytest.mark.long
def test_a_board_that_is_nowhere_is_told():
    r, _ = calibrating(finding="unseen")
    finish(r, 300.0)
    assert r.state.mode == "READY" and r.state.reason.code == "board_unseen"


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
