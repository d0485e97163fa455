"""What last summer left on the canes: lateral shoots, tendrils, old leaves, and canes that droop.

A lateral organ is made of rods that have its number on the cane. They come after all rods of the row, which keep their
indices; a cut that removes a cane removes them with it. Laterals are thin canes without nodes. Tendrils and leaves are
no wood: the blades and the arm pass them, and they have the class of the background.
"""

import math
from dataclasses import dataclass, replace

import numpy as np
from msgspec import structs
from scipy.spatial.transform import Rotation

from bridge.sim.vineyard.cane import draw, unit_vector
from bridge.sim.vineyard.row import Array, Rod, Row
from bridge.sim.world.config import WorldConfig
from rolling_panda.messages.types import WoodClass

#: A drooping cane stands so far above its base (m), and is bent from there to its tip by this angle (rad).
_STANDS, _BENT = 0.25, (math.radians(60.0), math.radians(140.0))
#: Length of laterals: mean, and limits (m); length of their rods (m).
_LATERAL, _LATERAL_LIMITS, _LATERAL_ROD = 0.09, (0.03, 0.30), 0.06
#: Radius of laterals at the base (m), at most this fraction of the node's; angle to the cane (rad).
_LATERAL_RADIUS, _LATERAL_SHARE, _BRANCHES = (0.001, 0.0025), 0.6, (math.radians(35.0), math.radians(70.0))
#: A tendril holds a wire within this distance, less than between two, and is wound around it over a length (m).
_GRASP, _WOUND = 0.15, 0.016
#: Length of the three rods of a free tendril; radius at the base and the tip of any (m).
_TENDRIL_ROD, _TENDRIL_RADIUS = (0.025, 0.05), (0.0008, 0.0005)
#: Stalk of a leaf, its blade as it dried and rolled up (m), and half the width of that (m).
_STALK, _BLADE, _ROLLED = (0.03, 0.07), (0.05, 0.10), (0.008, 0.018)
_STREAM = 0x6404
_Rods = list[Rod | None]


@dataclass(frozen=True)
class _Organ:
    """A chain of rods: its class, points (N×3, m) and the radius at each (N, m)."""

    kind: WoodClass
    points: Array
    radii: Array


def overgrown(row: Row, world: WorldConfig, seed: int, laterals: float = 0.0) -> Row:
    """The row with its drooping canes and lateral organs.

    Each cane and node has a random stream of its own: what grows there does not depend on the other vines, nor on the
    shares of other disturbances.

    Args:
        row: As it was grown, before any cut.
        world: Shares of canes and nodes.
        seed: Not negative.
        laterals: Fraction of nodes with a lateral shoot in any world, as of these vines.
    """
    world = structs.replace(world, laterals=max(world.laterals, laterals))
    if not (world.drooping or world.laterals or world.tendrils or world.leaves):
        return row
    canes: dict[tuple[int, int, int], list[int]] = {}
    for index, rod in row.standing():
        if rod.cane >= 0:
            canes.setdefault((rod.vine, rod.spur, rod.cane), []).append(index)
    # Ties are wires too, but short.
    wires = [
        rod for _, rod in row.standing() if rod.kind == "wire" and float(np.linalg.norm(rod.end - rod.start)) > 0.1
    ]
    rods: _Rods = list(row.rods)
    for numbers, own in canes.items():
        rng = np.random.default_rng([seed, _STREAM, *numbers])
        if float(rng.uniform()) < world.drooping:
            _droop(rods, own, rng)
        _add_organs(rods, own, wires, world, (seed, _STREAM, *numbers))
    return replace(row, rods=tuple(rods))


def _droop(rods: _Rods, own: list[int], rng: np.random.Generator) -> None:
    """Bend a cane that is out of the wires to one side; as along all canes, more along the row than across."""
    azimuth, bent = rng.uniform(0.0, math.tau), draw(rng, _BENT)
    # Horizontal, and square to the side that the cane bends to.
    axis = unit_vector(np.array([-0.5 * math.sin(azimuth), math.cos(azimuth), 0.0]))
    chain = [rod for rod in (rods[index] for index in own) if rod is not None]
    lengths = [float(np.linalg.norm(rod.end - rod.start)) for rod in chain]
    free = max(sum(lengths) - _STANDS, 1e-9)
    point, along = chain[0].start, 0.0
    for index, rod, length in zip(own, chain, lengths, strict=True):
        share = max(0.0, along + length / 2 - _STANDS) / free
        end = point + Rotation.from_rotvec(bent * share * axis).apply(rod.end - rod.start)
        rods[index] = replace(rod, start=point, end=end)
        point, along = end, along + length


