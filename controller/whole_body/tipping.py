"""Tipping constraint: the zero-moment point inside the support triangle, as rows over ξ̈.

The corners of the triangle are the contacts of the two driven wheels and the rear caster. The caster swivels: its
contact is on a circle about its pivot, and the smallest triangle of all directions is used. On flat ground the contact
forces have no tipping moment about the zero-moment point. So the wheels stay on the ground while it is inside.

With the momentum h = A_g q̇ of all masses about their centre c (centroidal map), the condition for an edge with a point
P and an inward normal n is linear in ḣ, and so in ξ̈:

    (n·r − margin) F_z − r_z n·F_xy − n_x k̇_y + n_y k̇_x ≥ 0,   r = c − P,  F = ḣ_lin + m g ẑ,  k̇ = ḣ_ang
"""

import math

import numpy as np
import pinocchio as pin
from msgspec import Struct

from controller.whole_body.compiled import MATRIX, NOTHING, NUMBER, VECTOR, compiled
from controller.whole_body.dynamics import acceleration_of_q
from rolling_panda.model.differential_drive import NQ, NXI, Array
from rolling_panda.model.robot import RobotModel

#: Distance of the caster's contact from its pivot (m, vendor's mesh).
_CASTER_TRAIL = 0.060
#: Distance (m) that the zero-moment point keeps from every edge. Masses of the base are estimates.
MARGIN = 0.03
_STEP = 1e-4


class TippingRows(Struct, frozen=True):
    """Bound of the acceleration: matrix ξ̈ ≥ bound, in metres of the zero-moment point at the robot's own weight.

    Attributes:
        matrix: (3×9), a row for each edge: front, left, right.
        bound: (3), never positive: zero acceleration is always allowed.
    """

    matrix: Array
    bound: Array

    def over_velocity(self, xi: Array, dt: float) -> tuple[Array, Array]:
        """The same as rows over the next ξ̇: matrix ξ̇_next ≥ bound.

        Args:
            xi: ξ̇ (9) sent last.
            dt: Control period (s).
        """
        lower = np.empty(3)
        _over_velocity(self.matrix, self.bound, xi, dt, lower)
        return self.matrix, lower


class Tipping:
    """Zero-moment point and acceleration bound. Uses the work space of its `RobotModel`."""

    def __init__(self, robot: RobotModel) -> None:
        """Work out the triangle of a robot with the wheels and the caster's pivot in its description."""
        self._robot = robot
        mass = float(pin.computeTotalMass(robot.model))
        self._weight = mass * float(np.linalg.norm(robot.model.gravity.linear))
        wheels = [robot.model.jointPlacements[robot.model.getJointId(f"wheel_{s}")] for s in ("left", "right")]
        left, right = (placement.translation[:2] for placement in wheels)
        pivot = robot.model.frames[robot.frame_id("caster_pivot_link")].placement.translation[:2]
        #: A point on each edge and its inward normal (3×2, base_link): front, left, right.
        self.points = np.array([(left + right) / 2, left, right])
        self.normals = np.array(
            [[-1.0, 0.0], _inner_normal(left, pivot, _CASTER_TRAIL), _inner_normal(right, pivot, _CASTER_TRAIL)]
        )

        kept = np.sum(self.normals * self.points, axis=1) + MARGIN
        self._edges = np.column_stack([self.normals, kept])
        # Views of Pinocchio's own memory: the centroidal map A_g (6×12) and the centre of mass (3).
        self._map, self._center = robot.data.Ag, robot.data.com[0]

    def rows(self, q: Array, xi: Array, dt: float = 0.0, S: Array | None = None) -> TippingRows:
        """The bound on ξ̈ at q (12) and ξ̇ (9).

        Args:
            q: Configuration (12).
            xi: ξ̇ (9).
            dt: Time (s) that the acceleration is kept for: the speed of the base at its end counts as well, since in a
                bend the robot is pressed outwards by its speed and not by its acceleration.
            S: S(q) where it is known already (12×9).
        """
        if S is None:
            S = self._robot.drive.basis(float(q[2]))
        pin.computeCentroidalMap(self._robot.model, self._robot.data, q)
        pressed = self._pressed(q, xi, S)
        L, matrix, bound = np.empty((3, 6)), np.empty((3, NXI)), np.empty(3)
        _condition(self._edges, q, self._center, L)
        _rows(L, self._map, S, pressed, self._weight, matrix, bound)
        if dt > 0.0:
            for wheel in range(2):
                nudged = xi.copy()
                nudged[wheel] += _STEP
                change = self._pressed(q, nudged, S) - pressed
                matrix[:, wheel] += L @ change * (dt / _STEP / self._weight)
        return TippingRows(matrix, bound)

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
        # The wrench on the first joint is the wrench of the ground.
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
        """ḣ (6) at ξ̈ = 0: the part of the velocities."""
        v, a = np.empty(NQ), np.zeros(NQ)
        _motion(S, xi, v, a)
        change = pin.computeCentroidalMomentumTimeVariation(self._robot.model, self._robot.data, q, v, a)
        pressed: Array = change.vector.copy()
        return pressed


