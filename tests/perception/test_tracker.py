from dataclasses import replace
from typing import NamedTuple

import numpy as np
import pytest

from perception.config import TrackerConfig
from perception.plant.numbering import SpurNumber
from perception.rules.pruning import Cut
from perception.segmentation.frame import View
from perception.skeleton.fragments import CANE
from perception.tracking.tracker import Proposal, Tracker, direction_covariance, position_covariance
from rolling_panda import reasons
from rolling_panda.messages.robot import Intrinsics

CONFIG = TrackerConfig()
UP = np.array([0.0, -1.0, 0.0])


def view(cane=True, depth=0.8):
    """A camera at the origin of odom that looks along z at one upright cane in the middle of the image."""
    labels = np.zeros((120, 160), dtype=np.uint8)
    image = np.full((120, 160), 3.0, dtype=np.float32)
    if cane:
        labels[:, 78:83] = CANE
        image[:, 78:83] = depth
    intrinsics = Intrinsics(160, 120, 200.0, 200.0, 79.5, 59.5)
    return View(0, 0.0, intrinsics, image, labels, b"", np.eye(3), np.zeros(3))


def proposal(x=0.0, y=0.0, z=0.8, spur=1, tangent=UP, cane=-1):
    cut = Cut("spur cut", np.array([x, y, z]), tangent, 0.004, 0.9, 4, 2, "Because.", cane=cane)
    return Proposal(cut, SpurNumber(1, spur))


class Fed(NamedTuple):
    points: tuple
    withdrawn: tuple
    severed: tuple


def look_from(place, *cuts):
    """What a look shows of spur 1 from a place behind the first one (m)."""
    image = replace(view(depth=0.8 + place), t=np.array([0.0, 0.0, -place]))
    return image, list(cuts)


def survey(tracker, *looks):
    """What is shown after each look, and what each has withdrawn."""
    shown, withdrawn = [], []
    for image, cuts in looks:
        withdrawn += tracker.update(image, image.labels, cuts, [SpurNumber(1, 1)]).withdrawn
        shown.append(tracker.points())
    return shown, withdrawn


def feed(tracker, image, *proposals):
    update = tracker.update(image, image.labels, list(proposals))
    return Fed(tracker.points(), update.withdrawn, update.severed)


def test_a_point_shows_after_enough_frames_agree():
    tracker = Tracker(CONFIG)
    shown = [len(feed(tracker, view(), proposal()).points) for _ in range(CONFIG.min_hits)]
    assert shown == [0] * (CONFIG.min_hits - 1) + [1]


def test_a_cut_of_another_cane_beside_it_is_another_point_however_near():
    tracker = Tracker(CONFIG)
    for _ in range(CONFIG.min_hits):
        (first,) = feed(tracker, view(), proposal(cane=0)).points or (None,)
    for look in range(2 * CONFIG.min_hits + 1):
        points = feed(tracker, view(), proposal(x=0.012, cane=1)).points
        assert look or points == (first,)
    (other,) = points
    assert (first.cane, other.cane) == (0, 1) and other.point_id != first.point_id


def test_where_most_looks_cut_an_internode_is_taken_whole_not_half_way_to_where_others_did():
    def look(offset, noise=0.0):
        one = proposal(y=0.1 - offset + noise)
        return replace(one, cut=replace(one.cut, offset=offset, reason=reasons.said(f"{1000 * offset:.0f}")))

    tracker, noise = Tracker(CONFIG), (0.001, -0.001, 0.001, -0.001, 0.0)
    for each in noise[:3]:
        (point,) = feed(tracker, view(), look(0.02, each)).points or (None,)
    assert point.offset == 0.02 and point.position[1] == pytest.approx(0.08, abs=1e-3)
    # A wire comes into view, and the blades give way to it.
    for each in noise:
        (point,) = feed(tracker, view(), look(0.0105, each)).points
    assert point.offset == 0.0105 and point.reason == reasons.said("10") and point.revision == 2
    assert point.position[1] == pytest.approx(0.0895, abs=1e-3)
    # One look that does not see it changes nothing.
    (point,) = feed(tracker, view(), look(0.02)).points
    assert point.offset == 0.0105 and point.revision == 2
    assert point.position[1] == pytest.approx(0.0895, abs=1e-3)


