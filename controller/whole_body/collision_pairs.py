"""Which parts of the robot are watched against each other and against the ground.

The Panda's SRDF says which of its links never meet or always touch. The cutter and the camera are longer than the hand
that it was written for, so that of the hand's entries only those with its neighbours, links 6 and 7, are taken over.
"""

import itertools
import xml.etree.ElementTree as ET
from typing import Any

import numpy as np
import pinocchio as pin

from controller.whole_body.collision_geometry import BASE, CASTER, GROUND, TOOL, part_of
from rolling_panda.differential_drive import NQ, Array
from rolling_panda.resources import panda_description
from rolling_panda.robot_model import ARM_Q, RobotModel

#: Postures that decide which pairs can come near each other at all, and what "near" means (m).
_SAMPLES, _SEED, _NEVER_NEARER = 4096, 20240521, 0.05
#: A pair whose distance varies by less than this (m) is one that no motion changes.
_CONSTANT = 1e-6
_CARRIED = (BASE, CASTER, "link0")
_NEIGHBOURS_OF_TOOL = ("link6", "link7")
#: What was decided, by everything that it depends on: a program has several models of one robot.
_decided: dict[tuple[object, ...], tuple[tuple[int, int], ...]] = {}


def self_pairs(robot: RobotModel, geometry: Any, ground: int) -> list[tuple[int, int]]:
    """Pairs of indices into `geometry` to watch: within the robot, and arm and tool against the ground.

    Left out are the pairs that the SRDF disables, those whose distance no motion changes, and those that stay farther
    apart than 50 mm in 4096 seeded random postures within the joint limits.

    Args:
        robot: Whose joints the geometry hangs on.
        geometry: Pinocchio's geometry model, its ground added.
        ground: Index of the ground.
    """
    bounds = robot.limits.lower[ARM_Q].tobytes(), robot.limits.upper[ARM_Q].tobytes()
    known = (robot.model.saveToString(), geometry.saveToString(), *bounds, ground)
    if known not in _decided:
        _decided[known] = tuple(_decide(robot, geometry, ground))
    return list(_decided[known])


def _decide(robot: RobotModel, geometry: Any, ground: int) -> list[tuple[int, int]]:
    disabled = _disabled_links()
    parts = [part_of(item.name) for item in geometry.geometryObjects]
    joints = [item.parentJoint for item in geometry.geometryObjects]
    pairs = []
    for a, b in itertools.combinations(range(len(parts)), 2):
        moves = joints[a] != joints[b]
        if ground in (a, b):
            moves = parts[a if b == ground else b] not in (*_CARRIED, GROUND)
        if moves and not _is_disabled(parts[a], parts[b], disabled):
            pairs.append((a, b))
    distances = _sampled(robot, geometry, pairs)
    least, most = distances.min(axis=0), distances.max(axis=0)
    keep = (least < _NEVER_NEARER) & (most - least > _CONSTANT)
    return [pair for pair, kept in zip(pairs, keep, strict=True) if kept]


def _is_disabled(a: str, b: str, disabled: frozenset[frozenset[str]]) -> bool:
    if a in TOOL or b in TOOL:
        return bool({a, b} & set(_NEIGHBOURS_OF_TOOL))
    return frozenset((a, b)) in disabled


def _disabled_links() -> frozenset[frozenset[str]]:
    root = ET.parse(panda_description() / "srdf" / "panda.srdf").getroot()
    return frozenset(
        frozenset(entry.get(key, "").removeprefix("panda_") for key in ("link1", "link2"))
        for entry in root.iter("disable_collisions")
    )


def _sampled(robot: RobotModel, geometry: Any, pairs: list[tuple[int, int]]) -> Array:
    """Distances (samples × pairs, m) in seeded random postures of the arm."""
    trial = geometry.copy()
    trial.removeAllCollisionPairs()
    for a, b in pairs:
        trial.addCollisionPair(pin.CollisionPair(a, b))
    data = trial.createData()
    results = [data.distanceResults[i] for i in range(len(pairs))]
    rng = np.random.default_rng(_SEED)
    lower, upper = robot.limits.lower[ARM_Q], robot.limits.upper[ARM_Q]
    q, out = np.zeros(NQ), np.empty((_SAMPLES, len(pairs)))
    for row in out:
        q[ARM_Q] = rng.uniform(lower, upper)
        pin.computeDistances(robot.model, robot.data, trial, data, q)
        row[:] = [result.min_distance for result in results]
    return out
