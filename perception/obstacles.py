"""What stands in the robot's way: posts, trunks, cordons and wires as rods, gathered over all frames.

The row is taken for what every trained row is: upright rods (posts, trunks) and rods along it (wires, cordons). Points
of one class are told apart by where they are across the rod, and each group gets the line that fits it best.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from perception.clearance import Rods
from perception.config import ObstacleConfig
from perception.frame import View
from perception.pixels import pixels_of
from perception.plant import Array
from rolling_panda.messages import WOOD_CLASSES, WoodClass
from rolling_panda.row_messages import Capsule

#: Share of all that is told that rods may be: on a long row the nearest, so that canes have room too.
_RODS = 0.75
#: How a class of rods stands: `upright`, `along` the row as one straight line, or along it in bent `pieces`.
_SHAPES: dict[WoodClass, str] = {"post": "upright", "trunk": "upright", "cordon": "pieces", "wire": "along"}


@dataclass(frozen=True)
class _Rod:
    start: Array
    end: Array
    radius: float

    @property
    def length(self) -> float:
        return float(np.linalg.norm(self.end - self.start))


class ObstacleMap:
    """Remembers where rods were seen, in cells of a few centimetres, and turns them into capsules."""

    def __init__(self, config: ObstacleConfig) -> None:
        """Start with nothing seen."""
        self._config = config
        self._seen: dict[WoodClass, _Cells] = {kind: _Cells(config.cell) for kind in _SHAPES}
        self._fitted: dict[WoodClass, list[tuple[Array, _Rod]]] = {}
        self._capsules: tuple[Capsule, ...] = ()

    def update(self, view: View, labels: NDArray[np.uint8]) -> tuple[Capsule, ...]:
        """Take one frame in; everything known now.

        Args:
            view: The frame.
            labels: H×W class indices.

        Returns:
            Rods in odom (m), each with the larger of the radii seen along it; where they are too many the nearest ones.
        """
        config, grown = self._config, False
        for kind, cells in self._seen.items():
            rows, cols = pixels_of(labels, (WOOD_CLASSES.index(kind),))
            depth = view.depth[rows, cols]
            nearest = config.nearest if kind == "wire" else config.thick_nearest
            used = np.flatnonzero((depth > nearest) & (depth < config.farthest))
            used = used[:: max(1, len(used) // config.points)]
            grown |= cells.add(view.points(rows[used], cols[used], depth[used]))
        if grown:
            away = view.R[:, 2]
            self._capsules = tuple(
                capsule
                for kind, cells in self._seen.items()
                for capsule in self._rods(kind, cells.often(config.hits), away)
            )
        most = max(1, int(_RODS * config.most))
        if len(self._capsules) <= most:
            return self._capsules
        gaps = Rods(self._capsules).gaps(view.t[None])[0]
        return tuple(self._capsules[k] for k in np.sort(np.argsort(gaps, kind="stable")[:most]).tolist())

    def _rods(self, kind: WoodClass, points: Array, away: Array) -> list[Capsule]:
        config, shape = self._config, _SHAPES[kind]
        if shape == "upright":
            groups = _groups(points, 0, config.apart)
        elif shape == "along":
            groups = _groups(points, 2, config.wire_apart)
        else:
            groups = _pieces(points, config.piece, config.piece_apart)
        rods = self._fits(kind, [group for group in groups if len(group) >= config.least], away)
        return [
            Capsule(kind, _vector(rod.start), _vector(rod.end), rod.radius, rod.radius)
            for rod in rods
            if rod.length >= config.shortest
        ]

    def _fits(self, kind: WoodClass, groups: list[Array], away: Array) -> list[_Rod]:
        """A rod for each group; where no look has changed a group its rod stays, with the side that was seen then."""
        old = {(len(group), group[0].tobytes()): (group, rod) for group, rod in self._fitted.get(kind, [])}
        new = []
        for group in groups:
            before = old.get((len(group), group[0].tobytes()))
            if before is not None and np.array_equal(before[0], group):
                new.append(before)
            else:
                new.append((group, _fit(group, away, thin=kind == "wire")))
        self._fitted[kind] = new
        return [rod for _, rod in new]


class _Cells:
    """Cells of a cubic grid with the mean of the points that fell into each."""

    def __init__(self, size: float) -> None:
        self._size = size
        self._number: dict[tuple[int, int, int], int] = {}
        self._mean, self._times = np.zeros((256, 3)), np.zeros(256, dtype=int)

    def add(self, points: Array) -> bool:
        """Take the points of one frame; whether anything was among them."""
        if len(points) == 0:
            return False
        keys = np.floor(points / self._size).astype(int)
        least = keys.min(axis=0)
        _, deep, high = (keys.max(axis=0) - least + 1).tolist()
        # One number for each cell of the box around them, which sorts faster than three.
        places = (keys - least) @ np.array([deep * high, high, 1])
        _, first, inverse, counts = np.unique(places, return_index=True, return_inverse=True, return_counts=True)
        sums = np.stack([np.bincount(inverse, points[:, i]) for i in range(3)], axis=1)
        number = self._number
        cells = np.array([number.setdefault((x, y, z), len(number)) for x, y, z in keys[first].tolist()])
        while len(number) > len(self._times):
            self._mean = np.concatenate([self._mean, np.zeros_like(self._mean)])
            self._times = np.concatenate([self._times, np.zeros_like(self._times)])
        # A running mean over the frames, the noise of one frame being most of what there is.
        times = self._times[cells] + 1
        self._mean[cells] += (sums / counts[:, None] - self._mean[cells]) / times[:, None]
        self._times[cells] = np.minimum(times, 50)
        return True

    def often(self, hits: int) -> Array:
        """Means of the cells seen in at least `hits` frames, N×3."""
        out: Array = self._mean[self._times >= hits]
        return out


def _groups(points: Array, axis: int, apart: float) -> list[Array]:
    """Points in groups between which there is a gap of `apart` along one axis."""
    if len(points) == 0:
        return []
    points = points[np.argsort(points[:, axis])]
    return np.split(points, np.nonzero(np.diff(points[:, axis]) > apart)[0] + 1)


def _pieces(points: Array, piece: float, apart: float) -> list[Array]:
    """Points in groups by the stretch of the row, `piece` long, that they are in, without gaps of `apart` across it."""
    if len(points) == 0:
        return []
    number = np.floor(points[:, 0] / piece)
    order = np.argsort(number, kind="stable")
    pieces = np.split(points[order], np.nonzero(np.diff(number[order]))[0] + 1)
    return [body for each in pieces for level in _groups(each, 2, apart) for body in _groups(level, 1, apart)]


def _fit(points: Array, away: Array, thin: bool) -> _Rod:
    """The line through a group of surface points, moved inwards from the side that was seen.

    Args:
        points: On the surface, N×3.
        away: Direction of the camera's view (3): the axis lies behind the surface.
        thin: True where the radius is less than the noise, so that the points are the axis.
    """
    middle = points.mean(axis=0)
    _, _, axes = np.linalg.svd(points - middle, full_matrices=False)
    along = axes[0]
    reach = (points - middle) @ along
    start, end = middle + reach.min() * along, middle + reach.max() * along
    side = np.cross(along, away)
    size = float(np.linalg.norm(side))
    if thin or size < 1e-6:
        return _Rod(start, end, _THIN)
    spread = np.abs((points - middle) @ (side / size))
    radius = float(np.clip(np.quantile(spread, 0.95), _THIN, 0.2))
    inwards = np.cross(side, along) / size
    inwards *= np.sign(float(inwards @ away)) or 1.0
    # Of a half cylinder that is seen from one side, the mean of the surface lies π/4 of a radius before the axis.
    return _Rod(start + 0.785 * radius * inwards, end + 0.785 * radius * inwards, radius)


#: A wire's radius with its sag and the noise of the depth at arm's length (m).
_THIN = 0.004


def _vector(point: Array) -> tuple[float, float, float]:
    x, y, z = (float(value) for value in point)
    return x, y, z