def test_a_point_is_where_most_looks_see_the_cane_not_half_way_to_where_a_few_saw_another():
    tracker = Tracker(CONFIG)
    for z in (0.8, 0.801, 0.828, 0.799, 0.826, 0.8):
        (point,) = feed(tracker, view(), proposal(z=z)).points or (None,)
    assert point.position == pytest.approx((0.0, 0.0, 0.8), abs=1e-3)
    # It follows when most of the newest looks agree on another place.
    for _ in range(CONFIG.averaging_window):
        (point,) = feed(tracker, view(depth=0.826), proposal(z=0.826)).points
    assert point.position == pytest.approx((0.0, 0.0, 0.826), abs=1e-3)


def test_a_close_up_counts_as_much_as_all_looks_before_it():
    tracker = Tracker(CONFIG)
    for _ in range(5):
        (point,) = feed(tracker, view(), proposal()).points or (None,)
    tracker.refine(point.point_id, np.array([0.005, 0.0, 0.8]))
    for _ in range(5):
        (point,) = feed(tracker, view(), proposal()).points
    assert point.position == pytest.approx((0.005, 0.0, 0.8), abs=2e-3)


def test_a_point_is_where_it_says_it_is_also_after_a_small_step_along_its_internode():
    def look(offset):
        one = proposal(y=0.1 - offset)
        return replace(one, cut=replace(one.cut, offset=offset))

    tracker = Tracker(CONFIG)
    for _ in range(3):
        feed(tracker, view(), look(0.02))
    for _ in range(6):
        # Less than what a point may move by before it is called another one.
        (point,) = feed(tracker, view(), look(0.0165)).points
    assert point.offset == 0.0165 and point.revision == 2
    assert point.position[1] == pytest.approx(0.1 - 0.0165, abs=1e-4)


def test_after_many_looks_two_that_agree_are_enough_where_none_disagrees():
    def seen(*others):
        said = (proposal(), None, *others, None, None, proposal(), None)
        shown, _ = survey(Tracker(CONFIG), *[look_from(0.0, *([] if cut is None else [cut])) for cut in said])
        return len(shown), shown[-1]

    looks, points = seen(None, None)
    assert looks >= CONFIG.sparse_observations and len(points) == CONFIG.sparse_hits - 1 == 1
    assert seen()[1] and seen()[0] >= CONFIG.sparse_observations
    assert not seen(proposal(y=0.06), None)[1], "another look put the cut elsewhere"
    tracker = Tracker(CONFIG)
    for _ in range(2):
        early = feed(tracker, view(), proposal()).points
    assert not early, "two looks are not many"


def test_looks_from_one_place_are_one_viewpoint_where_others_do_not_show_the_cut():
    elsewhere = [look_from(0.1 * k) for k in range(1, 6)]
    alone, _ = survey(Tracker(CONFIG), *elsewhere, *[look_from(0.0, proposal())] * 20)
    assert not any(alone)
    # A step of a centimetre is no other viewpoint.
    beside, _ = survey(Tracker(CONFIG), *elsewhere, *[look_from(0.01 * k, proposal()) for k in range(4)])
    assert not any(beside)
    three, _ = survey(Tracker(CONFIG), *elsewhere, *[look_from(0.1 * k, proposal()) for k in range(3)])
    assert [len(points) for points in three[-3:]] == [0, 0, 1]
    # While the robot stands there is one viewpoint, and it is enough.
    standing, _ = survey(Tracker(CONFIG), *[look_from(0.0, proposal())] * CONFIG.min_hits)
    assert len(standing[-1]) == 1


