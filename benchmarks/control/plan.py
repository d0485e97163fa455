"""A planned motion as data: one row for each control period."""

import hashlib
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from benchmarks.control.arm_path import ArmPath
from benchmarks.control.base_path import BaseMotion
from benchmarks.control.plan_limits import PlanLimits
from controller.motion.rest_to_rest import quickest
from rolling_panda.model.differential_drive import NQ, NXI, Array
from rolling_panda.model.robot import ARM_Q, ARM_XI, RobotModel

#: Largest distance of any point of arm and tool from the axis of each arm joint (m).
_LEVERS = np.array([1.25, 1.25, 0.95, 0.95, 0.6, 0.55, 0.4])
#: Largest distance of any point of the robot from the middle of the axle (m).
_BASE_LEVER = 1.3


@dataclass(frozen=True)
class Plan:
    """A motion from rest to rest.

    Attributes:
        t: Time of each row (T, s), one control period apart.
        q: Configuration (T×12). q[k+1] is q[k] integrated with xi[k] over one period, on the exact arc of the wheels.
        xi: ξ̇ from each row to the next (T×9); zero in the last.
        T_odom_tool: Tool poses (T×4×4).
        digest: SHA-256 of t, q and xi, the identity of the plan.
    """

    t: Array
    q: Array
    xi: Array
    T_odom_tool: Array
    digest: str

    @property
    def duration(self) -> float:
        """Time from the first row to the last (s)."""
        return float(self.t[-1])

    def travel(self) -> "Travel":
        """Bound of the motion of every point of the robot."""
        steps = np.abs(np.diff(self.q, axis=0))
        moved = np.hypot(steps[:, 0], steps[:, 1]) + _BASE_LEVER * steps[:, 2] + steps[:, ARM_Q] @ _LEVERS
        return Travel(np.concatenate([[0.0], np.cumsum(moved)]))


@dataclass(frozen=True)
class Travel:
    """Upper bound of the distance that any point of the robot has travelled up to each row (T, m)."""

    bound: Array

    def next_row(self, row: int, gap: float) -> int:
        """The next row to check after a `row` with this gap (m)."""
        return max(row + 1, int(np.searchsorted(self.bound, self.bound[row] + max(gap, 0.0), side="right")) - 1)


def arm_samples(path: ArmPath, limits: PlanLimits) -> Array:
    """The arm's postures (n×7) along a path, one a control period, at rest at each of the path's postures."""
    legs = [
        (a, b, quickest(1.0, limits.arm_rates(b - a)))
        for a, b in zip(path.postures, path.postures[1:], strict=False)
        if float(np.abs(b - a).max()) > 1e-9
    ]
    out, begun = [path.postures[:1]], 0.0
    row = 1
    for a, b, profile in legs:
        last = int(np.ceil((begun + profile.duration) / limits.dt - 1e-9))
        times: Array = limits.dt * np.arange(row, last + 1, dtype=np.float64) - begun
        out.append(a + profile.at(times)[:, None] * (b - a))
        # The next segment begins on a whole period, so that no period has the end of one and the start of another.
        row, begun = last + 1, last * limits.dt
    return np.vstack(out)


def assemble(robot: RobotModel, q: Array, base: BaseMotion, arm: Array, limits: PlanLimits, wait: "Wait") -> Plan:
    """Plan of a base motion and the arm's samples (n×7), each after its waiting rows.

    Args:
        robot: Robot model, for the tool's poses.
        q: Configuration (12) at the start.
        base: Motion of the base.
        arm: Postures of the arm.
        limits: Limits, for the control period.
        wait: Number of rows for which base and arm wait.
    """
    count = max(wait.base + len(base.wheels) + 1, wait.arm + len(arm))
    rows = np.empty((count, NQ))
    xi = np.zeros((count, NXI))
    poses = np.arange(count) - wait.base
    rows[:, :3] = base.poses[np.clip(poses, 0, len(base.poses) - 1)]
    xi[wait.base : wait.base + len(base.wheels), :2] = base.wheels / limits.dt
    rows[:, 3:5] = q[3:5]
    rows[1:, 3:5] += np.cumsum(xi[:-1, :2], axis=0) * limits.dt
    rows[:, ARM_Q] = arm[np.clip(np.arange(count) - wait.arm, 0, len(arm) - 1)]
    xi[:-1, ARM_XI] = np.diff(rows[:, ARM_Q], axis=0) / limits.dt
    t: Array = limits.dt * np.arange(count, dtype=np.float64)
    tool = np.array([robot.pose(row, robot.tool_id).homogeneous for row in rows])
    return Plan(t, rows, xi, tool, _digest(t, rows, xi))


@dataclass(frozen=True)
class Wait:
    """Number of rows for which base and arm wait before they move."""

    base: int = 0
    arm: int = 0


def orders(base: BaseMotion, arm: Array, late: bool) -> Iterator[Wait]:
    """Combinations of a base motion and an arm motion: together, the base first, the arm first.

    Args:
        base: Motion of the base.
        arm: Postures of the arm (n×7).
        late: True lets base and arm end together instead of beginning together.
    """
    waits = len(base.wheels) - len(arm) + 1
    yield Wait(base=max(-waits, 0), arm=max(waits, 0)) if late else Wait()
    yield Wait(arm=len(base.wheels))
    yield Wait(base=len(arm) - 1)


def _digest(*arrays: Array) -> str:
    digest = hashlib.sha256()
    for array in arrays:
        digest.update(np.ascontiguousarray(array, dtype="<f8").tobytes())
    return digest.hexdigest()
