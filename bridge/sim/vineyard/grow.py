"""Grows a row of vines in winter; the same seed gives the same row.

The row runs along +x. A cordon-trained vine has two permanent arms at the fruiting wire, spurs of two-year wood on the
arms, and one-year canes that grow upright from the spurs through the wires. A Guyot vine has one cane of last year laid
along the fruiting wire, with a shoot from each node, and a spur beside it. That cane is labelled as cordon, and has the
spur's number.
"""

import numpy as np

from bridge.sim.vineyard.cane import RowBuilder, draw, grow_cane, unit_vector
from bridge.sim.vineyard.config import VineyardConfig
from bridge.sim.vineyard.row import Array, Rod, Row
from bridge.sim.vineyard.surroundings import add_hose, add_old_cuts, add_posts_and_wires, add_ties, backdrop

#: Rods of a trunk, and length of a rod of a cordon arm (m).
_TRUNK_RODS, _ARM_ROD = 6, 0.12
#: The trunk of a cordon-trained vine ends so far below the arms (m).
_BELOW_ARMS = 0.05
#: From the head to the first shoot along the cane that was laid down (m): this bow carries none.
_GUYOT_BEND = 0.16
#: Positions of the spur's two canes as fractions of its length; the lower one further outwards.
_GUYOT_CANES = ((0.55, 0.8), (1.0, 0.3))


def grow(config: VineyardConfig, seed: int) -> Row:
    """A row with vines, posts, wires and hose, in the world frame.

    Parents come before their children. A vine depends on the seed and its number only, so that a longer row begins like
    a shorter one.

    Args:
        config: Ranges of all quantities.
        seed: Not negative.

    Raises:
        ConfigError: The ranges contradict each other.
    """
    config.check()
    growth = RowBuilder(config)
    add_posts_and_wires(growth)
    add_hose(growth)
    for vine in range(config.vines):
        first = len(growth.rods)
        _vine(growth, np.random.default_rng([seed, vine]), vine)
        # A separate random stream, so that the wood does not depend on old cuts and ties.
        rng = np.random.default_rng([seed, vine, 1])
        add_old_cuts(growth, rng, first)
        add_ties(growth, rng, first)
    return Row(tuple(growth.rods), backdrop=backdrop(config, seed))


def _vine(growth: RowBuilder, rng: np.random.Generator, vine: int) -> None:
    config = growth.config
    foot = np.array([config.first_vine_x + vine * config.vine_spacing, config.row_distance, 0.0])
    below = config.guyot_head if config.training == "guyot" else _BELOW_ARMS
    head = foot + [0.0, 0.0, config.fruiting_wire - below]
    points = foot + np.linspace(0, 1, _TRUNK_RODS + 1)[:, None] * (head - foot)
    points[1:-1, :2] += rng.normal(0.0, 0.008, (_TRUNK_RODS - 1, 2))
    radii = np.linspace(config.trunk_radius[1], config.trunk_radius[0], _TRUNK_RODS + 1)
    parent = -1
    for k in range(_TRUNK_RODS):
        parent = growth.add(Rod("trunk", points[k], points[k + 1], radii[k], radii[k + 1], parent, vine))
    if config.training == "guyot":
        _guyot_vine(growth, rng, vine, parent, head)
        return
    sites: list[tuple[int, Array]] = []
    for side in (-1.0, 1.0):
        sites += _arm(growth, rng, vine, parent, head, side)
    # Spurs are numbered along the row.
    for spur, (carrier, origin) in enumerate(sorted(sites, key=lambda site: float(site[1][0]))):
        _spur(growth, rng, carrier, origin, vine, spur)


def _arm(
    growth: RowBuilder, rng: np.random.Generator, vine: int, trunk: int, head: Array, side: float
) -> list[tuple[int, Array]]:
    """One cordon arm; returns the rod and the position of each spur."""
    config = growth.config
    reach = config.vine_spacing / 2 - 0.03
    count = max(3, round(reach / _ARM_ROD))
    along = np.linspace(0.0, 1.0, count + 1)
    points = head + np.outer(along, [side * reach, 0.0, 0.0])
    points[1:, 1] += rng.normal(0.0, 0.005, count)
    points[1:, 2] = config.cordon_height + rng.normal(0.0, 0.005, count)
    radii = config.cordon_radius[1] + along * (config.cordon_radius[0] - config.cordon_radius[1])
    stations: list[float] = []
    station = draw(rng, config.first_spur)
    while station < reach - 0.01 and len(stations) < config.spurs_per_arm:
        stations.append(station)
        station += draw(rng, config.spur_spacing)
    sites, parent = [], trunk
    for k in range(count):
        parent = growth.add(Rod("cordon", points[k], points[k + 1], radii[k], radii[k + 1], parent, vine))
        for station in stations:
            fraction = station / reach * count - k
            if 0.0 <= fraction < 1.0:
                sites.append((parent, points[k] + fraction * (points[k + 1] - points[k])))
    return sites


