"""A closer look: where the cut belongs as seen from near, and whether the wood beyond it is off."""

from dataclasses import dataclass, replace

import msgspec
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from bridge.sim.camera.config import CameraConfig
from bridge.sim.camera.frame import camera_frame
from bridge.sim.camera.renderer import Camera
from bridge.sim.vineyard.config import VineyardConfig
from bridge.sim.vineyard.grow import grow
from bridge.sim.vineyard.row import Row
from bridge.sim.vineyard.truth import RightCut, judge, judge_guyot
from controller.work.posture_search import cut_poses
from perception.config import PerceptionConfig
from perception.plant.map import NOTHING_KNOWN, Surroundings
from perception.segmentation.frame import View, decode_frame
from perception.segmentation.segmenter import LabelImageSegmenter
from perception.tracking.close_up import AROUND, check_close_up
from perception.tracking.picture_shift import PictureShift
from rolling_panda import messages as m
from rolling_panda import reasons
from rolling_panda.messages.perception import CloseUpResult
from rolling_panda.model.wire_values import vector3
from tests.support.cameras import BASE, MODEL, POSTURE, T_TOOL_CAMERA
from tests.support.points import point as pruning_point

SEED = 210
SEES = LabelImageSegmenter()


@dataclass(frozen=True)
class Scene:
    """A row and its right cuts, as the simulator knows them, and what the camera sees before each."""

    row: Row
    cuts: tuple[RightCut, ...]
    views: tuple[View, ...]

    def pairs(self) -> list[tuple[RightCut, View]]:
        return list(zip(self.cuts, self.views, strict=True))


@pytest.fixture(scope="module")
def scene() -> Scene:
    row = grow(VineyardConfig(vines=1), SEED)
    cuts = tuple(truth.cut for truth in judge(row) if truth.cut is not None)[::3]
    return Scene(row, cuts, tuple(view_from_clear(row, cut) for cut in cuts))


def point(cut: RightCut, aside: float = 0.0, along: float = 0.0) -> m.PruningPoint:
    """The point of a right cut, seen a little beside its cane or along it."""
    sideways = np.cross(cut.tangent, [0.0, 1.0, 0.0])
    place = cut.best + aside * sideways / np.linalg.norm(sideways) + along * cut.tangent
    return pruning_point("p1", vector3(place), vector3(cut.tangent), vine=1, spur=1, offset=0.02)


def view_from_clear(row: Row, cut: RightCut, clearance: float = 0.22) -> View:
    """What the camera sees from where the tool is clear of the canes."""
    poses = cut_poses(cut.best, cut.tangent, np.array([0.0, 1.0, 0.0]), 0.15, clearance)
    place = (poses.clear * T_TOOL_CAMERA).homogeneous
    camera = Camera(CameraConfig(), SEED)
    view = decode_frame(camera_frame(camera.render(row, place), camera, BASE, POSTURE, 1), MODEL)
    return replace(view, R=place[:3, :3], t=place[:3, 3])


def look(view: View, seen: m.PruningPoint, known: Surroundings = NOTHING_KNOWN) -> CloseUpResult:
    return check_close_up(view, SEES, seen, 7, PerceptionConfig(), known).result


def surroundings(row: Row, position: np.ndarray) -> Surroundings:
    """What a perfect map knows around a position."""
    canes: dict[tuple[int, int, int], list[np.ndarray]] = {}
    nodes = []
    for _, rod in row.standing():
        if rod.cane >= 0:
            steps = np.linspace(0.0, 1.0, 6)[:, None]
            canes.setdefault((rod.vine, rod.spur, rod.cane), []).append(rod.start + steps * (rod.end - rod.start))
            nodes += [rod.at(0.5)[0]] if rod.kind == "node" else []
    near = [axis[np.linalg.norm(axis - position, axis=1) < AROUND] for axis in map(np.concatenate, canes.values())]
    found = np.array(nodes)
    return Surroundings(
        tuple(axis for axis in near if len(axis) >= 2), found[np.linalg.norm(found - position, axis=1) < AROUND]
    )


def without(row: Row, cut: RightCut) -> Row:
    """The row after the right cut."""
    rod = row.rods[cut.rod]
    assert rod is not None
    axis = rod.end - rod.start
    return row.sever(cut.rod, float(np.clip((cut.best - rod.start) @ axis / (axis @ axis), 0.0, 1.0)))


def test_every_right_cut_is_confirmed_within_two_millimetres_though_the_survey_was_off_by_four(scene: Scene) -> None:
    for cut, view in scene.pairs():
        seen = look(view, point(cut, aside=0.004))
        assert seen.finding == "seen" and seen.number == 7, (cut.rod, seen)
        off = np.array(seen.position) - cut.best
        assert float(np.linalg.norm(off - cut.tangent * (off @ cut.tangent))) < 0.0025


