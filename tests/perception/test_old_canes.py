"""Last year's canes of Guyot vines: their place, the spur beside them, and their removal."""

import dataclasses
from dataclasses import dataclass
from typing import Any

import numpy as np
import pytest

from bridge.sim.camera.config import CameraConfig
from bridge.sim.camera.frame import survey_frame
from bridge.sim.camera.renderer import Camera
from bridge.sim.vineyard.config import VineyardConfig
from bridge.sim.vineyard.grow import grow
from bridge.sim.vineyard.row import Row
from bridge.sim.vineyard.truth import GuyotTruth, judge_guyot
from controller.config import WorkConfig
from perception.config import PerceptionConfig, RuleConfig
from perception.pipeline import Perception
from perception.plant.model import Cane, Plant, Spur
from perception.plant.numbering import SpurNumber
from perception.rules.pruning import Decision, apply_rule
from perception.segmentation.frame import decode_frame
from perception.segmentation.segmenter import LabelImageSegmenter
from perception.skeleton.topology import trace_old_canes
from perception.tracking.old_canes import OldCanes, at_heads, beside_spurs
from rolling_panda import messages as m
from rolling_panda import reasons
from rolling_panda.commands import MovePoint, SetRule, UndoRule
from rolling_panda.messages.perception import Capsule
from rolling_panda.messages.robot import CameraFrame
from rolling_panda.model.robot import RobotModel

ALONG = np.array([1.0, 0.0, 0.0])
CAMERA = np.array([0.0, 0.0, 0.7])
FIRST, SECOND = SpurNumber(1, 1), SpurNumber(2, 1)


def cane(x: float, z: float = 0.6, begin: float = 0.0, length: float = 0.4, radius: float = 0.007) -> Cane:
    """From a trunk at x (m) along the row and up; nearer to it than `begin` (m) it is hidden."""
    arc = np.linspace(begin, length, 60)
    axis = np.array([x, 0.75, z]) + arc[:, None] * np.array([0.8, 0.0, 0.6])
    return Cane(axis, arc, radius, (), (), "hidden", begin)


def spur(x: float, *canes: Cane) -> Spur:
    return Spur(np.array([x, 0.75, 0.65]), None, 0.0, canes)


def plant(*spurs: Spur, trunks: tuple[float, ...] = ()) -> Plant:
    return Plant(spurs, np.array([(x, 0.75, 0.4) for x in trunks]).reshape(-1, 3), ())


def test_shoots_along_the_wire_are_no_spurs_and_their_canes_are_without_one() -> None:
    shoot, own = cane(0.9, 0.8), cane(0.52, 0.7)
    seen = plant(spur(0.53, own), spur(0.9, shoot), spur(1.1), trunks=(0.5,))
    heads = at_heads(seen, (), ALONG)
    assert [each.position[0] for each in heads.spurs] == [0.53]
    (unrooted,) = heads.unrooted
    np.testing.assert_array_equal(unrooted, shoot.axis)
    assert len(heads.other_canes(heads.spurs[0])) == len(shoot.axis), "blades keep off them all the same"


def test_a_post_may_hide_the_trunk_of_a_head_and_without_either_there_is_none() -> None:
    seen = plant(spur(0.53, cane(0.52)))
    post = Capsule("post", (0.48, 0.75, 0.1), (0.48, 0.75, 1.8), 0.04, 0.04)
    assert len(at_heads(seen, (post,), ALONG).spurs) == 1
    lost = at_heads(seen, (), ALONG)
    assert lost.spurs == () and len(lost.unrooted) == 1


def test_last_years_cane_is_beside_the_nearest_spur_within_reach_and_each_has_one() -> None:
    seen, numbers = plant(spur(0.5), spur(2.3)), (FIRST, SECOND)
    near, nearer, far = cane(0.56), cane(0.53), cane(1.3)
    assert beside_spurs([far], seen, numbers) == {}
    found = beside_spurs([nearer, near, far], seen, numbers)
    assert found.keys() == {FIRST} and found[FIRST] is nearer
    both = beside_spurs([nearer, cane(2.35)], seen, numbers)
    assert both.keys() == {FIRST, SECOND}
    assert beside_spurs([near], plant(), ()) == {}


