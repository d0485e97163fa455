"""Inverse kinematics of the Panda in closed form, for many poses at once.

The arm has seven joints for a pose of six, so the last joint is given and the other six follow. With q₇ the wrist W,
where the axes of joints 5 and 6 meet, is known; shoulder S, elbow E and W are a triangle with known sides, which gives
q₄; the axis of joint 5 lies in the plane square to the axis of joint 6 at a known angle to W→S, two ways, which gives
q₆, q₅ and E; and the shoulder can point at the elbow two ways (q₁, q₂, q₃). So there are up to four answers for a q₇.

Left out is the nearly straight arm, q₄ above −0.467 rad, where ω is small and the same wrist has a bent twin.
"""

from dataclasses import dataclass

import numpy as np

from rolling_panda.errors import ModelError
from rolling_panda.model.differential_drive import Array
from rolling_panda.model.robot import ARM_Q, RobotModel

_TINY = 1e-12


@dataclass(frozen=True)
class ArmPostures:
    """Answers for N poses, up to four each.

    Attributes:
        q: Arm joints (4×N×7, rad); NaN where there is no answer.
        omega: Manipulability ω = √det(J Jᵀ) of the arm (4×N); NaN where there is no answer.
    """

    q: Array
    omega: Array


class ArmIk:
    """The arm's dimensions, read from its model, and the solution for poses of the flange in the arm's root frame."""

    def __init__(self, robot: RobotModel) -> None:
        """Read the dimensions.

        Raises:
            ModelError: The arm has other offsets than a Panda, or does not stand above the middle of the axle.
        """
        placements = [robot.model.jointPlacements[robot.model.getJointId(f"panda_joint{i}")] for i in range(1, 8)]
        neutral = np.zeros(12)
        T_mount = robot.pose(neutral, robot.frame_id("arm_mount"))
        T_base = robot.pose(neutral, robot.frame_id("base_link"))
        self.mount: Array = T_base.actInv(T_mount).translation
        self.tool = robot.pose(neutral, robot.flange_id).actInv(robot.pose(neutral, robot.tool_id))
        self._d1 = float(placements[0].translation[2] - self.mount[2])
        self._d3, self._a = -float(placements[2].translation[1]), float(placements[3].translation[0])
        self._d5, self._a7 = float(placements[4].translation[1]), float(placements[6].translation[0])
        self._flange = float(robot.model.frames[robot.flange_id].placement.translation[2])
        limits = robot.limits
        self.lower, self.upper = limits.lower[ARM_Q], limits.upper[ARM_Q]
        if not np.isclose(-placements[4].translation[0], self._a) or min(self._d1, self._d3, self._d5) <= 0.0:
            raise ModelError("the arm's joint offsets are not a Panda's; the closed form does not fit it")
        if np.abs(self.mount[:2]).max() > 1e-9:
            raise ModelError(
                f"the arm stands at {self.mount[:2]} m in the base; planning needs it above the axle's middle"
            )

    @property
    def shoulder(self) -> Array:
        """The shoulder (3, m) in the base's frame, where the axes of joints 1 to 3 meet."""
        point: Array = self.mount + np.array([0.0, 0.0, self._d1])
        return point

    @property
    def reach(self) -> float:
        """Longest distance from shoulder to wrist (m)."""
        return float(np.hypot(self._d3, self._a) + np.hypot(self._d5, self._a))

    def wrist(self, R: Array, p: Array, q7: Array) -> Array:
        """Where the axes of joints 5 and 6 meet (N×3, m) for poses of the flange and last joints, in any frame."""
        point: Array = p - self._flange * R[:, :, 2] - self._a7 * _x6(R, q7)
        return point

    def solve(self, R: Array, p: Array, q7: Array) -> ArmPostures:
        """All postures with these poses of the flange and these last joints; joint limits are not looked at.

        Args:
            R: Orientation of panda_link8 in panda_link0 (N×3×3).
            p: Its position (N×3, m).
            q7: Last joint (N, rad).
        """
        z7 = R[:, :, 2]
        x6, y6 = _x6(R, q7), -z7
        W = self.wrist(R, p, q7)
        O7 = W + self._a7 * x6
        v = np.array([0.0, 0.0, self._d1]) - W
        L2 = np.maximum(_dot(v, v), _TINY)
        L = np.sqrt(L2)
        upper2, fore2 = self._d3**2 + self._a**2, self._d5**2 + self._a**2
        upper, fore = np.sqrt(upper2), np.sqrt(fore2)
        at_elbow = _acos((upper2 + fore2 - L2) / (2.0 * upper * fore))
        q4 = at_elbow + np.arctan2(self._d5, self._a) + np.arctan2(self._d3, self._a) - 2.0 * np.pi
        at_wrist = _acos((fore2 + L2 - upper2) / (2.0 * fore * L)) + np.arctan2(self._a, self._d5)
        # The forearm points from the wrist along cos ψ x₆ + sin ψ y₆.
        vx, vy = _dot(v, x6), _dot(v, y6)
        swing = _acos(L * np.cos(at_wrist) / np.maximum(np.hypot(vx, vy), _TINY))
        middle = np.arctan2(vy, vx)
        psi = np.stack([middle + swing, middle - swing])
        half = self._upper_arm(psi, q4, x6, y6, v, W, O7, z7)
        n = len(q7)
        q = np.empty((2, 2, n, 7))
        q[..., 3], q[..., 6] = q4, q7
        q[:, :, :, 4:6] = half.q56[:, None]
        q[:, 0, :, :3], q[:, 1, :, :3] = half.q123, half.flipped()
        return ArmPostures(q.reshape(4, n, 7), np.stack([half.omega, half.omega], axis=1).reshape(4, n))

    def _upper_arm(
        self, psi: Array, q4: Array, x6: Array, y6: Array, v: Array, W: Array, O7: Array, z7: Array
    ) -> "_Half":
        c, s = np.cos(psi)[..., None], np.sin(psi)[..., None]
        z5 = -(c * x6 + s * y6)
        x5 = -s * x6 + c * y6
        q6 = np.arctan2(-np.cos(psi), -np.sin(psi))
        q6 = np.where(q6 < self.lower[5], q6 + 2.0 * np.pi, q6)
        x4 = v - _dot(v, z5)[..., None] * z5
        x4 /= np.maximum(np.sqrt(_dot(x4, x4)), _TINY)[..., None]
        z4 = np.cross(x4, z5)
        q5 = np.arctan2(-_dot(x5, z4), _dot(x5, x4))
        E = W + self._a * x4 - self._d5 * z5
        c4, s4 = np.cos(q4)[:, None], np.sin(q4)[:, None]
        x3, z3 = c4 * x4 - s4 * z5, s4 * x4 + c4 * z5
        q2 = _acos(np.clip(z3[..., 2], -1.0, 1.0))
        q1 = np.arctan2(z3[..., 1], z3[..., 0])
        c1, s1 = np.cos(q1), np.sin(q1)
        y1 = np.stack([-s1, c1, np.zeros_like(c1)], axis=-1)
        x1 = np.stack([c1, s1, np.zeros_like(c1)], axis=-1)
        x2 = np.cos(q2)[..., None] * x1
        x2[..., 2] -= np.sin(q2)
        q3 = np.arctan2(_dot(x3, y1), _dot(x3, x2))
        # ω does not depend on the point that the Jacobian is taken at; the wrist has the most zeros.
        S = W + v
        J = np.zeros((*psi.shape, 7, 6))
        axes = (_up(y1), y1, z3, z4, z5, np.broadcast_to(np.cross(x6, y6), z5.shape), np.broadcast_to(z7, z5.shape))
        arms = (W - S, W - S, W - S, W - E, None, None, W - O7)
        for i, (axis, arm) in enumerate(zip(axes, arms, strict=True)):
            if arm is not None:
                J[..., i, :3] = np.cross(axis, np.broadcast_to(arm, axis.shape))
            J[..., i, 3:] = axis
        known = np.isfinite(q1)
        omega = np.full(psi.shape, np.nan)
        JJ = np.swapaxes(J[known], -1, -2) @ J[known]
        omega[known] = np.sqrt(np.maximum(np.linalg.det(JJ), 0.0))
        return _Half(np.stack([q1, q2, q3], axis=-1), np.stack([q5, q6], axis=-1), omega)

    def margin(self, q: Array) -> Array:
        """Least distance of any joint to its limits (…, rad) for postures (…×7); negative outside."""
        least: Array = np.minimum(q - self.lower, self.upper - q).min(axis=-1)
        return least