def test_a_point_that_other_viewpoints_do_not_show_is_withdrawn_until_they_do():
    tracker = Tracker(CONFIG)
    _, withdrawn = survey(tracker, *[look_from(0.0, proposal())] * 3, look_from(0.1))
    (before,) = tracker.points()
    assert not withdrawn, "one of two viewpoints shows it"
    _, withdrawn = survey(tracker, look_from(0.2))
    assert withdrawn == [reasons.withdrawn_as_unconfirmed(before.point_id, 1, 1)] and not tracker.points()
    assert tracker.find(before.point_id) == before
    survey(tracker, look_from(0.3, proposal()))
    (after,) = tracker.points()
    assert (after.point_id, after.revision) == (before.point_id, before.revision + 1)
    assert after.digest != before.digest, "an acceptance of the first one does not hold"


def test_viewpoints_withdraw_neither_a_point_by_hand_nor_what_a_new_rule_makes_of_all_frames():
    tracker, by_hand = Tracker(CONFIG), proposal(y=0.1)
    tracker.add(replace(by_hand, cut=replace(by_hand.cut, kind="by hand")))
    around = [look_from(0.1 * k) for k in range(9)]
    survey(tracker, *around[:5])
    for cut in (proposal(), proposal(y=0.01)):
        tracker.reset([cut])
        shown, withdrawn = survey(tracker, *around)
        assert {point.kind for point in shown[-1]} == {"by hand", "spur cut"} and not withdrawn


def test_a_point_that_more_frames_speak_against_than_for_is_withdrawn_until_they_do_not():
    tracker, site = Tracker(CONFIG), (SpurNumber(1, 1), "spur cut")

    def look(cuts, *against):
        image = view()
        return tracker.update(image, image.labels, cuts, [SpurNumber(1, 1)], against).withdrawn

    for _ in range(3):
        look([proposal()])
    (before,) = tracker.points()
    for _ in range(3):
        assert not look([], site), "as many are for it"
    look([], (SpurNumber(1, 1), "renewal cut"))
    look([], (SpurNumber(2, 1), "spur cut"))
    assert tracker.points() == (before,), "those speak against others"
    assert not tracker.unconfirmed()
    assert look([], site) == (reasons.withdrawn_as_contradicted(before.point_id, 1, 1),) and not tracker.points()
    assert tracker.unconfirmed() == {site}, "nobody may take the spur for one without a cut"
    assert not look([proposal()]) and not tracker.unconfirmed()
    (after,) = tracker.points()
    assert (after.point_id, after.revision) == (before.point_id, before.revision + 1)


def test_frames_speak_against_neither_a_point_by_hand_nor_one_of_a_later_rule():
    tracker, by_hand = Tracker(CONFIG), proposal(y=0.1)
    tracker.add(replace(by_hand, cut=replace(by_hand.cut, kind="by hand")))
    image = view()
    for _ in range(3):
        tracker.update(image, image.labels, [proposal()], [SpurNumber(1, 1)])
    against = [(SpurNumber(1, 1), "spur cut"), (SpurNumber(1, 1), "by hand")]
    for _ in range(2):
        tracker.reset([proposal()])
        for _ in range(3):
            tracker.update(image, image.labels, [], [SpurNumber(1, 1)], against)
        assert {point.kind for point in tracker.points()} == {"by hand", "spur cut"}


def test_viewpoints_of_a_rule_that_was_undone_do_not_count_against_a_point():
    tracker = Tracker(CONFIG)
    survey(tracker, *[look_from(0.0, proposal())] * CONFIG.min_hits)
    before = tracker.copy()
    tracker.reset([])
    around = [look_from(0.1 * k) for k in range(1, 6)]
    survey(tracker, *around)
    tracker.restore(before, lambda number, position: True)
    shown, withdrawn = survey(tracker, *around)
    assert len(shown[-1]) == 1 and not withdrawn


def test_with_another_calibration_earlier_viewpoints_do_not_count():
    tracker = Tracker(CONFIG)
    survey(tracker, *[look_from(0.1 * k) for k in range(1, 6)])
    tracker.withdraw_all()
    shown, _ = survey(tracker, *[look_from(0.0, proposal())] * CONFIG.min_hits)
    assert len(shown[-1]) == 1


def test_looks_that_say_nothing_do_not_make_it_forget_what_few_have_said():
    tracker = Tracker(CONFIG)
    for said in (True, *[False] * 6, True, *[False] * 6, True):
        points = feed(tracker, view(), *([proposal()] if said else [])).points
    assert len(points) == 1