def test_last_years_cane_stays_beside_the_spur_of_which_it_was_told_and_prefers_one_with_canes() -> None:
    knot, bearing = SpurNumber(1, 2), cane(0.52, 0.7)
    seen, numbers = plant(spur(0.53), spur(0.58, bearing)), (knot, FIRST)
    assert beside_spurs([cane(0.53)], seen, numbers).keys() == {FIRST}, "a knot is nearer, but no spur"
    bearing_too = plant(spur(0.53, bearing), spur(0.58, bearing))
    assert beside_spurs([cane(0.53)], bearing_too, numbers).keys() == {knot}
    told = {FIRST: cane(0.54)}
    assert beside_spurs([cane(0.53)], bearing_too, numbers, told).keys() == {FIRST}
    # Where its spur is not in the picture, it is nobody else's.
    assert beside_spurs([cane(0.53)], plant(spur(0.53, bearing)), (knot,), told) == {}
    assert beside_spurs([cane(0.53)], bearing_too, numbers, {SECOND: cane(2.3)}).keys() == {knot}


def test_what_shows_no_cane_beside_a_spur_of_the_same_head_is_no_spur() -> None:
    bearing = spur(0.53, cane(0.52, 0.7))
    seen = plant(bearing, spur(0.46), spur(2.3), trunks=(0.5, 2.3))
    assert [each.position[0] for each in at_heads(seen, (), ALONG).spurs] == [0.53, 2.3], "another head's stays"
    assert len(at_heads(plant(spur(0.46), trunks=(0.5,)), (), ALONG).spurs) == 1


def known(*looks: Cane, number: SpurNumber = FIRST) -> OldCanes:
    canes = OldCanes()
    for each in looks:
        canes.see({number: each})
    return canes


def test_it_is_an_obstacle_with_its_spurs_number_after_three_looks() -> None:
    assert known(cane(0.5), cane(0.5)).capsules(CAMERA) == ()
    inner, outer = known(*[cane(0.5)] * 3).capsules(CAMERA)
    assert {(each.kind, each.vine, each.spur, each.start_radius) for each in (inner, outer)} == {
        ("cordon", 1, 1, 0.007)
    }
    assert inner.start == pytest.approx((0.5, 0.75, 0.6), abs=1e-6) and inner.end == outer.start
    assert outer.end == pytest.approx((0.5 + 0.8 * 0.16, 0.75, 0.6 + 0.6 * 0.16), abs=1e-3)


def test_noise_is_no_news_and_what_a_picture_hides_is_where_it_was() -> None:
    canes = known(*[cane(0.5)] * 3)
    before = canes.capsules(CAMERA)
    hidden = cane(0.5, begin=0.06), cane(0.5, length=0.11)
    for look in (cane(0.508), cane(0.5, radius=0.0073), *hidden):
        canes.see({FIRST: look})
        assert canes.capsules(CAMERA) == before
    canes.see({FIRST: cane(0.512)})
    assert canes.capsules(CAMERA)[0].start[0] == pytest.approx(0.512)


def test_the_one_that_is_severed_is_forgotten_and_the_next_vines_stays() -> None:
    canes = known(*[cane(0.5)] * 3)
    for _ in range(3):
        canes.see({SECOND: cane(2.3)})
    at = cane(0.5).at(0.04)
    assert canes.sever(SECOND, at) == () and canes.sever(FIRST, at + [0.0, 0.0, 0.1]) == ()
    # The newest picture has its base hidden.
    canes.see({FIRST: cane(0.5, begin=0.08)})
    fallen = canes.sever(FIRST, at)
    assert fallen[-1].end == pytest.approx(cane(0.5).axis[-1])
    assert canes.newest.keys() == {SECOND}
    assert {each.vine for each in canes.capsules(CAMERA)} == {2}
    assert canes.is_severed(1) and not canes.is_severed(2)
    for _ in range(3):
        assert canes.is_severed(1), "one look may be mistaken"
        canes.see({FIRST: cane(0.5)})
    assert not canes.is_severed(1)


def test_in_a_long_row_only_the_nearest_are_obstacles() -> None:
    canes = OldCanes()
    for _ in range(3):
        canes.see({SpurNumber(vine, 1): cane(1.2 * vine) for vine in range(1, 60)})
    vines = sorted({each.vine for each in canes.capsules(np.array([1.2 * 30, 0.0, 0.7]))})
    assert len(vines) == 16 and 22 <= vines[0] and vines[-1] <= 38


