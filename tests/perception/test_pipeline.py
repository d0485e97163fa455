import io
import zlib

import msgspec
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from PIL import Image, ImageFilter

from bridge.sim.camera.config import CameraConfig
from bridge.sim.camera.frame import camera_frame, camera_pose, survey_frame, survey_place
from bridge.sim.camera.renderer import Camera
from bridge.sim.vineyard.config import VineyardConfig
from bridge.sim.vineyard.grow import grow
from perception.config import CloseUpConfig, PerceptionConfig
from perception.loop import PerceptionProcess
from perception.pipeline import Perception, with_width_bias
from perception.segmentation.frame import CORDON, POST, CorruptFrameError, decode_frame
from perception.segmentation.segmenter import LabelImageSegmenter, choose_segmenter
from perception.skeleton.topology import perceive_plant
from perception.tracking.camera_rays import CameraRays
from perception.tracking.close_up import check_close_up
from rolling_panda import messages as m
from rolling_panda import reasons
from rolling_panda.commands import AddPoint, AddPointInImage, EvaluateRule, LeaveSite, MovePoint, SetRule, UndoRule
from rolling_panda.messages.perception import SpurPicture, point_digest
from rolling_panda.messages.types import WOOD_CLASSES
from rolling_panda.model.robot import RobotModel
from rolling_panda.transport.codec import StrictDecoder, encode
from rolling_panda.transport.inbox import Inbox
from tests.support import onnx_by_hand


@pytest.fixture(scope="module")
def model():
    return RobotModel()


@pytest.fixture(scope="module")
def frames(model):
    row = grow(VineyardConfig(), 1)
    camera = Camera(CameraConfig(), 1)
    return [survey_frame(camera, row, model, k) for k in range(4)]


def perception(model):
    return Perception(PerceptionConfig(), LabelImageSegmenter(), model)


def test_points_show_after_they_were_seen_often_enough_and_keep_their_names(model, frames):
    seen = perception(model)
    results = [seen.process(frame) for frame in frames]
    assert not results[0].points and not results[1].points
    assert results[2].points
    after = {point.point_id: point for point in results[3].points}
    for point in results[2].points:
        assert after[point.point_id].revision == point.revision
        assert after[point.point_id].position == point.position
    assert results[3].frames == 4 and results[3].segmenter == "simulator labels" and results[3].canes


@pytest.mark.long
def test_close_ups_after_the_odometry_has_drifted_leave_points_where_the_map_has_their_canes(
    model, frames, monkeypatch
):
    """As often as one looks: each picture shows a cane by the drift aside, not by one more than the last one."""
    seen = Perception(PerceptionConfig(close_up=CloseUpConfig(max_distance=1.2)), LabelImageSegmenter(), model)
    for frame in frames:
        seen.process(frame)
    base = frames[0].base
    drifted = msgspec.structs.replace(frames[0], base=msgspec.structs.replace(base, x=base.x + 0.012))
    before, aside = {each.point_id: each for each in seen.points().points}, []
    expected = []

    def check(*arguments):
        expected.append(arguments[-1])
        return check_close_up(*arguments)

    monkeypatch.setattr("perception.pipeline.check_close_up", check)
    for point_id, point in before.items():
        for number in (1, 2, 3):
            look = seen.check_close_up(msgspec.structs.replace(drifted, point_id=point_id, number=number))
            if look.position is None:
                continue
            aside.append(look.position[0] - point.position[0])
            after = next(each for each in seen.points().points if each.point_id == point_id)
            assert np.linalg.norm(np.subtract(after.position, point.position)) < 0.006
    assert len(aside) >= 6
    assert np.median(aside) == pytest.approx(0.012, abs=0.002) and np.ptp(aside) < 0.012
    assert np.median([each[0] for each in expected if each.any()]) == pytest.approx(0.012, abs=0.003)