def test_the_node_before_the_cut_says_where_along_the_cane_it_belongs(scene: Scene) -> None:
    shifts = []
    for cut, view in scene.pairs():
        here, there = (look(view, point(cut, along=along)) for along in (0.0, 0.005))
        if here.reason or there.reason:
            continue
        shifts.append(float(np.subtract(there.position, here.position) @ cut.tangent))
    assert len(shifts) >= len(scene.cuts) / 2
    assert np.median(np.abs(shifts)) < 0.0015


def test_where_the_last_kept_node_is_not_seen_nothing_is_confirmed(scene: Scene) -> None:
    """From near it would be: the survey may have counted a node that is none."""
    unseen = 0
    for cut, view in scene.pairs():
        # As if the last kept node were 35 mm before the cut, where none is.
        seen = look(view, msgspec.structs.replace(point(cut), offset=0.035))
        assert seen.position is None or any(abs(node + 0.035) < 0.008 for node in seen.nodes)
        unseen += seen.reason == reasons.node_before_cut_unseen()
    assert unseen >= 2


@pytest.mark.parametrize("turn", [(0.0, 0.045, 0.0), (0.045, 0.0, 0.0)])
def test_a_picture_of_a_camera_that_is_turned_shows_the_same_cane_where_that_picture_has_it(scene: Scene, turn) -> None:
    confirmed, lost = [], 0
    for cut, view in scene.pairs():
        R = view.R @ Rotation.from_rotvec(turn).as_matrix()
        seen = look(replace(view, R=R), point(cut), surroundings(scene.row, cut.best))
        there = view.t + R @ view.R.T @ (cut.best - view.t)
        assert float(np.linalg.norm(there - cut.best)) > 0.012, "more than any cane is looked for without a shift"
        if seen.finding == "seen":
            confirmed.append(float(np.linalg.norm(np.array(seen.position) - there)))
        lost += seen.finding in ("severed", "changed")
    assert len(confirmed) >= 0.6 * len(scene.cuts) and lost == 0
    assert max(confirmed) < 0.008


def test_a_cane_beside_the_place_is_not_taken_for_it_where_nothing_around_agrees(scene: Scene) -> None:
    cut, view = scene.pairs()[0]
    strange = surroundings(scene.row, cut.best)
    strange = Surroundings(tuple(axis + [0.0, 0.1, 0.0] for axis in strange.axes), strange.nodes)
    beside = look(view, point(cut, aside=0.008), strange)
    assert beside.finding == "unseen" and beside.reason.code == "which_cane_unclear" and beside.position is None


@pytest.mark.long
def test_where_the_nodes_do_not_tell_which_internode_is_which_it_abstains(scene: Scene, monkeypatch) -> None:
    unsure = PictureShift(np.zeros(3), agreed=False)
    monkeypatch.setattr("perception.tracking.close_up.picture_shift", lambda *_: unsure)
    for cut, view in scene.pairs():
        seen = look(view, point(cut))
        assert seen.finding == "unseen" and seen.reason == reasons.which_internode_unclear() and seen.position is None
    gone = [look(view_from_clear(without(scene.row, cut), cut), point(cut)).finding for cut in scene.cuts]
    assert "severed" in gone, "that the wood is off needs no internode"


@pytest.mark.long
def test_after_the_cut_it_says_that_the_wood_beyond_is_off_and_before_never(scene: Scene) -> None:
    findings = [look(view_from_clear(without(scene.row, cut), cut), point(cut)).finding for cut in scene.cuts]
    assert findings.count("severed") >= 0.8 * len(findings)
    assert set(findings) <= {"severed", "unseen"}
    assert all(look(view, point(cut)).finding == "seen" for cut, view in scene.pairs())


@pytest.mark.long
def test_a_cane_that_sways_aside_is_not_taken_for_one_that_is_cut(scene: Scene) -> None:
    """It is farther aside than any cane is looked for, while its neighbours stand."""
    findings = []
    for cut in scene.cuts:
        known = surroundings(scene.row, cut.best)
        findings.append(look(view_from_clear(swaying(scene.row, cut, 0.022), cut), point(cut), known).finding)
    assert "severed" not in findings and findings.count("seen") >= len(findings) / 2


def across(cut: RightCut) -> np.ndarray:
    """Across the cane, along the row."""
    return np.cross(cut.tangent, [0.0, 1.0, 0.0])


def swaying(row: Row, cut: RightCut, *aside: float) -> Row:
    """The row with the cane of a cut aside (m); with several values there are as many of it."""
    chosen = row.rods[cut.rod]
    assert chosen is not None
    own = [
        each
        for each in row.rods
        if each and (each.vine, each.spur, each.cane) == (chosen.vine, chosen.spur, chosen.cane)
    ]
    rods = [each for each in row.rods if all(each is not one for one in own)]
    for each in aside:
        push = each * across(cut)
        rods += [replace(rod, start=rod.start + push, end=rod.end + push) for rod in own]
    return Row(tuple(rods), row.revision, row.backdrop)


