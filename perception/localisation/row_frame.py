"""The frame `map` of the row, in which perception stores and tells positions, and `odom`, which drifts against it.

The transform in use differs from the newest estimate by less than the estimate can tell. It stays the identity until
the odometry is wrong by more than `_DEPARTS`, so that a robot with good odometry has the same results as without.
"""

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
import pinocchio as pin
from msgspec.structs import replace as replace_message

from perception.arrays import Array, Labels
from perception.localisation.estimator import RZ, Cause, Estimate, RowLocaliser, X, Y
from perception.localisation.sighting import Axis, sighting
from perception.plant.model import Cane, Plant, Spur
from perception.segmentation.frame import View
from perception.tracking.camera_rays import Ray
from rolling_panda import messages as m
from rolling_panda import reasons
from rolling_panda.messages.perception import CloseUpResult, CutSight, Localisation
from rolling_panda.messages.types import Vector3
from rolling_panda.model.robot import pose_message
from rolling_panda.model.wire_values import vector3

#: Error at the wood in view from which on another transform is used (m): than the identity, and than any other.
_DEPARTS, _FOLLOWS = 0.006, 0.0015
#: The wood in view: so far before the camera, and so far to either side (m).
_AHEAD, _ASIDE = 0.8, 0.4
#: A place in the map that is known worse than this is looked for in pictures from near too (m, SD).
_UNCERTAIN = 0.004

_CAUSES: dict[Cause, Callable[[], m.Reason]] = {
    "time ran back": reasons.lost_by_clock,
    "odometry jumped": reasons.lost_by_odometry,
    "other wood": reasons.lost_among_others,
}
#: x, y and heading among the six components of the estimate.
_PLANAR = [X, Y, RZ]


class RowFrame:
    """The transform from odom to map, by which frames are used in map."""

    def __init__(self, on: bool) -> None:
        """At the origin of both; off, they stay one."""
        self._on = on
        self._localiser = RowLocaliser()
        #: T_map_odom in use; None for the identity.
        self._T: pin.SE3 | None = None

    @property
    def estimate(self) -> Estimate:
        """The newest estimate, which may differ a little from what is in use."""
        return self._localiser.estimate

    @property
    def T_map_odom(self) -> pin.SE3:
        """The transform in use."""
        return pin.SE3.Identity() if self._T is None else self._T

    @property
    def lost(self) -> m.Reason | None:
        """Why the place in the row is unknown; None if it is known."""
        estimate = self.estimate
        if not self._on or estimate.state != "lost":
            return None
        cause = reasons.lost_by_way(estimate.way) if estimate.cause not in _CAUSES else _CAUSES[estimate.cause]()
        return reasons.lost_in_row(cause)

    def message(self, stamp: float) -> Localisation:
        """The message, after a frame of this time (s)."""
        estimate = self.estimate
        a, b, c, d, e, f = estimate.covariance[np.ix_(_PLANAR, _PLANAR)][np.triu_indices(3)].tolist()
        return Localisation(
            header=m.Header(stamp, "map"),
            state=estimate.state if self._on else "off",
            T_map_odom=pose_message(self.T_map_odom),
            covariance=(a, b, c, d, e, f),
            way=estimate.way,
            bodies=estimate.bodies,
            reason=self.lost,
        )

    @property
    def uncertain(self) -> bool:
        """Whether the base has moved since it was located, so far that pictures from near have to tell where it is."""
        return self._on and self._localiser.moved and self._localiser.spread > _UNCERTAIN

    def forget(self) -> None:
        """Forget the wood, which another calibration sees elsewhere; what is known of the place stays."""
        self._localiser.forget()

    def predict(self, base: Array, stamp: float, inertial: bool = False) -> None:
        """The base is at a pose in odom (3) at a time (s), which `inertial` sensors have corrected or not."""
        if self._on:
            self._localiser.predict(base, stamp, inertial)

    def update(self, view: View, labels: Labels, canes: Sequence[Axis], near: bool = False) -> None:
        """Compare a frame, in odom, with the wood that was seen before; `near`: it is a close-up."""
        if not self._on:
            return
        estimate = self._localiser.update(sighting(view, labels, canes), view.t, near)
        if estimate.state != "located":
            return
        ahead, aside = view.t + _AHEAD * view.R[:, 2], _ASIDE * view.R[:, 0]
        used, off = self.T_map_odom, 0.0
        for place in (ahead - aside, ahead + aside):
            off = max(off, float(np.linalg.norm(estimate.T_map_odom.act(place) - used.act(place))))
        if off > (_DEPARTS if self._T is None else _FOLLOWS):
            self._T = estimate.T_map_odom

    def in_map(self, view: View) -> View:
        """A frame in odom as one in map."""
        T = self._T
        return view if T is None else replace(view, R=T.rotation @ view.R, t=T.act(view.t))

    def plant_in_map(self, plant: Plant) -> Plant:
        """The plant of a frame in odom as one in map."""
        T = self._T
        if T is None:
            return plant
        R, t = T.rotation, T.translation

        def moved(points: Array) -> Array:
            out: Array = points @ R.T + t
            return out

        def cane(each: Cane) -> Cane:
            return replace(each, axis=moved(each.axis))

        def spur(each: Spur) -> Spur:
            axis = None if each.axis is None else moved(each.axis)
            return replace(each, position=moved(each.position), axis=axis, canes=tuple(cane(c) for c in each.canes))

        return Plant(
            tuple(spur(each) for each in plant.spurs),
            moved(plant.trunks),
            tuple(moved(axis) for axis in plant.unrooted),
        )

    def ray_in_map(self, ray: Ray) -> Ray:
        """A ray in odom as one in map."""
        T = self._T
        return ray if T is None else Ray(T.act(ray.origin), T.rotation @ ray.direction)

    def check_in_odom(self, check: CloseUpResult) -> CloseUpResult:
        """The result of a close-up in map as it is told: in odom, since it is measured from where the arm is."""
        if self._T is None or check.position is None or check.tangent is None:
            return check
        return replace_message(check, position=self._place(check.position), tangent=self._direction(check.tangent))

    def sight_in_odom(self, sight: CutSight) -> CutSight:
        """The same of a picture on the way to a cut; the transform is nearly level, and leaves the covariance."""
        if self._T is None or sight.position is None:
            return sight
        return replace_message(sight, position=self._place(sight.position))

    def _place(self, position: Vector3) -> Vector3:
        assert self._T is not None
        return vector3(self._T.actInv(np.array(position)))

    def _direction(self, direction: Vector3) -> Vector3:
        assert self._T is not None
        turned = self._T.rotation.T @ np.array(direction)
        return vector3(turned / np.linalg.norm(turned))
