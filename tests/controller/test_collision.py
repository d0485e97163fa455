import numpy as np
import pinocchio as pin
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from controller.config import ControllerConfig
from controller.whole_body.collision import CollisionModel
from controller.whole_body.obstacle import Obstacle
from rolling_panda.errors import ControlError, InputError
from rolling_panda.model.robot import ARM_Q, RobotModel

ROBOT = RobotModel()
MODEL = CollisionModel(ROBOT)
HOME, REACH = np.array(ControllerConfig().work.home), np.array(ControllerConfig().work.reach)
seeds = st.integers(0, 2**32 - 1)


def at(arm, base=(0.0, 0.0, 0.0)):
    return np.array([*base, 0.0, 0.0, *arm])


def anywhere(rng):
    arm = rng.uniform(ROBOT.limits.lower[ARM_Q], ROBOT.limits.upper[ARM_Q])
    return at(arm, (*rng.uniform(-1, 1, 2), rng.uniform(-3, 3)))


def canes(rng, count, near=(0.0, 0.75, 1.0), spread=0.5):
    ends = np.array(near) + rng.uniform(-spread, spread, (count, 2, 3))
    return [
        Obstacle(f"cane {i}", "cane", tuple(a), tuple(b), float(rng.uniform(0.003, 0.05)))
        for i, (a, b) in enumerate(ends)
    ]


def moved(q, xi, step):
    """q after a small step of ξ̇: the base's motion by its velocity, exact to second order in the step."""
    half = q[2] + 0.5 * step * (ROBOT.drive.basis(q[2]) @ xi)[2]
    return q + step * (ROBOT.drive.basis(half) @ xi)


def by_pair(found):
    """Distances by pair; a part of several shapes counts with its nearest."""
    out = {}
    for distance, pair in zip(found.distance, found.pairs, strict=True):
        out[pair] = min(out.get(pair, np.inf), float(distance))
    return out


def test_survey_posture_is_clear_and_a_folded_arm_hits_its_own_base():
    MODEL.set_obstacles(())
    assert MODEL.least(at(HOME)).distance > 0.05
    folded = at([0.0, 1.76, 0.0, -1.9, 0.0, 1.9, 0.0])
    clearance = MODEL.least(folded)
    assert clearance.distance < -0.05
    assert clearance.pair[0] == "base"


def test_tool_hanging_beside_the_base_meets_the_ground():
    MODEL.set_obstacles(())
    low = at([1.57, 1.7, 0.0, -0.6, 0.0, 2.2, 0.0])
    found = by_pair(MODEL.distances(low))
    lowest = ROBOT.pose(low, ROBOT.tool_id).translation[2]
    assert lowest < 0.2
    # The blades' tips are 15 mm beyond the tool's origin.
    assert found["blades", "ground"] == pytest.approx(lowest, abs=0.03)


@settings(max_examples=30)
@given(seeds)
def test_the_tools_distances_need_no_posture(seed):
    rng = np.random.default_rng(seed)
    q = anywhere(rng)
    tool = ROBOT.pose(q, ROBOT.tool_id).copy()
    MODEL.set_obstacles(canes(rng, 12, tuple(tool.translation), 0.2))
    MODEL.allow({"cane 3"})
    every = {pair: away for pair, away in by_pair(MODEL.distances(q, 0.2)).items() if pair[1].startswith("cane ")}
    distances, at, pairs = MODEL.tool_distances((ROBOT.pose(anywhere(rng), ROBOT.tool_id), tool), 0.2)
    distances, pairs = distances[at == 1], [pair for pair, number in zip(pairs, at, strict=True) if number == 1]
    found = {}
    for distance, pair in zip(distances.tolist(), pairs, strict=True):
        found[pair] = min(found.get(pair, np.inf), distance)
    expected = {pair: away for pair, away in every.items() if pair[0] in ("blades", "cutter", "camera")}
    MODEL.allow(())
    assert found.keys() == expected.keys() and ("blades", "cane 3") not in found
    for pair, away in expected.items():
        assert found[pair] == pytest.approx(away, abs=1e-6 if away > 0.0 else 0.02)


