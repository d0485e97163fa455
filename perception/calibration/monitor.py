"""Monitor of the camera's calibration: the same canes, seen from several poses and at several speeds.

A camera that is turned by δ and shifted by τ against its calibration (in its own frame) sees a point x of its frame at
R x + t in place of R (x + δ × x + τ) + t. If its pictures are exposed by Δ later than the joints that come with them,
and it moves with v and ω (in its own frame), it is turned by ω Δ and shifted by v Δ on top. Two pictures of one cane
thus disagree by A (δ, τ, Δ), with

    A = G₂ − G₁,  G = [R [x]ₓ,  −R,  R [x]ₓ ω − R v].

Only the component across the cane is compared. The row's true position cancels out, and so do the wheels while the base
stands. Between two successive pictures the base may have moved. Such a pair tells Δ alone: slip and tilt of the base,
and the camera's mount, are unknowns of that pair. The sizes of slip and tilt are estimated. Each picture in motion has
a timing error of its own.
"""

from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import pinocchio as pin
from scipy.spatial import cKDTree

from perception.arrays import Array, interpolate
from rolling_panda import reasons
from rolling_panda.messages.types import Reason

#: The base stands while it is within this of where it stood (m, rad).
_STANDS, _FACES = 0.002, 0.002
#: Pictures of one pose say nothing about the camera: they have to be so far apart (m, rad). Most to compare with.
_APART, _TURNED, _PICTURES = 0.03, 0.05, 8
#: Spacing of samples of a cane (m), the length from its base that is compared (m), and samples that a match needs.
_SPACING, _LENGTH, _LEAST = 0.01, 0.35, 6
#: Canes nearer than this are taken for one (m), if they are parallel (cosine) and all samples agree to this (m, SD).
_REACH, _PARALLEL, _AGREE = 0.02, 0.95, 0.004
#: Standard deviation of a comparison (m): of depth and centre line in both pictures.
_NOISE = 0.003
#: Smallest variance of comparisons, as a share of that noise: errors that they have in common leave no residual.
_QUIETEST = 0.3
#: What the calibration is believed to before anything was seen (rad, m, s, SD).
_PRIOR = np.array([0.05] * 3 + [0.004] * 3 + [0.1])
#: Comparisons that are kept, and that an estimate needs; pictures that it needs.
_KEPT, _NEEDED, _NEEDED_PICTURES = 800, 20, 3
#: A residual of so many standard deviations counts less (Huber); rounds of reweighting.
_HUBER, _ROUNDS = 1.5, 8
#: At one place pictures are of two motions if their velocities differ by this (m/s, rad/s).
_FASTER, _TURNING = 0.05, 0.05
#: Most way (m) and time (s) from one picture to the next while the base moves, and its highest speed (m/s).
_DRIVEN, _PASSED, _FASTEST = 0.3, 3.0, 0.35
#: Errors of the base by wheels and ground after a way, SD: along and aside (m/m), heading (rad/m), height (m) and tilt
#: (rad), which change over a length (m).
_SLIP, _ASIDE, _TURN, _HEIGHT, _TILT, _UNEVEN = 0.035, 0.02, 0.09, 0.008, 0.015, 0.4
_HALF_TRACK = 0.28
#: Error of time of one picture (s, SD).
_JITTER = 0.010
#: Columns of a comparison: of the mount, and of all that is estimated. The time of either picture follows.
_MOUNT, _ESTIMATED = slice(0, 6), slice(0, 7)
#: Unknowns of a way of the base: 3 along its axes, 3 about them, and the mount.
_WHEELS, _GROUND, _UNKNOWNS = [0, 1, 5], [2, 3, 4], 12
#: The sizes of these unknowns and of errors of time are estimated. What is assumed counts as so many observations.
_ASSUMED = 2.0
#: Bounds of that size, as a multiple of the above.
_SMALLEST, _LARGEST = 0.1, 4.0
#: Comparisons with a base that has moved: those with a change of velocity that are kept, and others, by picture.
_KEPT_CHANGES, _KEPT_STEADY = 60, 20
#: Pictures tell the offset if they alone give this standard deviation (s). So many moving ones have to.
_TELLS, _NEEDED_MOVING = 0.1, 3
#: An offset from this on is told (s): 2.5 mm at the speed of a survey. Its interval is of so many standard deviations.
LATE_WARNS, _REGION_99 = 0.010, 2.6
#: A turn from this on is told, if its 95 % region (of two components) does not touch zero (rad).
WARNS, _REGION_95 = np.radians(0.25), 2.45


