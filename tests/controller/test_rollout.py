"""The preview against what is then done."""

import numpy as np
import pytest

from controller.motion.follower import Measured
from controller.planning import preview as preview_module
from controller.planning.preview_plan import PreviewRequest
from controller.planning.rollout import ActuatorLag, CutLog, Rollout, Samples
from controller.whole_body.collision import CollisionModel
from controller.work.point_queue import PointQueue
from rolling_panda import commands as intents
from rolling_panda.config import RobotConfig
from rolling_panda.errors import ControlError
from rolling_panda.messages.perception import Capsule
from rolling_panda.model.differential_drive import NXI
from rolling_panda.model.robot import ARM_Q, RobotModel
from tests.support.controller_at_work import CONFIG, entry
from tests.support.points import point
from tests.support.previewed import ROLLOUT, Previewed

POINTS = (point("a", (0.45, 0.75, 1.05)), point("b", (0.75, 0.75, 1.1), (0.1, 0.0, 0.995)))
DRIVE = RobotModel(RobotConfig()).drive
START = np.zeros(12)
START[ARM_Q] = CONFIG.work.home


@pytest.fixture(autouse=True)
def no_planner(monkeypatch):
    monkeypatch.setattr(preview_module, "_PLAN_S", 0.0)


@pytest.mark.long
def test_what_is_done_is_what_was_shown():
    """On a robot that is half as late again as the preview reckons with."""
    p = Previewed(POINTS, lag=1.5 * CONFIG.motion.arm_lag_s)
    shown = p.previewed()
    rows = np.array([row.tool for row in p.motion.rows])
    assert p.ask(intents.ApprovePreview, preview_hash=shown.preview_hash) == ""
    took = p.worked()
    assert [entry(p.robot, name).state for name in "ab"] == ["DONE", "DONE"]
    done = np.array(p.path)
    apart = np.array([np.linalg.norm(done - row, axis=1).min() for row in rows])
    assert apart.max() < 0.01
    assert took == pytest.approx(shown.duration_s, rel=0.2)
    cuts = {name: pose[:3, 3] for name, pose in p.robot.cuts}
    for cut in shown.cuts:
        assert cut.reason is None
        at = rows[np.argmin([abs(row.time - cut.cut_s) for row in p.motion.rows])]
        assert np.linalg.norm(at - cuts[cut.point_id]) < 0.01


def test_each_cut_says_when_and_how_near():
    made = ROLLOUT.roll(PreviewRequest(1, START, POINTS))
    a, b = made.cuts
    assert a.begins_s == 0.0 < a.cut_s < a.ends_s == b.begins_s < b.cut_s < b.ends_s == made.duration
    for cut in made.cuts:
        assert 0.0 < cut.clearance < 1.0 and all(cut.between)
        assert 0.0 < cut.manipulability < 0.2 and 0.0 < cut.joint_margin < 1.6
    assert set(made.plans) == {"a", "b"}
    times = [row.time for row in made.rows]
    assert times[0] == 0.0 and np.diff(times).max() <= 0.1 + 1e-9


@pytest.mark.long
def test_one_request_has_one_hash_and_another_one_has_another():
    one = ROLLOUT.roll(PreviewRequest(1, START, POINTS[:1]))
    assert Rollout(CONFIG, RobotConfig()).roll(PreviewRequest(2, START, POINTS[:1])).digest == one.digest
    moved = START.copy()
    moved[0] += 0.01
    assert ROLLOUT.roll(PreviewRequest(3, moved, POINTS[:1])).digest != one.digest


@pytest.mark.long
def test_what_cannot_be_reached_is_shown_as_not_cut_with_the_reason():
    made = ROLLOUT.roll(PreviewRequest(1, START, (point("high", (0.5, 0.75, 2.6)), POINTS[1])))
    assert made.cuts[0].cut_s is None
    assert made.cuts[0].reason.code == "not_reachable"
    assert made.cuts[1].reason is None


