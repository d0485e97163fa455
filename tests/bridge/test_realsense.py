# ruff: noqa: E402
"""The camera's driver with librealsense's own software device in place of the camera."""

import io
import time
import zlib
from collections.abc import Callable, Iterator

import numpy as np
import pytest
from PIL import Image

from tests.support.extras import need

need("real")

import pyrealsense2 as rs

from bridge.core.attitude import Inertial
from bridge.core.picture import DEPTH_UNIT, Picture
from bridge.real.config import CameraConfig
from bridge.real.picture_link import INERTIAL_KEY, pack_inertial
from bridge.real.realsense import (
    RealSense,
    open_realsense,
)
from bridge.real.software_realsense import SoftwareDevice, SoftwareMotion, WireMotion
from rolling_panda.errors import InputError
from rolling_panda.messages.robot import Intrinsics

WIDTH, HEIGHT = 64, 48


class SoftwareCamera(SoftwareDevice):
    """Looks at a wall that a test puts up."""

    def __init__(self) -> None:
        super().__init__(Intrinsics(WIDTH, HEIGHT, 40.0, 41.0, 32.0, 24.0), 30, 0.001)

    def wall(self, millimetres: int, red: int, at: float | None = None) -> None:
        """One exposure of it; the camera tells `at` (s) as its time, or now."""
        color = np.full((HEIGHT, WIDTH, 3), (red, 10, 20), np.uint8)
        self.show(np.full((HEIGHT, WIDTH), millimetres, np.uint16), color, time.time() if at is None else at)


@pytest.fixture
def device() -> SoftwareCamera:
    return SoftwareCamera()


@pytest.fixture
def camera(device: SoftwareCamera) -> Iterator[RealSense]:
    camera = RealSense(device, rs.align(rs.stream.color))
    yield camera
    camera.close()


def until(show: Callable[[], None], camera: RealSense, limit_s: float = 5.0) -> Picture:
    end = time.monotonic() + limit_s
    while True:
        show()
        time.sleep(0.02)
        picture = camera.capture(False)
        if picture is not None:
            return picture
        assert time.monotonic() < end, "no picture"


def test_a_picture_is_taken_when_asked_for_and_no_other(camera: RealSense, device: SoftwareCamera) -> None:
    for _ in range(5):
        device.wall(500, 200)
        time.sleep(0.02)
        assert camera.capture(False) is None
    camera.capture(True)
    picture = until(lambda: device.wall(800, 220), camera)
    assert (picture.intrinsics.width, picture.intrinsics.height) == (WIDTH, HEIGHT)
    assert (picture.intrinsics.fx, picture.intrinsics.fy) == pytest.approx((40.0, 41.0))
    counts = np.frombuffer(zlib.decompress(picture.depth_zlib), "<u2").reshape(HEIGHT, WIDTH)
    assert np.median(counts) * DEPTH_UNIT == pytest.approx(0.8, abs=0.001)
    color = np.asarray(Image.open(io.BytesIO(picture.color_jpeg)))
    assert color.shape == (HEIGHT, WIDTH, 3)
    assert abs(int(color[20, 20, 0]) - 220) < 12, "red and blue are swapped"
    assert picture.labels_zlib == b""
    device.wall(800, 220)
    time.sleep(0.1)
    assert camera.capture(False) is None, "one picture for one request"


class NumberedWalls:
    """Shows the camera walls, each a millimetre farther than the last, and knows when."""

    def __init__(self, device: SoftwareCamera, ahead_s: float = 0.0) -> None:
        """The camera's times are ahead of the Unix time by so much (s)."""
        self._device, self._ahead_s = device, ahead_s
        self._shown: list[float] = []

    def __call__(self) -> None:
        self._shown.append(time.monotonic())
        self._device.wall(499 + len(self._shown), 200, time.time() + self._ahead_s)

    def exposed(self, picture: Picture) -> float:
        """When the picture was shown (s, monotonic)."""
        counts = np.frombuffer(zlib.decompress(picture.depth_zlib), "<u2")
        return self._shown[round(1e3 * DEPTH_UNIT * float(np.median(counts))) - 500]


@pytest.mark.parametrize("domain", [rs.timestamp_domain.system_time, rs.timestamp_domain.global_time])
def test_a_picture_tells_when_it_was_exposed_on_the_clock_of_the_machine(
    camera: RealSense, device: SoftwareCamera, domain: rs.timestamp_domain
) -> None:
    device.domain = domain
    # Exposed in the future, which nothing else that could be taken for its time is.
    walls = NumberedWalls(device, 7.0)
    camera.capture(True)
    picture = until(walls, camera)
    assert picture.taken_at == pytest.approx(walls.exposed(picture) + 7.0, abs=0.01)


