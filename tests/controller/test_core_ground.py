"""Uneven ground: the base rolls, pitches and climbs as it drives, and the cut is made where the cane is."""

import math

import msgspec
import numpy as np
import pytest

from rolling_panda import messages as m
from rolling_panda.messages.perception import Capsule, CloseUpResult
from rolling_panda.model.base_attitude import T_odom_level
from rolling_panda.model.wire_values import planar_pose, vector3
from rolling_panda.reasons import text_of
from tests.support.controller_at_work import entry, run_until, working
from tests.support.points import point
from tests.support.worlds.kinematic_robot import KinematicRobot

#: Beyond the reach of where the robot stands, so that it drives there.
CUT = (1.2, 0.75, 1.1)
CANE = Capsule("cane", (1.2, 0.75, 0.95), (1.2, 0.75, 1.09), 0.004, 0.004, 1, 1)


class RockingRobot(KinematicRobot):
    """Its base stands on bumps half a metre long. What it carries is elsewhere than a level base would have it."""

    size = 0.0
    #: Whether it tells how it stands.
    tells = True

    @property
    def attitude(self) -> m.BaseAttitude:
        phase = 2.0 * math.pi * float(self.q[0]) / 0.5
        return m.BaseAttitude(
            0.2 * self.size * math.sin(phase), self.size * math.sin(phase), self.size * math.cos(phase)
        )

    def true_tool(self):
        """Position of the tool (3, m, odom)."""
        tool, tilted = self.model.kinematics(self.q).T_odom_tool, T_odom_level(planar_pose(self.q), self.attitude)
        return (tool if tilted is None else tilted * tool).translation

    def hear(self, message):
        if isinstance(message, m.Odometry) and self.size:
            message = msgspec.structs.replace(message, attitude=self.attitude if self.tells else None)
        if isinstance(message, CloseUpResult) and message.position is not None and not self.tells:
            # Who does not know how the base stands takes what the camera sees to be where a level base would see it.
            tilted = T_odom_level(planar_pose(self.q), self.attitude)
            message = msgspec.structs.replace(message, position=vector3(tilted.actInv(np.array(message.position))))
        super().hear(message)


def cut_at(monkeypatch, size, tells=True):
    """Works a point off; where the blades closed (3, m, odom), and the robot."""
    monkeypatch.setattr("tests.support.controller_at_work.KinematicRobot", RockingRobot)
    monkeypatch.setattr(RockingRobot, "size", size)
    monkeypatch.setattr(RockingRobot, "tells", tells)
    r = working((point("a", CUT),), obstacles=(CANE,))
    run_until(r, lambda s: s is not None and s.mode == "AUTO", 2.0)
    run_until(r, lambda s: s.phase == "CUT", 40.0)
    return r.true_tool(), r


@pytest.mark.long
@pytest.mark.parametrize("size", [0.0, 0.03, -0.03])
def test_the_blades_close_where_the_cane_is_and_nothing_jumps(monkeypatch, size):
    tool, r = cut_at(monkeypatch, size)
    assert tool == pytest.approx(CUT, abs=0.003)
    run_until(r, lambda s: s.mode != "AUTO", 40.0)
    assert entry(r, "a").state == "DONE", text_of(entry(r, "a").reason)
    told = [text for text in r.events if "accepted" in text and "mm" in text]
    assert not told, "what is only the ground's is no move of the cut"
    assert float(np.abs(np.diff(r.record, axis=0)).max()) < 0.2


def test_a_base_that_cannot_tell_how_it_stands_carries_the_blades_past_the_cane(monkeypatch):
    """So that the test above shows something: after the close-up the base rolls on over the bumps."""
    tool, _ = cut_at(monkeypatch, 0.03, tells=False)
    assert np.linalg.norm(tool - CUT) > 0.003