@settings(max_examples=60)
@given(seeds)
def test_distance_changes_as_the_dampers_say(seed):
    rng = np.random.default_rng(seed)
    q, xi = anywhere(rng), rng.uniform(-1, 1, 9)
    MODEL.set_obstacles(canes(rng, 10, near=ROBOT.pose(q, ROBOT.tool_id).translation))
    rows = MODEL.dampers(q, 0.1)
    step = 1e-5
    before, now, after = (MODEL.distances(moved(q, xi, s), within=1.0) for s in (-step, 0.0, step))

    def ordered(found):
        # Shapes keep their order within a pair of parts as long as their distances do not cross.
        return {
            pair: [d for d, p in zip(found.distance, found.pairs, strict=True) if p == pair] for pair in found.pairs
        }

    before, now, after = ordered(before), ordered(now), ordered(after)
    for row, distance, pair in zip(rows.normal_jacobian, rows.distance, rows.pairs, strict=True):
        index = int(np.argmin(np.abs(np.array(now[pair]) - distance)))
        others = np.delete(np.array(now[pair]), index)
        if distance < 1e-3 or (np.abs(others - distance) < 1e-3).any():
            continue  # Inside each other the nearest points jump; of two equal distances we cannot tell which is which.
        left = (now[pair][index] - before[pair][index]) / step
        right = (after[pair][index] - now[pair][index]) / step
        if abs(left - right) > 5e-3:
            continue  # A kink: the nearest point moves from one edge of the box to another.
        assert row @ xi == pytest.approx((left + right) / 2, abs=5e-3)


@settings(max_examples=25)
@given(seeds)
def test_distance_to_an_obstacle_is_that_of_the_nearest_points_of_the_tool(seed):
    rng = np.random.default_rng(seed)
    q = anywhere(rng)
    T = ROBOT.pose(q, ROBOT.tool_id)
    radius = float(rng.uniform(0.005, 0.1))
    start = T.translation + rng.uniform(-0.6, 0.6, 3)
    ball = Obstacle("ball", "trunk", tuple(start), tuple(start), radius)
    MODEL.set_obstacles([ball])
    found = by_pair(MODEL.distances(q, within=3.0))["cutter", "ball"]
    # The cutter's capsule: axis from 0.010 to 0.112 m ahead of the flange, which is 0.180 m behind the tool's origin.
    axis = T.translation + np.linspace(0.010 - 0.180, 0.112 - 0.180, 2001)[:, None] * T.rotation[:, 2]
    assert found == pytest.approx(np.linalg.norm(axis - start, axis=1).min() - 0.033 - radius, abs=1e-6)


def test_witness_points_are_as_far_apart_as_the_distance_says():
    rng = np.random.default_rng(4)
    MODEL.set_obstacles(canes(rng, 30))
    found = MODEL.distances(at(REACH))
    gaps = np.linalg.norm(found.point_a - found.point_b, axis=1)
    np.testing.assert_allclose(gaps, np.abs(found.distance), atol=1e-5)
    assert (np.diff(found.distance) >= 0.0).all()
    least = MODEL.least(at(REACH))
    assert (least.distance, least.pair) == (pytest.approx(found.distance[0]), found.pairs[0])


@settings(max_examples=6)
@given(seeds)
def test_dampers_on_a_long_way_are_those_of_a_model_that_looks_afresh_every_time(seed):
    rng = np.random.default_rng(seed)
    MODEL.set_obstacles(canes(rng, 60))
    q, xi = at(REACH), np.zeros(9)
    for _ in range(60):
        xi = 0.9 * xi + rng.normal(0.0, 0.3, 9)
        q = moved(q, xi, 0.02)
        remembered = MODEL.dampers(q, 0.1, ROBOT.kinematics(q))
        nearest = by_pair(remembered)
        MODEL_AFRESH.set_obstacles(MODEL.obstacles)
        fresh = by_pair(MODEL_AFRESH.distances(q, within=0.1))
        assert nearest.keys() == fresh.keys()
        assert nearest == pytest.approx(fresh, abs=1e-6)


MODEL_AFRESH = CollisionModel(RobotModel())