@pytest.mark.long
def test_pictures_from_near_find_the_place_after_the_wheels_have_slipped(model, frames):
    seen = Perception(PerceptionConfig(localise=True), LabelImageSegmenter(), model)
    for frame in frames:
        seen.process(frame)
    row, camera = grow(VineyardConfig(), 1), Camera(CameraConfig(), 1)
    position = survey_place()[1]
    true, told = m.PlanarPose(0.0, 0.35, 0.0), m.PlanarPose(0.02, 0.35, 0.0)
    for k in (4, 5, 6):
        image = camera.render(row, camera_pose(model, true, position), k)
        seen.process(camera_frame(image, camera, told, position, k))
    wood = np.array([0.3, 0.75, 1.0])
    assert seen.row_frame.T_map_odom.act(wood + [0.02, 0.0, 0.0])[0] == pytest.approx(wood[0], abs=0.004)


@pytest.mark.long
def test_close_ups_of_wood_that_the_wind_has_moved_do_not_lose_the_place_in_the_row(model, frames):
    config = PerceptionConfig(localise=True, close_up=CloseUpConfig(max_distance=1.2))
    seen, camera, other = (
        Perception(config, LabelImageSegmenter(), model),
        Camera(CameraConfig(), 1),
        grow(VineyardConfig(), 2),
    )
    for frame in frames:
        seen.process(frame)
    point_id, asked = seen.points().points[0].point_id, 0
    for k in range(4, 14):
        frame = survey_frame(camera, other, model, k)
        x, y, phi = frame.base.x + 0.1 * (k - 3), frame.base.y, frame.base.phi
        frame = msgspec.structs.replace(frame, base=msgspec.structs.replace(frame.base, x=x))
        seen.row_frame.predict(np.array([x, y, phi]), frame.header.stamp)
        asked += seen.row_frame.uncertain
        seen.check_close_up(msgspec.structs.replace(frame, point_id=point_id, number=k))
    assert asked >= 6 and seen.row_frame.lost is None
    for k in range(14, 20):
        seen.process(survey_frame(camera, other, model, k))
    assert seen.row_frame.lost is not None, "pictures of the row do"


@pytest.mark.long
def test_the_same_frames_give_the_same_points_and_they_fit_the_wire(model, frames):
    first, second = ([p.process(frame) for frame in frames][-1] for p in (perception(model), perception(model)))
    assert encode(first) == encode(second)
    assert StrictDecoder(m.PruningPoints).decode(encode(first)) == first


@pytest.mark.long
def test_a_corrupt_frame_changes_nothing(model, frames):
    seen, undisturbed = perception(model), perception(model)
    for frame in frames[:3]:
        seen.process(frame)
        undisturbed.process(frame)
    with pytest.raises(CorruptFrameError):
        seen.process(msgspec.structs.replace(frames[3], depth_zlib=frames[3].depth_zlib[:-9]))
    assert seen.process(frames[3]) == undisturbed.process(frames[3])


def test_without_labels_a_site_stays_undecided_with_the_reason(model, frames):
    result = perception(model).process(msgspec.structs.replace(frames[0], labels_zlib=b""))
    assert not result.points
    assert result.undecided_sites[0].reason.code == "frame_without_labels"


def test_an_unfamiliar_picture_gives_no_point_and_says_so(model, frames):
    segmenter = LabelImageSegmenter()
    seen = Perception(PerceptionConfig(), segmenter, model)
    segmenter.unfamiliar = reasons.picture_unfamiliar(2.4, 1.2)
    for frame in frames:
        result = seen.process(frame)
    assert not result.points and [site.reason for site in result.undecided_sites] == [segmenter.unfamiliar]
    segmenter.unfamiliar = None
    for frame in frames:
        result = seen.process(frame)
    assert result.points and all(site.reason.code != "picture_unfamiliar" for site in result.undecided_sites)


def cuts(result):
    """What is cut and where, by name."""
    return {point.point_id: (point.revision, point.position, point.digest) for point in result.points}


def unlit(frame):
    """The frame with all its wood taken for background, as by night; its depth stays."""
    blank = bytes(frame.intrinsics.width * frame.intrinsics.height)
    return msgspec.structs.replace(frame, labels_zlib=zlib.compress(blank))


