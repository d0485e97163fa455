"""Distances from points to capsules: obstacles with a tapered radius."""

import numpy as np

from perception.arrays import Array
from perception.config import RuleConfig
from rolling_panda.messages.perception import Capsule
from rolling_panda.messages.types import WoodClass


def permanent(capsules: tuple[Capsule, ...], rule: RuleConfig) -> tuple[Capsule, ...]:
    """Capsules without last year's canes, which have the class of a cordon and go where the rule is that of Guyot."""
    guyot = rule.system == "guyot"
    return tuple(capsule for capsule in capsules if not guyot or capsule.kind != "cordon" or capsule.spur < 0)


class CapsuleSet:
    """Capsules prepared for distance queries."""

    def __init__(self, capsules: tuple[Capsule, ...], kinds: tuple[WoodClass, ...] = ()) -> None:
        """Select capsules.

        Args:
            capsules: Of all classes.
            kinds: Classes to select; empty selects all.
        """
        chosen = [capsule for capsule in capsules if not kinds or capsule.kind in kinds]
        self._start = np.array([capsule.start for capsule in chosen]).reshape(-1, 3)
        self._axis = np.array([capsule.end for capsule in chosen]).reshape(-1, 3) - self._start
        self._radii = np.array([(capsule.start_radius, capsule.end_radius) for capsule in chosen]).reshape(-1, 2)
        self._squared_length = np.maximum(np.einsum("ij,ij->i", self._axis, self._axis), 1e-12)

    def nearest(self, points: Array) -> Array:
        """Signed distance (m) from each point (K×3, m, odom) to the nearest surface (K); infinite without capsules."""
        out: Array = np.min(self.distances(points), axis=1, initial=np.inf)
        return out

    def distances(self, points: Array) -> Array:
        """Signed distance (m) from each of K points (K×3) to each of N surfaces, K×N; negative inside a capsule."""
        off = points[:, None] - self._start
        fraction = np.clip(np.einsum("kij,ij->ki", off, self._axis) / self._squared_length, 0.0, 1.0)
        to_axis = np.linalg.norm(off - fraction[..., None] * self._axis, axis=2)
        first, last = self._radii.T
        out: Array = to_axis - first - fraction * (last - first)
        return out