def test_noise_is_averaged_and_changes_neither_name_nor_revision():
    tracker, rng = Tracker(CONFIG), np.random.default_rng(0)
    names = set()
    for _ in range(60):
        x, y = rng.normal(0.0, 0.002, 2)
        for point in feed(tracker, view(), proposal(x, y)).points:
            names.add((point.point_id, point.revision))
    assert len(names) == 1
    (point,) = tracker.points()
    assert np.linalg.norm(np.array(point.position) - [0.0, 0.0, 0.8]) < 0.004


def test_a_point_that_moves_gets_a_new_revision():
    tracker = Tracker(CONFIG)
    for _ in range(5):
        feed(tracker, view(), proposal())
    for _ in range(40):
        feed(tracker, view(), proposal(y=0.012))
    (point,) = tracker.points()
    assert point.revision > 1
    assert point.position[1] == pytest.approx(0.012, abs=CONFIG.position_tolerance)


def test_points_out_of_view_stay():
    tracker = Tracker(CONFIG)
    for _ in range(4):
        feed(tracker, view(), proposal(x=0.0))
    away = view()
    for _ in range(20):
        moved = View(0, 0.0, away.intrinsics, away.depth, away.labels, b"", away.R, np.array([5.0, 0.0, 0.0]))
        feed(tracker, moved)
    assert len(tracker.points()) == 1


def test_a_point_hidden_by_something_nearer_stays():
    tracker = Tracker(CONFIG)
    for _ in range(4):
        feed(tracker, view(), proposal())
    hidden = view(cane=False)
    hidden.depth[:] = 0.4
    for _ in range(20):
        feed(tracker, hidden)
    assert len(tracker.points()) == 1


def test_a_standing_cane_keeps_its_point_through_frames_without_proposal():
    tracker = Tracker(CONFIG)
    for _ in range(4):
        feed(tracker, view(), proposal())
    for _ in range(20):
        feed(tracker, view())
    assert len(tracker.points()) == 1


@pytest.mark.parametrize(
    ("swings", "stays"), [((0.0, 0.001, -0.001, 0.0), False), (0.015 * np.sin(np.arange(20.0)), True)]
)
def test_a_cane_that_sways_is_not_taken_to_be_cut_where_it_is_seen_no_farther_aside_than_before(swings, stays):
    tracker = Tracker(CONFIG)
    for swing in swings:
        feed(tracker, view(), proposal(x=swing))
    (point,) = tracker.points()
    assert abs(point.position[0]) < 0.002, "the middle of its way"
    aside = replace(view(), labels=np.roll(view().labels, 5, axis=1), depth=np.roll(view().depth, 5, axis=1))
    for _ in range(CONFIG.gone_frames):
        feed(tracker, aside)
    assert bool(tracker.points()) is stays
    if stays:
        for _ in range(CONFIG.gone_frames):
            feed(tracker, view(cane=False))
        assert not tracker.points()


def test_a_cut_cane_takes_its_point_away_and_says_so():
    tracker = Tracker(CONFIG)
    for _ in range(4):
        feed(tracker, view(), proposal())
    results = [feed(tracker, view(cane=False)) for _ in range(CONFIG.gone_frames)]
    assert [len(result.points) for result in results] == [1] * (CONFIG.gone_frames - 1) + [0]
    (withdrawn,) = results[-1].withdrawn
    assert withdrawn.code == "withdrawn_as_cut" and dict(withdrawn.values)["frames"] == CONFIG.gone_frames


def test_a_spur_has_one_cut_of_a_kind_and_the_better_supported_one_wins():
    tracker = Tracker(CONFIG)
    for _ in range(4):
        feed(tracker, view(), proposal(y=0.02))
    (old,) = tracker.points()
    withdrawn = []
    for _ in range(12):
        result = feed(tracker, view(), proposal(y=-0.07))
        assert len(result.points) <= 1
        withdrawn += result.withdrawn
    (new,) = tracker.points()
    assert new.point_id != old.point_id and new.position[1] == pytest.approx(-0.07)
    assert withdrawn == [reasons.withdrawn_as_elsewhere(old.point_id, old.vine, old.spur)]


