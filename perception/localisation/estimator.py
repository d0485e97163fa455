"""Where the base is in the map: odometry predicts, wood that was seen before corrects.

The state is the pose of the base in the map: x, y and the heading, which drift with the odometry, and the height and
the tilt, which follow the ground and return to what they were. Its covariance is that relative to the wood nearby, as a
cut needs it; from one end of the row to the other the map itself may be longer or more bent than the row.

A frame is compared with the lines of the map: canes, posts, trunks, cordons, wires. A sample has to be on its line, but
may be anywhere along it, so that a wire tells nothing of the place along the row. The normal equations of all samples
are added to those of the prediction, weakened by what all samples of a frame have in common (`_COMMON`).
"""

from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
import pinocchio as pin

from perception.arrays import Array
from perception.localisation.row_map import Neighbourhood, RowMap
from perception.localisation.sighting import ALONG, CANE, UPRIGHT, WIRES, Sighting
from rolling_panda.model.robot import on_plane

State = Literal["odometry", "located", "lost"]
Cause = Literal["", "time ran back", "odometry jumped", "other wood", "too far without wood"]

#: Indices of the state: position, rotation about the axes of the map.
X, Y, Z, RX, RY, RZ = range(6)

#: Errors of the base's way, as a share of it, and of its heading without a gyroscope (rad/m): slip and wear of the
#: wheels (SD), correlated over a length (m). Half the track (m).
_SLIP, _VEERS, _CORRELATED, _HALF_TRACK = 0.035, 0.088, 0.5, 0.28
#: Height (m) and tilt (rad) of the base on uneven ground (SD), and the way over which they change (m).
_HEIGHT, _TILT, _UNEVEN = 0.008, 0.015, 0.4
#: Where inertial sensors tell how the base stands: by how much height (m), tilt and heading (rad) are off after a metre
#: (SD), growing with the square root of the way.
_MEASURED_HEIGHT, _MEASURED_TILT, _GYROSCOPE = 0.008, 0.004, 0.004
#: Standard deviation of a sample across its line by kind (m): depth, centre line, wind.
_NOISE = {CANE: 0.004, UPRIGHT: 0.005, ALONG: 0.005, WIRES: 0.008}
#: What the samples of one frame have in common: tilt while driving, wind, depth (m and rad, SD).
_COMMON = np.array([0.0025, 0.0025, 0.0025, 0.003, 0.003, 0.003])
#: What many frames have in common, so that it is not averaged: hand-eye calibration from another posture, errors of the
#: map (m and rad, SD).
_LASTING = np.array([0.003, 0.002, 0.002, 0.002, 0.002, 0.002])
#: Distances within which a sample may be on a line, round by round (m), and smallest cosine with it.
_GATES, _ALIGNED = (0.05, 0.03, 0.02, 0.015, 0.015), 0.95
#: A residual counts half from this many standard deviations on (Cauchy).
_ROBUST = 2.0
#: Samples nearer than this to a line of the map are on it; those nearer than this are where wood is known (m).
_ON, _KNOWN = 0.012, 0.05
#: Share of samples at known wood that have to be on it, and least number of bodies that tell the place.
_EXPLAINED, _BODIES = 0.6, 3
#: The same for a frame from near, which shows laterals and leaves that the map has not: with few bodies, and with more.
_EXPLAINED_NEAR, _MORE_BODIES, _EXPLAINED_MORE = 0.5, 5, 0.35
#: Spacing of places along the row from which the comparison starts where the prediction is worse than this (m), and
#: how many standard deviations they reach.
_START, _STARTS = 0.02, 2.5
#: A place farther than this from the best (m) cannot be excluded if it explains no less than this share less. A squared
#: Mahalanobis distance of 1 from the prediction counts as so much of it: 8 are excluded.
_APART, _AMBIGUOUS, _UNLIKELY = 0.03, 0.08, 0.01
#: Largest squared Mahalanobis distance of a correction: 99.99 % of six components.
_PLAUSIBLE = 27.9
#: The base rests within this (m, rad) of where it was; frames that it is corrected by while it rests.
_RESTS, _AT_REST = 0.003, 3
#: A frame farther than this from those kept is kept (m).
_KEEP = 0.25
#: Frames in succession that show other wood than the map has, after which the robot is lost.
_OTHERS = 4
#: The same shares before a lost robot counts as found.
_FOUND, _FOUND_BODIES = 0.75, 5
#: Faster than this, beyond an allowance, odometry jumps (m/s, rad/s; m or rad).
_FASTEST, _TURNS, _JUMP = 2.0, 3.0, 0.3
#: A frame that is older than the last is late; one that is older by more than this is of a clock that began anew (s).
_ORDER, _LATE = 1e-6, 1.0
#: Added to the covariance of a robot that is lost (m², rad²).
_DOUBT = np.diag(np.array([0.1, 0.05, 0.02, 0.03, 0.03, 0.05]) ** 2)
#: Time from the joint state of a frame to its exposure, about (s).
_DELAY = 0.02
#: Standard deviation along the row, at the row, from which on the robot is lost (m).
_LOST = 0.08