@dataclass(frozen=True)
class MountError:
    """Error of the calibration.

    Attributes:
        turn: δ (3, rad), about the camera's axes: x right, y down, z forward.
        shift: τ (3, m).
        covariance: Of both (6×6).
        pictures: Number of pictures that were compared with earlier ones.
    """

    turn: Array
    shift: Array
    covariance: Array
    pictures: int

    @property
    def angle(self) -> float:
        """Angle between where the camera looks and where its calibration has it look (rad)."""
        return float(np.hypot(self.turn[0], self.turn[1]))

    @property
    def interval(self) -> float:
        """Half the extent of the 95 % region in the direction of that angle (rad)."""
        along = np.array([self.turn[0], self.turn[1]]) / max(self.angle, 1e-9)
        return float(_REGION_95 * np.sqrt(along @ self.covariance[:2, :2] @ along))

    @property
    def warning(self) -> Reason | None:
        """What to tell an operator; None while the error is small or not significant."""
        if self.angle <= WARNS or self.angle <= self.interval:
            return None
        about_x, about_y = self.turn[0], self.turn[1]
        if abs(about_y) >= abs(about_x):
            told = reasons.camera_looks_right if about_y > 0.0 else reasons.camera_looks_left
        else:
            told = reasons.camera_looks_up if about_x > 0.0 else reasons.camera_looks_down
        return told(float(np.degrees(self.angle)), float(np.degrees(self.interval)))


@dataclass(frozen=True)
class TimeOffset:
    """By how much pictures are exposed later than the joint states that come with them.

    Attributes:
        offset: Δ (s).
        sd: Its standard deviation (s).
        pictures: Number of pictures that tell it.
    """

    offset: float
    sd: float
    pictures: int

    @property
    def warning(self) -> Reason | None:
        """What to tell an operator; None while the offset is small or not significant."""
        interval = _REGION_99 * self.sd
        if abs(self.offset) <= max(LATE_WARNS, interval):
            return None
        told = reasons.frames_late if self.offset > 0.0 else reasons.frames_early
        return told(1e3 * abs(self.offset), 1e3 * interval)


@dataclass(frozen=True)
class _Picture:
    """Canes as seen from one pose of the camera.

    Attributes:
        number: Of the picture.
        R: Rotation of the camera in odom (3×3).
        t: Its position (3, m).
        velocity: Of the camera in its own frame: v (m/s) and ω (rad/s).
        base: Pose of the base in odom (3).
        stamp: Time (s).
        points: Samples (N×3, odom).
        directions: Of the canes there (N×3).
        canes: The cane of each (N).
    """

    number: int
    R: Array
    t: Array
    velocity: Array
    base: Array
    stamp: float
    points: Array
    directions: Array
    canes: Array

    @property
    def moves(self) -> bool:
        """Whether the camera moves."""
        v, turns = np.linalg.norm(self.velocity[:3]), np.linalg.norm(self.velocity[3:])
        return bool(v > _FASTER or turns > _TURNING)

    @cached_property
    def lever(self) -> Array:
        """G of each sample (N×3×7)."""
        local = (self.points - self.t) @ self.R
        turned = self.R @ _cross(local)
        v, turns = self.velocity[:3], self.velocity[3:]
        shifted = np.broadcast_to(-self.R, turned.shape)
        return np.concatenate([turned, shifted, (turned @ turns - self.R @ v)[:, :, None]], axis=2)


@dataclass(frozen=True)
class _Pair:
    """Comparisons of the canes of two pictures.

    Attributes:
        numbers: Of the pictures.
        moving: Those in which the camera moves.
        A: What the estimated does, and the time of either picture, in its SD (N×3×9).
        B: What the unknowns of a way of the base do, in their SD (N×3×12).
        off: Disagreement (N×3, m).
        weight: Of each.
    """

    numbers: tuple[int, int]
    moving: frozenset[int]
    A: Array
    B: Array
    off: Array
    weight: float


