from dataclasses import replace

import numpy as np
import pinocchio as pin

from controller.whole_body.collision_geometry import TOOL, add_ground, part_of, robot_geometry, self_pairs
from rolling_panda.model.robot import ARM_Q, RobotModel

ROBOT = RobotModel()
SHAPES = robot_geometry(ROBOT)
GROUND = add_ground(SHAPES)
PAIRS = self_pairs(ROBOT, SHAPES, GROUND)
NAMES = {frozenset(part_of(SHAPES.geometryObjects[i].name) for i in pair) for pair in PAIRS}


def watched(a, b):
    return frozenset((a, b)) in NAMES


def test_links_that_the_srdf_disables_are_not_watched_and_the_others_are():
    assert not watched("link5", "link7")
    assert not watched("link3", "link6")
    assert watched("link1", "link6")
    assert watched("link2", "link7")


def test_the_tool_is_watched_against_the_forearm_and_the_base():
    for part in TOOL:
        assert watched("link5", part)
        assert watched("base", part)
        assert watched("ground", part)
    for link in ("link5", "link6", "link7"):
        assert watched("base", link)


def test_neighbours_and_what_no_motion_changes_are_not_watched():
    assert not watched("base", "link0")
    assert not watched("base", "link1")
    assert not watched("base", "ground")
    assert not watched("link0", "ground")
    assert not watched("cutter", "camera")
    assert not watched("link6", "cutter")


def test_pairs_left_out_for_being_far_apart_do_not_meet_in_other_postures():
    trial = SHAPES.copy()
    parts = [part_of(item.name) for item in SHAPES.geometryObjects]
    skipped = [
        (a, b)
        for a in range(len(parts))
        for b in range(a + 1, len(parts))
        if (a, b) not in PAIRS and {parts[a], parts[b]} & set(TOOL) and {parts[a], parts[b]} & {"link3", "link4"}
    ]
    assert skipped
    for a, b in skipped:
        trial.addCollisionPair(pin.CollisionPair(a, b))
    data = trial.createData()
    rng = np.random.default_rng(99)
    q = np.zeros(12)
    least = np.inf
    for _ in range(10_000):
        q[ARM_Q] = rng.uniform(ROBOT.limits.lower[ARM_Q], ROBOT.limits.upper[ARM_Q])
        pin.computeDistances(ROBOT.model, ROBOT.data, trial, data, q)
        least = min(least, *(result.min_distance for result in data.distanceResults))
    assert least > 0.02


def test_a_robot_that_cannot_move_as_far_is_judged_for_itself():
    stiff = RobotModel()
    stiff.limits = replace(ROBOT.limits, upper=ROBOT.limits.lower)
    assert self_pairs(stiff, SHAPES, GROUND) == [], "what does not move comes no nearer"
    assert self_pairs(ROBOT, SHAPES, GROUND) == PAIRS
