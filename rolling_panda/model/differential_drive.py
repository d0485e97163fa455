"""The two-wheel base: its rolling constraints and its odometry.

q = [x, y, φ, θ_l, θ_r, q₁…q₇]; ξ = [θ_l, θ_r, q₁…q₇]. The paper's matrices with the wheels in the order of q
(docs/paper.md): left wheel forward turns right.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

NQ, NXI = 12, 9
Array = NDArray[np.float64]
#: x, y (m) and φ (rad).
Pose = tuple[float, float, float]
#: The lower part of S: the actuated coordinates are themselves.
_ACTUATED = np.vstack([np.zeros((NQ - NXI, NXI)), np.eye(NXI)])


@dataclass(frozen=True)
class WheelSizes:
    """Measured sizes of the two wheels, which need not be alike.

    Attributes:
        left: Rolling radius of the left wheel (m).
        right: Rolling radius of the right wheel (m).
        track: Distance between their contacts (m).
    """

    left: float
    right: float
    track: float

    def motion(self) -> Array:
        """2×2: turns angles of the left and right wheel (rad) into the axle centre's way (m) and turn (rad)."""
        left, right, track = self.left, self.right, self.track
        return np.array([[left / 2, right / 2], [-left / track, right / track]])


@dataclass(frozen=True)
class DifferentialDrive:
    """Geometry of the base.

    Attributes:
        wheel_radius: R, effective rolling radius (m).
        half_track: μ, half the distance between the wheel contacts (m).
        rho: ρ, distance of the reference point (x, y) ahead of the axle (m).
    """

    wheel_radius: float
    half_track: float
    rho: float = 0.0

    def constraint(self, phi: float) -> Array:
        """A(q), 3×12: A q̇ = 0 for no sideways slip of the axle and pure rolling of the left and the right wheel."""
        c, s = np.cos(phi), np.sin(phi)
        A = np.zeros((3, NQ))
        A[0, :3] = -s, c, -self.rho
        A[1, :4] = c, s, -self.half_track, -self.wheel_radius
        A[2, :3] = c, s, self.half_track
        A[2, 4] = -self.wheel_radius
        return A

    def basis(self, phi: float) -> Array:
        """S(q), 12×9: q̇ = S ξ̇, spanning the null space of A."""
        c, s = math.cos(phi), math.sin(phi)
        half, turn = self.wheel_radius / 2, self.wheel_radius / (2 * self.half_track)
        S = _ACTUATED.copy()
        # One by one, which is faster than two at once.
        S[0, 0], S[0, 1] = half * c + turn * self.rho * s, half * c - turn * self.rho * s
        S[1, 0], S[1, 1] = half * s - turn * self.rho * c, half * s + turn * self.rho * c
        S[2, 0], S[2, 1] = -turn, turn
        return S

    @property
    def sizes(self) -> WheelSizes:
        """Both wheels as drawn."""
        return WheelSizes(self.wheel_radius, self.wheel_radius, 2 * self.half_track)

    def twist(self, wheel_left: float, wheel_right: float) -> tuple[float, float]:
        """Forward velocity of the axle centre (m/s) and yaw rate (rad/s) from the wheel speeds (rad/s)."""
        v = self.wheel_radius * (wheel_left + wheel_right) / 2
        return v, self.wheel_radius * (wheel_right - wheel_left) / (2 * self.half_track)

    def wheels(self, v: float, omega: float) -> tuple[float, float]:
        """Wheel speeds left, right (rad/s) for a forward velocity (m/s) and a yaw rate (rad/s)."""
        turn = omega * self.half_track
        return (v - turn) / self.wheel_radius, (v + turn) / self.wheel_radius

    def integrate(self, pose: Array, turned_left: float, turned_right: float) -> Array:
        """The base pose [x, y, φ] of the reference point after the wheels turned by these angles (rad).

        Exact for constant wheel speeds: the axle centre follows an arc.
        """
        x, y, phi = pose.tolist()
        return np.array(self.rolled((x, y, phi), turned_left, turned_right))

    def rolled(self, pose: Pose, turned_left: float, turned_right: float) -> Pose:
        """`integrate` for plain numbers."""
        distance, angle = self.twist(turned_left, turned_right)
        x, y, phi = pose
        x, y, phi = arc((x - self.rho * math.cos(phi), y - self.rho * math.sin(phi), phi), distance, angle)
        return x + self.rho * math.cos(phi), y + self.rho * math.sin(phi), phi


def arc(pose: Pose, distance: float, angle: float) -> Pose:
    """Pose of the axle centre after an arc of a length (m) that turns by an angle (rad)."""
    x, y, phi = pose
    half = angle / 2
    chord = distance * math.sin(half) / half if half != 0.0 else distance
    return x + chord * math.cos(phi + half), y + chord * math.sin(phi + half), phi + angle