class MountMonitor:
    """Estimates the error of the calibration in use. `forget` it when another one is used."""

    def __init__(self) -> None:
        """Nothing was seen."""
        self._base: Array | None = None
        self._pictures: list[_Picture] = []
        self._last: _Picture | None = None
        self._standing: deque[_Pair] = deque()
        self._changes: deque[_Pair] = deque(maxlen=_KEPT_CHANGES)
        self._steady: deque[_Pair] = deque(maxlen=_KEPT_STEADY)
        self._count = self._number = 0
        self._theta: Array = np.zeros(7)
        #: The estimate; None before enough was seen.
        self.error: MountError | None = None
        #: The offset of time; None before enough was seen in motion.
        self.time: TimeOffset | None = None

    def forget(self) -> None:
        """Forget everything that was seen."""
        self._base, self._pictures, self._last, self._count, self._theta = None, [], None, 0, np.zeros(7)
        self.error, self.time = None, None
        for kept in (self._standing, self._changes, self._steady):
            kept.clear()

    def observe(
        self, R: Array, t: Array, base: Array, axes: Sequence[Array], velocity: Array | None = None, stamp: float = 0.0
    ) -> None:
        """Take in the canes of a picture.

        Args:
            R: Rotation of the camera in odom (3×3), by the calibration in use.
            t: Its position (3, m).
            base: Pose of the base in odom (3).
            axes: Centre line of each cane from its base outwards, N×3 in odom (m).
            velocity: Of the camera in its own frame: v (m/s) and ω (rad/s), 6; None if it is not known.
            stamp: Time of the joint state (s).
        """
        velocity = np.zeros(6) if velocity is None else velocity
        if not np.isfinite(velocity).all():
            return
        if self._last is not None and stamp < self._last.stamp:
            self.forget_time()
        self._number += 1
        picture = _picture(self._number, R, t, velocity, base, stamp, axes)
        if picture is None:
            return
        before, self._last = self._last, picture
        if self._base is None or np.hypot(*(base - self._base)[:2]) > _STANDS or abs(base[2] - self._base[2]) > _FACES:
            self._base, self._pictures = base, [picture]
            if before is not None and _followed(before, picture):
                self._drove(before, picture)
            return
        known = [each for each in self._pictures if _apart(each, picture)]
        if len(known) < len(self._pictures):
            return
        pairs = [self._compare(each, picture, 1.0 / len(known)) for each in known]
        self._pictures = [*self._pictures, picture][-_PICTURES:]
        if found := [pair for pair in pairs if pair is not None]:
            self._standing += found
            while sum(len(pair.off) for pair in self._standing) > _KEPT:
                self._standing.popleft()
            self._count += 1
            self._estimate()

    def forget_time(self) -> None:
        """Forget what tells the offset of time, as the clock is another one."""
        self._pictures, self._last, self.time, self._theta = [], None, None, np.append(self._theta[_MOUNT], 0.0)
        self._standing = deque(pair for pair in self._standing if not pair.moving)
        self._changes.clear()
        self._steady.clear()

    def _drove(self, before: _Picture, picture: _Picture) -> None:
        """Compare a picture with the one before, between which the base has moved."""
        pair = self._compare(before, picture, 1.0, driven=True)
        if pair is None:
            return
        faster = np.linalg.norm(picture.R @ picture.velocity[:3] - before.R @ before.velocity[:3]) > _FASTER
        (self._changes if faster else self._steady).append(pair)
        if faster:
            self._estimate()

    def _compare(self, known: _Picture, picture: _Picture, weight: float, driven: bool = False) -> _Pair | None:
        """The canes that both pictures show; None without any."""
        # Where the present estimate lets each sample be in the other picture.
        shifts = picture.lever @ self._theta
        distance, nearest = cKDTree(known.points - known.lever @ self._theta).query(picture.points - shifts)
        As, Bs, offs = [], [], []
        for cane in np.unique(picture.canes):
            rows = np.flatnonzero((picture.canes == cane) & (distance < _REACH))
            owners = known.canes[nearest[rows]]
            if len(rows) < _LEAST:
                continue
            owner = np.bincount(owners).argmax()
            rows = rows[owners == owner]
            match = nearest[rows]
            d = known.directions[match]
            aligned = np.abs(np.einsum("ij,ij->i", d, picture.directions[rows])) > _PARALLEL
            rows, match, d = rows[aligned], match[aligned], d[aligned]
            if len(rows) < _LEAST:
                continue
            square = np.eye(3) - d[:, :, None] * d[:, None, :]
            off = np.einsum("nij,nj->ni", square, picture.points[rows] - known.points[match])
            here, there = picture.lever[rows], known.lever[match]
            A = square @ (here - there)
            if np.linalg.norm((off - A @ self._theta).std(axis=0)) >= _AGREE:
                continue
            times = _JITTER * (square @ np.stack([-there[:, :, 6], here[:, :, 6]], axis=2))
            A, B = np.concatenate([A, times], axis=2).mean(axis=0), np.zeros((3, _UNKNOWNS))
            if driven:
                way = _way(known.base, picture.base)
                B[:, :6] = (square @ _moved(picture.points[rows], picture.base)).mean(axis=0) * _sizes(way)
                B[:, 6:], A[:, _MOUNT] = A[:, _MOUNT] * _PRIOR[_MOUNT], 0.0
            As.append(A)
            Bs.append(B)
            offs.append(off.mean(axis=0))
        if not offs:
            return None
        moving = frozenset(each.number for each in (known, picture) if each.moves)
        return _Pair((known.number, picture.number), moving, np.stack(As), np.stack(Bs), np.stack(offs), weight)

    def _estimate(self) -> None:
        pairs = [*self._standing, *self._changes, *self._steady]
        A, B, r = (np.concatenate(part) / _NOISE for part in zip(*((p.A, p.B, p.off) for p in pairs), strict=True))
        lengths = [len(pair.off) for pair in pairs]
        starts, of = np.concatenate([[0], np.cumsum(lengths)[:-1]]), np.repeat(np.arange(len(pairs)), lengths)
        given = np.array([pair.weight for pair in pairs])[of]
        # Where each column of a pair is among all that is estimated: of the camera, and the time of each picture.
        numbers = np.array([pair.numbers for pair in pairs])
        columns = np.column_stack(
            [np.tile(np.arange(7), (len(pairs), 1)), 7 + np.unique(numbers, return_inverse=True)[1].reshape(-1, 2)]
        )
        count = int(columns.max()) + 1
        AA, BB, BA = (np.einsum("nij,nik->njk", x, y) for x, y in ((A, A), (B, B), (B, A)))
        Ar, Br = np.einsum("nij,ni->nj", A, r), np.einsum("nij,ni->nj", B, r)
        prior = np.diag(np.concatenate([_PRIOR**-2, np.ones(count - 7)]))
        size, jitter, spread, trust = np.ones(_UNKNOWNS), 1.0, 1.0, np.ones(len(r))
        for _ in range(_ROUNDS):
            weight, scale = given * trust / spread, np.array([*[1.0] * 7, jitter, jitter])

            def summed(part: Array, weight: Array = weight) -> Array:
                shaped = weight.reshape(-1, *[1] * (part.ndim - 1))
                out: Array = np.add.reduceat(shaped * part, starts, axis=0)
                return out

            # The unknowns of each way are eliminated.
            known = np.linalg.inv(size[:, None] * summed(BB) * size + np.eye(_UNKNOWNS))
            sBA, sBr = size[:, None] * summed(BA) * scale, size * summed(Br)
            told = scale[:, None] * summed(AA) * scale - np.swapaxes(sBA, 1, 2) @ known @ sBA
            right = scale * summed(Ar) - np.einsum("pji,pjk,pk->pi", sBA, known, sBr)
            information, b = prior.copy(), np.zeros(count)
            np.add.at(information, (columns[:, :, None], columns[:, None, :]), told)
            np.add.at(b, columns, right)
            covariance = np.linalg.inv(information)
            estimate = covariance @ b
            own = estimate[columns]
            unknown = np.einsum("pij,pj->pi", known, sBr - np.einsum("pij,pj->pi", sBA, own))
            fitted = np.einsum("nij,nj->ni", A, (scale * own)[of]) + np.einsum("nij,nj->ni", B, (size * unknown)[of])
            left = np.linalg.norm(r - fitted, axis=1)
            trust = np.minimum(1.0, _HUBER / np.maximum(left, 1e-9))
            # Two of the three components are compared. The residuals tell the noise, within bounds.
            seen, seen_times = 1.0 - np.einsum("pii->pi", known), 1.0 - np.diag(covariance)[7:]
            free = 2.0 * float((given * trust).sum()) - 7.0 - float(seen.sum()) - float(seen_times.sum())
            spread = max(_QUIETEST, float(np.sum(given * trust * left**2)) / max(free, 1.0))
            for group in (_WHEELS, _GROUND):
                size[group] = _resized(size[group[0]], unknown[:, group], seen[:, group])
            jitter = _resized(jitter, estimate[7:], seen_times)
        self._theta = estimate[_ESTIMATED]
        if self._count >= _NEEDED_PICTURES - 1 and sum(len(pair.off) for pair in self._standing) >= _NEEDED:
            self.error = MountError(self._theta[:3], self._theta[3:6], covariance[_MOUNT, _MOUNT], self._count + 1)
        telling = [pairs[k].moving for k in np.flatnonzero(told[:, 6, 6] > _TELLS**-2)]
        moving = frozenset[int]().union(*telling)
        self.time = None
        if len(moving) >= _NEEDED_MOVING:
            self.time = TimeOffset(float(self._theta[6]), float(np.sqrt(covariance[6, 6])), len(moving))