SEED = 11
CONFIG = PerceptionConfig(rule=RuleConfig(system="guyot"))


@dataclass(frozen=True)
class Scene:
    """A row of two Guyot vines, the truth of the first one, and the frames of a way past its head."""

    row: Row
    truth: GuyotTruth
    frames: tuple[CameraFrame, ...]


MODEL = RobotModel()


def drive(row: Row, head: float, first: int = 0, reach: float = 0.3) -> tuple[CameraFrame, ...]:
    """Five frames on the way past a head at x (m)."""
    camera, arm = Camera(CameraConfig(), SEED), WorkConfig().survey_far
    places = np.linspace(head - 0.5 - reach, head - 0.5 + reach, 5).tolist()
    return tuple(survey_frame(camera, row, MODEL, first + k, x, arm) for k, x in enumerate(places))


@pytest.fixture(scope="module")
def scene() -> Scene:
    row = grow(VineyardConfig(vines=2, training="guyot"), SEED)
    truth = judge_guyot(row)[0]
    rod = row.rods[truth.removal.rod]
    assert rod is not None
    return Scene(row, truth, drive(row, float(rod.start[0])))


def after(scene: Scene, frames: tuple[CameraFrame, ...] | None = None) -> Perception:
    """Perception after some frames, those of the scene where none are given."""
    seen = Perception(CONFIG, LabelImageSegmenter(), MODEL)
    for frame in frames or scene.frames:
        seen.process(frame)
    return seen


def removal(seen: Perception) -> m.PruningPoint | None:
    """The removal of the first vine."""
    return next((each for each in seen.points().points if each.kind == "removal" and each.vine == 1), None)


def off_axis(position: np.ndarray | m.Vector3, rod_start: np.ndarray, rod_end: np.ndarray) -> float:
    """Distance from a position to a segment (m)."""
    span = rod_end - rod_start
    share = np.clip((np.array(position) - rod_start) @ span / (span @ span), 0.0, 1.0)
    return float(np.linalg.norm(np.array(position) - rod_start - share * span))


def test_it_is_traced_from_its_trunk_along_the_true_one(scene: Scene) -> None:
    arm = scene.row.rods[scene.truth.removal.rod]
    assert arm is not None
    for frame in scene.frames:
        view = decode_frame(frame, MODEL)
        assert view.labels is not None
        found = trace_old_canes(view, view.labels, CONFIG.skeleton)
        (old,) = (each for each in found if np.linalg.norm(each.base - arm.start) < 0.3)
        assert np.linalg.norm(old.base - arm.start) < 0.040
        assert abs(old.radius - arm.start_radius) < 0.0015
        for arc in np.arange(old.arc[0], min(old.length, 0.14), 0.01):
            assert off_axis(old.at(float(arc)), arm.start, arm.end) < 0.006


def test_without_a_trunk_in_view_none_is_traced(scene: Scene) -> None:
    view = decode_frame(scene.frames[2], MODEL)
    assert view.labels is not None
    labels = np.where(view.labels == m.WOOD_CLASSES.index("trunk"), np.uint8(0), view.labels)
    assert trace_old_canes(view, labels, CONFIG.skeleton) == []


def test_a_guyot_vine_has_three_points_of_one_spur_and_nothing_is_open(scene: Scene) -> None:
    seen = after(scene)
    points = {point.kind: point for point in seen.points().points if point.vine == 1}
    assert points.keys() == {"spur cut", "cane cut", "removal"} and len({point.spur for point in points.values()}) == 1
    assert [site for site in seen.points().undecided_sites if site.vine == 1] == []
    assert {point.spur for point in seen.points().points} == {1}, "shoots of last year's cane are no spurs"
    point = points["removal"]
    assert scene.truth.removal.holds(scene.truth.removal.rod, np.array(point.position))
    own = [each for each in seen.obstacles if each.kind == "cordon" and (each.vine, each.spur) == (1, point.spur)]
    assert own
    gaps = [off_axis(point.position, np.array(each.start), np.array(each.end)) for each in own]
    assert min(gaps) < 0.015
    # The obstacle map has it only once, and no cordon that stays is beside the cut.
    assert point.cordon_distance is None or point.cordon_distance > 0.08
    others = [each for each in seen.obstacles if each.kind == "cordon" and each.spur < 0]
    assert min(off_axis(point.position, np.array(each.start), np.array(each.end)) for each in others) > 0.09