def test_what_stands_around_comes_into_the_clearance():
    free = ROLLOUT.roll(PreviewRequest(1, START, POINTS[:1])).cuts[0]
    post = Capsule("post", (0.9, 0.72, 0.0), (0.9, 0.72, 2.0), 0.04, 0.04)
    beside = ROLLOUT.roll(PreviewRequest(1, START, POINTS[:1], (post,))).cuts[0]
    assert beside.clearance <= free.clearance
    assert beside.reason is None


def test_a_robot_that_is_nowhere_has_no_preview():
    with pytest.raises(ControlError, match="finite"):
        ROLLOUT.roll(PreviewRequest(1, np.full(12, np.nan), POINTS))


def test_where_pictures_take_long_a_look_back_does_not_keep_the_next_one_from_being_answered():
    """The cut before is still being looked at when the tool is at the next place."""
    near = (POINTS[0], point("b", (0.4, 0.77, 1.1)))
    made = ROLLOUT.roll(PreviewRequest(1, START, near, close_up_s=1.2))
    assert [cut.reason for cut in made.cuts] == [None, None]


def test_where_the_tool_cannot_leave_the_canes_nothing_is_cut_and_no_point_is_to_blame():
    stuck = START.copy()
    stuck[1] = 0.5
    x, y, z = RobotModel().pose(stuck, RobotModel().tool_id).translation.tolist()
    behind = Capsule("wire", (x - 0.4, y - 0.15, z), (x + 0.4, y - 0.15, z), 0.02, 0.02)
    made = ROLLOUT.roll(PreviewRequest(1, stuck, POINTS, (behind,)))
    assert made.cuts == () and made.refused == {} and made.duration < 10.0
    assert made.failure.code == "joints_not_reached" and dict(made.failure.values)["rotation_deg"] > 1.0


def test_what_asks_for_more_torque_than_a_joint_has_is_not_cut_and_says_so():
    robot, queue = RobotModel(), PointQueue(CONFIG.work)
    log = CutLog(robot, CollisionModel(robot), queue)
    log.sample(Measured(START, robot.kinematics(START), np.zeros(NXI)), "a", 0.0)
    log.closed("a", 0.5)
    times = np.linspace(0.0, 1.0, 101)
    way, rates = np.tile(START, (101, 1)), np.zeros((101, NXI))
    calm, refused = log.cuts(1.0, None, Samples(times, way, rates))
    assert calm[0].reason is None and calm[0].torque_margin > 0.0 and refused == {}
    rates[:, 3] = np.sin(20.0 * times) * 5.0
    way[:, ARM_Q][:, 1] += 0.25 * (1.0 - np.cos(20.0 * times))
    rushed, refused = log.cuts(1.0, None, Samples(times, way, rates))
    assert rushed[0].cut_s is None and rushed[0].torque_margin < 0.0
    assert rushed[0].reason == refused["a"] and refused["a"].code == "torque_lacking"
    assert ("joint", rushed[0].torque_joint) in refused["a"].values


def test_a_joint_ends_behind_its_command_by_the_lag_times_its_speed():
    servos = ActuatorLag(DRIVE, np.zeros(12), 0.05, 0.02, 0.01)
    command = np.zeros(NXI)
    command[4] = 0.5
    for _ in range(100):
        servos.step(command)
    assert servos.xi[4] == pytest.approx(0.5)
    assert servos.q[3 + 4] == pytest.approx(0.5 * (1.0 - 0.02), abs=1e-6)


def test_equal_wheels_drive_straight_on_and_without_lag_at_once():
    servos = ActuatorLag(DRIVE, np.zeros(12), 0.0, 0.0, 0.01)
    command = np.zeros(NXI)
    command[:2] = 1.0
    for _ in range(100):
        servos.step(command)
    np.testing.assert_allclose(servos.q[:3], (DRIVE.wheel_radius, 0.0, 0.0), atol=1e-9)
