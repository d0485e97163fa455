"""Where the straight way out of the canes is held, the arm's joints go back; where they are held too, work pauses."""

import msgspec
import numpy as np

from controller.motion.follower import Follower
from rolling_panda.reasons import text_of
from tests.support.controller_at_work import CONFIG, entry, run_until, working
from tests.support.points import point


def at_work_and_held(monkeypatch, jog_too=False):
    """Two points to cut, and after the first something holds the tool on its straight way back."""
    r = working((point("a", (0.4, 0.75, 1.0)), point("b", (0.7, 0.75, 1.0))))

    def held(done):
        def follow(*arguments):
            tracking = done(*arguments)
            if r.state.phase != "RETREAT" or r.state.active_point_id != "a":
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
    clear = CONFIG.work.row_distance - CONFIG.work.clearance + 0.02
    assert r.model.kinematics(r.q).T_odom_tool.translation[1] < clear
    assert entry(r, "a").state == "DONE" and any("joint 1" in text and "by its joints" in text for text in r.events)
    run_until(r, lambda s: s.mode != "AUTO", 60.0)
    assert r.state.mode == "READY" and entry(r, "b").state == "DONE" and len(r.cuts) == 2


def test_held_by_its_joints_too_it_pauses_and_says_why(monkeypatch):
    r = at_work_and_held(monkeypatch, jog_too=True)
    run_until(r, lambda s: s is not None and s.mode == "AUTO", 1.0)
    run_until(r, lambda s: s.mode != "AUTO", 40.0)
    assert r.state.mode == "PAUSED" and "joint 1" in text_of(r.state.reason)
    assert entry(r, "b").state == "ACCEPTED" and len(r.cuts) == 1
