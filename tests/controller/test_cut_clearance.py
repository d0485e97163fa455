from dataclasses import replace

import numpy as np
import pinocchio as pin
import pytest

from bridge.config import BridgeConfig
from bridge.sim.robot.cutter import close_blades
from bridge.sim.vineyard.row import Rod, Row
from controller.config import ControllerConfig
from controller.whole_body.collision import CollisionModel
from controller.whole_body.collision_geometry import TOOL
from controller.whole_body.obstacle import Axes, Obstacle
from controller.work.posture_search import CutClearance, CutPlan, PostureSearch, Unreachable, completed, cut_poses
from controller.work.tries import Tried
from rolling_panda import messages as m
from rolling_panda.messages.perception import Capsule, Obstacles
from rolling_panda.model.robot import ARM_Q, RobotModel
from rolling_panda.transport.inbox import Received
from tests.support.points import point

CONFIG = ControllerConfig()
SETTINGS = CONFIG.whole_body.hierarchy
POINT = np.array([0.3, 0.785, 1.169])
SHARES = np.linspace(0.0, 1.0, 111)


def wire(height, y=0.75):
    return Capsule("wire", (-0.2, y, height), (2.0, y, height), 0.004, 0.004)


def among(capsules, standing=()):
    """A search among these and the axes of all standing canes."""
    clearance = CutClearance(RobotModel(), CONFIG.whole_body.hierarchy)
    clearance.update(Received(Obstacles(header=m.Header(0.0, "odom"), capsules=capsules), 0.0), standing)
    return PostureSearch(RobotModel(), CONFIG.work, CONFIG.whole_body.joint_margin, clearance)


def find(*capsules, tangent=(0.0, 0.1, 1.0), azimuth=None, kind="spur cut", cane=0, tried=(), standing=(), **room):
    """A plan for the point, on spur 1 of vine 1, among these and the axes of all standing canes; `room` along it."""
    q = np.zeros(12)
    q[ARM_Q] = CONFIG.work.home
    search = among(capsules, standing)
    along = tuple((np.array(tangent) / np.linalg.norm(tangent)).tolist())
    cut = point("p1", tuple(POINT.tolist()), along, vine=1, spur=1, cane=cane, kind=kind, **room)
    return completed(search.find(cut, q, azimuth, tried))


def nearest(plan, capsule, part="cutter"):
    """Distance of the cutter's body, or of another part, to a rod at the cut (m)."""
    model = CollisionModel(RobotModel())
    radius = capsule.start_radius
    model.set_obstacles([Obstacle("rod", capsule.kind, capsule.start, capsule.end, radius)])
    near = model.distances(plan.q_cut, 0.2)
    return min(d for d, pair in zip(near.distance, near.pairs, strict=True) if "rod" in pair and pair[0] == part)


def blades(plan, capsule):
    """Distance of the blades to a rod at the cut (m)."""
    return nearest(plan, capsule, "blades")


def test_a_wire_over_the_cut_is_passed_from_below():
    over = wire(1.2)
    free, beside = find(), find(over)
    assert isinstance(free, CutPlan) and isinstance(beside, CutPlan)
    # The straight approach would press the cutter against the wire: control would stop before the cut.
    assert nearest(free, over) < SETTINGS.cutter_distance < nearest(beside, over)
    assert beside.poses.cut.rotation[2, 2] > free.poses.cut.rotation[2, 2] + 0.1
    np.testing.assert_allclose(beside.poses.cut.translation, POINT)


def test_beside_a_leaning_cane_the_blades_lean_away_from_a_wire():
    """Square to the cane one of the blades would come too near, from wherever the tool comes."""
    leaning = (0.3, 0.0, 1.0)
    free, beside = find(tangent=leaning), find(wire(POINT[2] + 0.0205, POINT[1]), tangent=leaning)
    assert isinstance(free, CutPlan) and isinstance(beside, CutPlan)
    steep, level = (abs(plan.poses.cut.rotation[2, 0]) for plan in (free, beside))
    assert level < steep - 0.1, "the blades are more level"
    np.testing.assert_allclose(beside.poses.cut.translation, POINT)


def keeper(below, towards=1.0):
    """A cane that stays, which leaves a stub so far below the point (m), at 45°."""
    start = POINT - [0.0, 0.0, below]
    end = start + 0.15 * np.array([towards, 0.0, 1.0])
    return Capsule("cane", tuple(start.tolist()), tuple(end.tolist()), 0.004, 0.004, 1, 1)