def test_a_point_gives_way_as_soon_as_more_looks_put_the_cut_elsewhere():
    tracker = Tracker(CONFIG)
    for _ in range(CONFIG.min_hits):
        shown = feed(tracker, view(), proposal(y=0.06)).points
    (first,) = shown
    elsewhere = [feed(tracker, view(), proposal()) for _ in range(CONFIG.min_hits + 1)]
    assert [told.points[0].point_id for told in elsewhere[:-1]] == [first.point_id] * CONFIG.min_hits
    (second,) = elsewhere[-1].points
    assert second.point_id != first.point_id
    assert elsewhere[-1].withdrawn == (reasons.withdrawn_as_elsewhere(first.point_id, first.vine, first.spur),)


@pytest.mark.parametrize("distance", [0.12, 0.16, 0.20])
def test_a_cane_too_near_to_be_measured_keeps_its_point(distance):
    tracker = Tracker(CONFIG)
    for _ in range(5):
        feed(tracker, view(), proposal())
    near = view(depth=0.0)
    near.t[2] = 0.8 - distance
    for _ in range(10):
        result = feed(tracker, near)
    assert len(result.points) == 1


def test_one_revision_has_one_hash_and_another_count_of_nodes_is_another_revision():
    tracker, rng, seen = Tracker(CONFIG), np.random.default_rng(0), set()
    for _ in range(30):
        x, y = rng.normal(0.0, 0.002, 2)
        seen |= {(point.revision, point.digest) for point in feed(tracker, view(), proposal(x, y)).points}
    assert len(seen) == 1
    other = proposal()
    other = replace(other, cut=replace(other.cut, nodes_kept=3))
    (point,) = feed(tracker, view(), other).points
    assert (point.revision, point.nodes_kept) == (2, 3) and (1, point.digest) not in seen


def test_the_place_is_as_uncertain_as_the_looks_differ():
    def spread(noise):
        tracker, rng = Tracker(CONFIG), np.random.default_rng(0)
        for _ in range(20):
            x, y = rng.normal(0.0, noise, 2)
            feed(tracker, view(), proposal(x, y))
        return np.sqrt(tracker.points()[0].position_covariance[0])

    assert 0.0015 <= spread(0.0) < spread(0.005) < 0.004


def averages(rng, noise, looks):
    values = rng.multivariate_normal(np.zeros(3), noise, looks)
    return values.mean(axis=0), np.cov(values.T, bias=True).reshape(3, 3)


@pytest.mark.parametrize("looks", [2, 5, 20])
def test_the_error_of_a_mean_is_as_large_as_its_covariance_says(looks):
    rng = np.random.default_rng(looks)
    noise = np.diag([0.001, 0.004, 0.002]) ** 2
    normalised = []
    for _ in range(400):
        mean, scatter = averages(rng, noise, looks)
        common = rng.normal(0.0, 0.0015, 3)
        covariance = position_covariance(scatter, looks)
        normalised.append((mean + common) @ np.linalg.solve(covariance, mean + common))
    # Three coordinates: 3 when it is exact.
    assert 1.5 < np.mean(normalised) < 4.5


def test_a_single_look_is_not_taken_for_the_truth_and_more_looks_tell_more():
    one, many = (position_covariance(np.zeros((3, 3)), looks) for looks in (1, 20))
    assert np.sqrt(one[0, 0]) > 0.002
    assert np.trace(many) < 0.5 * np.trace(one)
    assert np.sqrt(many[0, 0]) >= 0.0015, "the camera's own error does not average out"


def test_a_direction_is_uncertain_across_itself_only():
    direction = np.array([0.6, 0.0, 0.8])
    covariance = direction_covariance(0.01 * np.eye(3), 4, direction)
    assert direction @ covariance @ direction == pytest.approx(0.0, abs=1e-12)
    assert np.linalg.matrix_rank(covariance, tol=1e-9) == 2