@dataclass(frozen=True)
class Estimate:
    """An estimate.

    Attributes:
        T_map_odom: From odom to map (pin.SE3).
        T_map_base: Pose of the base (pin.SE3).
        covariance: Of x, y, z (m) and rotations about x, y, z of the map (rad), at the base (6×6).
        state: `odometry` before any wood was recognised, `located`, `lost`.
        cause: Why it is lost.
        way: Way since wood was last recognised (m).
        bodies: Canes, posts and trunks that were recognised last.
    """

    T_map_odom: pin.SE3
    T_map_base: pin.SE3
    covariance: Array
    state: State
    cause: Cause
    way: float
    bodies: int


@dataclass(frozen=True)
class _Fit:
    """The comparison of a sighting with the map: normal equations about the prediction, and how much it explains."""

    state: Array
    information: Array
    vector: Array
    explained: float
    bodies: int


class RowLocaliser:
    """Estimates the pose of the base in the map. It has no clock: the same sightings give the same estimates."""

    def __init__(self, row_map: RowMap | None = None) -> None:
        """At the origin of the map, which is then that of odom.

        Args:
            row_map: Wood that is known already; None in an unknown row.
        """
        self._map = RowMap() if row_map is None else row_map
        #: x, y, z, rotations about x and y of the map, heading.
        self._pose: Array = np.zeros(6)
        self._covariance: Array = np.diag([1e-6, 1e-6, 1e-6, 1e-6, 1e-6, 1e-6])
        self._odom: Array | None = None
        #: Pose in odom up to which the way has been counted.
        self._counted: Array = np.zeros(3)
        self._stamp = -np.inf
        self._way = 0.0
        self._since_fix = 0.0
        self._at_rest = 0
        self._others = 0
        self._bodies = 0
        self._speed = 0.0
        self._late = False
        self._state: State = "odometry"
        self._cause: Cause = ""

    @property
    def estimate(self) -> Estimate:
        """The present estimate."""
        T_map_base = _placement(self._pose)
        odom = np.zeros(3) if self._odom is None else self._odom
        T_odom_base = on_plane(odom)
        return Estimate(
            T_map_base * T_odom_base.inverse(),
            T_map_base,
            self._covariance + self._lasting(),
            self._state,
            self._cause,
            self._way,
            self._bodies,
        )

    def forget(self) -> None:
        """Forget the wood that was seen; the pose stays."""
        self._map = RowMap()

    def predict(self, base: Array, stamp: float, inertial: bool = False) -> Estimate:
        """Advance to a pose of the base in odom (3) at a time (s), which `inertial` sensors have corrected or not.

        A clock that starts anew, or odometry that does, leaves the base where it was in the map, but lost: wood has to
        be recognised before the place counts as known again. A frame that comes late changes nothing.
        """
        self._late = stamp < self._stamp - _ORDER
        if self._odom is None:
            self._odom, self._stamp = base.copy(), stamp
            self._counted = base.copy()
            self._pose[[X, Y, RZ]] = base
            return self.estimate
        moved, passed = base - self._odom, stamp - self._stamp
        if passed < -_LATE:
            self._late = False
            return self._anew(base, stamp, "time ran back")
        if self._late:
            return self.estimate
        if np.hypot(moved[0], moved[1]) > _FASTEST * passed + _JUMP or abs(moved[2]) > _TURNS * passed + _JUMP:
            return self._anew(base, stamp, "odometry jumped")
        self._speed = float(np.hypot(moved[0], moved[1])) / max(passed, 0.1)
        self._advance(base, inertial)
        self._odom, self._stamp = base.copy(), stamp
        if self.spread > _LOST and self._map.cameras and self._state != "lost":
            self._lost("too far without wood")
        return self.estimate

    def update(self, seen: Sighting, camera: Array, near: bool = False) -> Estimate:
        """Compare a sighting with the map, and keep it where the map has nothing yet.

        Args:
            seen: In odom, from the pose of the last `predict`.
            camera: Position of the camera (3, m, odom).
            near: It shows little of the row, as a close-up does. In the wind that may be nowhere, and the robot is not
                lost for it.
        """
        if self._late:
            return self.estimate
        T = self.estimate.T_map_odom
        here, eye = seen.moved(T.rotation, T.translation), T.act(camera)
        around = self._map.around(eye)
        known = len(around) > 0
        if not known:
            if self._state != "lost" and len(seen.of_kind(CANE)):
                self._map.add(here, eye)
            return self.estimate
        if self._at_rest >= _AT_REST and self._state == "located":
            return self.estimate
        fit = self._search(here, around)
        if fit is None:
            return self.estimate
        if self._state == "lost" and (fit.explained < _FOUND or fit.bodies < _FOUND_BODIES):
            return self.estimate
        if not _recognised(fit, near) or not self._correct(fit):
            if near:
                return self.estimate
            self._others += 1
            if self._others == _OTHERS:
                self._lost("other wood")
                self._covariance += _DOUBT
            return self.estimate
        self._others = 0
        if fit.bodies >= _BODIES:
            self._state, self._cause, self._way, self._bodies = "located", "", 0.0, fit.bodies
            self._since_fix = 0.0
            self._at_rest += 1
        T = self.estimate.T_map_odom
        eye = T.act(camera)
        if self._state == "located" and not near and self._map.distance(eye) > _KEEP:
            self._map.add(seen.moved(T.rotation, T.translation), eye)
        return self.estimate

    def _anew(self, base: Array, stamp: float, cause: Cause) -> Estimate:
        """The same place in the map at another pose in odom."""
        self._odom, self._stamp = base.copy(), stamp
        self._counted = base.copy()
        self._covariance = self._covariance + _DOUBT
        return self._lost(cause)

    def _lost(self, cause: Cause) -> Estimate:
        self._state, self._cause = "lost", cause
        return self.estimate

    def _lasting(self) -> Array:
        """Covariance of errors that do not change from frame to frame, among them that a frame is exposed late."""
        out: Array = np.diag(_LASTING**2)
        out[[X, Y], [X, Y]] += (_DELAY * self._speed) ** 2
        return out

    @property
    def moved(self) -> bool:
        """Whether the base has moved since frames told its place as well as they can."""
        return self._at_rest < _AT_REST

    @property
    def spread(self) -> float:
        """Standard deviation along the row of wood a metre beside the base (m)."""
        P = self._covariance
        return float(np.sqrt(max(P[X, X] + P[RZ, RZ] - 2 * P[X, RZ], 0.0)))

    def _advance(self, base: Array, inertial: bool) -> None:
        assert self._odom is not None
        c, s = np.cos(self._pose[RZ] - self._odom[2]), np.sin(self._pose[RZ] - self._odom[2])
        dx, dy = base[:2] - self._odom[:2]
        step, turned = np.array([c * dx - s * dy, s * dx + c * dy]), float(base[2] - self._odom[2])
        way = float(np.hypot(*(base - self._counted)[:2]))
        rolled = way + abs(float(base[2] - self._counted[2])) * _HALF_TRACK
        if rolled < _RESTS:
            # Noise of the odometry at rest is no way; what creeps away is.
            self._pose[[X, Y]] += step
            self._pose[RZ] += turned
            return
        self._counted = base.copy()
        self._at_rest = 0
        self._way += way
        F = np.eye(6)
        F[X, RZ], F[Y, RZ] = -step[1], step[0]
        # What inertial sensors leave does not follow the ground: it grows with the way.
        stays = 1.0 if inertial else float(np.exp(-rolled / _UNEVEN))
        F[[Z, RX, RY], [Z, RX, RY]] = stays
        P = F @ self._covariance @ F.T
        before = self._since_fix
        self._since_fix += rolled
        walked = _walked(before + rolled) - _walked(before)
        heading = self._pose[RZ] + turned / 2
        along = np.array([np.cos(heading), np.sin(heading)])
        P[:2, :2] += _SLIP**2 * walked * (np.outer(along, along) + 0.04 * np.eye(2))
        P[RZ, RZ] += _GYROSCOPE**2 * rolled if inertial else _VEERS**2 * walked
        for index, spread, measured in (
            (Z, _HEIGHT, _MEASURED_HEIGHT),
            (RX, _TILT, _MEASURED_TILT),
            (RY, _TILT, _MEASURED_TILT),
        ):
            P[index, index] += measured**2 * rolled if inertial else (1.0 - stays**2) * spread**2
        self._covariance = P
        self._pose[[X, Y]] += step
        self._pose[RZ] += turned
        self._pose[[Z, RX, RY]] *= stays

    def _search(self, seen: Sighting, around: Neighbourhood) -> _Fit | None:
        """The best comparison over starts along the row; None where nothing tells whether it is the right one."""
        spread = self.spread
        reach = min(_STARTS * spread, 0.25) if spread > _START / 2 or self._state == "lost" else 0.0
        count = int(np.ceil(reach / _START))
        fits = []
        for k in sorted(range(-count, count + 1), key=abs):
            start = np.zeros(6)
            start[X] = k * _START
            fits.append(self._fit(seen, around, start, _GATES if count == 0 else _GATES[:3]))
        best = max(fits, key=self._merit)
        if count:
            others = [fit for fit in fits if abs(_at_wood(fit.state) - _at_wood(best.state)) > _APART]
            if any(self._merit(fit) > self._merit(best) - _AMBIGUOUS for fit in others):
                # Another place explains the frame as well: of the place along the row it tells nothing.
                best = self._fit(seen, around, np.zeros(6), _GATES, along=False)
                return replace(best, bodies=0)
            best = self._fit(seen, around, best.state, _GATES[2:])
        return best

    def _merit(self, fit: _Fit) -> float:
        """How much a fit explains, less its squared Mahalanobis distance from the prediction, scaled."""
        return fit.explained - _UNLIKELY * float(fit.state @ np.linalg.solve(self._covariance, fit.state))

    def _fit(
        self, seen: Sighting, around: Neighbourhood, start: Array, gates: tuple[float, ...], along: bool = True
    ) -> _Fit:
        """Gauss-Newton from a start (6), as a correction of the prediction, with the prediction as prior."""
        base, prior = self._pose[:3], np.linalg.inv(self._covariance)
        delta, H, g = start.copy(), np.zeros((6, 6)), np.zeros(6)
        kinds = (CANE, UPRIGHT, ALONG, WIRES) if along else (ALONG, WIRES)
        for gate in gates:
            points = _corrected(seen.points, base, delta)
            H, g = np.zeros((6, 6)), np.zeros(6)
            for kind in kinds:
                # Samples of wires and cordons are farther apart than those of canes.
                within = gate if kind == CANE else max(gate, 0.04)
                found = around.match(seen, points, kind, within, _ALIGNED if kind != WIRES else 0.8)
                if not len(found.rows):
                    continue
                square = np.eye(3) - found.directions[:, :, None] * found.directions[:, None, :]
                off = np.einsum("nij,nj->ni", square, found.places - points[found.rows])
                J = square @ _jacobian(seen.points[found.rows] - base)
                noise = _NOISE[kind]
                size = np.linalg.norm(off, axis=1) / noise
                weight = seen.weights[found.rows] / noise**2 / (1.0 + (size / _ROBUST) ** 2)
                weight[np.linalg.norm(off, axis=1) > gate] = 0.0
                J_w = J * weight[:, None, None]
                H += np.einsum("nij,nik->jk", J_w, J)
                # Residual about the prediction, not about the present iterate.
                g += np.einsum("nij,ni->j", J_w, off + np.einsum("nij,j->ni", J, delta))
            delta = np.asarray(np.linalg.solve(H + prior, g), dtype=np.float64)
        explained, bodies = self._explained(seen, around, delta)
        return _Fit(delta, H, g, explained, bodies)

    def _explained(self, seen: Sighting, around: Neighbourhood, delta: Array) -> tuple[float, int]:
        """Share of the samples at known wood that are on it, and the number of bodies that are."""
        points = _corrected(seen.points, self._pose[:3], delta)
        on = known = 0.0
        bodies: set[int] = set()
        for kind in (CANE, UPRIGHT):
            rows, tree = seen.of_kind(kind), around.trees[kind]
            if tree is None or not len(rows):
                continue
            distance = tree.query(points[rows], distance_upper_bound=_KNOWN)[0]
            weight = seen.weights[rows]
            near = distance < (_ON if kind == CANE else 0.02)
            known += float(weight[np.isfinite(distance)].sum())
            on += float(weight[near].sum())
            found, counts = np.unique(seen.bodies[rows[near]], return_counts=True)
            bodies.update(found[counts >= 4].tolist())
        if known == 0.0:
            return 1.0, 0
        return on / known, len(bodies)

    def _correct(self, fit: _Fit) -> bool:
        """Add what the frame tells to the prediction; False where they contradict each other."""
        common = np.diag(_COMMON**2)
        # (H⁻¹ + C)⁻¹ without the inverse of H, which a frame without canes and posts has none of.
        shrink = np.linalg.inv(np.eye(6) + fit.information @ common)
        H, g = shrink @ fit.information, shrink @ fit.vector
        H = (H + H.T) / 2
        P = np.asarray(np.linalg.inv(np.linalg.inv(self._covariance) + H), dtype=np.float64)
        delta = P @ g
        if float(delta @ np.linalg.solve(self._covariance + 1e-9 * np.eye(6), delta)) > _PLAUSIBLE:
            return False
        self._pose = self._pose + delta
        # Frames from one place err alike: their mean is not better than what they have in common.
        short = np.maximum(0.5 * np.diag(common) - np.diag(P), 0.0) if fit.bodies else np.zeros(6)
        self._covariance = (P + P.T) / 2 + np.diag(short)
        return True


