"""Where the straight way out of the canes is held, the arm's joints go back; where they are held too, work pauses."""

import msgspec
import numpy as np

from controller.motion.follower import Follower
from controller.work.posture_search import CutClearance, CutPlan, PostureSearch, completed
from rolling_panda import commands as intents
from rolling_panda import messages as m
from rolling_panda.model.robot import ARM_Q, RobotModel
from rolling_panda.reasons import text_of
from tests.support.controller_at_work import CONFIG, entry, run_until, working
from tests.support.points import point

#: The tool is clear of the canes to the right of this (m).
CLEAR = CONFIG.work.row_distance - CONFIG.work.clearance + 0.02


def at_work_and_held(monkeypatch, jog_too=False, point_id="a"):
    """Two points to cut, and something holds the tool on its straight way back: from the first cut, or from none."""
    r = working((point("a", (0.4, 0.75, 1.0)), point("b", (0.7, 0.75, 1.0))))

    def held(done):
        def follow(*arguments):
            tracking = done(*arguments)
            if r.state.phase != "RETREAT" or r.state.active_point_id != point_id:
                return tracking
            why = "joint 1"
            return msgspec.structs.replace(tracking, xi=np.zeros(9), scale=0.0, done=False, reason=why)

        return follow

    for name in ("follow", "jog") if jog_too else ("follow",):
        monkeypatch.setattr(Follower, name, held(getattr(Follower, name)))
    return r


def test_held_on_the_straight_way_back_the_tool_comes_out_by_joints_and_work_goes_on(monkeypatch):
    r = at_work_and_held(monkeypatch)
    run_until(r, lambda s: s is not None and s.mode == "AUTO", 1.0)
    run_until(r, lambda s: s.active_point_id == "b" and s.phase == "APPROACH", 40.0)
    # Clear of the canes before it goes on to the next.
    assert r.model.kinematics(r.q).T_odom_tool.translation[1] < CLEAR
    assert entry(r, "a").state == "DONE" and any("joint 1" in text and "by its joints" in text for text in r.events)
    run_until(r, lambda s: s.mode != "AUTO", 60.0)
    assert r.state.mode == "READY" and entry(r, "b").state == "DONE" and len(r.cuts) == 2


def test_held_by_its_joints_too_it_pauses_and_says_why(monkeypatch):
    r = at_work_and_held(monkeypatch, jog_too=True)
    run_until(r, lambda s: s is not None and s.mode == "AUTO", 1.0)
    run_until(r, lambda s: s.mode != "AUTO", 40.0)
    assert r.state.mode == "PAUSED" and "joint 1" in text_of(r.state.reason)
    assert joints_missed(r.state.reason) > 1.0
    assert entry(r, "b").state == "ACCEPTED" and len(r.cuts) == 1


def joints_missed(reason):
    """By how much (degrees) the joints are told to be off; of a reason or one of its causes."""
    values = dict(reason.values)
    if reason.code == "joints_not_reached":
        return values["rotation_deg"]
    return max((joints_missed(each) for each in values.values() if isinstance(each, m.Reason)), default=0.0)


def interrupted_among_the_canes(r):
    """Paused by a person on the way in, and started again: the tool first leaves the canes."""
    run_until(r, lambda s: s is not None and s.mode == "AUTO", 1.0)
    run_until(r, lambda s: s.phase == "ADVANCE" and s.active_point_id == "a", 40.0)
    run_until(r, lambda s: r.model.kinematics(r.q).T_odom_tool.translation[1] > 0.7, 40.0)
    assert r.ask(intents.Pause(user="ada")).ok
    run_until(r, lambda s: s.mode == "PAUSED", r.now + 5.0)
    assert r.model.kinematics(r.q).T_odom_tool.translation[1] > CLEAR
    assert r.ask(intents.Resume(user="ada")).ok
    run_until(r, lambda s: s.mode == "READY", r.now + 1.0)
    assert r.ask(intents.Start(user="ada")).ok
    run_until(r, lambda s: s.mode == "AUTO", r.now + 1.0)


def test_held_on_the_way_out_after_an_interruption_it_comes_out_by_joints_and_work_goes_on(monkeypatch):
    r = at_work_and_held(monkeypatch, point_id="")
    interrupted_among_the_canes(r)
    run_until(r, lambda s: s.mode != "AUTO", 90.0)
    assert r.state.mode == "READY" and entry(r, "a").state == entry(r, "b").state == "DONE"


def test_held_by_its_joints_too_on_the_way_out_it_pauses_and_says_why(monkeypatch):
    r = at_work_and_held(monkeypatch, jog_too=True, point_id="")
    interrupted_among_the_canes(r)
    run_until(r, lambda s: s.mode != "AUTO", 40.0)
    assert r.state.mode == "PAUSED" and "joint 1" in text_of(r.state.reason)
    assert joints_missed(r.state.reason) > 1.0
    assert not r.cuts


def test_the_arm_goes_to_where_the_tool_is_clear_though_the_base_has_gone_on():
    q = np.zeros(12)
    q[ARM_Q] = CONFIG.work.home
    cut = point("a", (0.4, 0.75, 1.0))
    search = PostureSearch(
        RobotModel(),
        CONFIG.work,
        CONFIG.whole_body.joint_margin,
        CutClearance(RobotModel(), CONFIG.whole_body.hierarchy),
    )
    plan = completed(search.find(cut, q))
    assert isinstance(plan, CutPlan)
    onwards, away = plan.q_cut.copy(), plan.q_cut.copy()
    onwards[0] += 0.15
    away[0] += 3.0
    clear = search.arm_at(plan.poses.clear, onwards, plan.q_clear[ARM_Q])
    assert clear is not None
    np.testing.assert_array_equal(clear[:5], onwards[:5])
    tool = RobotModel().kinematics(clear).T_odom_tool
    np.testing.assert_allclose(tool.translation, plan.poses.clear.translation, atol=1e-3)
    assert search.arm_at(plan.poses.clear, away, plan.q_clear[ARM_Q]) is None
    # From there the joints would swing the tool through the canes in an arc.
    aside = onwards.copy()
    aside[ARM_Q] += [-1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]
    assert search.arm_at(plan.poses.clear, aside, plan.q_clear[ARM_Q]) is None