def test_its_point_keeps_its_name_and_its_obstacle_is_no_news_from_frame_to_frame(scene: Scene) -> None:
    seen = after(scene)
    point = removal(seen)
    capsules = [each for each in seen.obstacles if each.vine == 1 and each.kind == "cordon"]
    for frame in scene.frames:
        seen.process(frame)
    again = removal(seen)
    assert point is not None and again is not None and again.point_id == point.point_id
    assert [each for each in seen.obstacles if each.vine == 1 and each.kind == "cordon"] == capsules


def test_by_the_spur_rule_what_looks_like_it_is_an_arm_that_stays(scene: Scene) -> None:
    seen = after(scene)
    rule = m.PruningRule(system="spur")
    at = removal(seen)
    assert at is not None and at.cordon_distance is not None
    seen.answer(SetRule(user="Ada", rule=rule))
    assert removal(seen) is None
    for frame in scene.frames[2:]:
        seen.process(frame)
    assert removal(seen) is None
    cordons = [each for each in seen.obstacles if each.kind == "cordon"]
    assert cordons and all(each.spur == -1 for each in cordons)
    assert min(off_axis(at.position, np.array(each.start), np.array(each.end)) for each in cordons) < 0.03
    seen.answer(UndoRule(user="Ada", rule=rule))
    back = removal(seen)
    assert back is not None and back.position == at.position


@pytest.mark.long
def test_a_cordon_trained_row_has_no_removal() -> None:
    row = grow(VineyardConfig(vines=1), 1)
    camera = Camera(CameraConfig(), 1)
    seen = Perception(PerceptionConfig(), LabelImageSegmenter(), MODEL)
    for k, x in enumerate(np.linspace(-0.4, 0.4, 5).tolist()):
        result = seen.process(survey_frame(camera, row, MODEL, k, x))
    assert result.points and all(point.kind != "removal" for point in result.points)
    assert all(each.spur == -1 for each in seen.obstacles if each.kind == "cordon")


def test_nobody_moves_its_cut_and_other_numbers_of_the_rule_leave_it(
    scene: Scene, monkeypatch: pytest.MonkeyPatch
) -> None:
    seen = after(scene)
    point = removal(seen)
    assert point is not None
    refused = seen.answer(MovePoint(user="Ada", point_id=point.point_id, along=0.005))
    assert (refused.ok, refused.reason) == (False, reasons.removal_fixed())
    # Whatever the newest picture shows of it.
    monkeypatch.setattr(OldCanes, "newest", {})
    changed = m.PruningRule(system="guyot", nodes_kept=1, fruiting_nodes=6)
    assert seen.answer(SetRule(user="Ada", rule=changed)).ok
    assert removal(seen) == point
    assert reasons.old_cane_unseen() not in [site.reason for site in seen.points().undecided_sites if site.vine == 1]
    assert {each.nodes_kept for each in seen.points().points if each.kind == "spur cut" and each.vine == 1} == {1}


def test_what_one_picture_lacks_is_not_left_open_where_others_gave_a_point(scene: Scene) -> None:
    seen = after(scene)
    low = WorkConfig().survey_low
    camera = Camera(CameraConfig(), SEED)
    head = scene.truth.removal.least[0]
    for k in range(2):
        result = seen.process(survey_frame(camera, scene.row, MODEL, 10 + k, float(head) - 0.5, low))
    assert "cane cut" in {point.kind for point in result.points if point.vine == 1}
    assert [site.reason.code for site in result.undecided_sites if site.vine == 1] == []


