"""Wheels by a board: found as they are, and refused where pictures or motions do not tell."""

import cv2
import numpy as np
import pinocchio as pin
import pytest
from msgspec.structs import replace

from bridge.sim.camera.config import CameraConfig
from bridge.sim.camera.frame import camera_frame, camera_pose, survey_place
from bridge.sim.camera.renderer import Camera
from bridge.sim.vineyard.row import Row
from controller.work.base_views import ROUNDS
from perception.calibration.base import BaseView, measure_wheels
from perception.calibration.board_view import BoardView
from perception.calibration.hand_eye import CalibrationError
from perception.calibration.robot import RobotCalibrator
from rolling_panda import messages as m
from rolling_panda.calibration.board import corners
from rolling_panda.messages.perception import BASE
from rolling_panda.model.differential_drive import WheelSizes, arc
from rolling_panda.model.robot import RobotModel, configuration

MODEL = RobotModel()
DRAWN = MODEL.drive.sizes
WORN = WheelSizes(DRAWN.left * 0.987, DRAWN.right * 0.989, DRAWN.track * 1.014)
_, SURVEY = survey_place()
T_BASE_CAMERA = MODEL.pose(configuration(m.PlanarPose(0.0, 0.0, 0.0), SURVEY), MODEL.camera_id)
LENS = np.array([[447.0, 0.0, 423.5], [0.0, 447.0, 239.5], [0.0, 0.0, 1.0]])
MOUNTED = pin.SE3.Identity()
BOARD = pin.SE3(np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]]), np.array([0.38, 0.45, 1.14]))


def legs(rounds=ROUNDS):
    """Ways (m) and turns (rad) between the pictures, as the odometry has them."""
    out = []
    for places, headings in rounds:
        out += [(way, 0.0) for way in np.diff([0.0, *places])]
        out += [(0.0, turn) for turn in np.radians(np.diff([0.0, *headings]))]
    return out


def driven(moves, true=WORN, used=DRAWN, slip=0.0, seed=1, camera=MOUNTED):
    """Pictures of a robot whose wheels are `true` after each of the moves that its odometry, with `used`, shows."""
    rng = np.random.default_rng(seed)
    place, shown, wheels = (0.0, 0.0, 0.0), (0.0, 0.0, 0.0), np.zeros(2)
    views = []
    for number, (way, turn) in enumerate([(0.0, 0.0), *moves]):
        angles = np.linalg.solve(used.motion(), [way, turn])
        rolled = angles * (1.0 + slip * rng.standard_normal(2))
        place, shown = arc(place, *(true.motion() @ rolled).tolist()), arc(shown, way, turn)
        wheels = wheels + angles
        # Its ground is not level.
        tilt = pin.exp3(np.array([*(0.01 * rng.standard_normal(2)), 0.0]))
        base = pin.SE3(pin.exp3(np.array([0.0, 0.0, place[2]])) @ tilt, np.array([place[0], place[1], 0.003]))
        seen = (base * T_BASE_CAMERA * camera).actInv(BOARD)
        pixels, _ = cv2.projectPoints(corners(), pin.log3(seen.rotation), seen.translation, LENS, None)
        pixels = pixels.reshape(-1, 2) + 0.05 * rng.standard_normal((len(corners()), 2))
        board = BoardView(corners(), pixels, LENS, None, np.array(shown))
        views.append(BaseView(board, T_BASE_CAMERA, wheels, 5.0 * number))
    return views


def errors(fit, true=WORN):
    """Of radius, difference of the radii and track (shares)."""
    sizes = fit.sizes
    radius = (sizes.left + sizes.right) / (true.left + true.right) - 1.0
    return np.array([radius, sizes.right / sizes.left - true.right / true.left, sizes.track / true.track - 1.0])


@pytest.mark.long
def test_wheels_are_found_whatever_the_camera_is_mounted_like_and_the_ground_is_like():
    misplaced = pin.SE3(pin.exp3(np.array([0.01, -0.008, 0.006])), np.array([0.006, -0.004, 0.005]))
    for seed, camera in ((1, MOUNTED), (2, misplaced)):
        fit = measure_wheels(driven(legs(), seed=seed, camera=camera), DRAWN, DRAWN)
        off, sd = errors(fit), np.array([fit.radius_sd, fit.apart_sd, fit.track_sd])
        assert np.all(np.abs(off) < 3.0 * sd) and np.all(sd < 0.003), (off, sd)
        assert np.abs(off).max() < 0.003 and fit.slip < 0.003 and fit.views == 33