def bitten(plan, capsule):
    """Whether the cane would be between the closing blades: 30 mm wide, and 18 mm to either side of the cut."""
    ends = (np.array([capsule.start, capsule.end]) - POINT) @ plan.poses.cut.rotation
    at = ends[0] - ends[0, 1] / (ends[1, 1] - ends[0, 1]) * (ends[1] - ends[0])
    return bool(abs(at[0]) < 0.015 + capsule.start_radius and abs(at[2]) < 0.018)


@pytest.mark.parametrize("towards", [1.0, -1.0])
def test_blades_that_remove_a_stub_lean_past_the_cane_that_stays(towards):
    beside = keeper(0.018, towards)
    straight = find(beside, tangent=(0.0, 0.0, 1.0))
    stub = find(beside, tangent=(0.0, 0.0, 1.0), kind="renewal cut")
    assert isinstance(straight, CutPlan) and isinstance(stub, CutPlan)
    assert bitten(straight, beside) and not bitten(stub, beside)
    np.testing.assert_allclose(stub.poses.cut.translation, POINT)


@pytest.mark.parametrize("towards", [1.0, -1.0])
def test_open_blades_that_remove_a_stub_do_not_press_the_cane_that_stays(towards):
    """It is no obstacle, since the blades may touch it; but so near to its base it hardly bends."""
    beside = keeper(0.020, towards)
    stub = find(beside, tangent=(0.0, 0.0, 1.0), kind="renewal cut")
    assert isinstance(stub, CutPlan)
    assert way_room(stub, (beside.start, beside.end)) > beside.start_radius


@pytest.mark.parametrize("towards", [1.0, -1.0])
def test_a_stub_is_cut_farther_out_where_that_brings_more_room_than_half_of_the_way(towards):
    beside = keeper(0.014, towards)
    here, out = (find(beside, tangent=(0.0, 0.0, 1.0), kind="renewal cut", **room) for room in ({}, {"outward": 0.007}))
    assert isinstance(here, CutPlan) and isinstance(out, CutPlan)
    less, more = (way_room(plan, (beside.start, beside.end)) for plan in (here, out))
    assert here.along == 0.0 < out.along and more > less + 0.5 * out.along


def test_a_cut_is_not_moved_along_its_wood_for_less_room_than_half_of_the_way():
    """Canes all around, one of which leans: 5 mm farther out the blades have 1 mm more room beside it."""
    low, high = ((POINT + [0.022 + 0.2 * z, 0.0, z]).tolist() for z in (-0.2, 0.3))
    lines = (standing()[0], (tuple(low), tuple(high)))
    around = [(0.045 * np.cos(angle), 0.045 * np.sin(angle)) for angle in np.linspace(0.6, 2.0 * np.pi - 0.6, 9)]
    plan = find(tangent=(0.0, 0.0, 1.0), standing=lines + standing(*around)[1:], outward=0.007)
    assert isinstance(plan, CutPlan) and plan.along == 0.0


@pytest.mark.parametrize("towards", [1.0, -1.0])
def test_blades_do_not_lean_into_what_the_bark_hides_of_the_cane_that_stays(towards):
    """It is seen from 14 mm beside the stub on, and comes out of it 16 mm below the cut."""
    whole = keeper(0.016, towards)
    start = POINT + [0.014 * towards, 0.0, -0.002]
    seen = Capsule("cane", tuple(start.tolist()), whole.end, 0.004, 0.004, 1, 1)
    plan = find(seen, tangent=(0.0, 0.0, 1.0), kind="renewal cut")
    assert isinstance(plan, Unreachable) or not bitten(plan, whole)


@pytest.mark.parametrize("tangent", [(0.278, -0.035, 0.96), (-0.3, 0.1, 1.0), (0.5, 0.0, 1.0)])
@pytest.mark.parametrize("up", [-0.0065, 0.004, 0.0065])
def test_blades_that_lean_do_not_close_on_a_wire_that_they_pass_while_open(tangent, up):
    near = wire(POINT[2] + up, POINT[1] + 0.018)
    plan = find(near, tangent=tangent)
    if isinstance(plan, Unreachable):
        lacking = dict(dict(plan.reason.values)["near"].values)
        assert lacking["part"] in ("blades", "cutter") and "wire" in lacking["other"]
        return
    rod = Rod("wire", np.array(near.start), np.array(near.end), near.start_radius, near.end_radius)
    assert not close_blades(Row((rod,)), plan.poses.cut.homogeneous, BridgeConfig()).jammed


