"""Zeros of the arm's joints by a board: found as they are, and refused where pictures or postures do not tell."""

import numpy as np
import pinocchio as pin
import pytest
from msgspec.structs import replace

from bridge.sim.camera.config import CameraConfig
from bridge.sim.camera.frame import survey_frame
from bridge.sim.camera.renderer import Camera
from bridge.sim.vineyard.config import VineyardConfig
from bridge.sim.vineyard.grow import grow
from bridge.sim.vineyard.row import Row
from bridge.sim.world.config import CALM
from bridge.sim.world.errors import draw_errors
from controller.config import ControllerConfig
from controller.work.camera_views import JOINTS, view_postures
from perception.calibration.board_view import BoardView
from perception.calibration.camera import CameraCalibration
from perception.calibration.hand_eye import CalibrationError, calibrate
from perception.calibration.robot import RobotCalibrator
from perception.config import PerceptionConfig
from perception.pipeline import Perception
from perception.segmentation.segmenter import choose_segmenter
from rolling_panda import messages as m
from rolling_panda.calibration.board import HEIGHT, WIDTH, corners
from rolling_panda.commands import UseCamera
from rolling_panda.messages.perception import ARM, CameraMount
from rolling_panda.messages.robot import NO_OFFSETS
from rolling_panda.model.robot import ARM_Q, RobotModel, configuration, mount_pose, turn_and_shift

MODEL = RobotModel()
HOME = np.array(ControllerConfig().work.home)
POSTURES = np.stack(view_postures(MODEL, HOME, JOINTS))
LENS = np.array([[447.0, 0.0, 423.5], [0.0, 447.0, 239.5], [0.0, 0.0, 1.0]])
OFF = np.radians([0.4, -0.5, 0.3, 0.6, -0.4, 0.2, -0.3])
MEASURED = slice(1, 6)


def at_home():
    return configuration(m.PlanarPose(0.0, 0.0, 0.0), (0.0, 0.0, *HOME.tolist()))


def board_in_odom():
    ahead = MODEL.pose(at_home(), MODEL.camera_id)
    return ahead * pin.SE3(np.eye(3), np.array([-WIDTH / 2, -HEIGHT / 2, 0.45]))


def seen(postures=POSTURES, off=OFF, noise=0.08, seed=1, base=None, camera=None):
    """Pictures from these postures, by encoders that are off, of a camera that is not quite where it is drawn."""
    rng, board, views = np.random.default_rng(seed), board_in_odom(), []
    mounted = pin.SE3(pin.exp3(np.array([0.005, -0.008, 0.006])), np.array([0.003, -0.004, 0.002]))
    for number, posture in enumerate(postures):
        q = at_home()
        q[ARM_Q] = posture - off
        T_camera_board = (MODEL.pose(q, MODEL.camera_id) * mounted).actInv(board)
        there = corners() @ T_camera_board.rotation.T + T_camera_board.translation
        pixels = there[:, :2] / there[:, 2:] * 447.0 + LENS[:2, 2]
        pixels = pixels + noise * rng.standard_normal(pixels.shape)
        q[ARM_Q] = posture
        if base is not None:
            q[:3] = base(number)
        views.append(BoardView(corners(), pixels, LENS, MODEL.pose(q, MODEL.flange_id), q))
    return views


@pytest.mark.long
def test_offsets_of_joints_2_to_6_are_found_and_those_of_1_and_7_left_at_zero():
    for seed in (1, 2, 3):
        found = calibrate(seen(seed=seed), RobotModel())
        wrong = np.degrees(found.offsets - OFF)
        assert np.abs(wrong[MEASURED]).max() < max(0.01, 4.0 * np.degrees(found.offset_sd))
        assert np.degrees(found.offset_sd) < 0.01 and found.pixels < 0.2
        assert found.offsets[0] == 0.0 and found.offsets[6] == 0.0


def refused(views):
    with pytest.raises(CalibrationError) as error:
        calibrate(views, RobotModel())
    return error.value.reason.code


