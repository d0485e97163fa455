"""A RealSense made of librealsense's software device and the simulated camera's pictures."""

import io
import threading
import time
import zlib
from typing import Any

import numpy as np
import pyrealsense2 as rs
from numpy.typing import NDArray
from PIL import Image

from bridge.core.attitude import Inertial
from bridge.real.picture_link import INERTIAL_KEY, KEY, Exposure, unpack, unpack_inertial
from bridge.real.realsense import MotionSamples, RealSense
from rolling_panda.messages.robot import Intrinsics
from rolling_panda.transport.zenoh import ForeignWire


class SoftwareDevice:
    """Colour and depth streams of one camera; `wait_for_frames` returns the pictures that were shown."""

    def __init__(self, lens: Intrinsics, rate_hz: int, depth_unit: float) -> None:
        """Streaming, nothing shown yet.

        Args:
            lens: Of both streams.
            rate_hz: Frames a second that it says it has.
            depth_unit: Metres a depth count.
        """
        self._lens, self._rate_hz, self._depth_unit = _intrinsics(lens), rate_hz, depth_unit
        #: Clock of its times: the machine's (s since 1970), or `hardware_clock`, its own.
        self.domain = rs.timestamp_domain.system_time
        # Sensors belong to their device.
        self._device = rs.software_device()
        depth, color = self._device.add_sensor("Depth"), self._device.add_sensor("Color")
        depth_profile = depth.add_video_stream(self._stream(rs.stream.depth, rs.format.z16, 2, 0))
        depth.add_read_only_option(rs.option.depth_units, depth_unit)
        color_profile = color.add_video_stream(self._stream(rs.stream.color, rs.format.rgb8, 3, 1))
        extrinsics = rs.extrinsics()
        extrinsics.rotation, extrinsics.translation = [1, 0, 0, 0, 1, 0, 0, 0, 1], [0, 0, 0]
        depth_profile.register_extrinsics_to(color_profile, extrinsics)
        self._device.create_matcher(rs.matchers.default)
        self._syncer = rs.syncer()
        self._sensors = ((depth, depth_profile), (color, color_profile))
        for sensor, profile in self._sensors:
            sensor.open(profile)
            sensor.start(self._syncer)
        self._number = 0

    def show(self, depth: NDArray[np.uint16], color: NDArray[np.uint8], at: float) -> None:
        """One exposure, at `at` (s, on the clock of `domain`): depth counts (H×W) and colours (H×W×3)."""
        self._number += 1
        images: tuple[NDArray[Any], NDArray[Any]] = (depth, color)
        for (sensor, profile), image in zip(self._sensors, images, strict=True):
            frame = rs.software_video_frame()
            frame.pixels = np.ascontiguousarray(image)
            frame.bpp = image.itemsize * (image.size // depth.size)
            frame.stride = depth.shape[1] * frame.bpp
            frame.timestamp, frame.frame_number = 1e3 * at, self._number
            frame.domain = self.domain
            frame.profile = profile.as_video_stream_profile()
            if image is depth:
                frame.depth_units = self._depth_unit
            sensor.on_video_frame(frame)

    def wait_for_frames(self, timeout_ms: int) -> Any:
        """The next set; raises RuntimeError when none comes in time."""
        return self._syncer.wait_for_frames(timeout_ms)

    def close(self) -> None:
        """Stop both streams."""
        for sensor, _ in self._sensors:
            sensor.stop()
            sensor.close()

    def _stream(self, kind: Any, layout: Any, bytes_per_pixel: int, uid: int) -> Any:
        stream = rs.video_stream()
        stream.type, stream.index, stream.uid, stream.fmt = kind, 0, uid, layout
        stream.width, stream.height = self._lens.width, self._lens.height
        stream.fps, stream.bpp, stream.intrinsics = self._rate_hz, bytes_per_pixel, self._lens
        return stream


class WireFrames:
    """Implements the driver's `Frames` with a software device that is created at the first picture."""

    def __init__(self, wire: ForeignWire, rate_hz: int) -> None:
        """Listen; the wire is closed with the frames."""
        self._wire, self._rate_hz = wire, rate_hz
        self._device: SoftwareDevice | None = None
        self._begun = threading.Event()
        wire.subscribe(KEY, self._on_exposure)

    def wait_for_frames(self, timeout_ms: int) -> Any:
        """The next set; raises RuntimeError when none comes in time."""
        end = time.monotonic() + timeout_ms * 1e-3
        if not self._begun.wait(timeout_ms * 1e-3) or self._device is None:
            raise RuntimeError(f"Frame didn't arrive within {timeout_ms}")
        return self._device.wait_for_frames(max(1, round(1e3 * (end - time.monotonic()))))

    def close(self) -> None:
        """Let go of the wire, and stop."""
        self._wire.close()
        if self._device is not None:
            self._device.close()

    def _on_exposure(self, data: bytes, at: float) -> None:
        exposure = unpack(data)
        if self._device is None:
            self._device = SoftwareDevice(exposure.intrinsics, self._rate_hz, exposure.depth_unit)
            self._begun.set()
        self._device.show(*_images(exposure), exposure.at)


class SoftwareMotion(MotionSamples):
    """Gyroscope and accelerometer of one camera, with samples given by `feel`."""

    def __init__(self) -> None:
        """Streaming, nothing felt yet."""
        super().__init__()
        self._device = rs.software_device()
        self._sensor = self._device.add_sensor("Motion Module")
        self._profiles = [self._stream(rs.stream.gyro, 4), self._stream(rs.stream.accel, 5)]
        self._sensor.open(self._profiles)
        self._sensor.start(self)
        self._number, self._closed = 0, False

    def feel(self, sample: Inertial) -> None:
        """One sample of both."""
        self._number += 1
        for profile, values in zip(self._profiles, (sample.rate, sample.force), strict=True):
            frame, data = rs.software_motion_frame(), rs.vector()
            data.x, data.y, data.z = values.tolist()
            frame.data, frame.profile = data, profile.as_motion_stream_profile()
            frame.timestamp, frame.frame_number = 1e3 * sample.at, self._number
            frame.domain = rs.timestamp_domain.system_time
            self._sensor.on_motion_frame(frame)

    def close(self) -> None:
        """Stop both streams; safe to call twice."""
        if not self._closed:
            self._closed = True
            self._sensor.stop()
            self._sensor.close()

    def _stream(self, kind: Any, uid: int) -> Any:
        stream, scale = rs.motion_stream(), rs.motion_device_intrinsic()
        scale.data = np.eye(3, 4).tolist()
        scale.noise_variances = scale.bias_variances = [0.0] * 3
        stream.type, stream.index, stream.uid, stream.fps = kind, 0, uid, 200
        stream.fmt, stream.intrinsics = rs.format.motion_xyz32f, scale
        return self._sensor.add_motion_stream(stream)


class WireMotion(SoftwareMotion):
    """Implements the driver's `Motion` with samples that come over the wire."""

    def __init__(self, wire: ForeignWire) -> None:
        """Listen; the wire belongs to the frames."""
        super().__init__()
        wire.subscribe(INERTIAL_KEY, lambda data, _: self.feel(unpack_inertial(data)))


def open_fake_realsense(wire: ForeignWire, rate_hz: int, inertial: bool = False) -> RealSense:
    """The camera's own driver on frames, and inertial samples, that come over the wire."""
    motion = WireMotion(wire) if inertial else None
    return RealSense(WireFrames(wire, rate_hz), rs.align(rs.stream.color), motion)


def _images(exposure: Exposure) -> tuple[NDArray[np.uint16], NDArray[np.uint8]]:
    shape = (exposure.intrinsics.height, exposure.intrinsics.width)
    depth = np.frombuffer(zlib.decompress(exposure.depth_zlib), "<u2").reshape(shape)
    return depth.astype(np.uint16), np.asarray(Image.open(io.BytesIO(exposure.color_jpeg)))


def _intrinsics(lens: Intrinsics) -> Any:
    out = rs.intrinsics()
    out.width, out.height = lens.width, lens.height
    out.fx, out.fy, out.ppx, out.ppy = lens.fx, lens.fy, lens.cx, lens.cy
    out.model, out.coeffs = rs.distortion.none, [0.0] * 5
    return out