def test_another_approach_is_found_where_the_usual_one_would_close_on_a_wire():
    near = wire(POINT[2] + 0.0065, POINT[1] + 0.018)
    assert isinstance(find(near, tangent=(0.278, -0.035, 0.96)), CutPlan)


@pytest.mark.parametrize(("gap", "bites"), [(0.003, False), (-0.001, True)])
def test_a_post_beside_a_corner_of_the_blades_counts_only_where_it_reaches_between_them(gap, bites):
    """The blades' space ends 15 mm to the side of the cut and 18 mm ahead of it."""
    at = POINT + np.array([0.015, 0.018, 0.0]) + (0.04 + gap) * np.sqrt(0.5) * np.array([1.0, 1.0, 0.0])
    low, high = (tuple((at + [0.0, 0.0, z]).tolist()) for z in (-0.5, 0.5))
    clearance = CutClearance(RobotModel(), SETTINGS)
    post = Capsule("post", low, high, 0.04, 0.04)
    clearance.update(Received(Obstacles(header=m.Header(0.0, "odom"), capsules=(post,)), 0.0))
    cut = point("p1", tuple(POINT.tolist()), (0.0, 0.0, 1.0), vine=1, spur=1)
    square = cut_poses(POINT, np.array([0.0, 0.0, 1.0]), np.array([0.0, 1.0, 0.0]), 0.1, 0.2)
    assert (clearance.bitten(square.cut, cut) is not None) == bites


def test_a_stub_that_cannot_be_cut_without_the_cane_that_stays_is_refused():
    plan = find(keeper(0.006), tangent=(0.0, 0.0, 1.0), kind="renewal cut")
    assert isinstance(plan, Unreachable)
    near = dict(plan.reason.values)["near"]
    assert dict(near.values)["part"] == "blades" and "cane 0" in dict(near.values)["other"]


def beside(x, y, spur, number, undecided=False):
    """An upright cane so far beside the point and behind it (m)."""
    low, high = (tuple((POINT + [x, y, z]).tolist()) for z in (-0.2, 0.1))
    return Capsule("cane", low, high, 0.004, 0.004, 1, spur, undecided, number)


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_the_tool_turns_until_a_cane_that_may_stay_is_not_between_the_blades(side):
    diagonal = beside(0.014 * side, 0.017, 2, 0, undecided=True)
    free, turned = find(tangent=(0.0, 0.0, 1.0)), find(diagonal, tangent=(0.0, 0.0, 1.0))
    assert isinstance(free, CutPlan) and isinstance(turned, CutPlan)
    assert bitten(free, diagonal) and not bitten(turned, diagonal)
    np.testing.assert_allclose(turned.poses.cut.translation, POINT)


@pytest.mark.parametrize(("spur", "number"), [(2, 0), (1, 1)])
@pytest.mark.parametrize("kind", ["spur cut", "cane cut", "by hand"])
def test_a_cut_that_would_take_a_cane_that_stays_is_refused_and_names_it(spur, number, kind):
    """It is just before the blades' tips, which pass it while they are open."""
    plan = find(beside(0.0, 0.017, spur, number), tangent=(0.0, 0.0, 1.0), kind=kind)
    assert isinstance(plan, Unreachable)
    near = dict(plan.reason.values)["near"]
    assert dict(near.values)["part"] == "blades" and f"spur {spur}" in dict(near.values)["other"]


@pytest.mark.parametrize(("kind", "cut", "other"), [("spur cut", 0, 0), ("renewal cut", 0, 1), ("by hand", -1, 0)])
def test_what_is_cut_and_what_falls_with_it_are_in_nothings_way(kind, cut, other):
    """The cane of the cut itself, and of a stub the canes that go with it."""
    plan = find(beside(0.0, 0.017, 1, other), tangent=(0.0, 0.0, 1.0), kind=kind, cane=cut)
    assert isinstance(plan, CutPlan)