@pytest.mark.long
def test_what_does_not_tell_the_joints_is_refused_with_the_reason():
    assert refused(seen(POSTURES[:9])) == "calibration_few_views"
    assert refused(seen(base=lambda number: (0.001 * number, 0.0, 0.0))) == "calibration_base_moved"
    wrist = np.tile(HOME, (14, 1))
    wrist[:, 6] += np.linspace(-0.6, 0.6, 14)
    assert refused(seen(wrist)) == "calibration_axes_parallel"
    wrist[:, 4:6] += 0.3 * np.random.default_rng(1).standard_normal((14, 2))
    assert refused(seen(wrist, off=0.0 * OFF)) == "arm_postures_alike", "nothing but the wrist has moved"
    assert refused(seen(noise=3.0)) == "calibration_error_high"
    rng = np.random.default_rng(2)
    shaky = [
        BoardView(view.points, view.pixels + 1.0 * rng.standard_normal(2), LENS, view.T_odom_flange, view.q)
        for view in seen(POSTURES[:10])
    ]
    assert refused(shaky) == "arm_unsure"


def photographed(world, seed=3, used=NO_OFFSETS, count=16, board=True):
    """Frames of a robot whose arm and camera have the errors of a world, with these offsets in use."""
    camera, errors = Camera(CameraConfig(board=board, calibration_angle=0.0), seed, world), draw_errors(world, seed)
    frames = [
        survey_frame(camera, Row(()), MODEL, k, arm=tuple(p.tolist()), offsets=errors.joint_offset - np.array(used))
        for k, p in enumerate(POSTURES[:count], 1)
    ]
    frames = [replace(frame, point_id=f"{ARM}{k}", number=k, joint_offsets=used) for k, frame in enumerate(frames, 1)]
    return frames, errors


@pytest.mark.long
def test_pictures_give_offers_for_arm_and_camera_and_a_second_round_finds_what_is_left():
    world = replace(CALM, joint_offset=np.radians(0.5), hand_eye_angle=0.005, hand_eye_shift=0.003, focal_error=0.003)
    calibrator = RobotCalibrator(RobotModel(), clock=lambda: 1.8e9)
    frames, errors = photographed(world)
    findings = [calibrator.look(frame).finding for frame in frames]
    assert findings.count("seen") >= 14
    offer = calibrator.state.arm
    assert calibrator.state.arm_refused is None and offer.made_at == 1.8e9 and offer.views >= 14
    assert np.abs(np.degrees(np.array(offer.offsets) - errors.joint_offset))[MEASURED].max() < 0.01
    # The camera takes up what joint 7 is off by: it is where its pictures are, on the arm as it is told.
    assert calibrator.mount.joint_offsets == offer.offsets and calibrator.mount.made_at == offer.made_at
    last = pin.SE3(pin.exp3(np.array([0.0, 0.0, errors.joint_offset[6]])), np.zeros(3)).inverse()
    true = last * MODEL.T_flange_camera * pin.SE3(errors.hand_eye, errors.hand_eye_shift)
    turn, shift = turn_and_shift(true, mount_pose(calibrator.mount))
    assert turn < 0.001 and shift < 0.001
    # What is found is added to what is in use.
    used = tuple((0.5 * np.array(offer.offsets)).tolist())
    again, _ = photographed(world, used=used, count=12)
    for frame in again:
        calibrator.look(frame)
    assert np.abs(np.degrees(np.array(calibrator.state.arm.offsets) - errors.joint_offset))[MEASURED].max() < 0.02
    calibrator.look(frames[0])
    assert calibrator.state.arm is None and calibrator.state.arm_views == 1 and calibrator.mount is None
    assert calibrator.state.arm_refused.code == "calibration_few_views"


