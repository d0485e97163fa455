import zlib

import msgspec
import numpy as np
import pytest

from benchmarks.perception_points import camera_frame, evaluate, survey_arm
from bridge.sim.camera import Camera
from bridge.sim.camera_config import CameraConfig
from bridge.sim.vineyard import grow
from bridge.sim.vineyard_config import VineyardConfig
from perception.config import PerceptionConfig
from perception.pipeline import Perception
from perception.segmenter import LabelImageSegmenter
from rolling_panda import messages as m
from rolling_panda.codec import StrictDecoder, encode
from rolling_panda.errors import MessageError
from rolling_panda.robot_model import RobotModel, configuration


@pytest.fixture(scope="module")
def model():
    return RobotModel()


@pytest.fixture(scope="module")
def frames(model):
    row = grow(VineyardConfig(), 1)
    camera = Camera(CameraConfig(), 1)
    base = m.PlanarPose()
    position = msgspec.convert((0.0, 0.0, *survey_arm()), m.Actuated)
    place = model.pose(configuration(base, position), model.camera_id).homogeneous
    return [camera_frame(camera.render(row, place, k), camera, base, position, k) for k in range(4)]


def perception(model):
    return Perception(PerceptionConfig(), LabelImageSegmenter(), model)


@pytest.mark.parametrize("seed", [3, 101])
def test_points_of_a_rendered_row_are_where_a_grower_would_cut(model, seed):
    score = evaluate(seed, model=model)
    assert score.points >= 4
    assert score.right_place >= 0.8 * score.points
    assert np.median(np.abs(score.along)) < 0.003
    assert np.median(score.off_axis) < 0.003


def test_points_show_after_they_were_seen_often_enough_and_keep_their_names(model, frames):
    seen = perception(model)
    results = [seen.process(frame) for frame in frames]
    assert not results[0].points and not results[1].points
    assert results[2].points
    after = {point.point_id: point for point in results[3].points}
    for point in results[2].points:
        assert after[point.point_id].revision == point.revision
        assert after[point.point_id].position == point.position
    assert results[3].frames == 4 and results[3].segmenter == "simulator labels" and results[3].canes


def test_the_same_frames_give_the_same_points_and_they_fit_the_wire(model, frames):
    first, second = ([p.process(frame) for frame in frames][-1] for p in (perception(model), perception(model)))
    assert encode(first) == encode(second)
    assert StrictDecoder(m.PruningPoints).decode(encode(first)) == first


def test_a_corrupt_frame_changes_nothing(model, frames):
    seen = perception(model)
    for frame in frames[:3]:
        before = seen.process(frame)
    with pytest.raises(MessageError):
        seen.process(msgspec.structs.replace(frames[3], depth_zlib=frames[3].depth_zlib[:-9]))
    after = seen.process(frames[3])
    assert after.frames == 4
    assert [point.position for point in after.points] == [point.position for point in before.points]


def test_without_labels_it_abstains_with_the_reason(model, frames):
    result = perception(model).process(msgspec.structs.replace(frames[0], labels_zlib=b""))
    assert not result.points
    assert "label image" in result.abstained[0]


def test_an_empty_view_gives_no_points(model, frames):
    k = frames[0].intrinsics
    blank = zlib.compress(bytes(k.width * k.height))
    result = perception(model).process(msgspec.structs.replace(frames[0], labels_zlib=blank))
    assert result.points == () and result.canes == ()