def test_a_picture_from_before_the_request_is_not_the_one_that_is_asked_for(
    camera: RealSense, device: SoftwareCamera
) -> None:
    camera.capture(True)
    early, walls, end = NumberedWalls(device, -1.0), NumberedWalls(device), time.monotonic() + 5.0
    while camera.taken < 3:
        assert time.monotonic() < end, "no picture"
        early()
        time.sleep(0.02)
        assert camera.capture(False) is None
    asked = time.monotonic()
    taken_at = until(walls, camera).taken_at
    assert taken_at is not None and taken_at >= asked - 0.01


def test_a_picture_that_has_its_time_by_the_cameras_own_clock_alone_tells_none(
    camera: RealSense, device: SoftwareCamera
) -> None:
    device.domain = rs.timestamp_domain.hardware_clock
    camera.capture(True)
    # Long ago by any other clock.
    assert until(NumberedWalls(device, -1e6), camera).taken_at is None


class HeldUp:
    """The clocks for a thread that is held up around two of three readings of the Unix time."""

    def __init__(self, before_s: float, after_s: float) -> None:
        self._readings, self._before_s, self._after_s = 0, before_s, after_s

    def monotonic(self) -> float:
        return time.monotonic()

    def time(self) -> float:
        held = self._readings % 3 < 2
        self._readings += 1
        time.sleep(self._before_s * held)
        now = time.time()
        time.sleep(self._after_s * held)
        return now


@pytest.mark.parametrize(("before_s", "after_s"), [(0.2, 0.0), (0.0, 0.2)])
def test_a_thread_that_is_held_up_between_its_readings_of_the_clocks_makes_no_picture_older_or_younger(
    camera: RealSense, device: SoftwareCamera, monkeypatch: pytest.MonkeyPatch, before_s: float, after_s: float
) -> None:
    monkeypatch.setattr("bridge.real.realsense.time", HeldUp(before_s, after_s))
    walls = NumberedWalls(device, 7.0)
    camera.capture(True)
    picture = until(walls, camera, 15.0)
    assert picture.taken_at == pytest.approx(walls.exposed(picture) + 7.0, abs=0.01)


def test_the_newest_of_both_inertial_sensors_is_told_while_it_is_fresh(device: SoftwareCamera) -> None:
    motion = SoftwareMotion()
    camera = RealSense(device, rs.align(rs.stream.color), motion)
    assert camera.inertial() is None
    motion.feel(Inertial(1.0, np.array([0.1, -0.2, 0.3]), np.array([0.0, -9.81, 0.5])))
    told = camera.inertial()
    assert told is not None
    assert told.rate == pytest.approx([0.1, -0.2, 0.3]) and told.force == pytest.approx([0.0, -9.81, 0.5])
    motion.feel(Inertial(1.005, np.array([0.4, 0.0, 0.0]), np.array([0.0, -9.8, 0.0])))
    newer = camera.inertial()
    assert newer is not None and newer.rate == pytest.approx([0.4, 0.0, 0.0])
    for k in range(1, 5):
        motion.feel(Inertial(1.005 + 0.005 * k, np.array([0.1 + (-1.0) ** k, 0.0, 0.0]), np.array([0.0, -9.8, 0.0])))
    shaken = camera.inertial()
    assert shaken is not None and shaken.at == pytest.approx(1.025)
    assert shaken.rate == pytest.approx([0.1, 0.0, 0.0]), "what shakes does not turn"
    assert camera.inertial() is shaken
    time.sleep(0.1)
    assert camera.inertial() is None, "a camera that has fallen silent does not go on turning"
    camera.close()


def test_samples_come_over_the_wire_as_they_were_sent() -> None:
    heard: dict[str, Callable[[bytes, float], None]] = {}

    class Wire:
        def subscribe(self, key: str, callback: Callable[[bytes, float], None]) -> None:
            heard[key] = callback

    motion = WireMotion(Wire())  # type: ignore[arg-type]
    heard[INERTIAL_KEY](pack_inertial(Inertial(3.25, np.array([0.5, -0.25, 2.0]), np.array([1.0, -9.5, 0.125]))), 0.0)
    told = motion.newest()
    motion.close()
    assert told is not None
    assert (
        told.at == pytest.approx(3.25)
        and told.rate.tolist() == [0.5, -0.25, 2.0]
        and told.force.tolist() == [1.0, -9.5, 0.125]
    )


def test_a_camera_whose_inertial_sensors_are_not_read_tells_none(camera: RealSense) -> None:
    assert camera.inertial() is None


def test_without_a_camera_it_says_what_to_check() -> None:
    with pytest.raises(InputError, match="no RealSense camera 123.*cable"):
        open_realsense(CameraConfig(serial="123"))
