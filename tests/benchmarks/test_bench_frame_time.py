"""Late pictures: physics, camera and perception together find the offset that the world has, and correct it."""

from collections.abc import Iterator

import numpy as np
import pytest
from msgspec.structs import replace

from benchmarks.perception.frame_time import ride, summarise
from benchmarks.perception.row_drive import RowRobot
from bridge.sim.world.config import CALM
from controller.config import ControllerConfig
from controller.work.camera_views import ROW, view_postures
from perception.config import PerceptionConfig
from perception.pipeline import Perception
from perception.segmentation.segmenter import choose_segmenter
from rolling_panda.messages.robot import CameraFrame
from rolling_panda.model.robot import RobotModel

DELAY = 0.04


@pytest.mark.long
def test_late_pictures_are_told_and_their_points_are_nearer_to_the_wood_with_the_offset_that_is_told():
    late = replace(CALM, frame_delay=DELAY)
    views = view_postures(RobotModel(), np.array(ControllerConfig().work.home), ROW)[:3]
    found = ride(31, late, 1.0, "labels", views)
    assert found.check.warns and abs(found.check.offset - DELAY) < 3.0 * found.check.sd < 0.03
    assert len(found.points) > 5 and np.median(found.corrected) < np.median(found.points) - 0.001
    figures = summarise([found])
    assert figures["check"]["warned"] == 1 and figures["corrected"]["median_m"]["n"] == len(found.corrected)


@pytest.fixture(scope="module")
def robot() -> Iterator[tuple[RowRobot, list[CameraFrame]]]:
    """A robot whose pictures are late, and those of a survey and of a check."""
    late = RowRobot(31, 1.0, replace(CALM, frame_delay=DELAY), 4.0)
    frames = [each.frame for each in late.drive(1.0, ControllerConfig().work.survey_speed, 0.2, 2.0)]
    for posture in view_postures(late.model, np.array(ControllerConfig().work.home), ROW)[:3]:
        frames += [each.frame for each in late.reach(posture, 2.0, 2.0)]
    yield late, frames
    late.close()


@pytest.mark.long
def test_late_pictures_are_offered_a_correction_and_with_it_nothing_is_left_to_correct(
    robot: tuple[RowRobot, list[CameraFrame]],
) -> None:
    late, frames = robot
    seeing = Perception(PerceptionConfig(), choose_segmenter("labels"))
    for frame in frames:
        seeing.process(frame)
    offer = seeing.robot_calibration.timing
    assert offer is not None and abs(offer.delay - DELAY) < 3.0 * offer.delay_sd < 0.03 and offer.views > 2
    warning = seeing.camera.state.warning
    assert warning is not None and warning.code == "frames_late"
    points = len(seeing.points().points)
    seeing.process(late.later(frames[-1], offer.delay))
    assert seeing.robot_calibration.timing is None and seeing.camera.state.time_offset is None
    assert not seeing.points().points, "they were seen where they are not"
    for frame in frames[:-1]:
        seeing.process(late.later(frame, offer.delay))
    left = seeing.camera.state
    assert left.time_offset is not None and abs(left.time_offset) < 0.01 and left.warning is None
    assert seeing.robot_calibration.timing is None and len(seeing.points().points) > 0.8 * points > 5


@pytest.mark.long
def test_what_is_found_is_added_to_the_delay_in_use(robot: tuple[RowRobot, list[CameraFrame]]) -> None:
    late, frames = robot
    seeing = Perception(PerceptionConfig(), choose_segmenter("labels"))
    for frame in frames:
        seeing.process(late.later(frame, -0.03))
    offer = seeing.robot_calibration.timing
    assert offer is not None and abs(offer.delay - DELAY) < 3.0 * offer.delay_sd
