"""A motion that was approved is judged by the room that it needs, not by all that comes into sight."""

import time
from dataclasses import replace

import msgspec
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from controller.motion.surroundings import obstacles_of
from controller.planning.path_watch import SAME, PathWatch
from controller.planning.preview_plan import STEP, PreviewRequest
from controller.planning.rollout import Rollout
from controller.whole_body.collision import CollisionModel
from rolling_panda.config import RobotConfig
from rolling_panda.messages.perception import Capsule
from rolling_panda.model.robot import ARM_Q, RobotModel
from tests.support.controller_at_work import CONFIG
from tests.support.points import point

A, B = point("a", (0.45, 0.75, 1.05)), point("b", (0.75, 0.75, 1.1))
START = np.zeros(12)
START[ARM_Q] = CONFIG.work.home
FOUND = ("obstacle_near_way", "obstacle_in_way")
KNOWN = Capsule("wire", (-2.0, 0.75, 1.7), (2.0, 0.75, 1.7), 0.004, 0.004)
MADE = Rollout(CONFIG, RobotConfig()).roll(PreviewRequest(1, START, (A, B), (KNOWN,)))
MODEL = CollisionModel(RobotModel())
CONFIGURATIONS = [
    np.array([row.base.x, row.base.y, row.base.phi, *row.position])
    for row in MADE.rows
    if row.time <= MADE.cuts[1].ends_s
]


def watch(made=MADE):
    return PathWatch(made, made.swept, CONFIG.whole_body.hierarchy)


def upright(x, y, kind="post", radius=0.03, **changes):
    return Capsule(kind, (x, y, 0.2), (x, y, 1.8), radius, radius, **changes)


def nearest(capsule):
    """Of the motion's configurations to it, part by part of the robot (m)."""
    MODEL.set_obstacles(obstacles_of([capsule]))
    name = MODEL.obstacles[0].name
    least = {}
    for q in CONFIGURATIONS:
        near = MODEL.distances(q, 0.3)
        for distance, (part, other) in zip(near.distance.tolist(), near.pairs, strict=True):
            if other == name:
                least[part] = min(least.get(part, 1.0), distance)
    return least


@given(st.floats(-0.6, 1.4), st.floats(0.35, 1.2), st.sampled_from(["post", "trunk", "cane"]))
def test_it_speaks_of_what_is_too_near_and_of_nothing_else(x, y, kind):
    thing = upright(x, y, kind)
    least, said = nearest(thing), watch().changed([KNOWN, thing])
    kept = {part: CONFIG.whole_body.hierarchy.kept((part, f"{kind} ")) for part in least}
    if any(distance < kept[part] for part, distance in least.items()):
        assert said.code in FOUND and said.values[0] == ("kind", kind)
    shown = max(cut.clearance for cut in MADE.cuts)
    if all(distance > max(shown, kept[part] + STEP) + 2.0 * STEP for part, distance in least.items()):
        assert said is None


def test_what_was_known_may_be_seen_a_little_elsewhere_and_no_more():
    x, y, _ = MADE.rows[len(MADE.rows) // 3].tool
    close = next(
        each for each in (upright(x, y + 0.001 * step) for step in range(0, 400)) if not watch().changed([KNOWN, each])
    )
    least = nearest(close)
    assert 0.001 < min(least[part] - CONFIG.whole_body.hierarchy.kept((part, "post ")) for part in least) < 0.015
    made = replace(MADE, request=replace(MADE.request, obstacles=(KNOWN, close)))
    nearer = 0.9 * SAME, 3.0 * SAME
    said = [watch(made).changed([KNOWN, upright(x, close.start[1] - by)]) for by in nearer]
    assert said[0] is None and said[1].code in FOUND


def test_the_spur_that_is_cut_may_be_touched_by_the_blades_and_its_neighbour_may_not():
    at = np.array(A.position)
    low, high = at - (0.0, 0.0, 0.05), at - (0.0, 0.0, 0.006)
    stays = Capsule("cane", tuple(low.tolist()), tuple(high.tolist()), 0.004, 0.004, vine=0, spur=0)
    assert watch().changed([KNOWN, stays]) is None
    post = Capsule("post", stays.start, stays.end, 0.004, 0.004)
    assert watch().changed([KNOWN, post]).code in FOUND


def test_last_years_cane_may_be_touched_by_the_blades_in_its_removal_and_in_no_other_cut():
    at = np.array(A.position)
    low, high = at - (0.0, 0.0, 0.06), at + (0.0, 0.0, 0.04)
    piece = Capsule("cordon", tuple(low.tolist()), tuple(high.tolist()), 0.007, 0.007, vine=0, spur=0)
    removal = msgspec.structs.replace(A, kind="removal", cane=-1)
    made = replace(MADE, request=replace(MADE.request, points=(removal, B)))
    assert watch(made).changed([KNOWN, piece]) is None
    for other in (msgspec.structs.replace(piece, spur=-1), msgspec.structs.replace(piece, vine=1)):
        assert watch(made).changed([KNOWN, other]).code in FOUND
    assert watch().changed([KNOWN, piece]).code in FOUND


def test_what_stands_where_the_work_has_been_is_no_matter():
    x, y, _ = next(row.tool for row in MADE.rows if row.time >= MADE.cuts[0].cut_s)
    behind = upright(x, y, radius=0.01)
    assert ("point", "a") in watch().changed([KNOWN, behind]).values
    thin = Capsule("post", (x, y, 1.045), (x, y, 1.055), 0.002, 0.002)
    assert ("point", "a") in watch().changed([KNOWN, thin]).values
    assert watch().changed([KNOWN, thin], first="b") is None


@pytest.mark.alone
def test_a_look_at_a_row_that_has_just_come_into_sight_is_quick():
    rng = np.random.default_rng(0)
    around = [KNOWN]
    for _ in range(60):
        x, z = rng.uniform(-1.0, 2.0), rng.uniform(0.8, 1.6)
        around.append(Capsule("cane", (x, 0.75, z), (x + rng.uniform(-0.1, 0.1), 0.85, z + 0.3), 0.004, 0.004))
    watching = watch()
    took = []
    for _ in range(5):
        began = time.perf_counter()
        watching.changed(around)
        took.append(time.perf_counter() - began)
    assert min(took) < 0.02