def test_unfamiliar_pictures_remove_neither_points_nor_obstacles(model, frames):
    segmenter = LabelImageSegmenter()
    seen = Perception(PerceptionConfig(), segmenter, model)
    before = [seen.process(frame) for frame in frames][-1]
    obstacles = seen.obstacles
    segmenter.unfamiliar = reasons.picture_unfamiliar(2.4, 1.2)
    for _ in range(8):
        for frame in frames:
            result = seen.process(unlit(frame))
            assert not seen.withdrawn
    assert result.points == before.points and seen.obstacles == obstacles
    assert [site.reason.code for site in result.undecided_sites] == ["picture_unfamiliar"]
    segmenter.unfamiliar = None
    kinds = {capsule.kind for capsule in obstacles}
    seen.process(frames[-1])
    assert {capsule.kind for capsule in seen.obstacles} == kinds >= {"cordon", "wire"}


def test_a_post_in_an_unfamiliar_picture_is_an_obstacle_all_the_same(model, frames):
    segmenter = LabelImageSegmenter()
    seen = Perception(PerceptionConfig(), segmenter, model)
    segmenter.unfamiliar = reasons.picture_unfamiliar(2.4, 1.2)
    for frame in frames:
        seen.process(frame)
    assert {capsule.kind for capsule in seen.obstacles} >= {"cordon", "wire"}


@pytest.mark.long
def test_a_single_unfamiliar_picture_leaves_the_open_places_on_the_page(model, frames):
    segmenter = LabelImageSegmenter()
    seen = Perception(PerceptionConfig(), segmenter, model)
    before = [seen.process(frame) for frame in frames][-1]
    segmenter.unfamiliar = reasons.picture_unfamiliar(2.4, 1.2)
    once = seen.process(frames[-1])
    assert once.undecided_sites == before.undecided_sites and cuts(once) == cuts(before) and once.canes
    twice = seen.process(frames[-1])
    assert [site.reason for site in twice.undecided_sites] == [segmenter.unfamiliar]
    segmenter.unfamiliar = None
    seen.process(frames[-1])
    segmenter.unfamiliar = reasons.picture_unfamiliar(2.4, 1.2)
    assert all(site.reason != segmenter.unfamiliar for site in seen.process(frames[-1]).undecided_sites)


@pytest.mark.long
def test_what_the_simulated_camera_sees_is_familiar_to_the_shipped_network_and_a_blurred_lens_is_not(model, frames):
    seen = Perception(PerceptionConfig(), choose_segmenter("network"), model)
    assert not seen.familiarity_unknown
    for frame in frames:
        result = seen.process(frame)
    assert result.points and all(site.reason.code != "picture_unfamiliar" for site in result.undecided_sites)
    for frame in frames[:2]:
        with Image.open(io.BytesIO(frame.color_jpeg)) as image:
            blurred = io.BytesIO()
            image.filter(ImageFilter.GaussianBlur(8.0)).save(blurred, "JPEG")
        later = seen.process(msgspec.structs.replace(frame, color_jpeg=blurred.getvalue()))
    assert cuts(later) == cuts(result)
    assert [site.reason.code for site in later.undecided_sites] == ["picture_unfamiliar"]


def test_a_network_that_does_not_tell_unfamiliar_pictures_is_said_to(model, tmp_path):
    path = tmp_path / "net.onnx"
    path.write_bytes(onnx_by_hand.brightest_channel(list(WOOD_CLASSES)))
    unknowing = Perception(PerceptionConfig(), choose_segmenter("network", path), model)
    assert unknowing.familiarity_unknown and not perception(model).familiarity_unknown
    sent = PerceptionProcess(PerceptionConfig(), unknowing).step(Inbox(), 0.0)
    told = [message.reason.code for message in sent if isinstance(message, m.LogEvent)]
    assert told == ["perception_started", "familiarity_unknown"]


def test_what_cannot_be_a_post_is_told_with_its_count(model, frames):
    seen = perception(model)
    for frame in frames:
        labels = np.frombuffer(zlib.decompress(frame.labels_zlib), np.uint8).copy()
        labels[labels == CORDON] = POST
        seen.process(msgspec.structs.replace(frame, labels_zlib=zlib.compress(labels.tobytes())))
    (lying,) = (reason for reason in seen.rejected_wood if reason.code == "wood_lying")
    assert dict(lying.values)["kind"] == "post" and dict(lying.values)["count"] >= 1.0


