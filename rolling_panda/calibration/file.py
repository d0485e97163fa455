"""The files that keep the calibrations, in the robot's state folder: of the camera, base, arm and camera clock."""

import tomllib
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeVar

import msgspec
import numpy as np

from rolling_panda.errors import ConfigError
from rolling_panda.messages.perception import CameraMount
from rolling_panda.messages.robot import AnyCalibration, ArmCalibration, BaseCalibration, FrameTiming
from rolling_panda.model.differential_drive import WheelSizes
from rolling_panda.model.robot import RobotModel, mount_pose, turn_and_shift
from rolling_panda.runtime.state_folder import replace_durably

FILE, BASE_FILE, ARM_FILE, TIMING_FILE = "camera.toml", "base.toml", "arm.toml", "timing.toml"
#: A calibration that places the camera farther from the drawing than this (rad, m) is of another camera or bracket.
FARTHEST_TURN, FARTHEST_SHIFT = 0.15, 0.05
#: A day, and the age from which on a calibration is old (s): work shakes brackets loose, tyres wear, arms are hit.
DAY_S = 86400.0
OLD_S = 90 * DAY_S
#: Largest difference of radii and track from those drawn, and of the radii from each other (shares).
FARTHEST_WHEELS, FARTHEST_APART = 0.05, 0.02
_HEAD = "# Where the camera is on the arm's flange. Without this file, perception takes it to be where it is drawn."
_BASE_HEAD = "# Sizes of the base's wheels (m). Without this file, the bridge takes them to be as drawn."
_ARM_HEAD = "# Offsets of the arm's encoders (rad). Without this file, the bridge takes them to be zero."
_TIMING_HEAD = "# Delay of the camera's pictures (s). Without this file, the bridge takes it to be as configured."
_REMEDY = "calibrate the camera again, or remove the file"
_BASE_REMEDY = "calibrate the base again, or remove the file"
_ARM_REMEDY = "calibrate the arm again, or remove the file"
_TIMING_REMEDY = "remove the file, and use the next calibration that is offered"

#: File of each calibration of the robot, and its first line.
_KEPT_IN = {
    BaseCalibration: (BASE_FILE, _BASE_HEAD),
    ArmCalibration: (ARM_FILE, _ARM_HEAD),
    FrameTiming: (TIMING_FILE, _TIMING_HEAD),
}

Kept = TypeVar("Kept")


@dataclass(frozen=True)
class Calibrated:
    """Calibrations of the robot itself, as the bridge uses them; None takes the part to be as drawn."""

    base: BaseCalibration | None = None
    arm: ArmCalibration | None = None
    timing: FrameTiming | None = None


def load(folder: Path, robot_id: str, drawn: RobotModel) -> CameraMount | None:
    """The calibration of a robot; None where none was made.

    Args:
        folder: State folder of the robot.
        robot_id: Its id.
        drawn: A model with the camera as drawn.

    Raises:
        ConfigError: The file cannot be read, is of another robot, or its values are out of range.
    """
    path = folder / FILE
    mount = _read(path, robot_id, CameraMount, "a camera", _REMEDY)
    if mount is None:
        return None
    turn, shift = turn_and_shift(drawn.T_flange_camera, mount_pose(mount))
    if turn > FARTHEST_TURN or shift > FARTHEST_SHIFT:
        raise ConfigError(
            f"{path} places the camera {np.degrees(turn):.1f} degrees and {1e3 * shift:.0f} mm from where it is drawn; "
            f"at most {np.degrees(FARTHEST_TURN):.1f} degrees and {1e3 * FARTHEST_SHIFT:.0f} mm are allowed; {_REMEDY}"
        )
    return mount


def save(folder: Path, robot_id: str, mount: CameraMount) -> None:
    """Replace the calibration of a robot; an interruption leaves the old one or the new.

    Raises:
        OSError: The file is not on disk.
    """
    _write(folder / FILE, robot_id, mount, _HEAD)


def load_robot(folder: Path, robot_id: str, drawn: WheelSizes) -> Calibrated:
    """The calibrations of a robot's wheels, joints and camera clock.

    Args:
        folder: State folder of the robot.
        robot_id: Its id.
        drawn: The wheels as drawn.

    Raises:
        ConfigError: A file cannot be read, is of another robot, or its values are out of range.
    """
    path = folder / BASE_FILE
    base = _read(path, robot_id, BaseCalibration, "a base", _BASE_REMEDY)
    if base is not None and not plausible(base, drawn):
        raise ConfigError(
            f"{path} has wheels that differ from those drawn by more than {100 * FARTHEST_WHEELS:.0f} %, or from each "
            f"other by more than {100 * FARTHEST_APART:.0f} %; {_BASE_REMEDY}"
        )
    arm = _read(folder / ARM_FILE, robot_id, ArmCalibration, "an arm", _ARM_REMEDY)
    timing = _read(folder / TIMING_FILE, robot_id, FrameTiming, "a camera's clock", _TIMING_REMEDY)
    return Calibrated(base, arm, timing)


def save_robot(folder: Path, robot_id: str, calibration: AnyCalibration) -> None:
    """Replace one of the robot's calibrations; an interruption leaves the old one or the new.

    Raises:
        OSError: The file is not on disk.
    """
    path, head = _KEPT_IN[type(calibration)]
    _write(folder / path, robot_id, calibration, head)


def plausible(base: BaseCalibration, drawn: WheelSizes) -> bool:
    """Whether wheels can have these sizes."""
    shares = base.left / drawn.left, base.right / drawn.right, base.track / drawn.track
    near = max(abs(share - 1.0) for share in shares) <= FARTHEST_WHEELS
    return near and abs(base.right / base.left - 1.0) <= FARTHEST_APART


def _read(path: Path, robot_id: str, kind: type[Kept], what: str, remedy: str) -> Kept | None:
    """The calibration in a file; None without one.

    Raises:
        ConfigError: It cannot be read, or is of another robot.
    """
    try:
        document = tomllib.loads(path.read_text(encoding="utf-8"))
        owner = document.pop("robot", "")
        calibration = msgspec.convert(document, kind)
    except FileNotFoundError:
        return None
    except (OSError, ValueError) as error:
        raise ConfigError(f"{path} is no calibration of {what}: {error}; {remedy}") from error
    if owner != robot_id:
        raise ConfigError(f"{path} is of the robot {owner!r}, and this is {robot_id!r}; {remedy}")
    return calibration


def _write(path: Path, robot_id: str, calibration: Any, head: str) -> None:
    # Strings, numbers and lists of numbers are written alike in JSON and in TOML.
    values = {"robot": robot_id} | msgspec.structs.asdict(calibration)
    lines = [f"{name} = {msgspec.json.encode(value).decode()}" for name, value in values.items()]
    replace_durably(path, "\n".join((head, *lines, "")).encode())
