"""A motion is waited for as long as there is a prospect of its end, and not longer."""

import numpy as np
import pytest
from msgspec.structs import replace

from controller.motion.follower import MotionTimeout, Tracking, missed
from controller.work import cutting
from rolling_panda import commands as intents
from rolling_panda import reasons
from rolling_panda.messages.perception import Capsule
from rolling_panda.reasons import text_of
from tests.support.controller_at_work import entry, finish, robot, run_until, working
from tests.support.points import point

TIMEOUT, DT = 6.0, 0.01


def tracking(scale=1.0, reason="", done=False, error=0.0, turn=0.0):
    return Tracking(np.zeros(9), None, error, turn, 0.05, not reason, reason, done, scale)


def noted(timeout, seconds, **how):
    for _ in range(round(seconds / DT)):
        timeout.note(tracking(**how))


@pytest.fixture
def timeout():
    out = MotionTimeout(TIMEOUT, DT)
    out.start(2.0)
    return out


def test_over_is_what_has_run_out_and_is_in_place(timeout):
    assert timeout.over(tracking(done=True, error=0.001), 0.0, 0.0015)
    assert not timeout.over(tracking(done=True, error=0.002), 0.0, 0.0015)
    assert not timeout.over(tracking(done=True, turn=0.3), 0.0, 0.0015)
    assert not timeout.over(tracking(error=0.001), 0.0, 0.0015)


def test_late_is_what_takes_much_longer_than_planned(timeout):
    timeout.over(tracking(), 10.0, 0.0)
    assert not timeout.late(10.0 + 2.5 * 2.0 + TIMEOUT)
    assert timeout.late(10.1 + 2.5 * 2.0 + TIMEOUT)
    timeout.start(4.0)
    timeout.over(tracking(), 30.0, 0.0)
    assert not timeout.late(40.0)


def test_what_is_held_back_without_a_pause_is_late_soon(timeout):
    held = {"scale": 0.0, "reason": "blades – post 0"}
    noted(timeout, 2.9, **held)
    assert not timeout.late(2.9)
    noted(timeout, 0.2, **held)
    assert timeout.late(3.1)
    # It went on: counting begins anew.
    noted(timeout, 0.01, scale=0.5, reason=held["reason"])
    noted(timeout, 2.9, **held)
    assert not timeout.late(6.0)
    timeout.again()
    noted(timeout, 2.9, **held)
    assert not timeout.late(9.0)


@pytest.mark.parametrize("how", [{"scale": 0.0}, {"scale": 0.0, "reason": "near", "done": True}])
def test_a_clock_that_stands_for_no_reason_or_has_run_out_is_not_held(timeout, how):
    noted(timeout, 20.0, **how)
    assert not timeout.late(20.0)


def test_what_is_missing_is_said_with_the_reason():
    said = missed("the cut", tracking(error=0.0102, turn=0.02, reason="joint 3"))
    assert said.code == "not_reached_for"
    left = {"position_mm": pytest.approx(10.2), "rotation_deg": pytest.approx(1.146, abs=1e-3)}
    assert dict(said.values) == {"goal": "the cut", "cause": "joint 3"} | left
    assert missed("the cut", tracking()) == reasons.not_reached("the cut", 0.0, 0.0)


def test_a_post_beside_the_way_is_told_as_the_reason_within_seconds():
    r = working(
        (point("a", (1.4, 0.75, 1.1)),), obstacles=(Capsule("post", (0.8, 0.35, 0.0), (0.8, 0.35, 1.9), 0.04, 0.04),)
    )
    run_until(r, lambda s: s is not None and s.mode == "AUTO", 2.0)
    held = None
    while entry(r, "a").state == "ACCEPTED":
        r.step()
        if held is None and r.controller.tracking is not None and r.controller.tracking.reason:
            held = r.now
        assert r.now < 20.0
    assert entry(r, "a").state == "FAILED_NOT_CUT" and "post 0" in text_of(entry(r, "a").reason)
    assert held is not None and r.now - held < 4.0


def test_a_cut_that_was_not_reached_is_tried_another_way():
    """A wire is seen over the cut when the tool is on its way in already."""
    r = working((point("a", (0.3, 0.785, 1.169)),))
    run_until(r, lambda s: s is not None and s.phase == "ADVANCE", 20.0)
    r.obstacles = (Capsule("wire", (-0.2, 0.75, 1.2), (2.0, 0.75, 1.2), 0.004, 0.004),)
    run_until(r, lambda s: entry(r, "a").reason is not None, 20.0)
    assert entry(r, "a").state == "ACCEPTED" and entry(r, "a").reason.code == "missed_once"
    finish(r, 60.0)
    assert entry(r, "a").state == "DONE" and len(r.cuts) == 1


@pytest.mark.long
def test_a_camera_place_that_the_base_does_not_come_to_is_left_and_the_cut_tried_again(monkeypatch):
    """Wheels that have slipped leave the base elsewhere, with the tool where it should be."""
    ready, tries = cutting.camera_ready, []
    monkeypatch.setattr(cutting, "camera_ready", lambda *given: len(tries) > 0 and ready(*given))
    r = working((point("a", (0.3, 0.785, 1.169)),))
    run_until(r, lambda s: s is not None and s.phase == "APPROACH", 10.0)
    run_until(r, lambda s: entry(r, "a").reason is not None, 30.0)
    assert entry(r, "a").state == "ACCEPTED" and entry(r, "a").reason.code == "missed_once"
    tries.append(1)
    finish(r, 60.0)
    assert entry(r, "a").state == "DONE" and len(r.cuts) == 1


def test_a_way_on_which_the_tool_hardly_gets_on_is_tried_another_way(monkeypatch):
    """Near a singularity the motion is possible, and takes for ever."""
    track = cutting.FollowedMotion.track

    def crawling(way, robot):
        # The robot does not get on.
        done = replace(track(way, robot), reason="joint 1", feasible=True, scale=0.015)
        way.timeout.note(done)
        return replace(done, xi=np.zeros(9))

    r = working((point("a", (0.3, 0.785, 1.169)),))
    run_until(r, lambda s: s is not None and s.phase == "APPROACH", 10.0)
    monkeypatch.setattr(cutting.FollowedMotion, "track", crawling)
    run_until(r, lambda s: entry(r, "a").reason is not None, 30.0)
    assert entry(r, "a").state == "ACCEPTED" and entry(r, "a").reason.code == "missed_once"


@pytest.mark.long
def test_an_arm_that_came_in_another_posture_than_planned_is_brought_into_it_before_the_canes():
    """Both cuts turned far about canes that lean: without that the second one is not reached in three tries."""
    near = (point("a", (0.5, 0.746, 0.954), tangent=(-0.16, 0.36, 0.92)),)
    far = point("b", (0.561, 0.734, 1.055), tangent=(0.29, -0.54, 0.79))
    r = robot()
    r.step()
    r.show((*near, far))
    r.step()
    turned = [intents.SetApproach(user="ada", point_id=name, azimuth=-0.7) for name in "ab"]
    for intent in (intents.Arm(user="ada"), intents.AcceptAll(user="ada"), *turned, intents.Start(user="ada")):
        assert r.ask(intent).ok
    finish(r, 60.0)
    assert [cut[0] for cut in r.cuts] == ["a", "b"]
    assert entry(r, "b").state == "DONE"