def test_a_place_that_an_operator_leaves_needs_nothing_until_that_is_taken_back(model, frames):
    seen, _ = shown(model, frames)
    places = [site for site in seen.points().undecided_sites if site.vine > 0]
    assert places, "the pictures show something that is undecided"
    vine, spur = places[0].vine, places[0].spur

    def needs():
        return {site.needs for site in seen.points().undecided_sites if (site.vine, site.spur) == (vine, spur)}

    before = needs()
    answer = seen.answer(LeaveSite(user="Ada", vine=vine, spur=spur))
    assert (answer.ok, answer.reason) == (True, reasons.site_left(vine, spur)) and needs() == {"nothing"}
    answer = seen.answer(LeaveSite(user="Ada", vine=vine, spur=spur, left=False))
    assert (answer.ok, answer.reason) == (True, reasons.site_reopened(vine, spur)) and needs() == before
    answer = seen.answer(LeaveSite(user="Ada", vine=99, spur=1))
    assert (answer.ok, answer.reason) == (False, reasons.site_unknown(99, 1))


def test_a_spur_that_was_told_of_stays_a_point_or_an_open_place(model, frames):
    seen, told, unconfirmed = perception(model), set(), []
    for frame in frames:
        result = seen.process(frame)
        points = {(point.vine, point.spur) for point in result.points}
        sites = {(site.vine, site.spur) for site in result.undecided_sites if site.vine}
        told |= points | sites
        assert told == points | sites
        unconfirmed.append([site for site in result.undecided_sites if site.reason.code == "cut_unconfirmed"])
    assert unconfirmed[0] and all(site.needs == "another look" for site in unconfirmed[0])
    assert len(unconfirmed[-1]) < len(unconfirmed[0])


def test_an_empty_view_gives_no_points(model, frames):
    k = frames[0].intrinsics
    blank = zlib.compress(bytes(k.width * k.height))
    result = perception(model).process(msgspec.structs.replace(frames[0], labels_zlib=blank))
    assert result.points == () and result.canes == ()


def shown(model, frames):
    seen = perception(model)
    for frame in frames:
        result = seen.process(frame)
    assert result.points
    return seen, result.points


def test_another_rule_changes_the_points_at_once_and_back_again(model, frames):
    seen, before = shown(model, frames)
    answer = seen.answer(SetRule(user="Ada", rule=m.PruningRule(nodes_kept=1)))
    assert answer.ok and answer.reason.code == "points_by_new_rule"
    fewer = seen.points().points
    assert fewer and all(point.nodes_kept == 1 for point in fewer)
    # One node lower on the same canes.
    low = {(point.vine, point.spur): point.position[2] for point in fewer}
    for point in before:
        if (point.vine, point.spur) in low and point.kind == "spur cut":
            assert point.position[2] - low[point.vine, point.spur] > 0.04
    assert seen.answer(SetRule(user="Ada")).ok
    after = np.array([point.position for point in seen.points().points])
    for point in before:
        assert np.linalg.norm(after - point.position, axis=1).min() < 0.006


@pytest.mark.long
def test_frames_after_another_rule_follow_it(model, frames):
    seen, _ = shown(model, frames)
    seen.answer(SetRule(user="Ada", rule=m.PruningRule(nodes_kept=1)))
    for frame in frames:
        result = seen.process(frame)
    assert result.points and all(point.nodes_kept == 1 for point in result.points)


def test_a_click_into_the_picture_adds_a_point_that_stays(model, frames):
    seen, before = shown(model, frames)
    view = decode_frame(frames[-1], model)
    k = view.intrinsics
    u, v, _ = view.pixels(np.array(before[0].position) + 0.02 * np.array(before[0].tangent))[0]
    click = AddPointInImage(
        user="Ada", sequence=frames[-1].sequence, u=float((u + 0.5) / k.width), v=float((v + 0.5) / k.height)
    )
    answer = seen.answer(click)
    assert answer.ok, answer.reason
    added = {point.point_id: point for point in seen.process(frames[0]).points}[dict(answer.reason.values)["point"]]
    beyond = np.array(before[0].position) + 0.02 * np.array(before[0].tangent)
    assert np.linalg.norm(np.array(added.position) - beyond) < 0.006
    again = seen.answer(click)
    assert not again.ok and again.reason == reasons.point_there_already(added.point_id, 10.0)
    assert added.reason.code == "placed_past_node" and added.radius == pytest.approx(before[0].radius, abs=0.001)
    assert seen.answer(SetRule(user="Ada", rule=m.PruningRule(nodes_kept=1))).ok
    kept = {point.point_id for point in seen.points().points}
    assert added.point_id in kept, "another rule does not take it away"


