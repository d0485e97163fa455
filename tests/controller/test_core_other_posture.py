"""An arm that comes to a cut in another posture than planned is brought into the planned one before it enters."""

import msgspec
import numpy as np
import pytest

from rolling_panda.model.robot import ARM_Q, RobotModel
from tests.support.controller_at_work import CONFIG, entry, run_until, working
from tests.support.points import point

#: All postures count as ones in which the tool hardly moves.
HARDLY = msgspec.structs.replace(
    CONFIG,
    whole_body=msgspec.structs.replace(
        CONFIG.whole_body,
        hierarchy=msgspec.structs.replace(CONFIG.whole_body.hierarchy, good_manipulability=1.0),
    ),
)


def with_elbow_aside(model: RobotModel, q: np.ndarray, joint_rad: float) -> np.ndarray:
    """The same tool pose with the base where it is and another place of the elbow, until a joint is so far off."""
    goal, out = model.kinematics(q).T_odom_tool, q.copy()
    way = np.zeros(7)
    while np.abs(out[ARM_Q] - q[ARM_Q]).max() < joint_rad:
        kinematics = model.kinematics(out)
        J = kinematics.J[:, -7:]
        free = np.linalg.svd(J)[2][-1]
        way = free if not way.any() or free @ way > 0.0 else -free
        off = goal.translation - kinematics.T_odom_tool.translation
        out[ARM_Q] += 0.02 * way + np.linalg.pinv(J) @ np.concatenate([off, np.zeros(3)])
    return out


def to_the_canes(config, seconds):
    """The robot where it enters the canes, and the arm with its elbow aside, as it was put after some seconds."""
    r = working((point("a", (0.4, 0.75, 1.0)),), config=config)
    run_until(r, lambda s: s is not None and s.mode == "AUTO", 1.0)
    run_until(r, lambda s: r.now >= seconds, 10.0)
    assert r.state.phase == "APPROACH"
    r.q = with_elbow_aside(r.model, r.q, 0.75)
    aside = r.q[ARM_Q].copy()
    run_until(r, lambda s: s.phase == "ADVANCE", 20.0)
    return r, aside


@pytest.mark.parametrize("seconds", [0.9, 1.1])
def test_where_the_tool_hardly_moves_the_arm_takes_the_planned_posture_before_it_enters(seconds):
    r, aside = to_the_canes(HARDLY, seconds)
    assert np.abs(r.q[ARM_Q] - aside).max() > 0.6
    run_until(r, lambda s: s.mode != "AUTO", 60.0)
    assert entry(r, "a").state == "DONE"


def test_where_the_tool_moves_well_it_enters_as_it_is():
    r, aside = to_the_canes(CONFIG, 1.1)
    assert np.abs(r.q[ARM_Q] - aside).max() < 0.3
    run_until(r, lambda s: s.mode != "AUTO", 60.0)
    assert entry(r, "a").state == "DONE"