def test_hundreds_of_obstacles_in_reach_are_all_seen():
    rng = np.random.default_rng(7)
    tool = ROBOT.pose(at(REACH), ROBOT.tool_id).translation
    near = canes(rng, 200, near=tool, spread=0.1)
    MODEL.set_obstacles(near)
    seen = {pair[1] for pair in MODEL.dampers(at(REACH), 0.1).pairs}
    assert {o.name for o in near} <= seen
    # Replaced, none of the old ones is left.
    MODEL.set_obstacles(canes(rng, 1, near=tool, spread=0.01))
    assert {b for _, b in MODEL.dampers(at(REACH), 0.1).pairs if b.startswith("cane")} == {"cane 0"}
    MODEL.set_obstacles(())
    assert not any(b.startswith("cane") for _, b in MODEL.dampers(at(REACH), 0.1).pairs)


def test_an_obstacle_out_of_reach_costs_no_pair_and_one_that_comes_near_does():
    post = Obstacle("post", "post", (3.0, 0.0, 0.0), (3.0, 0.0, 1.8), 0.04)
    MODEL.set_obstacles([post])
    assert "post" not in {b for _, b in MODEL.distances(at(HOME)).pairs}
    driven = by_pair(MODEL.distances(at(HOME, (2.6, 0.0, 0.0))))
    assert driven["base", "post"] == pytest.approx(3.0 - 0.04 - (2.6 + 0.190), abs=1e-5)
    assert by_pair(MODEL.distances(at(HOME, (3.6, 0.0, 0.0))))["caster", "post"] < 0.04


def test_the_cane_being_cut_may_come_between_the_blades_but_not_near_the_handle():
    T = ROBOT.pose(at(REACH), ROBOT.tool_id)
    y = 0.3 * T.rotation[:, 1]
    cane = Obstacle("cane 3", "cane", tuple(T.translation - y), tuple(T.translation + y), 0.004)
    MODEL.set_obstacles([cane])
    assert by_pair(MODEL.dampers(at(REACH), 0.05))["blades", "cane 3"] < 0.02
    try:
        MODEL.allow({"cane 3"})
        allowed = by_pair(MODEL.dampers(at(REACH), 0.1))
        assert ("blades", "cane 3") not in allowed
        assert ("cutter", "cane 3") in allowed
        MODEL.set_obstacles([cane])
        assert ("blades", "cane 3") not in by_pair(MODEL.distances(at(REACH)))
        with pytest.raises(InputError, match="no part wing; known are base, blades"):
            MODEL.allow({"cane 3"}, {"wing"})
    finally:
        MODEL.allow(())
    assert ("blades", "cane 3") in by_pair(MODEL.dampers(at(REACH), 0.1))


def test_kinematics_of_an_earlier_posture_are_refused():
    MODEL.set_obstacles(())
    old = ROBOT.kinematics(at(HOME))
    ROBOT.kinematics(at(REACH))
    with pytest.raises(ControlError, match="compute them again"):
        MODEL.dampers(at(HOME), 0.1, old)


def test_names_of_obstacles_are_unique():
    post = Obstacle("post", "post", (3.0, 0.0, 0.0), (3.0, 0.0, 1.8), 0.04)
    with pytest.raises(InputError, match="same name"):
        MODEL.set_obstacles([post, post])


def test_no_part_moves_farther_than_the_bound_that_the_memory_rests_on():
    rng = np.random.default_rng(3)
    for _ in range(300):
        q = anywhere(rng)
        change = np.zeros(12)
        change[[0, 1, 2, *range(5, 12)]] = rng.uniform(-0.2, 0.2, 10)
        tips = []
        for configuration in (q, q + change):
            pin.framesForwardKinematics(ROBOT.model, ROBOT.data, configuration)
            tips.append([ROBOT.data.oMf[i].translation.copy() for i in (ROBOT.tool_id, ROBOT.camera_id)])
        travelled = np.linalg.norm(np.array(tips[1]) - np.array(tips[0]), axis=1).max()
        assert travelled <= MODEL.motion_bound @ np.abs(change)