@pytest.mark.long
def test_offsets_beyond_belief_are_refused_and_so_is_a_picture_without_a_board():
    calibrator = RobotCalibrator(RobotModel(), clock=lambda: 1.8e9)
    frames, _ = photographed(replace(CALM, joint_offset=np.radians(2.0)), count=12)
    for frame in frames:
        calibrator.look(frame)
    assert calibrator.state.arm is None and calibrator.state.arm_refused.code == "arm_far"
    blank, _ = photographed(CALM, count=1, board=False)
    result = calibrator.look(replace(blank[0], point_id=f"{ARM}20"))
    assert result.finding == "unseen" and result.reason.code == "board_not_in_picture"
    assert calibrator.state.arm_views == 12


NEW = (0.0, 0.01, -0.005, 0.008, 0.0, 0.002, 0.0)


def mount(offsets, made_at=1.8e9):
    pose = MODEL.T_flange_camera
    x, y, z = pose.translation.tolist()
    return CameraMount(
        position=(x, y, z),
        quat_xyzw=tuple(pin.Quaternion(pose.rotation).coeffs().tolist()),
        made_at=made_at,
        joint_offsets=offsets,
    )


def test_the_camera_that_was_measured_with_the_arm_is_offered_once_the_arm_is_used_and_an_older_one_is_warned_of():
    kept = []
    camera = CameraCalibration(RobotModel(), mount(NO_OFFSETS), kept.append, clock=lambda: 1.8e9)
    assert not camera.follow(NO_OFFSETS) and camera.state.warning is None
    camera.measured_with_arm(mount(NEW, 1.8e9 + 5.0))
    assert camera.state.offer is None, "the arm is not in use yet"
    assert not camera.use(1.8e9 + 5.0).ok
    assert camera.follow(NEW), "what was seen before is elsewhere now"
    assert camera.state.warning.code == "camera_of_other_arm" and camera.state.offer == mount(NEW, 1.8e9 + 5.0)
    assert camera.use(1.8e9 + 5.0).ok and kept == [mount(NEW, 1.8e9 + 5.0)]
    assert camera.state.warning is None and not camera.follow(NEW)
    camera.measured_with_arm(mount(NO_OFFSETS))
    assert camera.follow(tuple(2.0 * each for each in NEW)) and camera.state.offer is None, "of another arm"


def test_after_a_restart_a_camera_of_another_arm_is_warned_of_and_nothing_is_offered():
    camera = CameraCalibration(RobotModel(), mount(NO_OFFSETS), lambda each: None, clock=lambda: 1.8e9)
    assert not camera.follow(NEW), "nothing was seen before"
    assert camera.state.warning.code == "camera_of_other_arm" and camera.state.offer is None
    other = CameraCalibration(RobotModel(), mount(NEW), lambda each: None, clock=lambda: 1.8e9)
    other.follow(NEW)
    assert other.state.warning is None
    drawn = CameraCalibration(RobotModel(), None, lambda each: None, clock=lambda: 1.8e9)
    drawn.follow(NEW)
    assert drawn.state.warning is None, "the drawing is of no arm"


@pytest.mark.long
def test_points_that_were_seen_by_other_angles_are_withdrawn_and_found_anew():
    row, camera = grow(VineyardConfig(), 2002), Camera(CameraConfig(), 2002)
    seeing = Perception(PerceptionConfig(), choose_segmenter("labels", None))
    for number in range(1, 5):
        before = seeing.process(survey_frame(camera, row, MODEL, number)).points
    frame = survey_frame(camera, row, MODEL, 5)
    own = replace(frame, joint_offsets=NEW)
    asked = seeing.check_close_up(replace(own, point_id=before[0].point_id, number=1))
    assert asked.reason.code == "point_unknown_to_perception", "it is elsewhere by the new angles"
    after = seeing.process(own).points
    assert before and {reason.code for reason in seeing.withdrawn} == {"withdrawn_for_calibration"}
    assert len(seeing.withdrawn) == len(before) and not {p.point_id for p in before} & {p.point_id for p in after}
    assert not seeing.answer(UseCamera(user="ada", made_at=1.0)).ok
    seeing.process(replace(survey_frame(camera, row, MODEL, 6), joint_offsets=NEW))
    assert not seeing.withdrawn