def _resized(size: float, found: Array, seen: Array) -> float:
    """Size of unknowns, as a multiple of what is assumed, by what was found in units of the present one."""
    square = (_ASSUMED + size**2 * float((found**2).sum())) / (_ASSUMED + float(seen.sum()))
    return float(np.clip(np.sqrt(square), _SMALLEST, _LARGEST))


def _cross(x: Array) -> Array:
    """[x]ₓ of each (N×3×3)."""
    out = np.zeros((len(x), 3, 3))
    out[:, 0, 1], out[:, 0, 2], out[:, 1, 2] = -x[:, 2], x[:, 1], -x[:, 0]
    return out - np.swapaxes(out, 1, 2)


def _way(before: Array, after: Array) -> float:
    """Way of the farther wheel between two poses of the base, about (m)."""
    return float(np.hypot(*(after - before)[:2])) + _HALF_TRACK * abs(float(after[2] - before[2]))


def _sizes(way: float) -> Array:
    """Standard deviations of the base's pose after a way (m): along, aside, up, roll, pitch, heading."""
    uneven = float(np.sqrt(min(2.0 * way / _UNEVEN, 2.0)))
    return np.array([_SLIP * way, _ASIDE * way, _HEIGHT * uneven, _TILT * uneven, _TILT * uneven, _TURN * way])


