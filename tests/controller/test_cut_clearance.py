from dataclasses import replace

import numpy as np
import pytest

from controller.config import ControllerConfig
from controller.whole_body.collision import CollisionModel
from controller.whole_body.obstacle import Obstacle
from controller.work.posture_search import CutClearance, CutPlan, PostureSearch, Unreachable, completed
from rolling_panda import messages as m
from rolling_panda.messages.perception import Capsule, Obstacles
from rolling_panda.model.robot import ARM_Q, RobotModel
from rolling_panda.transport.inbox import Received

CONFIG = ControllerConfig()
SETTINGS = CONFIG.whole_body.hierarchy
POINT = np.array([0.3, 0.785, 1.169])


def wire(height, y=0.75):
    return Capsule("wire", (-0.2, y, height), (2.0, y, height), 0.004, 0.004)


def find(*capsules):
    """A plan for the point, among these."""
    clearance = CutClearance(RobotModel(), CONFIG.whole_body.hierarchy)
    message = Obstacles(header=m.Header(0.0, "odom"), capsules=capsules)
    clearance.update(Received(message, 0.0))
    q = np.zeros(12)
    q[ARM_Q] = CONFIG.work.home
    search = PostureSearch(RobotModel(), CONFIG.work, CONFIG.whole_body.joint_margin, clearance.too_near)
    return completed(search.find(POINT, np.array([0.0, 0.1, 1.0]), q))


def nearest(plan, capsule):
    """Distance of the cutter's body to a rod at the cut (m)."""
    model = CollisionModel(RobotModel())
    radius = capsule.start_radius
    model.set_obstacles([Obstacle("rod", capsule.kind, capsule.start, capsule.end, radius)])
    near = model.distances(plan.q_cut, 0.2)
    return min(d for d, pair in zip(near.distance, near.pairs, strict=True) if "rod" in pair and pair[0] == "cutter")


def test_a_wire_over_the_cut_is_passed_from_below():
    over = wire(1.2)
    free, beside = find(), find(over)
    assert isinstance(free, CutPlan) and isinstance(beside, CutPlan)
    # The straight approach would press the cutter against the wire: control would stop before the cut.
    assert nearest(free, over) < SETTINGS.cutter_distance < nearest(beside, over)
    assert beside.poses.cut.rotation[2, 2] > free.poses.cut.rotation[2, 2] + 0.1
    np.testing.assert_allclose(beside.poses.cut.translation, POINT)


def test_a_wire_in_the_way_from_everywhere_is_said_to_be():
    plan = find(wire(POINT[2]))
    assert isinstance(plan, Unreachable)
    assert plan.reason.code == "no_clear_posture" and plan.reason.values[0][1].values[0] == ("place", "at the cut")


def test_what_is_far_away_changes_nothing():
    free, far = find(), find(wire(1.9))
    assert isinstance(free, CutPlan) and isinstance(far, CutPlan)
    np.testing.assert_array_equal(free.q_cut, far.q_cut)


@pytest.mark.parametrize(
    ("pair", "kept"),
    [
        (("blades", "wire 1"), SETTINGS.blade_distance),
        (("cutter", "wire 1"), SETTINGS.cutter_distance),
        (("camera", "wire 1"), SETTINGS.collision_distance),
        (("link5", "cutter"), SETTINGS.cutter_distance),
        (("link5", "base"), SETTINGS.collision_distance),
        (("camera", "cane 3, vine 1, spur 2"), SETTINGS.cane_distance),
        (("cutter", "cane 3"), SETTINGS.cutter_distance),
        (("blades", "cane 3"), SETTINGS.blade_distance),
    ],
)
def test_each_pair_keeps_its_own_distance(pair, kept):
    assert SETTINGS.kept(pair) == kept


def cane(x, y=0.785, top=1.159, spur=1):
    return Capsule("cane", (x, y, 0.95), (x, y, top), 0.004, 0.004, 1, spur)


def test_the_spur_that_is_cut_is_in_nothings_way_and_another_one_as_near_is():
    def beside(spur):
        return find(cane(POINT[0]), cane(POINT[0] + 0.02, top=1.3, spur=spur))

    free, own, crossed = find(), beside(1), beside(2)
    assert isinstance(own, CutPlan)
    np.testing.assert_array_equal(free.q_cut, own.q_cut)
    # Where the cane is of another spur, the straight approach is not taken.
    assert not isinstance(crossed, CutPlan) or not np.allclose(crossed.q_cut, free.q_cut)


def test_clear_of_the_canes_there_is_room_for_the_motion_to_lead_on():
    """The blades may come nearer to something at the cut than where the motions between cuts begin and end."""
    free = find()
    x, y, z = free.poses.clear.translation.tolist()
    beside = Capsule("wire", (x + 0.047, y, z - 0.03), (x + 0.047, y, z + 0.03), 0.002, 0.002)
    clearance = CutClearance(RobotModel(), CONFIG.whole_body.hierarchy)
    clearance.update(Received(Obstacles(header=m.Header(0.0, "odom"), capsules=(beside,)), 0.0))
    near, far = free.q_clear.copy(), free.q_clear.copy()
    far[0] += 1.0
    assert clearance.too_near(replace(free, q_clear=far, q_stand_off=far, q_cut=near)) == (0.0, None)
    lacking, why = clearance.too_near(replace(free, q_clear=near, q_stand_off=far, q_cut=far))
    assert lacking == pytest.approx(0.003, abs=0.001)
    assert why.code == "too_near" and dict(why.values)["place"] == "clear of it"
    assert dict(why.values)["distance_mm"] == pytest.approx(17.0, abs=0.5) and dict(why.values)["needed_mm"] == 20.0
