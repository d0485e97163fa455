"""Task: the base follows position and heading of the posture.

With the error (e_x, e_y, e_φ) of the reference in base_link:
v = v_ref cos e_φ + k_x e_x, φ̇ = φ̇_ref + k_y v_ref e_y + k_φ sin e_φ, the classic law for a unicycle (Kanayama 1990).
A lateral error is corrected by steering while the base drives, as a differential drive cannot move sideways.
"""

import math

from controller.whole_body.task import IkProblem
from rolling_panda.model.differential_drive import Array

#: k_y, gain of the lateral error (rad/m²).
_SIDE = 4.0


class BaseReference:
    """Forward speed in mode `row`, yaw rate in modes `row` and `free`; nothing in the others."""

    name = "base reference"
    rows = 2

    def __init__(self, place: float, heading: float, gain_place: float, gain_heading: float, speed: Array) -> None:
        """Scale by the base's largest speeds.

        Args:
            place: Weight of the place.
            heading: Weight of the heading.
            gain_place: k_x (1/s).
            gain_heading: k_φ (1/s).
            speed: Largest ν (9).
        """
        self._gains = gain_place, gain_heading
        self._limits = float(speed[0]), float(speed[1])
        self._shares = place**0.5 / self._limits[0], heading**0.5 / self._limits[1]

    def prepare(self, jacobian: Array) -> None:
        """Nothing is the same in every mode."""

    def write(self, problem: IkProblem, jacobian: Array, target: Array) -> None:
        """Write the rows."""
        mode = problem.base
        place = self._shares[0] if mode == "row" else 0.0
        heading = self._shares[1] if mode in ("row", "free") else 0.0
        jacobian[0, 0], jacobian[1, 1] = place, heading
        if heading == 0.0:
            target[0] = target[1] = 0.0
            return
        x, y, phi = problem.q[:3].tolist()
        x_ref, y_ref, phi_ref = problem.posture.q[:3].tolist()
        x_rate, y_rate, turn = problem.posture.rate[:3].tolist()
        c, s = math.cos(phi), math.sin(phi)
        ahead = c * (x_ref - x) + s * (y_ref - y)
        aside = c * (y_ref - y) - s * (x_ref - x)
        error = phi_ref - phi
        speed = math.cos(phi_ref) * x_rate + math.sin(phi_ref) * y_rate
        v = speed * math.cos(error) + self._gains[0] * ahead
        if mode == "free":
            v = speed = 0.0
        omega = turn + _SIDE * speed * aside + self._gains[1] * math.sin(error)
        target[0] = place * max(-self._limits[0], min(self._limits[0], v))
        target[1] = heading * max(-self._limits[1], min(self._limits[1], omega))
