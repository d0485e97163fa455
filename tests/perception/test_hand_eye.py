"""The camera on the flange from pictures of a board: found from noisy views, and refused where it cannot be."""

import dataclasses

import numpy as np
import pinocchio as pin
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from controller.config import ControllerConfig
from controller.work.camera_views import view_postures
from perception.calibration.board_view import BoardView
from perception.calibration.hand_eye import FEWEST, CalibrationError, calibrate
from rolling_panda.calibration.board import corners
from rolling_panda.model.robot import ARM_Q, RobotModel, turn_and_shift
from rolling_panda.reasons import text_of

MODEL = RobotModel()
HOME = np.array(ControllerConfig().work.home)
POSTURES = view_postures(MODEL, HOME)
LENS = np.array([[447.0, 0.0, 423.5], [0.0, 447.0, 239.5], [0.0, 0.0, 1.0]])
#: The board 0.45 m before the camera in the survey posture.
T_ODOM_BOARD = pin.SE3(np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]]), np.array([0.38, 0.45, 1.14]))


def flange(posture):
    q = np.zeros(12)
    q[ARM_Q] = posture
    return MODEL.pose(q, MODEL.flange_id)


def seen(T_flange_camera, postures=POSTURES, noise=0.0, focal=1.0, seed=0):
    """What a camera that is mounted like this sees of the board."""
    rng, points, views = np.random.default_rng(seed), corners(), []
    for posture in postures:
        T_odom_flange = flange(posture)
        T_camera_board = (T_odom_flange * T_flange_camera).actInv(T_ODOM_BOARD)
        place = points @ T_camera_board.rotation.T + T_camera_board.translation
        pixels = focal * LENS[0, 0] * place[:, :2] / place[:, 2:] + LENS[:2, 2]
        pixels = pixels + noise * rng.standard_normal(pixels.shape)
        views.append(BoardView(points, pixels, LENS, T_odom_flange, np.zeros(12)))
    return views


def mounted(turn, shift):
    """The camera turned (rad) and shifted (m) against the drawing."""
    return MODEL.T_flange_camera * pin.SE3(pin.exp3(np.array(turn)), np.array(shift))


angles = st.tuples(*[st.floats(-0.08, 0.08)] * 3)
shifts = st.tuples(*[st.floats(-0.02, 0.02)] * 3)


@pytest.mark.long
@settings(max_examples=12, deadline=None)
@given(angles, shifts, st.floats(0.99, 1.01), st.floats(0.0, 0.25), st.integers(0, 1000))
def test_a_camera_is_found_wherever_it_is_mounted(turn, shift, focal, noise, seed):
    true = mounted(turn, shift)
    found = calibrate(seen(true, noise=noise, focal=focal, seed=seed))
    off = true.actInv(found.T_flange_camera)
    turned = np.abs(pin.log3(off.rotation))
    # Where it looks is what matters. About its own axis it is known less well, since the views are near square.
    assert turned[:2].max() < 2e-5 + 4e-3 * noise and turned[2] < 2e-5 + 2e-2 * noise
    assert np.linalg.norm(off.translation) < 2e-5 + 1e-2 * noise
    assert found.focal == pytest.approx(focal, abs=1e-4 + 2e-2 * noise)
    assert found.pixels == pytest.approx(np.sqrt(2) * noise, abs=0.02 + 0.1 * noise)


@pytest.mark.long
def test_the_standard_deviations_are_those_of_the_errors():
    true, errors, told = mounted((0.01, -0.01, 0.005), (0.003, 0.0, -0.004)), [], []
    for seed in range(20):
        found = calibrate(seen(true, noise=0.2, seed=seed))
        off = true.actInv(found.T_flange_camera)
        errors.append([*pin.log3(off.rotation), *off.translation])
        told.append((found.angle_sd, found.shift_sd))
    real = np.std(errors, axis=0)
    assert np.mean([angle for angle, _ in told]) == pytest.approx(max(*real[:2], real[2] / 4.0), rel=0.5)
    assert np.mean([shift for _, shift in told]) == pytest.approx(real[3:].max(), rel=0.5)