def test_an_approach_set_by_a_person_is_kept_and_only_the_blades_lean():
    turned = 0.2
    free = find(tangent=(0.3, 0.0, 1.0), azimuth=turned)
    beside = find(wire(POINT[2] + 0.0205, POINT[1]), tangent=(0.3, 0.0, 1.0), azimuth=turned)
    assert isinstance(free, CutPlan) and isinstance(beside, CutPlan)
    across = np.cross([0.3, 0.0, 1.0], [0.0, 1.0, 0.0])
    for plan in (free, beside):
        approach = plan.poses.cut.rotation[:, 2]
        assert np.arctan2(approach @ across / np.linalg.norm(across), approach[1]) == pytest.approx(turned, abs=0.02)


def standing(*beside, low=-0.2, high=0.3):
    """Axes of upright canes, so far beside the point and behind it (m), and of the cane that is cut."""
    return tuple(
        tuple(tuple((POINT + [x, y, z]).tolist()) for z in (low, 0.5 * (low + high), high))
        for x, y in ((0.0, 0.0), *beside)
    )


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_open_blades_come_in_beside_a_cane_that_is_cut_off_later(side):
    """It is nothing's obstacle, but it would push the blade that comes in over it."""
    x, y = 0.028 * side, -0.03
    lines = standing((x, y))
    pushes = lines[1][0], lines[1][-1]
    free, beside = find(standing=standing()), find(standing=lines)
    assert isinstance(free, CutPlan) and isinstance(beside, CutPlan)
    assert way_room(free, pushes) < 0.0 < way_room(beside, pushes)
    np.testing.assert_allclose(beside.poses.cut.translation, POINT)


def test_where_canes_push_from_everywhere_the_cut_is_made_all_the_same():
    around = [(0.04 * np.cos(angle), 0.04 * np.sin(angle)) for angle in np.linspace(0.0, 2.0 * np.pi, 9)]
    assert isinstance(find(standing=standing(*around)), CutPlan)


def test_open_blades_have_the_room_that_is_between_them_and_a_cane():
    clearance, plan = CutClearance(RobotModel(), SETTINGS), find(tangent=(0.0, 0.0, 1.0))
    assert isinstance(plan, CutPlan)
    cut = point("p1", tuple(POINT.tolist()), (0.0, 0.0, 1.0), vine=1, spur=1, cane=0)
    rooms = []
    for away in (0.040, 0.045):
        clearance.update(None, standing((away, 0.0)))
        rooms.append(clearance.beside(plan.poses, cut))
    assert rooms[0] > 0.0 and rooms[1] - rooms[0] == pytest.approx(0.005, abs=2e-4)


def test_the_cane_that_is_cut_and_those_far_away_push_nothing():
    free, beside = find(), find(standing=standing((0.12, 0.0)))
    np.testing.assert_array_equal(free.q_cut, beside.q_cut)


def way_room(plan, cane):
    """Least distance of the tool from the axis of a cane all along its straight way into the cut (m)."""
    model = CollisionModel(RobotModel())
    axis = Axes((Obstacle("met", "cane", *cane, 1e-6),))
    clear, cut = plan.poses.clear, plan.poses.cut
    places = [pin.SE3(cut.rotation, clear.translation + s * (cut.translation - clear.translation)) for s in SHARES]
    return float(model.tool_gaps(places, axis).min())


def test_the_blades_tips_pass_nothing_on_the_way_in_that_they_would_touch():
    """A short spur of another vine beside the way: the tips come past it, the cutter behind them does not reach it."""
    x, y, z = (POINT + [0.036, -0.035, 0.0]).tolist()
    stub = Capsule("cordon", (x, y, z - 0.02), (x, y, z + 0.02), 0.003, 0.003)
    free, past = find(tangent=(0.0, 0.0, 1.0)), find(stub, tangent=(0.0, 0.0, 1.0))
    assert isinstance(free, CutPlan) and isinstance(past, CutPlan)
    axis = stub.start, stub.end
    assert way_room(free, axis) - 0.003 < SETTINGS.blade_distance < way_room(past, axis) - 0.003