@dataclass(frozen=True)
class _Half:
    q123: Array
    q56: Array
    omega: Array

    def flipped(self) -> Array:
        """The same upper arm with the shoulder turned round: q₁ + π, −q₂, q₃ + π."""
        turned = self.q123.copy()
        turned[..., 0] = wrapped(turned[..., 0] + np.pi)
        turned[..., 1] *= -1.0
        turned[..., 2] = wrapped(turned[..., 2] + np.pi)
        return turned


def wrapped(angle: Array) -> Array:
    """The same angles in −π…π."""
    return np.arctan2(np.sin(angle), np.cos(angle))


def _x6(R: Array, q7: Array) -> Array:
    """The x axis of joint 6's frame (N×3): that of the flange, turned back by the last joint."""
    x6: Array = np.cos(q7)[:, None] * R[:, :, 0] - np.sin(q7)[:, None] * R[:, :, 1]
    return x6


def _acos(cosine: Array) -> Array:
    """Arc cosine; NaN outside −1…1, which marks what has no answer."""
    inside = np.abs(cosine) <= 1.0
    return np.where(inside, np.arccos(np.where(inside, cosine, 0.0)), np.nan)


def _dot(a: Array, b: Array) -> Array:
    out: Array = (a * b).sum(axis=-1)
    return out


def _up(like: Array) -> Array:
    out = np.zeros_like(like)
    out[..., 2] = 1.0
    return out