def _spur(growth: RowBuilder, rng: np.random.Generator, carrier: int, origin: Array, vine: int, spur: int) -> None:
    config = growth.config
    carrying = growth.rods[carrier]
    assert carrying is not None
    radius = draw(rng, config.stub_radius)
    lean = rng.normal(0.0, [0.2, 0.12]).clip(-0.4, 0.4)
    upward = unit_vector(np.array([lean[0], lean[1], 1.0]))
    length = draw(rng, config.stub_length) + carrying.start_radius
    tip = origin + length * upward
    stub = growth.add(Rod("spur", origin, tip, radius * 1.1, radius, carrier, vine, spur))

    count = int(rng.choice(3, p=config.cane_shares)) + 1
    # The lower cane starts just above the cordon and the upper one at the tip, on opposite sides: at the two nodes kept
    # last winter.
    low = (carrying.start_radius + 0.010) / length
    fractions = {1: [1.0], 2: [low, 1.0], 3: [low, (low + 1.0) / 2, 1.0]}[count]
    azimuth = float(rng.choice([0.0, np.pi])) + rng.normal(0.0, 0.5)
    for cane, fraction in enumerate(fractions):
        outward = np.array([np.cos(azimuth), np.sin(azimuth), 0.0])
        opening = draw(rng, (0.2, 0.4) if fraction == 1.0 else (0.6, 1.0))
        leave = unit_vector(np.cos(opening) * upward + np.sin(opening) * outward)
        bark = 0.0 if fraction == 1.0 else radius / np.sin(opening)
        grow_cane(growth, rng, stub, origin + fraction * (tip - origin), leave, bark, (vine, spur, cane))
        azimuth += np.pi + rng.normal(0.0, 0.4)


def _guyot_vine(growth: RowBuilder, rng: np.random.Generator, vine: int, trunk: int, head: Array) -> None:
    """Append arm, shoots and spur of one vine.

    Args:
        growth: The row.
        rng: Random generator.
        vine: Number along the row.
        trunk: Index of the trunk's last rod.
        head: Where it ends (3, m).
    """
    config = growth.config
    side = float(rng.choice([-1.0, 1.0]))
    _guyot_spur(growth, rng, vine, trunk, -side)
    level = head + [side * _GUYOT_BEND, 0.0, config.guyot_wire - head[2]]
    steps = [draw(rng, config.internode) for _ in range(config.guyot_nodes - 1)]
    # The arm never reaches the next vine's head.
    longest = config.vine_spacing - _GUYOT_BEND - 0.12
    scale = min(1.0, longest / max(sum(steps), 1e-9))
    radii = np.linspace(config.guyot_radius[1], config.guyot_radius[0], config.guyot_nodes + 1)
    parent = growth.add(Rod("cordon", head, level, radii[0], radii[1], trunk, vine, 0))
    here = level
    for node in range(config.guyot_nodes):
        _guyot_shoot(growth, rng, parent, here, vine, node + 1)
        if node < config.guyot_nodes - 1:
            following = here + [side * scale * steps[node], rng.normal(0.0, 0.003), rng.normal(0.0, 0.003)]
            parent = growth.add(Rod("cordon", here, following, radii[node + 1], radii[node + 2], parent, vine, 0))
            here = following


def _guyot_spur(growth: RowBuilder, rng: np.random.Generator, vine: int, trunk: int, side: float) -> None:
    config = growth.config
    radius = draw(rng, config.stub_radius)
    upward = unit_vector(np.array([0.5 * side, rng.normal(0.0, 0.1), 1.0]))
    carrying = growth.rods[trunk]
    assert carrying is not None
    origin = carrying.end
    length = draw(rng, config.stub_length) + carrying.end_radius
    tip = origin + length * upward
    stub = growth.add(Rod("spur", origin, tip, radius * 1.1, radius, trunk, vine, 0))
    azimuth = (0.0 if side > 0 else np.pi) + rng.normal(0.0, 0.4)
    for cane, (fraction, opening) in enumerate(_GUYOT_CANES):
        outward = np.array([np.cos(azimuth), np.sin(azimuth), 0.0])
        leave = unit_vector(np.cos(opening) * upward + np.sin(opening) * outward)
        bark = 0.0 if fraction == 1.0 else radius / np.sin(opening)
        grow_cane(growth, rng, stub, origin + fraction * (tip - origin), leave, bark, (vine, 0, cane))
        azimuth += np.pi + rng.normal(0.0, 0.4)


def _guyot_shoot(
    growth: RowBuilder, rng: np.random.Generator, parent: int, origin: Array, vine: int, site: int
) -> None:
    leave = unit_vector(np.array([rng.normal(0.0, 0.15), rng.normal(0.0, 0.25), 1.0]))
    carrying = growth.rods[parent]
    assert carrying is not None
    grow_cane(growth, rng, parent, origin, leave, carrying.end_radius, (vine, site, 0))
