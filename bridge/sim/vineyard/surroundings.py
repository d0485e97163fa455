"""Posts, wires, hose, ties and old cuts of a row, and the rows behind."""

import numpy as np

from bridge.sim.vineyard.cane import RowBuilder, draw, unit_vector
from bridge.sim.vineyard.config import VineyardConfig
from bridge.sim.vineyard.row import Array, Rod

#: A tie is a ring of this length and thickness around wood and wire (m).
_TIE_LENGTH, _TIE_THICKNESS = 0.012, 0.002


def add_posts_and_wires(growth: RowBuilder) -> None:
    """Append posts and wires."""
    config = growth.config
    first, last = _ends(config)
    y = config.row_distance
    pitch = config.vines_per_post * config.vine_spacing
    # A post at the row's start, then one after every few vines, and one at its end.
    for x in [*np.arange(first, last - 1e-6, pitch), last]:
        foot, top = np.array([x, y, 0.0]), np.array([x, y, config.post_height])
        growth.add(Rod("post", foot, top, config.post_radius, config.post_radius))
    under = -config.cordon_radius[1] - config.wire_radius
    for above in (under, *config.wires):
        ends = np.array([[first, y, config.fruiting_wire + above], [last, y, config.fruiting_wire + above]])
        growth.add(Rod("wire", ends[0], ends[1], config.wire_radius, config.wire_radius))


def add_hose(growth: RowBuilder) -> None:
    """Append the drip hose."""
    config = growth.config
    if config.hose_height > 0.0:
        ends = [np.array([x, config.row_distance, config.hose_height]) for x in _ends(config)]
        growth.add(Rod("hose", ends[0], ends[1], config.hose_radius, config.hose_radius))


def add_old_cuts(growth: RowBuilder, rng: np.random.Generator, first: int) -> None:
    """Append old cuts: one on the tip of every stub, and some on trunk and arms.

    Args:
        growth: The row so far.
        rng: Random generator.
        first: Index of the vine's first rod.
    """
    config = growth.config
    present = [(index, rod) for index, rod in enumerate(growth.rods) if index >= first and rod is not None]
    for index, rod in present:
        if rod.kind == "spur":
            tip = rod.end + draw(rng, config.old_cut) * unit_vector(rod.end - rod.start)
            growth.add(Rod("old cut", rod.end, tip, rod.end_radius, rod.end_radius * 0.9, index, rod.vine, rod.spur))
    bark = [(index, rod) for index, rod in present if rod.kind in ("trunk", "cordon")]
    for _ in range(int(rng.integers(config.old_cuts_a_vine[0], config.old_cuts_a_vine[1] + 1))):
        index, rod = bark[int(rng.integers(len(bark)))]
        point, thickness = rod.at(float(rng.uniform(0.1, 0.9)))
        outward = _square(rng, rod)
        radius = min(float(rng.uniform(0.005, 0.010)), 0.6 * thickness)
        tip = point + (thickness + draw(rng, config.old_cut)) * outward
        growth.add(Rod("old cut", point, tip, radius, radius, index, rod.vine))


def add_ties(growth: RowBuilder, rng: np.random.Generator, first: int) -> None:
    """Append ties around arms; they have the class of the wire, which the blades must avoid too."""
    config = growth.config
    arms = [rod for rod in growth.rods[first:] if rod is not None and rod.kind == "cordon"]
    if config.training == "guyot":
        # The bow between head and wire is tied to nothing.
        arms = arms[1:]
    for _ in range(int(rng.integers(config.ties_a_vine[0], config.ties_a_vine[1] + 1))):
        rod = arms[int(rng.integers(len(arms)))]
        point, thickness = rod.at(float(rng.uniform(0.2, 0.8)))
        along = unit_vector(rod.end - rod.start) * _TIE_LENGTH / 2
        growth.add(Rod("wire", point - along, point + along, thickness + _TIE_THICKNESS, thickness + _TIE_THICKNESS))


def backdrop(config: VineyardConfig, seed: int) -> tuple[Rod, ...]:
    """The rows behind, in less detail."""
    rng = np.random.default_rng([seed, 2**20])
    rods: list[Rod] = []
    first, last = _ends(config)
    for row in range(1, config.rows_behind + 1):
        y = config.row_distance + row * config.row_spacing
        shift = float(rng.uniform(0.0, config.vine_spacing))
        for above in (0.0, *config.wires):
            z = config.fruiting_wire + above
            thick = config.wire_radius if above else config.cordon_radius[1]
            ends = [np.array([first - 3.0, y, z]), np.array([last + 3.0, y, z])]
            rods.append(Rod("wire" if above else "cordon", ends[0], ends[1], thick, thick))
        for x in np.arange(first - 3.0 + shift, last + 3.0, config.vine_spacing):
            foot = np.array([x, y, 0.0])
            rods.append(Rod("trunk", foot, foot + [0.0, 0.0, config.fruiting_wire], *config.trunk_radius[::-1]))
            for _ in range(2 * config.spurs_per_arm * 2):
                start = np.array([x + rng.uniform(-0.9, 0.9), y, config.fruiting_wire])
                lean = rng.normal(0.0, config.cane_tilt, 2)
                tip = start + draw(rng, config.cane_length) * unit_vector(np.array([lean[0], lean[1], 1.0]))
                rods.append(Rod("cane", start, tip, config.cane_radius_mean, 0.5 * config.cane_radius_mean))
    return tuple(rods)


def _ends(config: VineyardConfig) -> tuple[float, float]:
    first = config.first_vine_x - config.vine_spacing / 2
    return first, first + config.vines * config.vine_spacing


def _square(rng: np.random.Generator, rod: Rod) -> Array:
    """A random unit vector square to the rod (3)."""
    axis = unit_vector(rod.end - rod.start)
    across = rng.standard_normal(3)
    return unit_vector(across - float(across @ axis) * axis)
