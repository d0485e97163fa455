"""The secateurs: blades that close on what is really between them."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bridge.config import BridgeConfig
from bridge.core.interface import CutterState
from bridge.sim.vineyard.row import Rod, Row
from rolling_panda.messages.types import Outcome
from rolling_panda.model.differential_drive import Array

Mask = NDArray[np.bool_]
_SOFT = frozenset({"cane", "spur", "node", "old cut"})
_IGNORED = frozenset({"background", "ground"})


@dataclass(frozen=True)
class Severed:
    """One rod that was cut through: its index and the rod as it was, and where (3, m, world)."""

    index: int
    rod: Rod
    point: Array


@dataclass(frozen=True)
class Bite:
    """What the blades did when they met: the row afterwards, what was severed, and why not if nothing was."""

    row: Row
    severed: tuple[Severed, ...]
    jammed: bool
    detail: str


class Cutter:
    """Blades that close in `close_s`, bite at the end of it, and take as long to open again."""

    def __init__(self, config: BridgeConfig) -> None:
        """Start open."""
        self._config = config
        self._left = 0.0
        self.state: CutterState = "open"
        self.cut_id = ""
        self.point_id = ""
        self.outcome: Outcome = ""
        self.detail = ""

    def begin(self, cut_id: str, point_id: str) -> None:
        """Begin to close."""
        self.cut_id, self.point_id = cut_id, point_id
        self.outcome, self.detail = "", ""
        self.state, self._left = "closing", self._config.close_s

    def step(self, dt: float, enabled: bool) -> bool:
        """Let `dt` seconds pass; True when the blades meet now and `bite` is due.

        Without `enabled` blades that close open again: nothing was cut.
        """
        if self.state == "open":
            return False
        if self.state == "closing" and not enabled:
            self.finish("FAILED_NOT_CUT", "the cutter was inhibited before the blades met", jammed=False)
            return False
        self._left -= dt
        if self._left > dt / 2:
            return False
        if self.state == "closing":
            return True
        self.state = "open"
        return False

    def finish(self, outcome: Outcome, detail: str, jammed: bool) -> None:
        """Say how the cut ended, and open."""
        self.outcome, self.detail = outcome, detail
        self.state, self._left = "jammed" if jammed else "opening", self._config.close_s


def bite(row: Row, T_world_tool: Array, config: BridgeConfig) -> Bite:
    """Close the blades on the row.

    A cane, spur or node is severed where its axis passes the blade plane (through the tool's origin, square to its y)
    between the blades. A wire, post, trunk, cordon or any wood thicker than the blades take, with any part of it
    there, jams them, and then nothing is severed.

    Args:
        row: As it stands.
        T_world_tool: Homogeneous pose of the tool (4×4).
        config: Sizes of the blades.
    """
    standing = [(i, rod) for i, rod in row.standing() if rod.kind not in _IGNORED]
    if not standing:
        return Bite(row, (), False, "nothing between the blades")
    R, p = T_world_tool[:3, :3], T_world_tool[:3, 3]
    starts = (np.array([rod.start for _, rod in standing]) - p) @ R
    ends = (np.array([rod.end for _, rod in standing]) - p) @ R
    fraction = _plane_crossing(starts, ends)
    at = starts + np.nan_to_num(fraction)[:, None] * (ends - starts)
    crosses = ~np.isnan(fraction) & _between(at, config)
    radius = np.array([max(rod.start_radius, rod.end_radius) for _, rod in standing])
    touched = _touches(starts, ends, radius, config)

    cuts: list[tuple[int, Rod, float]] = []
    for k in np.flatnonzero(crosses | touched):
        index, rod = standing[k]
        local = rod.at(float(fraction[k]))[1] if crosses[k] else 0.0
        if rod.kind not in _SOFT and touched[k]:
            return Bite(row, (), True, f"a {rod.kind} is between the blades")
        if 2 * local > config.largest_diameter:
            return Bite(row, (), True, f"{rod.kind} of {2000 * local:.0f} mm is too thick for the blades")
        if crosses[k]:
            cuts.append((index, rod, float(fraction[k])))
    if not cuts:
        return Bite(row, (), False, "nothing between the blades")
    severed = tuple(Severed(index, rod, rod.at(along)[0]) for index, rod, along in cuts)
    for index, _, along in cuts:
        # An earlier cut of this bite may have taken the rod along.
        if row.rods[index] is not None:
            row = row.sever(index, along)
    return Bite(row, severed, False, "")


def _plane_crossing(starts: Array, ends: Array) -> Array:
    """Fraction 0…1 at which each rod's axis passes y = 0; NaN where it does not."""
    rise = ends[:, 1] - starts[:, 1]
    flat = np.abs(rise) < 1e-9
    fraction = -starts[:, 1] / np.where(flat, 1.0, rise)
    return np.where(flat | (fraction < 0.0) | (fraction > 1.0), np.nan, fraction)


def _between(points: Array, config: BridgeConfig) -> Mask:
    inside: Mask = (np.abs(points[:, 0]) <= config.opening / 2) & (np.abs(points[:, 2]) <= config.blade_half_length)
    return inside


def _touches(starts: Array, ends: Array, radius: Array, config: BridgeConfig) -> Mask:
    """Whether any part of each rod is between the blades: its axis clipped to the slot, grown by its radius."""
    half = np.array([config.opening / 2, config.blade_half_thickness, config.blade_half_length])
    reach = np.broadcast_to(half, starts.shape) + radius[:, None]
    along = ends - starts
    safe = np.where(np.abs(along) < 1e-12, 1e-12, along)
    near, far = (-reach - starts) / safe, (reach - starts) / safe
    enter = np.minimum(near, far).max(axis=1).clip(min=0.0)
    leave = np.maximum(near, far).min(axis=1).clip(max=1.0)
    touches: Mask = enter <= leave
    return touches
