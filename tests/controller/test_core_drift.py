"""Odometry that drifts: the controller works where the row is, as perception tells it, and moves without a jump."""

import msgspec
import numpy as np
import pinocchio as pin
import pytest

from controller.core import Controller
from rolling_panda import commands as intents
from rolling_panda.config import RobotConfig
from rolling_panda.messages.perception import Capsule
from rolling_panda.model.map_frame import MapFrame
from rolling_panda.model.wire_values import vector3
from rolling_panda.reasons import text_of
from tests.support.controller_at_work import CONFIG, entry, run_until, working
from tests.support.fake_wire import located
from tests.support.points import point
from tests.support.worlds.kinematic_robot import KinematicRobot

#: Beyond the reach of where the robot stands, so that it drives there.
CUT = (1.2, 0.75, 1.1)
CANE = Capsule("cane", (1.2, 0.75, 0.95), (1.2, 0.75, 1.09), 0.004, 0.004, 1, 1)


class DriftingRobot(KinematicRobot):
    """`q` is what odometry tells. While the base moves, odom drifts against the row, which stays where it is."""

    where = MapFrame()
    #: Drift of odom in map for each metre driven: along, across (m), heading (rad).
    rates = (0.05, 0.02, 0.03)
    _told_at = 0.0

    def integrate(self, command):
        before = self.q[:3].copy()
        super().integrate(command)
        driven = float(np.linalg.norm(self.q[:2] - before[:2]))
        if driven:
            along, across, turn = (rate * driven for rate in self.rates)
            here = self.q[:2]
            # About the robot, so that the place where it stands moves by no more than the drift.
            step = pin.SE3(pin.exp3(np.array([0.0, 0.0, turn])), np.zeros(3))
            step.translation = np.array([*here, 0.0]) - step.rotation @ np.array([*here, 0.0])
            step.translation += np.array([along, across, 0.0])
            self.where = MapFrame(self.where.pose_in_map(step))
        if self.now - self._told_at > 0.3 and self.where.T_map_odom is not None:
            self._told_at = self.now
            self.hear(located(self.where.T_map_odom))

    def close_up(self, request):
        seen = super().close_up(request)
        if seen.position is None:
            return seen
        return msgspec.structs.replace(seen, position=vector3(self.where.position_in_odom(np.array(seen.position))))


def drifting(monkeypatch, rates):
    """A robot that is put to work as `working` does it."""
    monkeypatch.setattr("tests.support.controller_at_work.KinematicRobot", DriftingRobot)
    monkeypatch.setattr(DriftingRobot, "rates", rates)
    return working((point("a", CUT),), obstacles=(CANE,))


@pytest.mark.parametrize("rates", [(0.0, 0.0, 0.0), (0.08, 0.03, 0.04), (-0.08, -0.03, -0.04)])
def test_the_cut_is_made_where_the_cane_is_and_nothing_jumps(monkeypatch, rates):
    r = drifting(monkeypatch, rates)
    near, cut = [], []
    run_until(r, lambda s: s is not None and s.mode == "AUTO", 2.0)
    while r.state.mode == "AUTO":
        r.step()
        tool = r.where.pose_in_map(r.model.kinematics(r.q).T_odom_tool).translation
        if r.state.phase == "ADVANCE":
            near.append(abs(tool[0] - CUT[0]))
        if r.state.phase == "CUT":
            cut.append(tool)
        assert r.now < 40.0, r.state.reason
    assert entry(r, "a").state == "DONE", text_of(entry(r, "a").reason)
    drifted = np.linalg.norm(r.where.position_in_odom(np.array(CUT)) - CUT)
    assert drifted > 0.03 or not any(rates)
    # Between the close-up and the end of the base's motion it drifts by some millimetres more.
    assert len(r.cuts) == 1 and cut[0] == pytest.approx(CUT, abs=0.006)
    assert max(near[len(near) // 3 :]) < 0.025, "straight in, not from where the row is by odometry"
    told = [text for text in r.events if "accepted" in text and "mm" in text]
    assert not told, "it is told of no move that is only the odometry's"
    assert float(np.abs(np.diff(r.record, axis=0)).max()) < 0.2


def test_a_survey_keeps_its_line_along_the_row_and_comes_back_to_its_beginning():
    r = DriftingRobot(Controller(CONFIG, RobotConfig()), CONFIG.work.home, dt=1.0 / CONFIG.rate_hz)
    r.step()
    assert r.ask(intents.Arm(user="ada")).ok and r.ask(intents.Survey(user="ada", distance=2.0)).ok
    aside = []
    run_until(r, lambda s: s is not None and s.mode == "AUTO", 2.0)
    while r.state.mode == "AUTO":
        r.step()
        aside.append(float(r.where.configuration_in_map(r.q)[1]))
        assert r.now < 40.0
    base = r.where.configuration_in_map(r.q)
    assert base[0] == pytest.approx(2.0, abs=0.03) and abs(r.q[0] - 2.0) > 0.05
    assert max(map(abs, aside)) < 0.03 and abs(base[2]) < 0.03


def test_the_last_stretch_ends_where_the_close_up_saw_the_cane_whatever_is_told_of_the_map_since():
    """The camera is blind there and the base at rest: a correction of the map is of wood that was seen elsewhere."""
    r = working((point("a", CUT),), obstacles=(CANE,))
    run_until(r, lambda s: s is not None and s.mode == "AUTO" and s.phase == "ADVANCE", 20.0)
    r.hear(located(pin.SE3(np.eye(3), np.array([0.0, 0.0, 0.026]))))
    r.show((point("a", (CUT[0] + 0.004, CUT[1], CUT[2]), revision=2),))
    run_until(r, lambda s: s.mode != "AUTO", 40.0)
    assert entry(r, "a").state == "DONE", text_of(entry(r, "a").reason)
    assert r.cuts[0][1][:3, 3] == pytest.approx(CUT, abs=0.002)