def test_a_posture_that_something_new_would_touch_does_not_fit_any_more():
    """A rod where the forearm comes to be at the cut, far from the tool."""
    plan, model = find(tangent=(0.0, 0.0, 1.0)), CollisionModel(RobotModel())
    assert isinstance(plan, CutPlan)
    forearm = model.placed(plan.q_cut)[model.shapes.parts.index("link5")][9:]
    rod = Capsule("wire", tuple((forearm - 0.01).tolist()), tuple((forearm + 0.01).tolist()), 0.004, 0.004)
    cut = point("p1", tuple(POINT.tolist()), vine=1, spur=1, cane=0)
    same, other = (completed(among(around).fit(plan, cut, POINT)) for around in ((), (rod,)))
    assert same.plan is not None and same.plan.approach == plan.approach and same.lacking is None
    assert other.lacking is not None and "link" in dict(other.lacking.values)["part"]
    assert other.plan is None or other.plan.approach != plan.approach


@pytest.mark.parametrize("nearer", [(0.0, 0.0, -0.006), (0.006, 0.0, 0.0)])
def test_a_stub_that_is_seen_nearer_to_the_cane_that_stays_is_cut_farther_out(nearer):
    """There the open blades do not press it, which they would where it is seen."""
    beside, along = keeper(0.022), (0.0, 0.0, 1.0)
    search = among((beside,))
    cut = point("p1", tuple(POINT.tolist()), along, vine=1, spur=1, cane=0, kind="renewal cut", outward=0.007)
    q = np.zeros(12)
    q[ARM_Q] = CONFIG.work.home
    plan = completed(search.find(cut, q))
    assert isinstance(plan, CutPlan) and plan.along == 0.0
    there, moved = (completed(search.fit(plan, cut, POINT + by)) for by in (np.zeros(3), nearer))
    assert there.plan is not None and there.plan.along == 0.0
    assert moved.plan is not None and moved.plan.along > 0.0


def room(plan, cane):
    """Distance of the tool at the cut from the axis of a cane (m)."""
    model = CollisionModel(RobotModel())
    model.set_obstacles([Obstacle("met", "post", *cane, 1e-6)])
    near = model.distances(plan.q_cut, 0.5)
    return min(d for d, pair in zip(near.distance, near.pairs, strict=True) if "met" in pair and pair[0] in TOOL)


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_after_a_cane_was_met_the_next_way_is_another_one_with_more_room_beside_it(side):
    x, y, z = (POINT + [0.06 * side, -0.05, 0.0]).tolist()
    cane = (x, y, z - 0.2), (x, y, z + 0.2)
    first = find()
    again = find(tried=(Tried(first.approach, cane),))
    assert isinstance(again, CutPlan)
    assert room(again, cane) > room(first, cane) + 0.01
    np.testing.assert_allclose(again.poses.cut.translation, POINT)
    third = find(tried=(Tried(first.approach, cane), Tried(again.approach, cane)))
    assert third.approach not in (first.approach, again.approach)


def test_an_approach_set_by_a_person_is_kept_after_a_cane_was_met():
    x, y, z = (POINT + [0.06, -0.05, 0.0]).tolist()
    tried = Tried((0.2, 0.0, 0.0), ((x, y, z - 0.2), (x, y, z + 0.2)))
    again = find(azimuth=0.2, tried=(tried,))
    assert isinstance(again, CutPlan) and again.approach[0] == 0.2 and again.approach[1:] != (0.0, 0.0)


def test_a_wire_in_the_way_from_everywhere_is_said_to_be():
    plan = find(wire(POINT[2]))
    assert isinstance(plan, Unreachable)
    assert plan.reason.code == "no_clear_posture" and plan.reason.values[0][1].values[0] == ("place", "at the cut")


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_beside_a_wire_the_cut_is_made_elsewhere_on_the_same_wood_as_far_as_it_may_be(side):
    level = wire(POINT[2] + 0.0135 * side, POINT[1])
    away, towards = ("inward", "outward") if side > 0.0 else ("outward", "inward")
    plan = find(level, tangent=(0.0, 0.0, 1.0), **{away: 0.005, towards: 0.007})
    assert isinstance(plan, CutPlan)
    assert -0.005 <= plan.along * side < 0.0
    np.testing.assert_allclose(plan.poses.cut.translation, POINT + [0.0, 0.0, plan.along])
    for room in ({}, {towards: 0.007}, {away: 0.002}):
        assert isinstance(find(level, tangent=(0.0, 0.0, 1.0), **room), Unreachable)


