"""The frames of REP-105: in `map` the row stands still, and `odom`, which is continuous, drifts against it.

Motion is computed from the configuration, which has the base level. So "in odom" is here as if the base stood level
(`rolling_panda.model.base_attitude`); on level ground, and without inertial sensors, that is odom itself.
"""

import math
from dataclasses import dataclass
from functools import cached_property
from typing import Any, TypeVar

import numpy as np
import pinocchio as pin
from msgspec.structs import replace

from rolling_panda.errors import ModelError
from rolling_panda.messages.perception import Capsule, CloseUpResult, CutSight, Localisation
from rolling_panda.messages.robot import CameraFrame, Odometry
from rolling_panda.messages.types import Pose
from rolling_panda.model.base_attitude import T_odom_level, camera_in_odom
from rolling_panda.model.differential_drive import Array
from rolling_panda.model.robot import RobotModel, placement
from rolling_panda.model.wire_values import vector3

_ORIGIN = Pose((0.0, 0.0, 0.0), (0.0, 0.0, 0.0, 1.0))
#: Radius of what the base carries, and the largest movement within it that is ignored (m).
_REACH, _MOVED = 1.2, 0.0007

_Seen = TypeVar("_Seen", CloseUpResult | None, CutSight | None)


@dataclass(frozen=True, eq=False)
class MapFrame:
    """Where odom is in map; its methods return what they are given while the two are one.

    Attributes:
        T_map_odom: The transform (pin.SE3); None for the identity.
        pose: The same as a message.
        T_odom_level: From odom as if the base stood level (pin.SE3); None for the identity.
    """

    T_map_odom: Any = None
    pose: Pose = _ORIGIN
    T_odom_level: Any = None

    @cached_property
    def T_map_level(self) -> Any:
        """Both transforms in one (pin.SE3); None for the identity."""
        if self.T_map_odom is None or self.T_odom_level is None:
            return self.T_odom_level if self.T_map_odom is None else self.T_map_odom
        return self.T_map_odom * self.T_odom_level

    def after(self, localisation: Localisation) -> "MapFrame":
        """As perception tells it now: the same object while the transform stays, or where its quaternion is none."""
        pose = localisation.T_map_odom
        if pose == self.pose:
            return self
        try:
            return MapFrame(None if pose == _ORIGIN else placement(pose), pose, self.T_odom_level)
        except ModelError:
            return self

    def standing(self, odometry: Odometry, least: float = _MOVED) -> "MapFrame":
        """With the base as it stands now: the same object while what it carries has moved less than `least` (m)."""
        now, before = T_odom_level(odometry.pose, odometry.attitude), self.T_odom_level
        if now is None or before is None:
            return self if now is before else MapFrame(self.T_map_odom, self.pose, now)
        change, base = before.actInv(now), np.array([odometry.pose.x, odometry.pose.y, 0.0])
        turned = float(np.linalg.norm(pin.log3(change.rotation)))
        moved = float(np.linalg.norm(change.act(base) - base)) + _REACH * turned
        return self if moved < least else MapFrame(self.T_map_odom, self.pose, now)

    def camera(self, frame: CameraFrame, model: RobotModel) -> Any:
        """T_map_camera (pin.SE3) when a frame was taken; the model's `data` is overwritten."""
        T_odom_camera = camera_in_odom(frame, model)
        return T_odom_camera if self.T_map_odom is None else self.T_map_odom * T_odom_camera

    def tilted(self, position: Array) -> Array:
        """A position (3, m) in odom itself, of one as if the base stood level."""
        out: Array = position if self.T_odom_level is None else self.T_odom_level.act(position)
        return out

    def levelled(self, position: Array) -> Array:
        """The inverse of `tilted`."""
        out: Array = position if self.T_odom_level is None else self.T_odom_level.actInv(position)
        return out

    def level(self, seen: _Seen) -> _Seen:
        """What was seen, with its position in odom as if the base stood level."""
        if self.T_odom_level is None or seen is None or seen.position is None:
            return seen
        return replace(seen, position=vector3(self.levelled(np.array(seen.position))))

    def configuration_in_map(self, q: Array) -> Array:
        """The same configuration (12) with the base where it is in map. Height and tilt of the ground are left out."""
        return q if self.T_map_odom is None else _moved(self.T_map_odom, q)

    def configuration_in_odom(self, q: Array) -> Array:
        """The inverse of `configuration_in_map`, as exact as the ground is level."""
        return q if self.T_map_odom is None else _moved(self.T_map_odom.inverse(), q)

    def pose_in_map(self, T_odom_x: Any) -> Any:
        """T_map_x (pin.SE3) of T_odom_x."""
        return T_odom_x if self.T_map_level is None else self.T_map_level * T_odom_x

    def pose_in_odom(self, T_map_x: Any) -> Any:
        """T_odom_x (pin.SE3) of T_map_x."""
        return T_map_x if self.T_map_level is None else self.T_map_level.actInv(T_map_x)

    def position_in_map(self, position: Array) -> Array:
        """A position (3, m) in map of one in odom."""
        out: Array = position if self.T_map_level is None else self.T_map_level.act(position)
        return out

    def position_in_odom(self, position: Array) -> Array:
        """A position (3, m) in odom of one in map."""
        out: Array = position if self.T_map_level is None else self.T_map_level.actInv(position)
        return out

    def capsules_in_odom(self, capsules: tuple[Capsule, ...]) -> tuple[Capsule, ...]:
        """Capsules in odom of those in map."""
        if self.T_map_level is None or not capsules:
            return capsules
        T = self.T_map_level.inverse()
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