@pytest.mark.long
def test_a_second_calibration_begins_with_the_wheels_of_the_first():
    fit = measure_wheels(driven(legs(), used=WORN), WORN, DRAWN)
    assert np.abs(errors(fit)).max() < 0.003


def refused(views, used=DRAWN):
    with pytest.raises(CalibrationError) as error:
        measure_wheels(views, used, DRAWN)
    return error.value.reason.code


@pytest.mark.long
def test_what_does_not_tell_the_wheels_is_refused_with_the_reason():
    straight = [(0.25, 0.0), (-0.5, 0.0), (0.25, 0.0)] * 5
    turns = [(0.0, -0.4), (0.0, 0.6), (0.0, -0.2)] * 5
    assert refused(driven(legs())[:9]) == "base_few_views"
    assert refused(driven(straight)) == "base_moved_little", "without turns"
    assert refused(driven(turns)) != "", "without drives"
    assert refused(driven([(0.02, 0.0), (-0.02, 0.1), (0.0, -0.1)] * 5)) == "base_moved_little"
    assert refused(driven(legs(), slip=0.05)) == "base_slipped"
    small = WheelSizes(DRAWN.left * 0.93, DRAWN.right * 0.93, DRAWN.track)
    assert refused(driven(legs(), true=small)) == "base_implausible"


@pytest.mark.long
def test_a_clock_that_jumps_and_a_board_that_moves_are_refused():
    views = driven(legs())
    late, early = list(views), list(views)
    late[20] = BaseView(views[20].board, views[20].T_base_camera, views[20].wheels, views[20].stamp + 3600.0)
    early[20] = BaseView(views[20].board, views[20].T_base_camera, views[20].wheels, views[5].stamp)
    assert refused(late) == refused(early) == "base_clock_jumped"
    moved = [*views[:16], *driven(legs(), camera=pin.SE3(np.eye(3), np.array([0.05, 0.0, 0.0])))[16:]]
    assert refused(moved) in ("base_slipped", "base_unsure")


@pytest.mark.long
def test_pictures_give_an_offer_and_a_new_round_begins_anew():
    camera = Camera(replace(CameraConfig(), board=True, width=848, height=480), 5)
    calibrator = RobotCalibrator(MODEL, clock=lambda: 1.8e9)
    place, shown, wheels = (0.0, 0.0, 0.0), (0.0, 0.0, 0.0), np.zeros(2)
    frames = []
    for number, (way, turn) in enumerate([(0.0, 0.0), *legs(ROUNDS[:2])], 1):
        angles = np.linalg.solve(DRAWN.motion(), [way, turn])
        place, shown, wheels = arc(place, *(WORN.motion() @ angles).tolist()), arc(shown, way, turn), wheels + angles
        T_world_camera = camera_pose(MODEL, m.PlanarPose(*place), SURVEY)
        frame = camera_frame(
            camera.render(Row(()), T_world_camera, number), camera, m.PlanarPose(*shown), SURVEY, number
        )
        position = (*wheels.tolist(), *SURVEY[2:])
        frames.append(replace(frame, point_id=f"{BASE}{number}", number=number, position=position))
    results = [calibrator.look(frame) for frame in frames]
    assert [result.finding for result in results].count("seen") >= 15
    state = calibrator.state
    assert state.base is not None and state.base_refused is None and state.base.made_at == 1.8e9
    offered = WheelSizes(state.base.left, state.base.right, state.base.track)
    assert abs((offered.left + offered.right) / (WORN.left + WORN.right) - 1.0) < 0.003
    assert abs(offered.track / WORN.track - 1.0) < 0.006
    calibrator.look(frames[0])
    assert calibrator.state.base is None and calibrator.state.base_views == 1
    assert calibrator.state.base_refused.code == "base_few_views"
    blank = Camera(CameraConfig(), 5)
    base, position = survey_place()
    frame = camera_frame(blank.render(Row(()), camera_pose(MODEL, base, position), 1), blank, base, position, 1)
    assert calibrator.look(replace(frame, point_id=f"{BASE}2")).finding == "unseen"
    assert calibrator.state.base_views == 1