def test_encoders_with_another_zero_are_told_by_larger_deviations():
    rng, true = np.random.default_rng(1), mounted((0.01, 0.0, 0.0), (0.0, 0.0, 0.0))
    offset = np.radians(0.1) * rng.standard_normal(7)
    views = seen(true, [posture + offset for posture in POSTURES], noise=0.1)
    askew = [dataclasses.replace(v, T_odom_flange=flange(p)) for v, p in zip(views, POSTURES, strict=True)]
    exact, found = calibrate(views), calibrate(askew)
    assert found.pixels > 2 * exact.pixels and found.angle_sd > 2 * exact.angle_sd
    assert np.abs(pin.log3(true.actInv(found.T_flange_camera).rotation)[:2]).max() < 0.004


def test_one_picture_of_a_board_that_was_pushed_does_not_spoil_the_others():
    true = mounted((0.01, 0.01, 0.0), (0.0, 0.002, 0.0))
    views = seen(true, noise=0.1)
    views[4] = dataclasses.replace(views[4], pixels=views[4].pixels + 15.0)
    found = calibrate(views)
    assert found.views == len(views) - 1 and turn_and_shift(true, found.T_flange_camera)[0] < 1.5e-3


def test_what_cannot_be_solved_is_refused_with_the_reason():
    true = mounted((0.01, 0.0, 0.0), (0.0, 0.0, 0.0))
    views = seen(true, noise=0.1)
    # The last joint alone turns the camera about one axis.
    one_axis = [HOME + [0, 0, 0, 0, 0, 0, angle] for angle in np.linspace(-0.6, 0.6, 14)]
    rng = np.random.default_rng(3)
    shaken = [dataclasses.replace(v, pixels=v.pixels + 2.5 * rng.standard_normal(v.pixels.shape)) for v in views]
    rolled = [dataclasses.replace(v, q=np.array([0.001 * k, *[0.0] * 11])) for k, v in enumerate(views)]
    for refused, code in (
        (views[: FEWEST - 1], "calibration_few_views"),
        ([], "calibration_few_views"),
        (seen(true, one_axis), "calibration_axes_parallel"),
        (seen(true, [HOME] * 12), "calibration_axes_parallel"),
        (shaken, "calibration_error_high"),
        (rolled, "calibration_base_moved"),
    ):
        with pytest.raises(CalibrationError) as error:
            calibrate(refused)
        assert error.value.reason.code == code and text_of(error.value.reason) == str(error.value)


def test_views_that_leave_it_uncertain_are_refused():
    # Twelve blurred pictures from nearly the same place.
    near = [HOME + 0.12 * np.array([np.sin(k), np.cos(k), 0, 0, np.sin(2 * k), 0, np.cos(2 * k)]) for k in range(12)]
    with pytest.raises(CalibrationError) as error:
        calibrate(seen(mounted((0.0, 0.0, 0.0), (0.0, 0.0, 0.0)), near, noise=1.0))
    assert error.value.reason.code == "calibration_unsure"


def test_the_postures_are_in_reach_and_turn_the_camera_about_two_axes():
    limits = MODEL.limits.lower[ARM_Q], MODEL.limits.upper[ARM_Q]
    assert len(POSTURES) >= 20
    for posture in POSTURES:
        assert (posture > limits[0] + 0.05).all() and (posture < limits[1] - 0.05).all()
        q = np.zeros(12)
        q[ARM_Q] = posture
        assert MODEL.pose(q, MODEL.tool_id).translation[1] < 0.45 - 0.1
        place = T_ODOM_BOARD * pin.SE3(np.eye(3), np.array([0.12, 0.09, 0.0]))
        u, v, z = MODEL.pose(q, MODEL.camera_id).actInv(place).translation
        assert abs(u) < 0.1 * z and abs(v) < 0.1 * z