def among(cut: RightCut, *aside: float) -> Surroundings:
    """A map of the cane of a cut and of others beside it (m), of which a picture in a storm may show none."""
    axis = cut.best + np.linspace(-0.06, 0.06, 25)[:, None] * cut.tangent
    return Surroundings(tuple(axis + each * across(cut) for each in (0.0, *aside)), np.zeros((0, 3)))


def test_a_cane_that_sways_is_found_by_itself_where_no_other_one_can_be_it(scene: Scene) -> None:
    places = []
    for cut in scene.cuts:
        seen = look(view_from_clear(swaying(scene.row, cut, 0.016), cut), point(cut), among(cut, -0.05, 0.05))
        if seen.position is not None:
            off = np.array(seen.position) - cut.best - 0.016 * across(cut)
            places.append(float(np.linalg.norm(off - cut.tangent * (off @ cut.tangent))))
    assert len(places) >= 0.7 * len(scene.cuts) and max(places) < 0.004


def test_of_two_canes_that_may_be_it_none_is_taken(scene: Scene) -> None:
    for cut in scene.cuts:
        row = swaying(scene.row, cut, 0.016, -0.02)
        seen = look(view_from_clear(row, cut), point(cut), among(cut, -0.06, 0.06))
        assert seen.position is None, seen


def test_a_neighbour_that_sways_to_where_a_cane_was_is_not_taken_for_it(scene: Scene) -> None:
    """What stands there is nearer to the place of the neighbour, 28 mm aside."""
    for cut in scene.cuts:
        seen = look(view_from_clear(swaying(scene.row, cut, 0.016), cut), point(cut), among(cut, -0.05, 0.028, 0.06))
        assert seen.position is None, seen


def test_a_cane_whose_depth_is_lost_beyond_the_cut_is_not_taken_for_one_that_is_cut(scene: Scene) -> None:
    for cut, view in scene.pairs():
        u, v, z = view.pixels(cut.best + 0.012 * cut.tangent)[0]
        far = view.pixels(cut.best + 0.06 * cut.tangent)[0]
        rows = slice(max(0, round(min(v, far[1]))), round(max(v, far[1])) + 1)
        columns = slice(max(0, round(min(u, far[0])) - 12), round(max(u, far[0])) + 13)
        depth = view.depth.copy()
        depth[rows, columns] = 0.0
        seen = look(replace(view, depth=depth), point(cut))
        # Nor is it confirmed: the wood without depth may be another cane.
        assert z > 0.0 and seen.finding == "unseen" and seen.reason.code in ("beyond_cut_hidden", "no_cane_at_place"), (
            seen
        )


@dataclass(frozen=True)
class OldCane:
    """A Guyot row, the removal of its last year's cane, and what the camera sees before it."""

    row: Row
    cut: RightCut
    view: View

    def point(self, aside: float = 0.0) -> m.PruningPoint:
        return msgspec.structs.replace(point(self.cut, aside), kind="removal", offset=None, radius=0.007)


@pytest.fixture(scope="module", params=[3, 11])
def old(request: pytest.FixtureRequest) -> OldCane:
    row = grow(VineyardConfig(vines=1, training="guyot"), request.param)
    cut = judge_guyot(row)[0].removal
    return OldCane(row, cut, view_from_clear(row, cut))


@pytest.mark.parametrize("kind", ["cordon", "trunk", "spur", "cane", "node", "old cut"])
def test_last_years_cane_is_seen_where_it_stands_whatever_wood_the_network_takes_it_for(
    old: OldCane, kind: m.WoodClass
) -> None:
    labels = old.view.labels
    assert labels is not None
    classes = [m.WOOD_CLASSES.index(each) for each in ("cordon", kind)]
    taken = replace(old.view, labels=np.where(labels == classes[0], np.uint8(classes[1]), labels))
    seen = look(taken, old.point(aside=0.003))
    assert seen.finding == "seen" and seen.position is not None, seen
    off = np.array(seen.position) - old.cut.best
    assert float(np.linalg.norm(off - old.cut.tangent * (off @ old.cut.tangent))) < 0.0025


def test_last_years_cane_that_was_cut_off_is_seen_to_be_gone(old: OldCane) -> None:
    assert look(view_from_clear(without(old.row, old.cut), old.cut), old.point()).finding == "severed"
    # A spur cut there looks for a cane, and last year's is none.
    assert look(old.view, point(old.cut)).finding != "seen"


def test_from_too_far_or_out_of_the_picture_it_says_nothing_and_why(scene: Scene) -> None:
    cut = scene.cuts[0]
    far = look(view_from_clear(scene.row, cut, clearance=0.6), point(cut))
    assert far.finding == "unseen" and far.reason.code == "camera_not_at_standoff" and far.position is None
    beside = look(scene.views[0], point(cut, aside=0.6))
    assert beside.finding == "unseen" and beside.reason == reasons.place_outside_picture()
