"""Torque check of a planned motion."""

from dataclasses import dataclass

import numpy as np

from controller.whole_body.dynamics import Dynamics
from rolling_panda.errors import InputError
from rolling_panda.model.differential_drive import NQ, NXI, Array
from rolling_panda.model.robot import RobotModel


@dataclass(frozen=True)
class JointTorque:
    """Torque of one actuator along a motion.

    Attributes:
        joint: Name of the joint.
        limit: Rated torque (Nm).
        peak: Largest magnitude of the torque (Nm).
        margin: Limit minus peak (Nm); negative if the motion is infeasible.
        at: Time of the peak (s).
    """

    joint: str
    limit: float
    peak: float
    margin: float
    at: float


@dataclass(frozen=True)
class TorqueReport:
    """Torques of a motion, wheels first, then the arm's joints."""

    joints: tuple[JointTorque, ...]

    @property
    def feasible(self) -> bool:
        """Whether every actuator has the torque that the motion asks for."""
        return all(joint.margin >= 0.0 for joint in self.joints)

    @property
    def tightest(self) -> JointTorque:
        """The actuator that uses the largest fraction of its limit."""
        return max(self.joints, key=lambda joint: joint.peak / joint.limit)


def torque_report(robot: RobotModel, t: Array, q: Array, xi: Array) -> TorqueReport:
    """Torques of a motion without contact, by inverse dynamics with the cutter and the camera carried.

    Acceleration is that of the samples: differences of `xi`, central but at the ends.

    Args:
        robot: Whose torque limits count.
        t: Times (T, s), rising.
        q: Configurations (T×12).
        xi: Velocities ξ̇ (T×9).

    Raises:
        InputError: Fewer than two samples, arrays that do not fit each other, times that do not rise, or a number that
            is not finite.
    """
    _check(t, q, xi)
    dynamics = Dynamics(robot)
    acceleration = np.gradient(xi, t, axis=0)
    torque = np.array([dynamics.inverse(*sample) for sample in zip(q, xi, acceleration, strict=True)])
    limits = robot.model.effortLimit[NQ - NXI :]
    names = list(robot.model.names)[1 + NQ - NXI :]
    size = np.abs(torque)
    return TorqueReport(
        tuple(
            JointTorque(name, float(limit), float(row.max()), float(limit - row.max()), float(t[row.argmax()]))
            for name, limit, row in zip(names, limits, size.T, strict=True)
        )
    )


def _check(t: Array, q: Array, xi: Array) -> None:
    if len(t) < 2 or q.shape != (len(t), NQ) or xi.shape != (len(t), NXI):
        raise InputError(
            f"a motion of {len(t)} times has q {q.shape} and xi {xi.shape}; "
            f"there must be two times or more, q (T, {NQ}) and xi (T, {NXI})"
        )
    if not all(np.isfinite(values).all() for values in (t, q, xi)) or not (np.diff(t) > 0.0).all():
        raise InputError("a motion's times must rise, and all its numbers be finite; check where it was made")
