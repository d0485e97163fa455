"""The file that keeps the camera's calibration: `camera.toml` in the robot's state folder."""

import tomllib
from pathlib import Path

import msgspec
import numpy as np

from rolling_panda.errors import ConfigError
from rolling_panda.messages.perception import CameraMount
from rolling_panda.model.robot import RobotModel, mount_pose, turn_and_shift
from rolling_panda.runtime.state_folder import replace_durably

FILE = "camera.toml"
#: A calibration that places the camera farther from the drawing than this (rad, m) is of another camera or bracket.
FARTHEST_TURN, FARTHEST_SHIFT = 0.15, 0.05
#: A calibration is old from this age on (s): work shakes brackets loose.
OLD_S = 90 * 86400.0
_HEAD = "# Where the camera is on the arm's flange. Without this file, perception takes it to be where it is drawn."
_REMEDY = "calibrate the camera again, or remove the file"


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
    try:
        document = tomllib.loads(path.read_text(encoding="utf-8"))
        owner = document.pop("robot", "")
        mount = msgspec.convert(document, CameraMount)
    except FileNotFoundError:
        return None
    except (OSError, ValueError) as error:
        raise ConfigError(f"{path} is no calibration of a camera: {error}; {_REMEDY}") from error
    if owner != robot_id:
        raise ConfigError(f"{path} is of the robot {owner!r}, and this is {robot_id!r}; {_REMEDY}")
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
    # Strings, numbers and lists of numbers are written alike in JSON and in TOML.
    values = {"robot": robot_id} | msgspec.structs.asdict(mount)
    lines = [f"{name} = {msgspec.json.encode(value).decode()}" for name, value in values.items()]
    replace_durably(folder / FILE, "\n".join((_HEAD, *lines, "")).encode())
