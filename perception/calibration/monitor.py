"""Monitor of the camera's calibration: the same canes, seen from several poses of the arm while the base stands.

A camera that is turned by δ and shifted by τ against its calibration (in its own frame) sees a point x of its frame at
R x + t in place of R (x + δ × x + τ) + t. Two pictures of one cane thus disagree by A (δ, τ), with

    A = [R₂ [x₂]ₓ − R₁ [x₁]ₓ,  R₁ − R₂].

Only what is square to the cane is compared. Neither the wheels nor the row's true place come in.
"""

from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass

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
#: What the calibration is believed to before anything was seen (rad, m, SD).
_PRIOR = np.array([0.05] * 3 + [0.004] * 3)
#: Comparisons that are kept, and that an estimate needs; pictures that it needs.
_KEPT, _NEEDED, _NEEDED_PICTURES = 800, 20, 3
#: A residual of so many standard deviations counts less (Huber); rounds of reweighting.
_HUBER, _ROUNDS = 1.5, 6
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
class _Picture:
    """Canes as seen from one pose of the camera: samples (N×3, odom), directions (N×3), and the cane of each (N)."""

    R: Array
    t: Array
    points: Array
    directions: Array
    canes: Array

    def lever(self, points: Array) -> tuple[Array, Array]:
        """R [x]ₓ (N×3×3) of points (N×3, odom), and R."""
        local = (points - self.t) @ self.R
        crossed = np.zeros((len(local), 3, 3))
        x, y, z = local.T
        crossed[:, 0, 1], crossed[:, 0, 2], crossed[:, 1, 2] = -z, y, -x
        crossed[:, 1, 0], crossed[:, 2, 0], crossed[:, 2, 1] = z, -y, x
        return self.R @ crossed, self.R


class MountMonitor:
    """Estimates the error of the calibration in use. `forget` it when another one is used."""

    def __init__(self) -> None:
        """Nothing was seen."""
        self._base: Array | None = None
        self._pictures: list[_Picture] = []
        self._compared: deque[tuple[Array, Array, float]] = deque(maxlen=_KEPT)
        self._count = 0
        #: The estimate; None before enough was seen.
        self.error: MountError | None = None

    def forget(self) -> None:
        """Forget everything that was seen."""
        self._base, self._pictures, self._count, self.error = None, [], 0, None
        self._compared.clear()

    def observe(self, R: Array, t: Array, base: Array, axes: Sequence[Array]) -> None:
        """Take in the canes of a picture.

        Args:
            R: Rotation of the camera in odom (3×3), by the calibration in use.
            t: Its position (3, m).
            base: Pose of the base in odom (3).
            axes: Centre line of each cane from its base outwards, N×3 in odom (m).
        """
        if self._base is None or np.hypot(*(base - self._base)[:2]) > _STANDS or abs(base[2] - self._base[2]) > _FACES:
            self._base, self._pictures = base, []
        known = [each for each in self._pictures if _apart(each, R, t)]
        if len(known) < len(self._pictures):
            return
        picture = _picture(R, t, axes)
        if picture is None:
            return
        found = [pair for each in known for pair in self._compare(each, picture, 1.0 / len(known))]
        self._pictures = [*self._pictures, picture][-_PICTURES:]
        if found:
            self._compared += found
            self._count += 1
            self._estimate()

    def _compare(self, known: _Picture, picture: _Picture, weight: float) -> list[tuple[Array, Array, float]]:
        """A (3×6) and residual (3, m) of each cane that both pictures show, with its weight."""
        there, R1 = known.lever(known.points)
        here, R2 = picture.lever(picture.points)
        theta = np.zeros(6) if self.error is None else np.concatenate([self.error.turn, self.error.shift])
        # Where the present estimate lets each sample be in the other picture.
        shifts = here @ theta[:3] - R2 @ theta[3:]
        distance, nearest = cKDTree(known.points - (there @ theta[:3] - R1 @ theta[3:])).query(picture.points - shifts)
        out = []
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
            A = square @ np.concatenate(
                [here[rows] - there[match], np.broadcast_to(R1 - R2, (len(rows), 3, 3))], axis=2
            )
            if np.linalg.norm((off - A @ theta).std(axis=0)) < _AGREE:
                out.append((A.mean(axis=0), off.mean(axis=0), weight))
        return out

    def _estimate(self) -> None:
        if self._count < _NEEDED_PICTURES - 1 or len(self._compared) < _NEEDED:
            return
        A = np.stack([each for each, _, _ in self._compared]) / _NOISE
        r = np.stack([each for _, each, _ in self._compared]) / _NOISE
        given = np.array([each for _, _, each in self._compared])
        prior, theta, trust = np.diag(_PRIOR**-2), np.zeros(6), np.ones(len(r))
        for _ in range(_ROUNDS):
            weight = given * trust
            information = np.einsum("n,nij,nik->jk", weight, A, A) + prior
            theta = np.linalg.solve(information, np.einsum("n,nij,ni->j", weight, A, r))
            left = np.linalg.norm(r - A @ theta, axis=1)
            trust = np.minimum(1.0, _HUBER / np.maximum(left, 1e-9))
        # Two of the three components are compared. The residuals tell the noise, within bounds.
        spread = float(np.sum(weight * left**2) / max(2.0 * weight.sum() - 6.0, 1.0))
        covariance = max(_QUIETEST, spread) * np.linalg.inv(information)
        self.error = MountError(theta[:3], theta[3:], covariance, self._count + 1)


def _apart(known: _Picture, R: Array, t: Array) -> bool:
    turned = float(np.linalg.norm(pin.log3(known.R.T @ R)))
    return float(np.linalg.norm(known.t - t)) > _APART or turned > _TURNED


def _picture(R: Array, t: Array, axes: Sequence[Array]) -> _Picture | None:
    points, directions, canes = [], [], []
    for number, axis in enumerate(axes):
        arc = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(axis, axis=0), axis=1))])
        at = np.arange(0.0, min(float(arc[-1]), _LENGTH), _SPACING)
        if len(at) < _LEAST:
            continue
        ahead, behind = interpolate(at + _SPACING, arc, axis), interpolate(at - _SPACING, arc, axis)
        chord = ahead - behind
        points.append(interpolate(at, arc, axis))
        directions.append(chord / np.maximum(np.linalg.norm(chord, axis=1, keepdims=True), 1e-9))
        canes.append(np.full(len(at), number))
    if not points:
        return None
    return _Picture(R, t, np.concatenate(points), np.concatenate(directions), np.concatenate(canes))
