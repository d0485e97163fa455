"""Velocity coordinates of the methods: ν = [v, φ̇, q̇₁…q̇₇], forward speed and yaw rate instead of wheels.

In ν the limits of the base are bounds of single entries, and a task of the base is a row with a single 1. ν and ξ̇ are
one to one: θ̇_l = (v − μφ̇)/R, θ̇_r = (v + μφ̇)/R.
"""

import numpy as np

from controller.whole_body.compiled import NOTHING, PACKED, VECTOR, compiled
from rolling_panda.model.differential_drive import Array, DifferentialDrive


class Actuation:
    """Conversion between ξ̇ and ν of one base."""

    def __init__(self, drive: DifferentialDrive) -> None:
        """Precompute both 2×2 maps."""
        R, mu = drive.wheel_radius, drive.half_track
        #: Wheel speeds [θ̇_l, θ̇_r] = wheels @ [v, φ̇].
        self.wheels: Array = np.array([[1.0 / R, -mu / R], [1.0 / R, mu / R]])
        #: [v, φ̇] = twist @ [θ̇_l, θ̇_r].
        self.twist: Array = np.array([[R / 2, R / 2], [-R / (2 * mu), R / (2 * mu)]])

    def nu(self, xi: Array) -> Array:
        """ν (9) of ξ̇ (9)."""
        out = np.empty(len(xi))
        _convert(self.twist, xi, out)
        return out

    def xi(self, nu: Array) -> Array:
        """ξ̇ (9) of ν (9)."""
        out = np.empty(len(nu))
        _convert(self.wheels, nu, out)
        return out

    def rows(self, A_xi: Array) -> Array:
        """Rows over ν (k×9) of rows over ξ̇ (k×9), so that both have the same product with the same motion."""
        out = A_xi.copy()
        out[:, :2] = A_xi[:, :2] @ self.wheels
        return out


@compiled(NOTHING(PACKED, VECTOR, VECTOR))
def _convert(base: Array, before: Array, after: Array) -> None:
    """The first two entries by the 2×2 map `base`, the others as they are."""
    after[:] = before
    for i in range(2):
        after[i] = base[i, 0] * before[0] + base[i, 1] * before[1]
