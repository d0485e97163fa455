"""The files of the calibrations: read at the next start, and refused where they are not of this robot."""

import math

import numpy as np
import pinocchio as pin
import pytest

from rolling_panda.calibration.file import (
    ARM_FILE,
    BASE_FILE,
    FILE,
    TIMING_FILE,
    Calibrated,
    load,
    load_robot,
    save,
    save_robot,
)
from rolling_panda.errors import ConfigError
from rolling_panda.messages.perception import CameraMount
from rolling_panda.messages.robot import ArmCalibration, BaseCalibration, FrameTiming, Intrinsics
from rolling_panda.model.robot import RobotModel, mount_pose, pose_message

MODEL = RobotModel()


def mount(turn=(0.01, -0.02, 0.005), shift=(0.003, 0.0, -0.004), **changes):
    pose = pose_message(MODEL.T_flange_camera * pin.SE3(pin.exp3(np.array(turn)), np.array(shift)))
    numbers = {"focal": 1.003, "made_at": 1.8e9, "views": 24, "pixels": 0.2, "angle_sd": 1e-5, "shift_sd": 2e-4}
    return CameraMount(position=pose.position, quat_xyzw=pose.quat_xyzw, **(numbers | changes))


def test_what_was_saved_is_read_at_the_next_start(tmp_path):
    assert load(tmp_path, "rp1", MODEL) is None
    save(tmp_path, "rp1", mount(views=3))
    save(tmp_path, "rp1", mount())
    assert load(tmp_path, "rp1", MODEL) == mount()


def check_refused(path, spoil, says, remedy, loaded):
    """A spoiled file is refused with what is wrong and what to do."""
    path.write_text(spoil(path.read_text()))
    with pytest.raises(ConfigError) as refused:
        loaded()
    assert says in str(refused.value) and remedy in str(refused.value), refused.value


@pytest.mark.parametrize(
    ("spoil", "says"),
    [
        (lambda text: text.replace('"rp1"', '"rp2"'), "'rp2'"),
        (lambda text: text.replace('robot = "rp1"', ""), "this is 'rp1'"),
        (lambda text: text.replace("focal = 1.003", "focal = 1.3"), "focal"),
        (lambda text: text.replace("focal = 1.003", "focus = 1.003"), "focus"),
        (lambda text: text.replace("views", "= ="), "no calibration"),
        (lambda text: text.replace("position = [", "position = [nan, "), "position"),
        (lambda text: "", "position"),
    ],
)
def test_a_file_of_another_robot_or_with_other_values_is_refused_with_what_to_do(tmp_path, spoil, says):
    save(tmp_path, "rp1", mount())
    check_refused(tmp_path / FILE, spoil, says, "calibrate the camera again", lambda: load(tmp_path, "rp1", MODEL))


@pytest.mark.parametrize("far", [{"turn": (0.0, 0.2, 0.0)}, {"shift": (0.06, 0.0, 0.0)}])
def test_a_camera_far_from_where_it_is_drawn_is_refused(tmp_path, far):
    save(tmp_path, "rp1", mount(**far))
    with pytest.raises(ConfigError, match="from where it is drawn"):
        load(tmp_path, "rp1", MODEL)


def test_a_mounted_camera_and_its_lens_are_used_until_they_are_taken_off():
    model, q = RobotModel(), np.zeros(12)
    drawn, flange = model.pose(q, model.camera_id), model.pose(q, model.flange_id)
    lens = Intrinsics(848, 480, 447.0, 447.0, 423.5, 239.5)
    model.mount_camera(mount())
    assert (flange * mount_pose(mount())).isApprox(model.pose(q, model.camera_id))
    assert math.isclose(model.lens(lens).fx, 1.003 * 447.0) and model.lens(lens).cx == 423.5
    model.mount_camera(None)
    assert model.pose(q, model.camera_id).isApprox(drawn) and model.lens(lens) == lens


DRAWN = MODEL.drive.sizes


def base(**changes):
    numbers = {"left": DRAWN.left * 0.99, "right": DRAWN.right * 0.991, "track": DRAWN.track * 1.01, "made_at": 1.8e9}
    return BaseCalibration(**(numbers | {"views": 33, "radius_sd": 0.001, "track_sd": 0.002} | changes))


