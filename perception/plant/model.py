"""The vine as perceived in one frame: spurs and their canes, with what was seen and what was hidden."""

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
#: Why a cane's axis stops: the wood ends there, something stands in front, or the image ends.
CaneEnd = Literal["free", "hidden", "image border"]


@dataclass(frozen=True)
class Span:
    """A stretch of a cane, by arc length from its base (m)."""

    start: float
    end: float

    def meets(self, start: float, end: float) -> bool:
        """Whether it has a part in common with start…end (m)."""
        return self.start < end and start < self.end


@dataclass(frozen=True)
class Node:
    """A node seen on a cane.

    Attributes:
        arc: From the cane's base (m).
        pixels: How large it was seen.
    """

    arc: float
    pixels: int


@dataclass(frozen=True)
class Cane:
    """A one-year cane as far as it was seen.

    Attributes:
        axis: Centre line from the base outwards, N×3 in odom (m), N ≥ 2.
        arc: Arc length of each axis point from where the cane leaves the spur (N, m), increasing.
        radius: Typical radius (m).
        nodes: By arc length; the basal bud too when it was seen.
        hidden: Stretches that were not seen, by arc length.
        end: Why the axis stops.
        base_gap: Distance from the first axis point to the wood it grows from (m).
        looks: Over how many looks the radius was measured.
    """

    axis: Array
    arc: Array
    radius: float
    nodes: tuple[Node, ...]
    hidden: tuple[Span, ...]
    end: CaneEnd
    base_gap: float
    looks: int = 1

    @property
    def base(self) -> Array:
        """First point of the axis (3, m, odom)."""
        point: Array = self.axis[0]
        return point

    @property
    def length(self) -> float:
        """Arc length at the last axis point (m)."""
        return float(self.arc[-1])

    def at(self, arc: float) -> Array:
        """Point on the axis at an arc length (3, m, odom); ends are held, never extrapolated."""
        return np.array([np.interp(arc, self.arc, self.axis[:, i]) for i in range(3)])

    def tangent(self, arc: float, reach: float = 0.01) -> Array:
        """Unit vector along the axis, away from the base, from the chord `reach` (m) to either side."""
        chord = self.at(min(arc + reach, self.length)) - self.at(max(arc - reach, float(self.arc[0])))
        length = float(np.linalg.norm(chord))
        fallback: Array = self.axis[-1] - self.axis[0]
        out: Array = chord / length if length > 1e-9 else fallback / max(float(np.linalg.norm(fallback)), 1e-9)
        return out


@dataclass(frozen=True)
class Spur:
    """A spur position: two-year wood on the cordon, with the canes that grow from it.

    Attributes:
        position: Centre of what was seen of it (3, m, odom).
        axis: The stub from the cordon outwards, 2×3 in odom (m); None where it was not seen clearly.
        radius: Of the stub (m), 0 where it was not seen clearly.
        canes: Longest first.
        doubt: Why not all of its canes may have been seen, in words; empty where nothing speaks for that.
    """

    position: Array
    axis: Array | None
    radius: float
    canes: tuple[Cane, ...]
    doubt: str = ""


@dataclass(frozen=True)
class Plant:
    """Everything perceived in one frame.

    Attributes:
        spurs: In order along the cordon.
        trunks: Where trunks stand, N×3 in odom (m).
        loose: Axes of pieces of cane that could not be followed to a spur, each N×3 in odom (m).
    """

    spurs: tuple[Spur, ...]
    trunks: Array
    loose: tuple[Array, ...]

    def beside(self, spur: Spur) -> Array:
        """Axis points of all cane that is not the given spur's, N×3 in odom (m)."""
        axes = [cane.axis for other in self.spurs if other is not spur for cane in other.canes]
        return np.concatenate([np.zeros((0, 3)), *axes, *self.loose])