def test_clicks_that_mean_no_cane_are_refused(model, frames):
    seen, before = shown(model, frames)
    sky = seen.answer(AddPointInImage(user="Ada", sequence=frames[-1].sequence, u=0.5, v=0.99))
    old = seen.answer(AddPointInImage(user="Ada", sequence=999, u=0.5, v=0.5))
    away = seen.answer(AddPoint(user="Ada", origin=(0.0, 0.0, 1.0), direction=(0.0, -1.0, 0.0)))
    assert not (sky.ok or old.ok or away.ok)
    assert sky.reason.code == "click_beside_cane" and old.reason == reasons.picture_too_old()
    assert seen.points().points == before


def test_canes_drawn_too_wide_are_measured_as_thick_as_they_are(model, frames):
    view = decode_frame(frames[0], model)
    cane, node = (m.WOOD_CLASSES.index(kind) for kind in ("cane", "node"))
    wide = view.labels.copy()
    wide[:, 1:][(view.labels[:, :-1] == cane) & (view.labels[:, 1:] <= 1)] = cane

    def radius(labels, widening):
        plant = perceive_plant(view, labels, with_width_bias(PerceptionConfig(), widening).skeleton)
        return np.median([cane.radius for spur in plant.spurs for cane in spur.canes if cane.length > 0.3])

    true = radius(view.labels, 0.0)
    assert radius(wide, 0.0) - true > 0.0004
    assert abs(radius(wide, 1.0) - true) < 0.0003


def test_a_point_says_how_sure_it_is_and_what_is_near(model, frames):
    seen, points = shown(model, frames)
    for point in points:
        rows = np.zeros((3, 3))
        rows[np.triu_indices(3)] = point.position_covariance
        covariance = rows + np.triu(rows, 1).T
        assert 0.001 < np.sqrt(np.linalg.eigvalsh(covariance)).min() <= np.sqrt(np.trace(covariance)) < 0.01
        assert 100.0 < point.force < 2000.0
        assert point.node_distance > 0.005
        assert point.digest == point_digest(point)
        assert point.cordon_distance is None or point.cordon_distance > -0.02
        if point.kind == "spur cut":
            assert (
                0.01 < point.offset <= 0.021
                and dict(dict(point.reason.values)["place"].values)["distance_mm"] == 1000 * point.offset
            )
    assert any(point.cordon_distance is not None for point in points)
    assert seen.points().rule == m.PruningRule()


@pytest.mark.long
def test_every_point_has_a_picture_that_is_drawn_anew_with_its_revision(model, frames):
    seen, points = shown(model, frames)
    for frame in frames:
        seen.process(frame)
    cuts = {cut.point_id: cut for picture in seen.pictures for cut in picture.drawing.cuts}
    assert cuts.keys() == {point.point_id for point in seen.points().points} >= {point.point_id for point in points}
    assert {picture.drawing.sequence for picture in seen.pictures} <= {frame.sequence for frame in frames}
    spurs = {(picture.drawing.vine, picture.drawing.spur) for picture in seen.pictures}
    assert spurs >= {(site.vine, site.spur) for site in seen.points().undecided_sites if site.vine}
    seen.answer(SetRule(user="Ada", rule=m.PruningRule(offset=0.03)))
    now = {point.point_id: point for point in seen.points().points}
    again = {cut.point_id: cut for picture in seen.pictures for cut in picture.drawing.cuts}
    moved = [name for name in cuts if name in now and now[name].revision > cuts[name].revision]
    assert moved and all(again[name].revision == now[name].revision for name in moved)
    assert all(again[name].position != cuts[name].position for name in moved)
    for picture in seen.pictures:
        assert StrictDecoder(SpurPicture).decode(encode(picture)) == picture


