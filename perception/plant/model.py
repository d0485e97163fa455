"""Plant model of one frame: spurs and their canes, with visible and hidden stretches."""

from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from perception.arrays import Array, interpolate
from rolling_panda.messages.types import Reason

#: Mean distance of the visible half of a cylinder from its axis, in radii.
SURFACE_OFFSET = np.pi / 4
#: Half the length of the chord that defines a direction (m).
_CHORD = 0.01
#: Why a cane's axis ends: the wood ends, something occludes it, or the image ends.
CaneEnd = Literal["free", "hidden", "image border"]


@dataclass(frozen=True)
class Span:
    """A stretch of a cane, by arc length from its base (m)."""

    start: float
    end: float

    def overlaps(self, start: float, end: float) -> bool:
        """Whether it overlaps start…end (m)."""
        return self.start < end and start < self.end


@dataclass(frozen=True)
class Node:
    """A node seen on a cane.

    Attributes:
        arc: Arc length from the cane's base (m).
        pixels: Size in the image (px).
    """

    arc: float
    pixels: int


@dataclass(frozen=True)
class Cane:
    """The visible part of a one-year cane.

    Attributes:
        axis: Centre line from the base outwards, N×3 in odom (m), N ≥ 2.
        arc: Arc length of each axis point from where the cane leaves the spur (N, m), increasing.
        radius: Typical radius (m).
        nodes: By arc length, including a visible basal bud.
        hidden: Occluded stretches, by arc length.
        end: Why the axis ends.
        base_gap: Distance from the first axis point to the wood it grows from (m).
        observations: Number of observations in the radius.
        number: Number on its spur in the plant map, the same in every frame; -1 before it has one.
    """

    axis: Array
    arc: Array
    radius: float
    nodes: tuple[Node, ...]
    hidden: tuple[Span, ...]
    end: CaneEnd
    base_gap: float
    observations: int = 1
    number: int = -1

    @property
    def base(self) -> Array:
        """First point of the axis (3, m, odom)."""
        point: Array = self.axis[0]
        return point

    @property
    def origin(self) -> Array:
        """Where it leaves the spur (3, m, odom): at arc length 0, straight back from the first point if that is beyond.

        In the plant map that is a median over the frames, which see the first point higher or lower.
        """
        first = float(self.arc[0])
        return self.at(0.0) if first <= 0.0 else self.base - first * self.tangent(first)

    @property
    def length(self) -> float:
        """Arc length at the last axis point (m)."""
        return float(self.arc[-1])

    def at(self, arc: float) -> Array:
        """Point on the axis at an arc length (3, m, odom); the ends are held."""
        point: Array = interpolate(np.array([arc]), self.arc, self.axis)[0]
        return point

    def shifted(self, by: float) -> "Cane":
        """The same cane with all arc lengths larger by so much (m)."""
        return replace(
            self,
            arc=self.arc + by,
            nodes=tuple(Node(node.arc + by, node.pixels) for node in self.nodes),
            hidden=tuple(Span(span.start + by, span.end + by) for span in self.hidden),
        )

    def tangent(self, arc: float) -> Array:
        """Unit vector along the axis, away from the base, from the chord over 1 cm to either side."""
        chord = self.at(min(arc + _CHORD, self.length)) - self.at(max(arc - _CHORD, float(self.arc[0])))
        length = float(np.linalg.norm(chord))
        fallback: Array = self.axis[-1] - self.axis[0]
        out: Array = chord / length if length > 1e-9 else fallback / max(float(np.linalg.norm(fallback)), 1e-9)
        return out


@dataclass(frozen=True)
class Spur:
    """A spur position: two-year wood on the cordon, with the canes that grow from it.

    Attributes:
        position: Centre of its visible surface (3, m, odom).
        axis: The stub from the cordon outwards, 2×3 in odom (m); None where it is not clearly visible.
        radius: Of the stub (m), 0 where it is not clearly visible.
        canes: Longest first.
        incomplete: Reason why canes may be out of view; None if none.
        hidden: Canes that other frames have shown, but this one does not.
    """

    position: Array
    axis: Array | None
    radius: float
    canes: tuple[Cane, ...]
    incomplete: Reason | None = None
    hidden: tuple[Cane, ...] = ()


@dataclass(frozen=True)
class Plant:
    """The plants of one frame.

    Attributes:
        spurs: In order along the cordon.
        trunks: Positions of trunks, N×3 in odom (m).
        unrooted: Axes of canes without a spur, each N×3 in odom (m).
    """

    spurs: tuple[Spur, ...]
    trunks: Array
    unrooted: tuple[Array, ...]

    def other_canes(self, spur: Spur) -> Array:
        """Axis points of all canes of other spurs, N×3 in odom (m)."""
        axes = [cane.axis for other in self.spurs if other is not spur for cane in other.canes]
        return np.concatenate([np.zeros((0, 3)), *axes, *self.unrooted])