def _recognised(fit: _Fit, near: bool) -> bool:
    """Whether enough of the known wood is where the fit has it; of a frame from near."""
    if not near or fit.bodies < _BODIES:
        return fit.explained >= _EXPLAINED
    return fit.explained >= (_EXPLAINED_MORE if fit.bodies >= _MORE_BODIES else _EXPLAINED_NEAR)


def _at_wood(correction: Array) -> float:
    """What a correction (6) is along the row a metre beside the base (m)."""
    return float(correction[X] - correction[RZ])


def _walked(way: float) -> float:
    """Variance of the integral over a way of noise with variance 1, correlated over `_CORRELATED` (m²)."""
    ratio = way / _CORRELATED
    return 2.0 * _CORRELATED**2 * (ratio - 1.0 + float(np.exp(-ratio)))


def _corrected(points: Array, base: Array, delta: Array) -> Array:
    out: Array = points + delta[:3] + np.cross(delta[3:], points - base)
    return out


def _jacobian(levers: Array) -> Array:
    """d(t + ω × r)/d(t, ω) for levers r (N×3), as N×3×6."""
    J = np.zeros((len(levers), 3, 6))
    J[:, 0, 0] = J[:, 1, 1] = J[:, 2, 2] = 1.0
    x, y, z = levers.T
    J[:, 0, 4], J[:, 0, 5] = z, -y
    J[:, 1, 3], J[:, 1, 5] = -z, x
    J[:, 2, 3], J[:, 2, 4] = y, -x
    return J


def _placement(pose: Array) -> pin.SE3:
    tilt = pin.exp3(np.array([pose[RX], pose[RY], 0.0]))
    return pin.SE3(tilt @ pin.exp3(np.array([0.0, 0.0, pose[RZ]])), pose[:3].copy())
