"""A Guyot vine: a cane of last year laid along the fruiting wire, with a shoot from each node, and a spur beside it.

The cane that was laid down is two years old now; in label images it counts as the cordon, which it is for a season.
"""

import numpy as np

from bridge.sim.vineyard.cane import Growth, grow_cane, towards, uniform
from bridge.sim.vineyard.row import Array, Rod

#: From the head to the first shoot along the cane that was laid down (m): this bow carries none.
_BOW = 0.16
#: The spur's two canes leave it at these shares of its length; the lower one further outwards.
_LEAVES = ((0.55, 0.8), (1.0, 0.3))


def guyot_vine(growth: Growth, rng: np.random.Generator, vine: int, trunk: int, head: Array) -> None:
    """Append arm, shoots and spur of one vine.

    Args:
        growth: The row that it joins.
        rng: Source of every draw.
        vine: Number along the row.
        trunk: Index of the trunk's last rod.
        head: Where it ends (3, m).
    """
    config = growth.config
    side = float(rng.choice([-1.0, 1.0]))
    _spur(growth, rng, vine, trunk, -side)
    level = head + [side * _BOW, 0.0, config.cordon_height - head[2]]
    steps = [uniform(rng, config.internode) for _ in range(config.guyot_nodes - 1)]
    # The arm never reaches the next vine's head.
    longest = config.vine_spacing - _BOW - 0.12
    scale = min(1.0, longest / max(sum(steps), 1e-9))
    radii = np.linspace(config.guyot_radius[1], config.guyot_radius[0], config.guyot_nodes + 1)
    parent = growth.add(Rod("cordon", head, level, radii[0], radii[1], trunk, vine))
    here = level
    for node in range(config.guyot_nodes):
        _shoot(growth, rng, parent, here, vine, node + 1)
        if node < config.guyot_nodes - 1:
            following = here + [side * scale * steps[node], rng.normal(0.0, 0.003), rng.normal(0.0, 0.003)]
            parent = growth.add(Rod("cordon", here, following, radii[node + 1], radii[node + 2], parent, vine))
            here = following


def _spur(growth: Growth, rng: np.random.Generator, vine: int, trunk: int, side: float) -> None:
    config = growth.config
    radius = uniform(rng, config.stub_radius)
    upward = towards(np.array([0.5 * side, rng.normal(0.0, 0.1), 1.0]))
    carrying = growth.rods[trunk]
    assert carrying is not None
    origin = carrying.end
    length = uniform(rng, config.stub_length) + carrying.end_radius
    tip = origin + length * upward
    stub = growth.add(Rod("spur", origin, tip, radius * 1.1, radius, trunk, vine, 0))
    azimuth = (0.0 if side > 0 else np.pi) + rng.normal(0.0, 0.4)
    for cane, (fraction, opening) in enumerate(_LEAVES):
        outward = np.array([np.cos(azimuth), np.sin(azimuth), 0.0])
        leave = towards(np.cos(opening) * upward + np.sin(opening) * outward)
        bark = 0.0 if fraction == 1.0 else radius / np.sin(opening)
        grow_cane(growth, rng, stub, origin + fraction * (tip - origin), leave, bark, (vine, 0, cane))
        azimuth += np.pi + rng.normal(0.0, 0.4)


def _shoot(growth: Growth, rng: np.random.Generator, parent: int, origin: Array, vine: int, site: int) -> None:
    leave = towards(np.array([rng.normal(0.0, 0.15), rng.normal(0.0, 0.25), 1.0]))
    carrying = growth.rods[parent]
    assert carrying is not None
    grow_cane(growth, rng, parent, origin, leave, carrying.end_radius, (vine, site, 0))