def test_past_a_wire_that_leaves_less_than_a_plan_has_to_spare_the_cut_is_made_all_the_same():
    """Control keeps 4 mm, and is slow from 5 mm on; a plan keeps 7 mm wherever there are."""
    level = wire(POINT[2] + 0.016, POINT[1])
    tight = find(level, tangent=(0.0, 0.0, 1.0))
    assert isinstance(tight, CutPlan) and tight.along == 0.0
    assert SETTINGS.blade_distance < blades(tight, level) < SETTINGS.blade_distance + 0.003
    spacious = find(level, tangent=(0.0, 0.0, 1.0), inward=0.005)
    assert isinstance(spacious, CutPlan) and spacious.along < 0.0
    assert blades(spacious, level) > SETTINGS.blade_distance + 0.0024
    assert isinstance(find(wire(POINT[2] + 0.014, POINT[1]), tangent=(0.0, 0.0, 1.0)), Unreachable)


def test_a_cut_with_room_is_made_at_its_point():
    plan = find(wire(1.2), inward=0.005, outward=0.007)
    assert isinstance(plan, CutPlan) and plan.along == 0.0
    np.testing.assert_allclose(plan.poses.cut.translation, POINT)


def test_where_a_wire_is_seen_beside_the_cut_the_same_approach_is_kept_a_little_along_the_wood():
    upright = (0.0, 0.0, 1.0)
    plan, level = find(tangent=upright), wire(POINT[2] + 0.0135, POINT[1])
    cut = point("p1", tuple(POINT.tolist()), upright, vine=1, spur=1, cane=0, inward=0.005)
    for others in (True, False):
        fitted = completed(among((level,)).fit(plan, cut, POINT, others=others))
        assert fitted.plan.approach == plan.approach and -0.005 <= fitted.plan.along < 0.0
        assert dict(fitted.lacking.values)["part"] == "blades"
        np.testing.assert_allclose(fitted.plan.poses.cut.translation, POINT + [0.0, 0.0, fitted.plan.along])


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
    cut = point("p1", tuple(POINT.tolist()), vine=1, spur=1)
    near, far = free.q_clear.copy(), free.q_clear.copy()
    far[0] += 1.0
    assert clearance.too_near(replace(free, q_clear=far, q_stand_off=far, q_cut=near), cut) == (0.0, None)
    lacking, why = clearance.too_near(replace(free, q_clear=near, q_stand_off=far, q_cut=far), cut)
    assert lacking == pytest.approx(0.003, abs=0.001)
    assert why.code == "too_near" and dict(why.values)["place"] == "clear of it"
    assert dict(why.values)["distance_mm"] == pytest.approx(17.0, abs=0.5) and dict(why.values)["needed_mm"] == 20.0


#: Of last year's cane where it rises from the head.
BOW = np.array([0.8, 0.0, 0.6])


def old_cane(start, end, vine=1, spur=1, radius=0.007):
    """A piece of last year's cane from one distance along it to another, past the point (m)."""
    ends = (tuple((POINT + along * BOW).tolist()) for along in (start, end))
    return Capsule("cordon", *ends, radius, radius, vine, spur)


def lying():
    """The piece after the bow, along the row."""
    corner = POINT + 0.1 * BOW
    return Capsule("cordon", tuple(corner.tolist()), tuple((corner + [0.3, 0.0, 0.0]).tolist()), 0.0065, 0.006, 1, 1)


def removal(*capsules, kind="removal", **changes):
    return find(*capsules, tangent=tuple(BOW.tolist()), kind=kind, cane=-1, **changes)


def test_last_years_cane_is_taken_off_where_it_rises_from_the_head():
    plan = removal(old_cane(-0.06, 0.1), lying())
    assert isinstance(plan, CutPlan)
    np.testing.assert_allclose(plan.poses.cut.translation, POINT)
    # The blades have it between them; the rest of the robot and the piece beyond keep their distances.
    across = plan.poses.cut.rotation.T @ BOW
    assert abs(across[1]) > np.cos(0.85)
    assert nearest(plan, old_cane(-0.06, 0.1)) > SETTINGS.cutter_distance
    assert min(nearest(plan, lying(), part) for part in ("blades", "cutter")) > SETTINGS.blade_distance


