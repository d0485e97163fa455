"""The frames of REP-105: in `map` the row stands still, and `odom`, which is continuous, drifts against it."""

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from msgspec.structs import replace

from rolling_panda.errors import ModelError
from rolling_panda.messages.perception import Capsule, Localisation
from rolling_panda.messages.types import Pose
from rolling_panda.model.differential_drive import Array
from rolling_panda.model.robot import placement
from rolling_panda.model.wire_values import vector3

_ORIGIN = Pose((0.0, 0.0, 0.0), (0.0, 0.0, 0.0, 1.0))


@dataclass(frozen=True, eq=False)
class MapFrame:
    """Where odom is in map; its methods return what they are given while the two are one.

    Attributes:
        T_map_odom: The transform (pin.SE3); None for the identity.
        pose: The same as a message.
    """

    T_map_odom: Any = None
    pose: Pose = _ORIGIN

    def after(self, localisation: Localisation) -> "MapFrame":
        """As perception tells it now: the same object while the transform stays, or where its quaternion is none."""
        pose = localisation.T_map_odom
        if pose == self.pose:
            return self
        try:
            return MapFrame() if pose == _ORIGIN else MapFrame(placement(pose), pose)
        except ModelError:
            return self

    def configuration_in_map(self, q: Array) -> Array:
        """The same configuration (12) with the base where it is in map. Height and tilt of the ground are left out."""
        return q if self.T_map_odom is None else _moved(self.T_map_odom, q)

    def configuration_in_odom(self, q: Array) -> Array:
        """The inverse of `configuration_in_map`, as exact as the ground is level."""
        return q if self.T_map_odom is None else _moved(self.T_map_odom.inverse(), q)

    def pose_in_map(self, T_odom_x: Any) -> Any:
        """T_map_x (pin.SE3) of T_odom_x."""
        return T_odom_x if self.T_map_odom is None else self.T_map_odom * T_odom_x

    def pose_in_odom(self, T_map_x: Any) -> Any:
        """T_odom_x (pin.SE3) of T_map_x."""
        return T_map_x if self.T_map_odom is None else self.T_map_odom.actInv(T_map_x)

    def position_in_map(self, position: Array) -> Array:
        """A position (3, m) in map of one in odom."""
        out: Array = position if self.T_map_odom is None else self.T_map_odom.act(position)
        return out

    def position_in_odom(self, position: Array) -> Array:
        """A position (3, m) in odom of one in map."""
        out: Array = position if self.T_map_odom is None else self.T_map_odom.actInv(position)
        return out

    def capsules_in_odom(self, capsules: tuple[Capsule, ...]) -> tuple[Capsule, ...]:
        """Capsules in odom of those in map."""
        if self.T_map_odom is None or not capsules:
            return capsules
        T = self.T_map_odom.inverse()
        ends = np.array([(each.start, each.end) for each in capsules]).reshape(-1, 3) @ T.rotation.T + T.translation
        return tuple(
            replace(each, start=vector3(start), end=vector3(end))
            for each, (start, end) in zip(capsules, ends.reshape(-1, 2, 3), strict=True)
        )


def _moved(T: Any, q: Array) -> Array:
    """A configuration (12) with its base moved by the horizontal part of a transform (pin.SE3)."""
    out = q.copy()
    turned = math.atan2(T.rotation[1, 0], T.rotation[0, 0])
    c, s = math.cos(turned), math.sin(turned)
    out[0] = T.translation[0] + c * q[0] - s * q[1]
    out[1] = T.translation[1] + s * q[0] + c * q[1]
    out[2] = q[2] + turned
    return out
