"""The benchmark of late pictures: physics, camera and perception together find the offset that the world has."""

import numpy as np
import pytest
from msgspec.structs import replace

from benchmarks.perception.frame_time import ride, summarise
from bridge.sim.world.config import CALM
from controller.config import ControllerConfig
from controller.work.camera_views import ROW, view_postures
from rolling_panda.model.robot import RobotModel


@pytest.mark.long
def test_late_pictures_are_told_and_their_points_are_nearer_to_the_wood_with_the_offset_that_is_told():
    late = replace(CALM, frame_delay=0.04)
    views = view_postures(RobotModel(), np.array(ControllerConfig().work.home), ROW)[:3]
    found = ride(31, late, 1.0, "labels", views)
    assert found.check.warns and abs(found.check.offset - 0.04) < 3.0 * found.check.sd < 0.03
    assert len(found.points) > 5 and np.median(found.corrected) < np.median(found.points) - 0.001
    figures = summarise([found])
    assert figures["check"]["warned"] == 1 and figures["corrected"]["median_m"]["n"] == len(found.corrected)