def _add_organs(rods: _Rods, own: list[int], wires: list[Rod], world: WorldConfig, stream: tuple[int, ...]) -> None:
    """Append what grows on the nodes of a cane: leaves and laterals on one side, tendrils on the other, in turn."""
    first, number = float(np.random.default_rng([*stream, 0]).uniform(0.0, math.tau)), 0
    nodes = [(index, rod) for index, rod in ((index, rods[index]) for index in own) if rod and rod.kind == "node"]
    # The basal bud has neither leaf nor tendril.
    for count, (index, node) in enumerate(nodes[1:], 1):
        turned, lateral, tendril, leaf = np.random.default_rng([*stream, count]).spawn(4)
        side = _square(node, first + math.pi * count + float(turned.normal(0.0, 0.3)))
        organs = []
        if float(lateral.uniform()) < world.laterals:
            organs.append(_lateral(node, side, lateral))
        if float(tendril.uniform()) < world.tendrils:
            organs.append(_tendril(node, -side, wires, tendril))
        if float(leaf.uniform()) < world.leaves:
            organs.append(_leaf(node, side, leaf))
        for organ in organs:
            _append(rods, index, organ, number)
            number += 1


def _append(rods: _Rods, parent: int, organ: _Organ, number: int) -> None:
    carrier = rods[parent]
    assert carrier is not None
    for start, end, radius, end_radius in zip(
        organ.points, organ.points[1:], organ.radii, organ.radii[1:], strict=False
    ):
        numbers = (carrier.vine, carrier.spur, carrier.cane)
        rods.append(Rod(organ.kind, start, end, float(radius), float(end_radius), parent, *numbers, organ=number))
        parent = len(rods) - 1


def _lateral(node: Rod, side: Array, rng: np.random.Generator) -> _Organ:
    point, thick = node.at(0.5)
    length = float(np.clip(rng.exponential(_LATERAL), *_LATERAL_LIMITS))
    angle, radius = draw(rng, _BRANCHES), min(draw(rng, _LATERAL_RADIUS), _LATERAL_SHARE * thick)
    heading = math.cos(angle) * _direction(node) + math.sin(angle) * side
    count = math.ceil(length / _LATERAL_ROD)
    points = [point]
    for _ in range(count):
        points.append(points[-1] + length / count * unit_vector(heading))
        heading = heading + rng.normal(0.0, 0.2, 3)
    return _Organ("cane", np.array(points), np.linspace(radius, 0.6 * radius, count + 1))


def _tendril(node: Rod, side: Array, wires: list[Rod], rng: np.random.Generator) -> _Organ:
    """One that is wound around a wire within reach, or a free one."""
    point, _ = node.at(0.5)
    for wire in wires:
        along = _direction(wire)
        ahead = float((point - wire.start) @ along)
        on_wire = wire.start + ahead * along
        if 0.0 <= ahead <= float((wire.end - wire.start) @ along) and float(np.linalg.norm(on_wire - point)) < _GRASP:
            between = (point + on_wire) / 2 + rng.normal(0.0, 0.01, 3)
            around = wire.start_radius + _TENDRIL_RADIUS[0]
            held = np.array([point, between, on_wire, on_wire + _WOUND * along])
            return _Organ("background", held, np.array([*_TENDRIL_RADIUS, around, around]))
    points, heading = [point], side
    for _ in range(3):
        points.append(points[-1] + draw(rng, _TENDRIL_ROD) * unit_vector(heading))
        heading = unit_vector(heading) + rng.normal(0.0, 0.6, 3)
    return _Organ("background", np.array(points), np.linspace(*_TENDRIL_RADIUS, 4))


def _leaf(node: Rod, side: Array, rng: np.random.Generator) -> _Organ:
    """A dry leaf hangs from its stalk, rolled up to a spindle."""
    point, _ = node.at(0.5)
    stalk, blade, wide = draw(rng, _STALK), draw(rng, _BLADE), draw(rng, _ROLLED)
    down = unit_vector(np.array([*rng.normal(0.0, 0.3, 2), -1.0]))
    top = point + stalk * unit_vector(side + 0.5 * down)
    points = [point, top, top + 0.4 * blade * down, top + blade * down]
    return _Organ("background", np.array(points), np.array([0.001, 0.0015, wide, 0.002]))


def _direction(rod: Rod) -> Array:
    return unit_vector(rod.end - rod.start)


def _square(rod: Rod, azimuth: float) -> Array:
    """Unit vector square to a rod (3), at an angle about it."""
    axis = _direction(rod)
    across = unit_vector(np.cross(axis, [0.0, 1.0, 0.0] if abs(axis[1]) < 0.9 else [1.0, 0.0, 0.0]))
    return math.cos(azimuth) * across + math.sin(azimuth) * np.cross(axis, across)