@pytest.mark.parametrize("kind", ["spur cut", "renewal cut", "cane cut", "by hand"])
def test_no_other_cut_closes_on_last_years_cane_and_the_reason_names_it(kind):
    plan = removal(old_cane(-0.06, 0.1), kind=kind)
    assert isinstance(plan, Unreachable)
    near = dict(dict(plan.reason.values)["near"].values)
    assert near["part"] == "blades" and near["other"] == "cordon 0, vine 1, spur 1"


@pytest.mark.parametrize(("vine", "spur", "name"), [(1, -1, "cordon 0"), (2, 1, "cordon 0, vine 2, spur 1")])
def test_a_removal_closes_on_no_permanent_cordon_and_on_no_other_vines_cane(vine, spur, name):
    plan = removal(old_cane(-0.06, 0.1, vine, spur))
    assert isinstance(plan, Unreachable)
    near = dict(dict(plan.reason.values)["near"].values)
    assert near["part"] == "blades" and near["other"] == name


def test_a_removal_keeps_clear_of_the_pieces_that_it_does_not_cut_through():
    """What bends back to the cut is of the same cane, and still in the way: the blades would bite on it."""
    start = POINT + 0.017 * np.array([0.0, 1.0, 0.0])
    back = Capsule("cordon", tuple(start.tolist()), tuple((start + 0.2 * BOW).tolist()), 0.007, 0.007, 1, 1)
    assert isinstance(removal(old_cane(-0.06, 0.1)), CutPlan)
    plan = removal(old_cane(-0.06, 0.1), back)
    assert isinstance(plan, Unreachable)
    assert "cordon 1" in str(plan.reason)


@pytest.mark.parametrize("number", [-1, 0, 1])
def test_a_removal_takes_no_cane_of_the_spur_beside_last_years_cane(number):
    plan = removal(old_cane(-0.06, 0.1), beside(0.0, 0.017, 1, number))
    assert not isinstance(plan, CutPlan) or not bitten(plan, beside(0.0, 0.017, 1, number))


def test_open_blades_that_remove_last_years_cane_push_no_shoot_of_it():
    """The shoot falls with it, but it stands while the blades come in."""
    foot = POINT + 0.024 * np.array([-0.6, 0.0, 0.8])
    shoot = (tuple(foot.tolist()), tuple((foot + [0.0, 0.0, 0.3]).tolist()))
    free, plan = removal(old_cane(-0.06, 0.1)), removal(old_cane(-0.06, 0.1), standing=(shoot,))
    assert isinstance(free, CutPlan) and isinstance(plan, CutPlan)
    assert way_room(free, shoot) < 0.003 <= way_room(plan, shoot)


def test_a_shoot_between_the_blades_leaves_no_room_for_a_removal_however_near_to_the_cut_it_grows():
    foot = POINT + 0.013 * np.array([-0.6, 0.0, 0.8])
    shoot = (tuple(foot.tolist()), tuple((foot + [0.0, 0.0, 0.3]).tolist()))
    cut = point("p1", tuple(POINT.tolist()), tuple(BOW.tolist()), vine=1, spur=1, cane=-1, kind="removal")
    clearance = CutClearance(RobotModel(), SETTINGS)
    nothing = Received(Obstacles(header=m.Header(0.0, "odom"), capsules=()), 0.0)
    clearance.update(nothing, (shoot,))
    square = cut_poses(POINT, BOW, np.array([0.0, 1.0, 0.0]), 0.1, 0.2)
    assert clearance.beside(square, cut) < 0.0


def test_where_a_close_up_sees_last_years_cane_it_is_removed_there():
    seen = POINT + [0.004, 0.003, -0.002]
    cut = point("p1", tuple(POINT.tolist()), tuple(BOW.tolist()), vine=1, spur=1, cane=-1, kind="removal")
    search = among((old_cane(-0.06, 0.1), lying()))
    plan = find(old_cane(-0.06, 0.1), lying(), tangent=tuple(BOW.tolist()), kind="removal", cane=-1)
    fitted = completed(search.fit(plan, cut, seen))
    assert fitted.plan is not None and fitted.lacking is None
    np.testing.assert_allclose(fitted.plan.poses.cut.translation, seen, atol=1e-9)
    other = point("p1", tuple(POINT.tolist()), tuple(BOW.tolist()), vine=1, spur=1, cane=-1, kind="by hand")
    assert completed(search.fit(plan, other, seen)).plan is None
