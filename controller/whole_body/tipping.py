"""Keeping the robot on its wheels: the zero-moment point inside the support triangle, as rows over ξ̈.

The triangle has its corners at the two driven wheels and at the rear caster. The caster swivels, so that its contact is
somewhere on a circle about its pivot; the triangle is taken as small as any direction makes it. On flat ground the
contact forces have no moment that tips at the zero-moment point, so that the wheels stay down while it is inside.

With the momentum h = A_g q̇ of all masses about their centre c (centroidal map), the condition for an edge with a point
P and an inward normal n is linear in ḣ, and so in ξ̈:

    (n·r − margin) F_z − r_z n·F_xy − n_x k̇_y + n_y k̇_x ≥ 0,   r = c − P,  F = ḣ_lin + m g ẑ,  k̇ = ḣ_ang
"""

import math
from dataclasses import dataclass

import numpy as np
import pinocchio as pin

from controller.whole_body.dynamics import acceleration_of_q
from rolling_panda.differential_drive import Array
from rolling_panda.robot_model import RobotModel

#: Distance of the caster's contact from its pivot (m, vendor's mesh).
_CASTER_TRAIL = 0.060
#: Distance (m) that the zero-moment point keeps from every edge. Masses of the base are estimates.
MARGIN = 0.03
_STEP = 1e-4


@dataclass(frozen=True)
class TippingRows:
    """What acceleration may be: matrix ξ̈ ≥ bound, in metres of the zero-moment point at the robot's own weight.

    Attributes:
        matrix: (3×9), a row for each edge: front, left, right.
        bound: (3), never positive: not to accelerate is always allowed.
    """

    matrix: Array
    bound: Array

    def over_velocity(self, xi: Array, dt: float) -> tuple[Array, Array]:
        """The same as rows over the next ξ̇: matrix ξ̇_next ≥ bound.

        Args:
            xi: ξ̇ (9) sent last.
            dt: Control period (s).
        """
        return self.matrix, self.bound * dt + self.matrix @ xi


class Tipping:
    """Zero-moment point and acceleration bound. Uses the work space of its `RobotModel`."""

    def __init__(self, robot: RobotModel, margin: float = MARGIN) -> None:
        """Work out the triangle.

        Args:
            robot: With the wheels and the caster's pivot in its description.
            margin: Distance that the zero-moment point keeps from every edge (m).
        """
        self._robot = robot
        self._mass = float(pin.computeTotalMass(robot.model))
        self._weight = self._mass * float(np.linalg.norm(robot.model.gravity.linear))
        wheels = [robot.model.jointPlacements[robot.model.getJointId(f"wheel_{s}")] for s in ("left", "right")]
        left, right = (placement.translation[:2] for placement in wheels)
        pivot = robot.model.frames[robot.frame_id("caster_pivot_link")].placement.translation[:2]
        #: A point on each edge and its inward normal (3×2, base_link): front, left, right.
        self.points = np.array([(left + right) / 2, left, right])
        self.normals = np.array(
            [[-1.0, 0.0], _inner_normal(left, pivot, _CASTER_TRAIL), _inner_normal(right, pivot, _CASTER_TRAIL)]
        )

        kept = np.sum(self.normals * self.points, axis=1) + margin
        self._edges: list[tuple[float, float, float]] = [
            (float(n[0]), float(n[1]), float(k)) for n, k in zip(self.normals, kept, strict=True)
        ]

    def rows(self, q: Array, xi: Array, dt: float = 0.0, S: Array | None = None) -> TippingRows:
        """The bound on ξ̈ at q (12) and ξ̇ (9).

        Args:
            q: Configuration (12).
            xi: ξ̇ (9).
            dt: Time (s) that the acceleration is kept for: the speed of the base at its end counts as well, since in a
                bend the robot is pressed outwards by its speed and not by its acceleration.
            S: S(q) where it is known already (12×9).
        """
        data = self._robot.data
        if S is None:
            S = self._robot.drive.basis(float(q[2]))
        pressed = self._pressed(q, xi, S)
        at_x, at_y, phi = q[:3].tolist()
        c, s = math.cos(phi), math.sin(phi)
        x, y, z = data.com[0].tolist()
        x, y = c * (x - at_x) + s * (y - at_y), c * (y - at_y) - s * (x - at_x)
        # L ḣ + weight · reach is the condition above; plain numbers, since arrays of three cost more than they save.
        entries = []
        for nx, ny, kept in self._edges:
            n_x, n_y, reach = c * nx - s * ny, s * nx + c * ny, nx * x + ny * y - kept
            entries.append((-z * n_x, -z * n_y, reach, n_y, -n_x, 0.0))
        L = np.array(entries)
        reach = L[:, 2]
        matrix, value = (L @ data.Ag) @ S, L @ pressed + self._weight * reach
        if dt > 0.0:
            for wheel in range(2):
                nudged = xi.copy()
                nudged[wheel] += _STEP
                matrix[:, wheel] += L @ (self._pressed(q, nudged, S) - pressed) * (dt / _STEP)
        return TippingRows(matrix / self._weight, np.minimum(value / -self._weight, 0.0))

    def zero_moment_point(self, q: Array, xi: Array, acceleration: Array) -> Array:
        """Where on the ground (2, m, base_link) the contact forces have no moment that tips.

        Args:
            q: Configuration (12).
            xi: ξ̇ (9).
            acceleration: ξ̈ (9).
        """
        model, data = self._robot.model, self._robot.data
        S = self._robot.drive.basis(float(q[2]))
        v = S @ xi
        pin.rnea(model, data, q, v, acceleration_of_q(S, v, acceleration))
        # What the world exerts on the first joint is what the ground has to exert, in all six directions.
        wrench = data.liMi[1].act(data.f[1])
        x = -wrench.angular[1] / wrench.linear[2] - q[0]
        y = wrench.angular[0] / wrench.linear[2] - q[1]
        c, s = np.cos(q[2]), np.sin(q[2])
        return np.array([c * x + s * y, c * y - s * x])

    def stability(self, q: Array, xi: Array, acceleration: Array) -> float:
        """Distance (m) of the zero-moment point from the nearest edge; negative where the robot tips."""
        zmp = self.zero_moment_point(q, xi, acceleration)
        return float(np.sum(self.normals * (zmp - self.points), axis=1).min())

    def _pressed(self, q: Array, xi: Array, S: Array) -> Array:
        """ḣ (6) at ξ̈ = 0: what the speeds alone press with."""
        v = S @ xi
        data = self._robot.data
        pin.computeCentroidalMapTimeVariation(self._robot.model, data, q, v)
        change: Array = data.dAg @ v
        # A_g Ṡ ξ̇: the whole robot takes part in the base's centripetal acceleration.
        change[0] -= self._mass * v[2] * v[1]
        change[1] += self._mass * v[2] * v[0]
        return change


def _inner_normal(wheel: Array, pivot: Array, radius: float) -> Array:
    """Inward normal (2) of the line through the wheel that touches the caster's circle on the inner side."""
    away = pivot - wheel
    distance = float(np.linalg.norm(away))
    along = away / distance
    across = np.array([-along[1], along[0]])
    if across @ (-wheel) < 0.0:
        across = -across
    sine = radius / distance
    normal: Array = across * np.sqrt(1.0 - sine**2) - along * sine
    return normal