@compiled(NOTHING(MATRIX, VECTOR, VECTOR, NUMBER, VECTOR))
def _over_velocity(matrix: Array, bound: Array, xi: Array, dt: float, lower: Array) -> None:
    """Lower = bound · dt + matrix ξ̇."""
    for i in range(3):
        lower[i] = bound[i] * dt
        for j in range(9):
            lower[i] += matrix[i, j] * xi[j]


@compiled(NOTHING(MATRIX, VECTOR, VECTOR, VECTOR))
def _motion(S: Array, xi: Array, v: Array, a: Array) -> None:
    """q̇ = S ξ̇ (12) into v, and q̈ = Ṡ ξ̇ (12) into the zeros of a: the base's centripetal acceleration."""
    for i in range(12):
        v[i] = 0.0
        for j in range(9):
            v[i] += S[i, j] * xi[j]
    a[0], a[1] = -v[2] * v[1], v[2] * v[0]


@compiled(NOTHING(MATRIX, VECTOR, VECTOR, MATRIX))
def _condition(edges: Array, q: Array, center: Array, L: Array) -> None:
    """For each edge, L (3×6) with L ḣ + weight · L[:, 2] ≥ 0 as the condition at the head of this file.

    Args:
        edges: n (2) and n·P + margin of each edge in base_link (3×3).
        q: Configuration (12).
        center: Of mass (3, odom).
        L: Written.
    """
    c, s = math.cos(q[2]), math.sin(q[2])
    x, y = c * (center[0] - q[0]) + s * (center[1] - q[1]), c * (center[1] - q[1]) - s * (center[0] - q[0])
    z = center[2]
    for i in range(3):
        n_x, n_y = c * edges[i, 0] - s * edges[i, 1], s * edges[i, 0] + c * edges[i, 1]
        L[i, 0], L[i, 1], L[i, 2] = -z * n_x, -z * n_y, edges[i, 0] * x + edges[i, 1] * y - edges[i, 2]
        L[i, 3], L[i, 4], L[i, 5] = n_y, -n_x, 0.0


@compiled(NOTHING(MATRIX, MATRIX, MATRIX, VECTOR, NUMBER, MATRIX, VECTOR))
def _rows(L: Array, A_g: Array, S: Array, pressed: Array, weight: float, matrix: Array, bound: Array) -> None:
    """Write L A_g S (3×9) into matrix and the bound from velocities and gravity (3), divided by the weight."""
    over_q = np.zeros(12)
    for i in range(3):
        left = weight * L[i, 2]
        for k in range(6):
            left += L[i, k] * pressed[k]
        bound[i] = min(-left / weight, 0.0)
        for j in range(12):
            over_q[j] = 0.0
            for k in range(6):
                over_q[j] += L[i, k] * A_g[k, j]
        for j in range(9):
            matrix[i, j] = 0.0
            for k in range(12):
                matrix[i, j] += over_q[k] * S[k, j] / weight


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