def _moved(points: Array, base: Array) -> Array:
    """What an error of the base's pose, along and about its axes, does to the residual of samples (N×3×6)."""
    R = pin.exp3(np.array([0.0, 0.0, base[2]]))
    turned = _cross(points - np.array([base[0], base[1], 0.0])) @ R
    return np.concatenate([np.broadcast_to(-R, turned.shape), turned], axis=2)


def _followed(before: _Picture, picture: _Picture) -> bool:
    """Whether a picture came so soon after another, and from so near, that the base can have driven there."""
    passed, way = picture.stamp - before.stamp, _way(before.base, picture.base)
    return 0.0 < passed < _PASSED and way < min(_DRIVEN, _FASTEST * passed + _STANDS)


def _apart(known: _Picture, picture: _Picture) -> bool:
    turned = float(np.linalg.norm(pin.log3(known.R.T @ picture.R)))
    faster = picture.velocity - known.velocity
    return (
        float(np.linalg.norm(known.t - picture.t)) > _APART
        or turned > _TURNED
        or float(np.linalg.norm(faster[:3])) > _FASTER
        or float(np.linalg.norm(faster[3:])) > _TURNING
    )


def _picture(
    number: int, R: Array, t: Array, velocity: Array, base: Array, stamp: float, axes: Sequence[Array]
) -> _Picture | None:
    points, directions, canes = [], [], []
    for cane, axis in enumerate(axes):
        arc = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(axis, axis=0), axis=1))])
        at = np.arange(0.0, min(float(arc[-1]), _LENGTH), _SPACING)
        if len(at) < _LEAST:
            continue
        ahead, behind = interpolate(at + _SPACING, arc, axis), interpolate(at - _SPACING, arc, axis)
        chord = ahead - behind
        points.append(interpolate(at, arc, axis))
        directions.append(chord / np.maximum(np.linalg.norm(chord, axis=1, keepdims=True), 1e-9))
        canes.append(np.full(len(at), cane))
    if not points:
        return None
    seen = np.concatenate(points), np.concatenate(directions), np.concatenate(canes)
    return _Picture(number, R, t, velocity, base, stamp, *seen)
