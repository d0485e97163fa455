"""Grows one one-year cane: a chain of tapered internodes with a swollen node between each two.

The chain carries its nodes in line, so cutting any rod of it takes off everything beyond.
"""

from dataclasses import dataclass, field

import numpy as np

from bridge.sim.vineyard.config import VineyardConfig
from bridge.sim.vineyard.row import Array, Rod
from rolling_panda.messages.types import WoodClass

#: A cane turns from the way it leaves its spur to upright over about this length (m).
_TURNING = 0.07
#: Canes zigzag a little at each node (rad).
_ZIGZAG = 0.05


@dataclass
class Growth:
    """The rods of a row while it grows."""

    config: VineyardConfig
    rods: list[Rod | None] = field(default_factory=list)

    def add(self, rod: Rod) -> int:
        """Append a rod and return its index."""
        self.rods.append(rod)
        return len(self.rods) - 1


def grow_cane(
    growth: Growth,
    rng: np.random.Generator,
    parent: int,
    origin: Array,
    leave: Array,
    bark: float,
    place: tuple[int, int, int],
) -> None:
    """Append the rods of one cane, base first: internode, basal bud, internode, node 1, internode, node 2 and so on.

    Args:
        growth: The row that it joins.
        rng: Source of every draw.
        parent: Index of the stub that carries it.
        origin: Where its axis meets that stub's (3, m).
        leave: Unit direction there (3).
        bark: Length of the cane that is inside the stub (m).
        place: Vine, spur and cane number.
    """
    config = growth.config
    length = uniform(rng, config.cane_length)
    base = float(rng.normal(config.cane_radius_mean, config.cane_radius_deviation))
    base = min(max(base, config.cane_radius[0]), config.cane_radius[1])
    lean = rng.normal(0.0, [config.cane_tilt, config.cane_tilt / 2]).clip(-0.3, 0.3)
    upright = towards(np.array([lean[0], lean[1], 1.0]))
    bend = rng.normal(0.0, 0.12, 2)
    zigzag = float(rng.choice([-1.0, 1.0])) * _ZIGZAG
    lean_over = uniform(rng.spawn(1)[0], config.cane_droop) * towards(lean)
    point, here = origin, 0.0
    middle = bark + uniform(rng, config.basal)
    while True:
        node = uniform(rng, config.node_length)
        last = middle + node / 2 >= bark + length
        stop = bark + length if last else middle - node / 2
        pieces: list[tuple[WoodClass, float, float]] = [("cane", stop - here, 1.0)]
        if not last:
            pieces.append(("node", node, uniform(rng, config.node_swelling)))
        for kind, piece, swelling in pieces:
            share = min(1.0, max(0.0, (here + piece / 2 - bark) / length))
            turned = np.exp(-max(0.0, here + piece / 2 - bark) / _TURNING)
            direction = turned * leave + (1.0 - turned) * upright
            side = zigzag * (1.0 - turned)
            over = lean_over * share**2
            direction = direction + [bend[0] * share + side + over[0], bend[1] * share * 0.5 + over[1], 0.0]
            beyond = point + piece * towards(direction)
            ends = [_radius(config, base, (s - bark) / length) * swelling for s in (here, here + piece)]
            parent = growth.add(Rod(kind, point, beyond, ends[0], ends[1], parent, *place))
            point, here = beyond, here + piece
        if last:
            return
        middle += uniform(rng, config.internode)
        zigzag = -zigzag


def _radius(config: VineyardConfig, base: float, share: float) -> float:
    return base * (1.0 - (1.0 - config.cane_taper) * min(1.0, max(0.0, share)))


def towards(vector: Array) -> Array:
    """The unit vector along `vector` (3)."""
    return vector / float(np.linalg.norm(vector))


def uniform(rng: np.random.Generator, spread: tuple[float, float]) -> float:
    """One draw from a spread."""
    return float(rng.uniform(spread[0], spread[1]))