def test_measured_wheels_are_read_at_the_next_start(tmp_path):
    assert load_robot(tmp_path, "rp1", DRAWN) == Calibrated()
    save_robot(tmp_path, "rp1", base(views=3))
    save_robot(tmp_path, "rp1", base())
    assert load_robot(tmp_path, "rp1", DRAWN) == Calibrated(base=base())
    assert load(tmp_path, "rp1", MODEL) is None, "a file of its own"


@pytest.mark.parametrize(
    ("spoil", "says"),
    [
        (lambda text: text.replace('"rp1"', '"rp2"'), "'rp2'"),
        (lambda text: text.replace("left = 0.1", "left = 0.2"), "left"),
        (lambda text: text.replace("track = 0.5", "track = nan # 0.5"), "track"),
        (lambda text: text.replace("views", "wiews"), "wiews"),
        (lambda text: "", "left"),
    ],
)
def test_a_file_of_other_wheels_is_refused_with_what_to_do(tmp_path, spoil, says):
    save_robot(tmp_path, "rp1", base())
    check_refused(
        tmp_path / BASE_FILE, spoil, says, "calibrate the base again", lambda: load_robot(tmp_path, "rp1", DRAWN)
    )


def test_wheels_far_from_those_drawn_or_from_each_other_are_refused(tmp_path):
    for far in ({"left": 0.1275, "right": 0.1275}, {"track": 0.4801}, {"left": DRAWN.left * 1.02}):
        save_robot(tmp_path, "rp1", base(**far))
        if far.get("left") == 0.1275:
            assert load_robot(tmp_path, "rp1", DRAWN).base is not None
            continue
        with pytest.raises(ConfigError, match="differ from those drawn"):
            load_robot(tmp_path, "rp1", DRAWN)


ARM = ArmCalibration(offsets=(0.0, 0.01, -0.02, 0.03, 0.0, -0.005, 0.0), made_at=1.8e9, views=25, pixels=0.1)


def test_the_joints_zeros_are_read_at_the_next_start_beside_the_wheels(tmp_path):
    save_robot(tmp_path, "rp1", base())
    save_robot(tmp_path, "rp1", ARM)
    assert load_robot(tmp_path, "rp1", DRAWN) == Calibrated(base(), ARM)


def test_the_camera_clocks_delay_is_read_at_the_next_start_and_one_that_cannot_be_is_refused(tmp_path):
    timing = FrameTiming(delay=0.038, made_at=1.8e9, views=14, delay_sd=0.002)
    save_robot(tmp_path, "rp1", ARM)
    save_robot(tmp_path, "rp1", timing)
    assert load_robot(tmp_path, "rp1", DRAWN) == Calibrated(arm=ARM, timing=timing)
    for old, new, says in (('"rp1"', '"rp2"', "'rp2'"), ("0.038", "0.38", "delay"), ("views", "wiews", "wiews")):
        save_robot(tmp_path, "rp1", timing)
        check_refused(
            tmp_path / TIMING_FILE,
            lambda text, old=old, new=new: text.replace(old, new),
            says,
            "use the next calibration that is offered",
            lambda: load_robot(tmp_path, "rp1", DRAWN),
        )


@pytest.mark.parametrize(
    ("spoil", "says"),
    [
        (lambda text: text.replace('"rp1"', '"rp2"'), "'rp2'"),
        (lambda text: text.replace("0.03", "0.036"), "offsets"),
        (lambda text: text.replace("0.03", "nan"), "offsets"),
        (lambda text: text.replace("[0.0,", "["), "offsets"),
        (lambda text: text.replace("views", "wiews"), "wiews"),
        (lambda text: "", "offsets"),
    ],
)
def test_a_file_of_another_arm_is_refused_with_what_to_do(tmp_path, spoil, says):
    save_robot(tmp_path, "rp1", ARM)
    check_refused(
        tmp_path / ARM_FILE, spoil, says, "calibrate the arm again", lambda: load_robot(tmp_path, "rp1", DRAWN)
    )
