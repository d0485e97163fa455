"""The simulated secateurs."""

from dataclasses import dataclass, replace

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from bridge.config import BridgeConfig
from bridge.core.interface import NO_CUT, CutterState
from bridge.sim.vineyard.row import Rod, Row
from rolling_panda import reasons
from rolling_panda.messages.types import Outcome, Reason
from rolling_panda.model.differential_drive import Array

Mask = NDArray[np.bool_]
_SOFT = frozenset({"cane", "spur", "node", "old cut"})
_IGNORED = frozenset({"background", "ground"})


@dataclass(frozen=True)
class SeveredRod:
    """A severed rod: its index, the rod before the cut, and the place of the cut.

    `along` is the fraction of the rod's length, and `point` the position there (3, m, world).
    """

    index: int
    rod: Rod
    along: float
    point: Array


@dataclass(frozen=True)
class CutResult:
    """Result of closing the blades: the severed rods, root first, and what was severed or why nothing."""

    severed: tuple[SeveredRod, ...]
    jammed: bool
    detail: Reason

    def at_rest(self, row: Row) -> "CutResult":
        """The same cut on the same rods of a row that no wind moves."""
        rods = ((item, row.rods[item.index]) for item in self.severed)
        severed = (SeveredRod(i.index, rod, i.along, rod.at(i.along)[0]) for i, rod in rods if rod is not None)
        return replace(self, severed=tuple(severed))

    def applied(self, row: Row, hangs: Array | None = None, lies: float | None = None) -> Row:
        """A row with the same rods after the cut; arguments as of `Row.sever`."""
        for item in self.severed:
            # An earlier cut may have removed the rod.
            if row.rods[item.index] is not None:
                row = row.sever(item.index, item.along, hangs, lies)
        return row


class Cutter:
    """State machine of the blades: they close in `close_s` and open in the same time."""

    def __init__(self, config: BridgeConfig) -> None:
        """Start open."""
        self._config = config
        self._remaining = 0.0
        self.state: CutterState = "open"
        self.cut_id = ""
        self.point_id = ""
        self.outcome: Outcome = ""
        self.detail = NO_CUT

    def start(self, cut_id: str, point_id: str) -> None:
        """Start to close."""
        self.cut_id, self.point_id = cut_id, point_id
        self.outcome = ""
        self.state, self._remaining = "closing", self._config.close_s

    def step(self, dt: float, enabled: bool) -> bool:
        """Advance by `dt` (s); True when the blades are closed and `close_blades` is due.

        Closing blades open again when they are not `enabled`.
        """
        if self.state == "open":
            return False
        if self.state == "closing" and not enabled:
            self.finish("FAILED_NOT_CUT", reasons.inhibited_while_closing(), jammed=False)
            return False
        self._remaining -= dt
        if self._remaining > dt / 2:
            return False
        if self.state == "closing":
            return True
        self.state = "open"
        return False

    def finish(self, outcome: Outcome, detail: Reason, jammed: bool) -> None:
        """Set the outcome and start to open."""
        self.outcome, self.detail = outcome, detail
        self.state, self._remaining = "jammed" if jammed else "opening", self._config.close_s