def test_a_cane_that_lacks_its_cut_is_open_though_the_other_one_has_its_point(
    scene: Scene, monkeypatch: pytest.MonkeyPatch
) -> None:
    lacking, hidden, alike = reasons.nodes_lacking(6, 8), reasons.cut_place_hidden(), reasons.canes_at_same_height()

    def without_cane_cut(*arguments: Any) -> Decision:
        others = {cut.kind: cut for cut in apply_rule(*arguments).cuts if cut.kind != "cane cut"}
        return Decision.of({**others, "cane cut": lacking}, (lacking,))

    monkeypatch.setattr("perception.pipeline.apply_rule", without_cane_cut)
    seen = after(scene)
    assert {each.kind for each in seen.points().points if each.vine == 1} == {"spur cut", "removal"}
    for short, long, told in ((hidden, lacking, lacking), (alike, alike, alike)):
        refused = Decision.of({"spur cut": short, "cane cut": long}, tuple(dict.fromkeys((short, long))))
        monkeypatch.setattr("perception.pipeline.apply_rule", lambda *_, refused=refused: refused)
        result = seen.process(scene.frames[2])
        assert [site.reason for site in result.undecided_sites if site.vine == 1] == [told]


def test_a_second_spur_of_a_head_does_not_ask_for_a_second_cane_of_last_year(
    scene: Scene, monkeypatch: pytest.MonkeyPatch
) -> None:
    seen = after(scene)
    head = float(scene.truth.removal.least[0])

    def with_another(*arguments: Any) -> Plant:
        heads = at_heads(*arguments)
        return dataclasses.replace(heads, spurs=(*heads.spurs, spur(head + 0.07, cane(head + 0.07, 0.7))))

    monkeypatch.setattr("perception.pipeline.at_heads", with_another)
    for frame in scene.frames[1:4]:
        result = seen.process(frame)
    told = [(site.spur, site.reason) for site in result.undecided_sites if site.vine == 1]
    assert told == [(2, reasons.not_two_canes(1))]


def severed(scene: Scene, at: m.Vector3) -> Row:
    """The row with the first vine's last year's cane cut off at a place."""
    rod = scene.row.rods[scene.truth.removal.rod]
    assert rod is not None
    span = rod.end - rod.start
    return scene.row.sever(scene.truth.removal.rod, float((np.array(at) - rod.start) @ span / (span @ span)))


@pytest.mark.long
def test_once_it_is_cut_off_it_is_no_obstacle_and_nobody_is_asked_for_it_again(scene: Scene) -> None:
    seen = after(scene)
    point = removal(seen)
    assert point is not None
    rule = m.PruningRule(system="guyot", nodes_kept=1)
    seen.answer(SetRule(user="Ada", rule=rule))
    told: list[m.Reason] = []
    for frame in drive(severed(scene, point.position), float(scene.truth.removal.least[0]), 5, reach=0.35):
        seen.process(frame)
        told += seen.withdrawn
    assert [reason.code for reason in told] == ["withdrawn_as_cut"]
    assert removal(seen) is None
    assert [site for site in seen.points().undecided_sites if site.vine == 1] == []
    beyond = np.array(point.position) + 0.03 * np.array(point.tangent)
    cordons = [each for each in seen.obstacles if each.kind == "cordon"]
    assert all(each.vine != 1 for each in cordons)
    assert min(off_axis(beyond, np.array(each.start), np.array(each.end)) for each in cordons) > 0.05
    # With the rule before, the canes of its spur are cut as before.
    seen.answer(UndoRule(user="Ada", rule=rule))
    assert {each.kind for each in seen.points().points if each.vine == 1} == {"spur cut", "cane cut"}


@pytest.mark.long
def test_what_a_picture_told_against_a_cut_with_a_point_is_not_open_after_that_cut(
    scene: Scene, monkeypatch: pytest.MonkeyPatch
) -> None:
    seen = after(scene)
    point = removal(seen)
    assert point is not None
    near = reasons.wire_near_cut(6.0)
    refused = Decision.of({"removal": near}, (near,))
    with monkeypatch.context() as patched:
        patched.setattr("perception.pipeline.apply_rule", lambda *_: refused)
        seen.process(scene.frames[2])
    # The pictures after the cut show no spur.
    monkeypatch.setattr("perception.pipeline.at_heads", lambda plant, *_: dataclasses.replace(plant, spurs=()))
    for frame in drive(severed(scene, point.position), float(scene.truth.removal.least[0]), 5, reach=0.35):
        seen.process(frame)
    assert removal(seen) is None
    assert [site for site in seen.points().undecided_sites if site.vine == 1] == []
