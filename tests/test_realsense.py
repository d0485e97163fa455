"""The camera's driver with librealsense's own software device in place of the camera."""

import io
import time
import zlib
from collections.abc import Callable, Iterator

import numpy as np
import pytest
from PIL import Image

rs = pytest.importorskip("pyrealsense2", reason="the extra `real` is not installed: pip install '.[real]'")

from bridge.picture import DEPTH_UNIT, Picture  # noqa: E402
from bridge.real.config import CameraConfig  # noqa: E402
from bridge.real.realsense import RealSense, open_realsense  # noqa: E402
from rolling_panda.errors import InputError  # noqa: E402

WIDTH, HEIGHT = 64, 48


class SoftwareCamera:
    """Colour and depth streams that a test feeds."""

    def __init__(self) -> None:
        self.device = rs.software_device()
        self.lens = self._lens()
        self.depth = self.device.add_sensor("Depth")
        depth_profile = self.depth.add_video_stream(self._stream(rs.stream.depth, rs.format.z16, 2, 0))
        self.depth.add_read_only_option(rs.option.depth_units, 0.001)
        self.color = self.device.add_sensor("Color")
        color_profile = self.color.add_video_stream(self._stream(rs.stream.color, rs.format.rgb8, 3, 1))
        extrinsics = rs.extrinsics()
        extrinsics.rotation, extrinsics.translation = [1, 0, 0, 0, 1, 0, 0, 0, 1], [0, 0, 0]
        depth_profile.register_extrinsics_to(color_profile, extrinsics)
        self.device.create_matcher(rs.matchers.default)
        self.syncer = rs.syncer()
        for sensor, profile in ((self.depth, depth_profile), (self.color, color_profile)):
            sensor.open(profile)
            sensor.start(self.syncer)
        self.profiles = depth_profile, color_profile
        self.number = 0

    def wait_for_frames(self, timeout_ms: int) -> object:
        return self.syncer.wait_for_frames(timeout_ms)

    def show(self, millimetres: int, red: int) -> None:
        """One exposure of a wall."""
        self.number += 1
        stamp = self.number * 33.0
        for sensor, profile, image in (
            (self.depth, self.profiles[0], np.full((HEIGHT, WIDTH), millimetres, np.uint16)),
            (self.color, self.profiles[1], np.full((HEIGHT, WIDTH, 3), (red, 10, 20), np.uint8)),
        ):
            frame = rs.software_video_frame()
            frame.pixels = np.ascontiguousarray(image)
            frame.bpp = image.itemsize * (image.size // (WIDTH * HEIGHT))
            frame.stride = WIDTH * frame.bpp
            frame.timestamp, frame.frame_number = stamp, self.number
            frame.domain = rs.timestamp_domain.hardware_clock
            frame.profile = profile.as_video_stream_profile()
            if sensor is self.depth:
                frame.depth_units = 0.001
            sensor.on_video_frame(frame)

    def close(self) -> None:
        for sensor in (self.depth, self.color):
            sensor.stop()
            sensor.close()

    def _lens(self) -> object:
        lens = rs.intrinsics()
        lens.width, lens.height, lens.fx, lens.fy, lens.ppx, lens.ppy = WIDTH, HEIGHT, 40.0, 41.0, 32.0, 24.0
        lens.model, lens.coeffs = rs.distortion.none, [0.0] * 5
        return lens

    def _stream(self, kind: object, layout: object, bytes_per_pixel: int, uid: int) -> object:
        stream = rs.video_stream()
        stream.type, stream.index, stream.uid, stream.fmt = kind, 0, uid, layout
        stream.width, stream.height, stream.fps, stream.bpp = WIDTH, HEIGHT, 30, bytes_per_pixel
        stream.intrinsics = self.lens
        return stream


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
        device.show(500, 200)
        time.sleep(0.02)
        assert camera.capture(False) is None
    camera.capture(True)
    picture = until(lambda: device.show(800, 220), camera)
    assert (picture.intrinsics.width, picture.intrinsics.height) == (WIDTH, HEIGHT)
    assert (picture.intrinsics.fx, picture.intrinsics.fy) == pytest.approx((40.0, 41.0))
    counts = np.frombuffer(zlib.decompress(picture.depth_zlib), "<u2").reshape(HEIGHT, WIDTH)
    assert np.median(counts) * DEPTH_UNIT == pytest.approx(0.8, abs=0.001)
    color = np.asarray(Image.open(io.BytesIO(picture.color_jpeg)))
    assert color.shape == (HEIGHT, WIDTH, 3)
    assert abs(int(color[20, 20, 0]) - 220) < 12, "red and blue are swapped"
    assert picture.labels_zlib == b""
    device.show(800, 220)
    time.sleep(0.1)
    assert camera.capture(False) is None, "one picture for one request"


def test_a_camera_that_falls_silent_says_so(camera: RealSense, device: SoftwareCamera) -> None:
    device.show(500, 200)
    time.sleep(0.1)
    assert camera.fault == ""
    time.sleep(2.2)
    assert "no frame for 2 s" in camera.fault


def test_without_a_camera_it_says_what_to_check() -> None:
    with pytest.raises(InputError, match="no RealSense camera 123.*cable"):
        open_realsense(CameraConfig(serial="123"))