def test_a_tap_on_a_picture_places_a_point_on_the_cane_under_it(model, frames):
    seen, _ = shown(model, frames)
    picture = next(each for each in seen.pictures if each.drawing.canes and not each.drawing.cuts)
    drawing = picture.drawing
    # Long after: the frames of the last minutes are other ones.
    seen.camera_rays = CameraRays()
    left, top, width, height = drawing.window
    for cane in drawing.canes:
        for x, y in cane:
            scale = drawing.size[0] / width
            if not (0 < x < drawing.size[0] and 0 < y < drawing.size[1]):
                continue
            u, v = (left + x / scale) / drawing.frame[0], (top + y / scale) / drawing.frame[1]
            answer = seen.answer(AddPointInImage(user="Ada", sequence=drawing.sequence, u=u, v=v))
            if answer.ok:
                break
        else:
            continue
        break
    assert answer.ok and answer.reason.code == "point_placed"
    by_hand = [point for point in seen.points().points if point.kind == "by hand"]
    assert [(point.vine, point.spur) for point in by_hand] == [(drawing.vine, drawing.spur)]


def test_another_rule_keeps_the_names_of_the_spurs_cuts(model, frames):
    seen, before = shown(model, frames)
    seen.answer(SetRule(user="Ada", rule=m.PruningRule(offset=0.03)))
    now = {(point.vine, point.spur, point.kind): point for point in seen.points().points}
    assert seen.points().rule.offset == 0.03
    kept = [(old, now[key]) for old in before if (key := (old.vine, old.spur, old.kind)) in now]
    assert kept
    for old, new in kept:
        moved = np.linalg.norm(np.subtract(old.position, new.position))
        assert new.point_id == old.point_id
        assert (new.revision > old.revision) is bool(moved > PerceptionConfig().tracker.position_tolerance)


@pytest.mark.long
def test_a_point_that_a_person_moves_stays_there_and_its_spur_gets_no_other(model, frames):
    seen, before = shown(model, frames)
    point = next(each for each in before if each.kind == "spur cut")
    refused = seen.answer(MovePoint(user="Ada", point_id="p999", along=0.005))
    assert not refused.ok and refused.reason == reasons.point_unseen("p999")
    answer = seen.answer(MovePoint(user="Ada", point_id=point.point_id, along=0.005))
    assert answer.ok, answer.reason
    moved = {each.point_id: each for each in seen.points().points}[point.point_id]
    assert moved.revision == point.revision + 1 and moved.digest == point_digest(moved) != point.digest
    step = np.subtract(moved.position, point.position)
    assert step @ np.array(point.tangent) == pytest.approx(0.005, abs=0.002)
    for frame in frames:
        points = seen.process(frame).points
    there = [each for each in points if (each.vine, each.spur) == (point.vine, point.spur)]
    assert [each.position for each in there if each.point_id == point.point_id] == [moved.position]
    assert not [each for each in there if each.kind == "spur cut"]
    seen.answer(SetRule(user="Ada", rule=m.PruningRule(offset=0.03)))
    there = [each for each in seen.points().points if (each.vine, each.spur) == (point.vine, point.spur)]
    assert [each.kind for each in there if each.kind in ("spur cut", "by hand")] == ["by hand"]


@pytest.fixture(scope="module")
def surveyed(model, frames):
    return shown(model, frames)[0]


def held(seen):
    """Everything that perception tells."""
    return encode(seen.points()), seen.obstacles


RULES = st.builds(
    m.PruningRule,
    system=st.sampled_from(["spur", "guyot"]),
    nodes_kept=st.integers(1, 5),
    fruiting_nodes=st.integers(3, 20),
    preferred_diameter=st.sampled_from([0.003, 0.006, 0.009, 0.015]),
    offset=st.sampled_from([0.005, 0.012, 0.02, 0.024, 0.05]),
)