def close_blades(row: Row, T_world_tool: Array, config: BridgeConfig) -> CutResult:
    """Close the blades on the row.

    A cane, spur or node, or last year's cane of a Guyot vine, is severed where its axis crosses the blade plane
    (through the tool's origin, normal to its y) between the blades. Any part of a wire, post, trunk or permanent
    cordon, or too thick wood, between the blades jams them, and nothing is severed.

    Args:
        row: The row.
        T_world_tool: Homogeneous pose of the tool (4×4).
        config: Sizes of the blades.
    """
    standing = [(i, rod) for i, rod in row.standing() if rod.kind not in _IGNORED]
    if not standing:
        return CutResult((), False, reasons.nothing_between_blades())
    R, p = T_world_tool[:3, :3], T_world_tool[:3, 3]
    starts = (np.array([rod.start for _, rod in standing]) - p) @ R
    ends = (np.array([rod.end for _, rod in standing]) - p) @ R
    fraction = _plane_crossing(starts, ends)
    at = starts + np.nan_to_num(fraction)[:, None] * (ends - starts)
    crosses = ~np.isnan(fraction) & _between(at, config)
    for _, rod in standing:
        if not _soft(rod) and _reaches(rod, T_world_tool, config):
            return CutResult((), True, reasons.blades_on_hard_part(rod.kind))

    cuts: list[tuple[int, Rod, float]] = []
    for k in np.flatnonzero(crosses):
        index, rod = standing[k]
        local = rod.at(float(fraction[k]))[1]
        if 2 * local > config.largest_diameter:
            return CutResult((), True, reasons.wood_beyond_blades(rod.kind, 2000 * local))
        cuts.append((index, rod, float(fraction[k])))
    if not cuts:
        return CutResult((), False, reasons.nothing_between_blades())
    severed = tuple(SeveredRod(index, rod, along, rod.at(along)[0]) for index, rod, along in cuts)
    return CutResult(severed, False, reasons.wood_severed(", ".join(item.rod.kind for item in severed)))


def wood_in_plane(row: Row, T_world_tool: Array) -> Array:
    """Where soft wood crosses the blade plane (N×2, m): the tool's x and z, the nearest to its origin first.

    Lateral shoots do not count.
    """
    soft = [rod for _, rod in row.standing() if _soft(rod) and rod.organ < 0]
    if not soft:
        return np.zeros((0, 2))
    R, p = T_world_tool[:3, :3], T_world_tool[:3, 3]
    starts, ends = ((np.array(each) - p) @ R for each in zip(*((rod.start, rod.end) for rod in soft), strict=True))
    fraction = _plane_crossing(starts, ends)
    at = (starts + np.nan_to_num(fraction)[:, None] * (ends - starts))[~np.isnan(fraction)][:, [0, 2]]
    nearest_first: Array = at[np.argsort(np.linalg.norm(at, axis=1), kind="stable")]
    return nearest_first


def _soft(rod: Rod) -> bool:
    """Whether the blades sever it."""
    return rod.kind in _SOFT or rod.last_years


def _plane_crossing(starts: Array, ends: Array) -> Array:
    """Fraction 0…1 at which each rod's axis crosses y = 0; NaN where it does not."""
    rise = ends[:, 1] - starts[:, 1]
    flat = np.abs(rise) < 1e-9
    fraction = -starts[:, 1] / np.where(flat, 1.0, rise)
    return np.where(flat | (fraction < 0.0) | (fraction > 1.0), np.nan, fraction)


def _between(points: Array, config: BridgeConfig) -> Mask:
    inside: Mask = (np.abs(points[:, 0]) <= config.opening / 2) & (np.abs(points[:, 2]) <= config.blade_half_length)
    return inside


def _reaches(rod: Rod, T_world_tool: Array, config: BridgeConfig) -> bool:
    """Whether any part of a rod is between the blades."""
    axis = rod.end - rod.start
    along = pin.Quaternion.FromTwoVectors(np.array([0.0, 0.0, 1.0]), axis).toRotationMatrix()
    wood = pin.coal.Capsule(max(rod.start_radius, rod.end_radius), float(np.linalg.norm(axis)))
    box = pin.coal.Box(config.opening, 2 * config.blade_half_thickness, 2 * config.blade_half_length)
    at_wood = pin.coal.Transform3s(along, (rod.start + rod.end) / 2)
    at_blades = pin.coal.Transform3s(T_world_tool[:3, :3].copy(), T_world_tool[:3, 3].copy())
    request, result = pin.coal.CollisionRequest(), pin.coal.CollisionResult()
    return bool(pin.coal.collide(wood, at_wood, box, at_blades, request, result))
