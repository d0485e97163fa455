"""A frame that is not what it should be is refused or left without points, and says why; it never makes a point."""

import io
import zlib

import msgspec
import numpy as np
import pytest
from PIL import Image

from bridge.sim.camera.config import CameraConfig
from bridge.sim.camera.frame import survey_frame
from bridge.sim.camera.renderer import Camera
from bridge.sim.vineyard.config import VineyardConfig
from bridge.sim.vineyard.grow import grow
from perception.config import CloseUpConfig, PerceptionConfig
from perception.pipeline import Perception
from perception.segmentation.frame import CorruptFrameError
from perception.segmentation.segmenter import choose_segmenter
from rolling_panda.messages.robot import CameraFrame
from rolling_panda.model.robot import RobotModel

#: So many of the same frame show a point where the frame is good.
AGAIN = 4
REFUSED = (
    "picture of another size",
    "picture that is none",
    "depth of another size",
    "depth cut short",
    "depth unit that is no number",
    "depth unit in millimetres",
)
WRONG_DEPTH = (
    "no depth at all",
    "depth of nothing but the farthest",
    "noise for depth",
    "depth ten times too near",
    "depth ten times too far",
)


@pytest.fixture(scope="module")
def model() -> RobotModel:
    return RobotModel()


@pytest.fixture(scope="module")
def good(model: RobotModel) -> CameraFrame:
    camera = Camera(CameraConfig(), 1)
    return survey_frame(camera, grow(VineyardConfig(), 1), model, 0)


def perception(model: RobotModel, name: str) -> Perception:
    return Perception(PerceptionConfig(), choose_segmenter(name, threads=1), model)


def jpeg(grey: int, height: int, width: int) -> bytes:
    data = io.BytesIO()
    Image.fromarray(np.full((height, width, 3), grey, np.uint8)).save(data, "JPEG")
    return data.getvalue()


def bad(good: CameraFrame, what: str) -> CameraFrame:
    k = good.intrinsics
    counts = np.frombuffer(zlib.decompress(good.depth_zlib), "<u2")
    noise = np.random.default_rng(0).integers(0, 2**16, counts.size).astype("<u2")
    changes: dict[str, dict[str, bytes | float]] = {
        "black picture": {"color_jpeg": jpeg(0, k.height, k.width)},
        "even picture": {"color_jpeg": jpeg(128, k.height, k.width)},
        "picture of another size": {"color_jpeg": jpeg(128, 100, 200)},
        "picture that is none": {"color_jpeg": b"not a picture"},
        "no depth at all": {"depth_zlib": zlib.compress(bytes(2 * counts.size))},
        "depth of nothing but the farthest": {"depth_zlib": zlib.compress(b"\xff" * (2 * counts.size))},
        "noise for depth": {"depth_zlib": zlib.compress(noise.tobytes())},
        "depth of another size": {"depth_zlib": zlib.compress(counts[:-1].tobytes())},
        "depth cut short": {"depth_zlib": good.depth_zlib[: len(good.depth_zlib) // 2]},
        "depth ten times too near": {"depth_unit": 0.1 * good.depth_unit},
        "depth ten times too far": {"depth_unit": 10 * good.depth_unit},
        "depth unit that is no number": {"depth_unit": float("nan")},
        "depth unit in millimetres": {"depth_unit": 1.0},
    }
    return msgspec.structs.replace(good, **changes[what])


@pytest.mark.long
@pytest.mark.parametrize("name", ["network", "labels"])
def test_the_same_frame_makes_points_where_it_is_good(model: RobotModel, good: CameraFrame, name: str) -> None:
    seen = perception(model, name)
    assert [bool(seen.process(good).points) for _ in range(AGAIN)][-1]


@pytest.mark.parametrize("what", REFUSED)
def test_what_cannot_be_a_frame_is_refused(model: RobotModel, good: CameraFrame, what: str) -> None:
    with pytest.raises(CorruptFrameError):
        perception(model, "network").process(bad(good, what))


@pytest.mark.parametrize(
    ("what", "name"),
    [(what, "network") for what in ("black picture", "even picture")]
    + [(what, name) for what in WRONG_DEPTH for name in ("network", "labels")],
)
def test_what_shows_nothing_makes_no_point_and_says_why(
    model: RobotModel, good: CameraFrame, what: str, name: str
) -> None:
    seen = perception(model, name)
    for _ in range(AGAIN):
        told = seen.process(bad(good, what))
    assert told.points == ()
    assert told.undecided_sites and all(each.reason for each in told.undecided_sites)


@pytest.fixture(scope="module")
def shown(model: RobotModel, good: CameraFrame) -> Perception:
    """Perception that shows points of the good frame, and looks closely from as far away as that was taken."""
    config = PerceptionConfig(close_up=CloseUpConfig(max_distance=1.2))
    seen = Perception(config, choose_segmenter("labels", threads=1), model)
    for _ in range(AGAIN):
        seen.process(good)
    return seen


def test_a_closer_look_at_the_good_frame_sees_points(shown: Perception, good: CameraFrame) -> None:
    looks = [
        shown.check_close_up(msgspec.structs.replace(good, point_id=point.point_id)) for point in shown.points().points
    ]
    assert [look.finding for look in looks].count("seen") >= 2


@pytest.mark.long
@pytest.mark.parametrize("what", (*REFUSED, *WRONG_DEPTH))
def test_a_closer_look_at_what_shows_nothing_neither_places_a_point_nor_calls_it_cut(
    shown: Perception, good: CameraFrame, what: str
) -> None:
    points = shown.points().points
    assert points
    for point in points:
        frame = msgspec.structs.replace(bad(good, what), point_id=point.point_id)
        if what in REFUSED:
            with pytest.raises(CorruptFrameError):
                shown.check_close_up(frame)
            continue
        look = shown.check_close_up(frame)
        assert look.finding in ("unseen", "changed") and look.reason and look.position is None
    assert shown.points().points == points
