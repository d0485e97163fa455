"""Clear of the canes, an arm at a joint limit or a singularity goes home before the next way begins."""

import numpy as np
import pytest

from controller.work import cutting
from rolling_panda.model.robot import ARM_Q
from tests.support.controller_at_work import CONFIG, entry, run_until, working
from tests.support.points import point

HOME = np.array(CONFIG.work.home)
#: Joint 5 at its limit: as after a long way from one cut to the next, with the tool clear of the canes.
WOUND = np.array([-1.99, -0.55, 2.56, -1.43, 2.87, 2.47, -0.22])


@pytest.mark.parametrize("away", [0.0, 0.1])
def test_after_a_failed_try_an_arm_at_a_joint_limit_goes_home_before_the_next(monkeypatch, away):
    """The first try fails at its stand-off, in such a posture."""
    ready, failing = cutting.camera_ready, [True]
    monkeypatch.setattr(cutting, "camera_ready", lambda *words: not failing and ready(*words))
    r = working((point("a", (0.9, 0.75, 1.0)), point("b", (1.2, 0.75, 1.0))))
    run_until(r, lambda s: s is not None and s.phase == "APPROACH", 10.0)
    run_until(r, lambda s: s.phase == "RETREAT", 60.0)
    assert not r.cuts
    failing.clear()
    r.q[1] -= away
    r.q[ARM_Q] = WOUND
    depth, deepest = r.model.kinematics(r.q).T_odom_tool.translation[1], -np.inf
    while r.state.phase != "APPROACH":
        r.step()
        deepest = max(deepest, r.model.kinematics(r.q).T_odom_tool.translation[1])
        assert r.now < 90.0, r.state.reason
    assert np.abs(r.q[ARM_Q] - HOME).max() < 0.3
    assert deepest < depth + 0.01, "nearer to the canes"
    run_until(r, lambda s: s.mode != "AUTO", 200.0)
    assert r.state.mode == "READY" and entry(r, "a").state == entry(r, "b").state == "DONE"
