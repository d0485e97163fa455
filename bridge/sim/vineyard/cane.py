"""Grows a one-year cane: a chain of tapered internodes and swollen nodes.

Each rod carries the next, so that a cut removes everything beyond.
"""

from dataclasses import dataclass, field

import numpy as np

from bridge.sim.vineyard.config import VineyardConfig
from bridge.sim.vineyard.row import Array, Rod
from rolling_panda.messages.types import WoodClass

#: Length over which a cane turns upright (m).
_TURNING = 0.07
#: Change of direction at each node (rad).
_ZIGZAG = 0.05


@dataclass
class RowBuilder:
    """Collects the rods of a row."""

    config: VineyardConfig
    rods: list[Rod | None] = field(default_factory=list)

    def add(self, rod: Rod) -> int:
        """Append a rod and return its index."""
        self.rods.append(rod)
        return len(self.rods) - 1


def grow_cane(
    row: RowBuilder,
    rng: np.random.Generator,
    parent: int,
    origin: Array,
    direction: Array,
    inside: float,
    numbers: tuple[int, int, int],
) -> None:
    """Append the rods of one cane, base first: internode, basal bud, internode, node 1, internode, node 2 and so on.

    Args:
        row: The row.
        rng: Random generator.
        parent: Index of the stub that carries it.
        origin: Intersection of its axis with that of the stub (3, m).
        direction: Unit vector along its axis there (3).
        inside: Length of the cane inside the stub (m).
        numbers: Vine, spur and cane.
    """
    config = row.config
    length = draw(rng, config.cane_length)
    base = float(rng.normal(config.cane_radius_mean, config.cane_radius_deviation))
    base = min(max(base, config.cane_radius[0]), config.cane_radius[1])
    lean = rng.normal(0.0, [config.cane_tilt, config.cane_tilt / 2]).clip(-0.3, 0.3)
    upright = unit_vector(np.array([lean[0], lean[1], 1.0]))
    bend = rng.normal(0.0, 0.12, 2)
    zigzag = float(rng.choice([-1.0, 1.0])) * _ZIGZAG
    lean_over = draw(rng.spawn(1)[0], config.cane_droop) * unit_vector(lean)
    point, here = origin, 0.0
    middle = inside + draw(rng, config.basal)
    while True:
        node = draw(rng, config.node_length)
        last = middle + node / 2 >= inside + length
        stop = inside + length if last else middle - node / 2
        pieces: list[tuple[WoodClass, float, float]] = [("cane", stop - here, 1.0)]
        if not last:
            pieces.append(("node", node, draw(rng, config.node_swelling)))
        for kind, piece, swelling in pieces:
            fraction = min(1.0, max(0.0, (here + piece / 2 - inside) / length))
            turned = np.exp(-max(0.0, here + piece / 2 - inside) / _TURNING)
            heading = turned * direction + (1.0 - turned) * upright
            side = zigzag * (1.0 - turned)
            over = lean_over * fraction**2
            heading = heading + [bend[0] * fraction + side + over[0], bend[1] * fraction * 0.5 + over[1], 0.0]
            beyond = point + piece * unit_vector(heading)
            ends = [_radius(config, base, (s - inside) / length) * swelling for s in (here, here + piece)]
            parent = row.add(Rod(kind, point, beyond, ends[0], ends[1], parent, *numbers))
            point, here = beyond, here + piece
        if last:
            return
        middle += draw(rng, config.internode)
        zigzag = -zigzag


def _radius(config: VineyardConfig, base: float, fraction: float) -> float:
    return base * (1.0 - (1.0 - config.cane_taper) * min(1.0, max(0.0, fraction)))


def unit_vector(vector: Array) -> Array:
    """Unit vector along `vector` (3)."""
    return vector / float(np.linalg.norm(vector))


def draw(rng: np.random.Generator, spread: tuple[float, float]) -> float:
    """Uniform random number from a range."""
    return float(rng.uniform(spread[0], spread[1]))
