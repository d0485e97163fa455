"""Grows a row of vines in winter: the same seed always gives the same row.

The row runs along +x. Cordon-trained vines carry two permanent arms at the fruiting wire, spurs of two-year wood stand
on the arms, and one-year canes grow upright from the spurs through the wires. Guyot vines carry one cane of last year
instead (`bridge.sim.vineyard.guyot`).
"""

import numpy as np

from bridge.sim.vineyard.cane import Growth, grow_cane, towards, uniform
from bridge.sim.vineyard.config import VineyardConfig
from bridge.sim.vineyard.guyot import guyot_vine
from bridge.sim.vineyard.row import Array, Rod, Row
from bridge.sim.vineyard.surroundings import backdrop, hose, posts_and_wires, ties, wounds

_TRUNK_RODS, _ARM_PIECE = 6, 0.12


def grow(config: VineyardConfig, seed: int) -> Row:
    """A row with `config.vines` vines, posts, wires and hose, in the world frame.

    Parents stand before their children. A vine depends on the seed and its own number only, so a longer row begins
    like a shorter one.

    Args:
        config: Spreads of every quantity.
        seed: Not negative.

    Raises:
        ConfigError: The spreads contradict each other.
    """
    config.check()
    growth = Growth(config)
    posts_and_wires(growth)
    hose(growth)
    for vine in range(config.vines):
        first = len(growth.rods)
        _vine(growth, np.random.default_rng([seed, vine]), vine)
        # What stands beside the wood is drawn from a stream of its own, so that the wood does not depend on it.
        rng = np.random.default_rng([seed, vine, 1])
        wounds(growth, rng, first)
        ties(growth, rng, first)
    return Row(tuple(growth.rods), backdrop=backdrop(config, seed))


def _vine(growth: Growth, rng: np.random.Generator, vine: int) -> None:
    config = growth.config
    foot = np.array([config.first_vine_x + vine * config.vine_spacing, config.row_distance, 0.0])
    head = foot + [0.0, 0.0, config.cordon_height - 0.05]
    points = foot + np.linspace(0, 1, _TRUNK_RODS + 1)[:, None] * (head - foot)
    points[1:-1, :2] += rng.normal(0.0, 0.008, (_TRUNK_RODS - 1, 2))
    radii = np.linspace(config.trunk_radius[1], config.trunk_radius[0], _TRUNK_RODS + 1)
    parent = -1
    for k in range(_TRUNK_RODS):
        parent = growth.add(Rod("trunk", points[k], points[k + 1], radii[k], radii[k + 1], parent, vine))
    if config.training == "guyot":
        guyot_vine(growth, rng, vine, parent, head)
        return
    sites: list[tuple[int, Array]] = []
    for side in (-1.0, 1.0):
        sites += _arm(growth, rng, vine, parent, head, side)
    # Spurs are numbered along the row, as a person walking past would count them.
    for spur, (carrier, origin) in enumerate(sorted(sites, key=lambda site: float(site[1][0]))):
        _spur(growth, rng, carrier, origin, vine, spur)


def _arm(
    growth: Growth, rng: np.random.Generator, vine: int, trunk: int, head: Array, side: float
) -> list[tuple[int, Array]]:
    """One cordon arm; returns where its spurs stand: carrying rod and point on its axis."""
    config = growth.config
    reach = config.vine_spacing / 2 - 0.03
    count = max(3, round(reach / _ARM_PIECE))
    along = np.linspace(0.0, 1.0, count + 1)
    points = head + np.outer(along, [side * reach, 0.0, 0.0])
    points[1:, 1] += rng.normal(0.0, 0.005, count)
    points[1:, 2] = config.cordon_height + rng.normal(0.0, 0.005, count)
    radii = config.cordon_radius[1] + along * (config.cordon_radius[0] - config.cordon_radius[1])
    stations: list[float] = []
    station = uniform(rng, config.first_spur)
    while station < reach - 0.01 and len(stations) < config.spurs_per_arm:
        stations.append(station)
        station += uniform(rng, config.spur_spacing)
    sites, parent = [], trunk
    for k in range(count):
        parent = growth.add(Rod("cordon", points[k], points[k + 1], radii[k], radii[k + 1], parent, vine))
        for station in stations:
            fraction = station / reach * count - k
            if 0.0 <= fraction < 1.0:
                sites.append((parent, points[k] + fraction * (points[k + 1] - points[k])))
    return sites


def _spur(growth: Growth, rng: np.random.Generator, carrier: int, origin: Array, vine: int, spur: int) -> None:
    config = growth.config
    carrying = growth.rods[carrier]
    assert carrying is not None
    radius = uniform(rng, config.stub_radius)
    lean = rng.normal(0.0, [0.2, 0.12]).clip(-0.4, 0.4)
    upward = towards(np.array([lean[0], lean[1], 1.0]))
    length = uniform(rng, config.stub_length) + carrying.start_radius
    tip = origin + length * upward
    stub = growth.add(Rod("spur", origin, tip, radius * 1.1, radius, carrier, vine, spur))

    count = int(rng.choice(3, p=config.cane_shares)) + 1
    # The lower cane leaves just above the bark of the cordon, the upper one at the tip, as the two nodes that were
    # left on the spur last winter would have it; they stand on opposite sides.
    low = (carrying.start_radius + 0.010) / length
    fractions = {1: [1.0], 2: [low, 1.0], 3: [low, (low + 1.0) / 2, 1.0]}[count]
    azimuth = float(rng.choice([0.0, np.pi])) + rng.normal(0.0, 0.5)
    for cane, fraction in enumerate(fractions):
        outward = np.array([np.cos(azimuth), np.sin(azimuth), 0.0])
        opening = uniform(rng, (0.2, 0.4) if fraction == 1.0 else (0.6, 1.0))
        leave = towards(np.cos(opening) * upward + np.sin(opening) * outward)
        bark = 0.0 if fraction == 1.0 else radius / np.sin(opening)
        grow_cane(growth, rng, stub, origin + fraction * (tip - origin), leave, bark, (vine, spur, cane))
        azimuth += np.pi + rng.normal(0.0, 0.4)
