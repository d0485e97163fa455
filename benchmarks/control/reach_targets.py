"""Targets of `bench reach`: read from a file, or drawn from a seed."""

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Literal

import msgspec
import numpy as np
import pinocchio as pin
from msgspec import Meta, Struct

from benchmarks.control.arm_ik import ArmIk
from rolling_panda.errors import InputError
from rolling_panda.messages.supervision import ArmAngles
from rolling_panda.model.differential_drive import Array
from rolling_panda.model.robot import ARM_Q, RobotModel

Number = Annotated[float, Meta(ge=-1e3, le=1e3)]
FreeAxis = Literal["none", "tool_y"]
Goals = Literal["anywhere", "row"]
#: Survey posture, where drawn targets start (rad).
HOME = (-0.2784, -0.1128, -0.0354, -2.0055, 1.6759, 1.2124, -0.269)
#: Drawn goals: x and y (m) either way, z (m), tilt of the tool's z from horizontal (rad) either way.
_SIDE, _HEIGHTS, _TILT = 4.0, (0.4, 1.5), np.radians(40.0)
#: Goals like cuts of a row: x and y (m), z (m), the tool's yaw from across the row, tilt and roll (rad) either way.
_ROW_X, _ROW_Y, _ROW_Z, _ROW_TURN = (-0.5, 2.0), (0.65, 0.85), (0.9, 1.3), np.radians([40.0, 20.0, 20.0])


#: Joints of starts anywhere (rad).
_LOWER, _UPPER = RobotModel().limits.lower[ARM_Q], RobotModel().limits.upper[ARM_Q]


class Start(Struct, frozen=True, forbid_unknown_fields=True):
    """Base pose [x, y, φ] (m, rad) and arm joints (rad) at the start."""

    base: tuple[Number, Number, Number]
    arm: tuple[Number, Number, Number, Number, Number, Number, Number]


class Goal(Struct, frozen=True, forbid_unknown_fields=True):
    """Tool pose wanted in odom."""

    position: tuple[Number, Number, Number]
    quat_xyzw: tuple[Number, Number, Number, Number]


class Target(Struct, frozen=True, forbid_unknown_fields=True):
    """One start and one goal; with `tool_y` free, any rotation about the tool's y will do."""

    start: Start
    goal: Goal
    free_axis: FreeAxis = "none"

    @property
    def q(self) -> Array:
        """Configuration (12) at the start."""
        q = np.zeros(12)
        q[:3], q[ARM_Q] = self.start.base, self.start.arm
        return q

    @property
    def T_odom_goal(self) -> Any:
        """The goal (pin.SE3)."""
        x, y, z, w = self.goal.quat_xyzw
        return pin.SE3(pin.Quaternion(w, x, y, z).normalized().toRotationMatrix(), np.array(self.goal.position))

    @property
    def free(self) -> bool:
        """Whether the rotation about the tool's y is free."""
        return self.free_axis == "tool_y"


class _File(Struct, frozen=True, forbid_unknown_fields=True):
    targets: Annotated[tuple[Target, ...], Meta(min_length=1)]


def read(path: Path) -> tuple[Target, ...]:
    """The targets of a file.

    Raises:
        InputError: It cannot be read, is not JSON, or says something else than targets; one line that says where.
    """
    try:
        targets = msgspec.json.decode(path.read_bytes(), type=_File).targets
    except OSError as error:
        raise InputError(f"cannot read the targets {path}: {error.strerror}") from error
    except msgspec.DecodeError as error:
        raise InputError(f"{path}: {error}; a file of targets is {_EXAMPLE}") from error
    for i, target in enumerate(targets):
        length = float(np.linalg.norm(target.goal.quat_xyzw))
        if abs(length - 1.0) > 1e-2:
            raise InputError(f"{path}: targets[{i}].goal.quat_xyzw has length {length:.3f}; it must be 1")
    return targets


def write(path: Path, targets: tuple[Target, ...]) -> None:
    """A file that `read` reads."""
    path.write_bytes(msgspec.json.format(msgspec.json.encode(_File(targets)), indent=1) + b"\n")


def draw(
    seed: int, count: int, free_axis: FreeAxis, anywhere: bool = False, goals: Goals = "anywhere"
) -> tuple[Target, ...]:
    """Goals anywhere around a base at the origin, the arm in its survey posture, or anywhere within its limits.

    x and y are within 4 m, z is 0.4 to 1.5 m; the approach axis (tool z) has any yaw and is tilted up to 40° from
    horizontal either way, and the roll about it is any. Nothing is left out, so that some goals without a free axis are
    beyond what the arm can reach from anywhere. Goals like cuts of a row are at the left of the base, the tool across
    the row and its y along an upright cane, each within some degrees. Of starts anywhere many are in collision with
    themselves.
    """
    rng = np.random.default_rng(seed)
    targets = []
    for _ in range(count):
        if goals == "row":
            position = (rng.uniform(*_ROW_X), rng.uniform(*_ROW_Y), rng.uniform(*_ROW_Z))
            yaw, tilt, roll = rng.uniform(-_ROW_TURN, _ROW_TURN)
            yaw, roll = yaw + np.pi / 2, roll + np.pi / 2
        else:
            position = (*rng.uniform(-_SIDE, _SIDE, 2), rng.uniform(*_HEIGHTS))
            yaw, roll = rng.uniform(-np.pi, np.pi, 2)
            tilt = rng.uniform(-_TILT, _TILT)
        R = pin.rpy.rpyToMatrix(0.0, np.pi / 2 - tilt, yaw) @ pin.rpy.rpyToMatrix(0.0, 0.0, roll)
        quaternion = tuple(float(v) for v in pin.Quaternion(R).coeffs())
        goal = msgspec.convert({"position": tuple(map(float, position)), "quat_xyzw": quaternion}, Goal)
        arm = msgspec.convert(rng.uniform(_LOWER, _UPPER).tolist(), ArmAngles) if anywhere else HOME
        targets.append(Target(Start((0.0, 0.0, 0.0), arm), goal, free_axis))
    return tuple(targets)


@dataclass(frozen=True)
class Beyond:
    """A proof that no place of the base and no posture of the arm has the tool at a goal."""

    rise: float
    reach: float


def beyond(ik: ArmIk, target: Target) -> Beyond | None:
    """Whether a goal is out of reach from everywhere, by geometry alone.

    The wrist's height follows from the goal and the last joint; where it is higher above the shoulder than the arm is
    long for every angle of that joint, limits or not, there is nothing to be found. None: there may be a way.
    """
    if target.free:
        return None
    goal = target.T_odom_goal
    T = goal * ik.tool.inverse()
    q7: Array = np.linspace(-np.pi, np.pi, 721)
    n = len(q7)
    wrist = ik.wrist(np.broadcast_to(T.rotation, (n, 3, 3)), np.broadcast_to(T.translation, (n, 3)), q7)
    rise = float(np.abs(wrist[:, 2] - ik.shoulder[2]).min())
    return Beyond(rise, ik.reach) if rise > ik.reach else None


_EXAMPLE = json.dumps(
    {
        "targets": [
            {
                "start": {"base": ["x", "y", "phi"], "arm": ["q1…q7"]},
                "goal": {"position": ["x", "y", "z"], "quat_xyzw": ["x", "y", "z", "w"]},
                "free_axis": "none|tool_y",
            }
        ]
    },
    ensure_ascii=False,
)