@pytest.mark.long
@settings(max_examples=25)
@given(st.lists(RULES, min_size=1, max_size=3))
def test_what_a_rule_would_change_is_what_it_changes_and_taken_back_all_is_as_it_was(surveyed, rules):
    begun, stages = held(surveyed), []
    for rule in rules:
        before = {point.point_id: point.digest for point in surveyed.points().points}
        told = surveyed.answer(EvaluateRule(user="Ada", rule=rule)).effect
        assert held(surveyed) == (stages[-1][1] if stages else begun), "to ask changes nothing"
        former = surveyed.points().rule
        assert surveyed.answer(SetRule(user="Ada", rule=rule)).ok
        after = {point.point_id: point.digest for point in surveyed.points().points}
        assert set(told.removed) == before.keys() - after.keys()
        assert set(told.changed) == {name for name in before.keys() & after.keys() if before[name] != after[name]}
        assert told.added == len(after.keys() - before.keys())
        if rule != former:
            stages.append((rule, held(surveyed)))
    while stages:
        rule, there = stages.pop()
        assert held(surveyed) == there
        assert surveyed.answer(UndoRule(user="Ada", rule=rule)).ok
    assert held(surveyed) == begun


@pytest.mark.long
def test_a_revision_never_has_two_contents_though_a_rule_is_taken_back(model, frames):
    seen, _ = shown(model, frames)
    contents = {}
    for kept in (1, 3, 1, 2, 4):
        rule = m.PruningRule(nodes_kept=kept)
        seen.answer(SetRule(user="Ada", rule=rule))
        for point in seen.points().points:
            assert contents.setdefault((point.point_id, point.revision), point.digest) == point.digest
        if kept != 2:
            assert seen.answer(UndoRule(user="Ada", rule=rule)).ok


@pytest.mark.long
def test_a_rule_that_was_changed_since_or_never_cannot_be_taken_back(model, frames):
    seen, _ = shown(model, frames)
    assert seen.answer(UndoRule(user="Ada", rule=m.PruningRule())).reason == reasons.no_rule_before()
    seen.answer(SetRule(user="Ada", rule=m.PruningRule(nodes_kept=1)))
    before = held(seen)
    undone = seen.answer(UndoRule(user="Ada", rule=m.PruningRule(nodes_kept=3)))
    assert undone.reason == reasons.rule_changed_since()
    assert held(seen) == before


@pytest.mark.long
def test_frames_come_on_after_a_rule_was_taken_back_and_what_a_person_placed_stays(model, frames):
    seen, before = shown(model, frames)
    rule = m.PruningRule(nodes_kept=1)
    seen.answer(SetRule(user="Ada", rule=rule))
    moved = next(point for point in seen.points().points if point.kind == "spur cut")
    assert seen.answer(MovePoint(user="Ada", point_id=moved.point_id, along=0.005)).ok
    seen.process(frames[0])
    assert seen.answer(UndoRule(user="Ada", rule=rule)).ok
    back = {point.point_id: point for point in seen.points().points}
    assert back[moved.point_id].kind == "by hand"
    others = [point for point in before if point.point_id != moved.point_id and point.spur != moved.spur]
    assert others and all(back[point.point_id].digest == point.digest for point in others)
    for frame in frames:
        later = {point.point_id: point for point in seen.process(frame).points}
    assert all(name in later for name in back)


@pytest.mark.long
def test_what_was_cut_meanwhile_does_not_come_back_with_the_rule(model, frames):
    seen, before = shown(model, frames)
    rule = m.PruningRule(nodes_kept=1)
    seen.answer(SetRule(user="Ada", rule=rule))
    cut = next(point for point in seen.points().points if point.kind == "spur cut")
    row, camera = grow(VineyardConfig(), 1), Camera(CameraConfig(), 1)

    def where(rod):
        """How far the rod is from the cut (m), and the share of its length at which it is nearest."""
        axis = rod.end - rod.start
        share = float(np.clip((cut.position - rod.start) @ axis / (axis @ axis), 0.0, 1.0))
        return float(np.linalg.norm(cut.position - rod.start - share * axis)), share

    number, rod = min(row.standing(), key=lambda each: where(each[1])[0])
    after = row.sever(number, where(rod)[1])
    for k in range(4, 7):
        seen.process(survey_frame(camera, after, model, k))
    assert len(seen.withdrawn) == 1 and seen.withdrawn[0].code == "withdrawn_as_cut"
    seen.answer(UndoRule(user="Ada", rule=rule))
    assert seen.withdrawn == (), "what a frame took away is told once"
    back = {point.point_id for point in seen.points().points}
    # One node higher on the same cane there is no wood any more; all other cuts are asked for as before.
    assert {point.point_id for point in before} - back == {cut.point_id}
