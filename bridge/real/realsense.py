"""The RealSense camera on the hand: pictures on demand, from a thread that reads the stream, and inertial samples."""

import math
import threading
import time
from collections import deque
from dataclasses import replace
from typing import Any, Protocol

import numpy as np

from bridge.core.attitude import Inertial
from bridge.core.picture import Picture, encode_picture
from bridge.real.config import CameraConfig
from rolling_panda.errors import InputError
from rolling_panda.messages.robot import Intrinsics
from rolling_panda.model.differential_drive import Array

_WAIT_MS = 1000
#: Samples of the inertial sensors come every 5 ms; older than this they tell nothing of now (s). So many are kept.
_FRESH_S, _MOST = 0.05, 40
#: Both clocks are read so often at most, until the readings are this near to each other (s).
_READINGS, _NARROW_S = 5, 20e-6


class Frames(Protocol):
    """Source of pairs of a colour and a depth frame: librealsense's pipeline, or its syncer in a test."""

    def wait_for_frames(self, timeout_ms: int) -> Any:
        """The next set; raises RuntimeError when none comes in time."""

    def close(self) -> None:
        """Stop the stream."""


#: A sample of one sensor: when it came, its time (s) and values (3).
Sample = tuple[float, float, Array]


class Motion(Protocol):
    """Stream of a gyroscope and an accelerometer."""

    def newest(self) -> Inertial | None:
        """The newest sample; None before the first one of both, and where none has come for a while."""

    def close(self) -> None:
        """Stop the stream."""


class MotionSamples:
    """Samples of each sensor since they were read last; librealsense's threads call it with each."""

    def __init__(self) -> None:
        """None yet."""
        self._came = {name: deque[Sample](maxlen=_MOST) for name in ("gyro", "accel")}
        self._told: Inertial | None = None
        self._told_at = -math.inf

    def __call__(self, frame: Any) -> None:
        """Take in a frame."""
        if not frame.is_motion_frame():
            return
        told = frame.as_motion_frame().get_motion_data()
        values, at = np.array([told.x, told.y, told.z]), 1e-3 * float(frame.get_timestamp())
        self._came[frame.get_profile().stream_type().name].append((time.monotonic(), at, values))

    def newest(self) -> Inertial | None:
        """As of `Motion`: the means of the samples since it was called last."""
        gyroscope, accelerometer = self._came["gyro"], self._came["accel"]
        if gyroscope and accelerometer:
            (turned, at, rate), (felt, _, force) = _mean(gyroscope), _mean(accelerometer)
            self._told, self._told_at = Inertial(at, rate, force), min(turned, felt)
        return self._told if time.monotonic() - self._told_at <= _FRESH_S else None


def _mean(came: deque[Sample]) -> Sample:
    """The mean of the values of samples, which it takes away, with the times of the last one."""
    samples = [came.popleft() for _ in range(len(came))]
    return *samples[-1][:2], np.mean([values for _, _, values in samples], axis=0)


class RealSense:
    """Implements the camera's part of the robot. `capture` returns at once."""

    def __init__(self, frames: Frames, align: Any, motion: Motion | None = None) -> None:
        """Begin to take frames.

        Args:
            frames: Open stream; closed with the camera.
            align: librealsense's filter that puts depth into the colour image.
            motion: Open stream of inertial samples; closed with the camera. None where they are not used.
        """
        self._frames, self._align, self._motion = frames, align, motion
        self._asked, self._closing = threading.Event(), threading.Event()
        self._asked_at = 0.0
        self._ready: Picture | None = None
        self.taken = 0
        self._thread = threading.Thread(target=self._run, name="realsense", daemon=True)
        self._thread.start()

    def capture(self, expose: bool) -> Picture | None:
        """Take the next frame if `expose` is set; returns a picture that has become ready, each once."""
        if expose:
            self._asked_at = time.monotonic()
            self._asked.set()
        picture, self._ready = self._ready, None
        return picture

    def inertial(self) -> Inertial | None:
        """The newest sample of the inertial sensors."""
        return None if self._motion is None else self._motion.newest()

    def close(self) -> None:
        """Stop; safe to call twice."""
        if not self._closing.is_set():
            self._closing.set()
            self._thread.join()
            self._frames.close()
            if self._motion is not None:
                self._motion.close()

    def _run(self) -> None:
        while not self._closing.is_set():
            try:
                frames = self._frames.wait_for_frames(_WAIT_MS)
                depth, color = frames.get_depth_frame(), frames.get_color_frame()
                if not (depth and color):
                    continue
                self.taken += 1
                taken_at = _taken_at(color)
                # A frame from before the request shows an earlier pose of the robot, or the cane before the cut.
                if self._asked.is_set() and (taken_at is None or taken_at >= self._asked_at):
                    self._asked.clear()
                    self._ready = replace(self._picture(frames), taken_at=taken_at)
            except RuntimeError:
                # librealsense reports a missing frame and a disconnected cable like this; who waits sees no picture.
                continue

    def _picture(self, frames: Any) -> Picture:
        aligned = self._align.process(frames)
        depth, color = aligned.get_depth_frame(), aligned.get_color_frame()
        lens = color.get_profile().as_video_stream_profile().get_intrinsics()
        return encode_picture(
            Intrinsics(lens.width, lens.height, lens.fx, lens.fy, lens.ppx, lens.ppy),
            np.asanyarray(color.get_data()),
            np.asanyarray(depth.get_data()).astype(np.float32) * np.float32(depth.get_units()),
            None,
        )


def _taken_at(frame: Any) -> float | None:
    """Time of exposure on the machine's monotonic clock (s); None if only the camera's clock is known."""
    if frame.get_frame_timestamp_domain().name == "hardware_clock":
        return None
    return 1e-3 * float(frame.get_timestamp()) - _unix_ahead()


def _unix_ahead() -> float:
    """By how much the Unix time is ahead of the monotonic clock (s).

    The Unix time is read between two readings of the monotonic clock. A thread can be held up between readings, so the
    nearest two of a few pairs count. The error is at most half of their distance.
    """
    narrowest, ahead = math.inf, 0.0
    for _ in range(_READINGS):
        before, unix, after = time.monotonic(), time.time(), time.monotonic()
        if after - before < narrowest:
            narrowest, ahead = after - before, unix - 0.5 * (before + after)
        if narrowest <= _NARROW_S:
            break
    return ahead


class _Pipeline:
    def __init__(self, pipeline: Any) -> None:
        self._pipeline = pipeline

    def wait_for_frames(self, timeout_ms: int) -> Any:
        return self._pipeline.wait_for_frames(timeout_ms)

    def close(self) -> None:
        self._pipeline.stop()


class _MotionPipeline(MotionSamples):
    """A pipeline of its own: that of the pictures waits for a picture with each sample."""

    def __init__(self, rs: Any, serial: str) -> None:
        super().__init__()
        self._pipeline, settings = rs.pipeline(), rs.config()
        if serial:
            settings.enable_device(serial)
        settings.enable_stream(rs.stream.gyro)
        settings.enable_stream(rs.stream.accel)
        self._pipeline.start(settings, self)

    def close(self) -> None:
        self._pipeline.stop()


def open_realsense(config: CameraConfig, inertial: bool = False) -> RealSense:
    """The camera with the configured serial number, or the only one there is.

    Args:
        config: Which camera, and its pictures.
        inertial: Whether its gyroscope and accelerometer are read too.

    Raises:
        InputError: The driver is not installed, there is no such camera, or it has no inertial sensors.
    """
    try:
        import pyrealsense2 as rs
    except ImportError as error:
        raise InputError("the camera's driver is not installed; run: pip install 'rolling-panda[real]'") from error
    # The pipeline would wait 15 s for a camera to be plugged in.
    present = [device.get_info(rs.camera_info.serial_number) for device in rs.context().query_devices()]
    if not present or (config.serial and config.serial not in present):
        there = f"; there are {', '.join(present)}" if present else ""
        raise InputError(f"no RealSense camera {config.serial or 'at all'}{there}; check its USB 3 cable and its power")
    pipeline, settings = rs.pipeline(), rs.config()
    if config.serial:
        settings.enable_device(config.serial)
    settings.enable_stream(rs.stream.depth, config.width, config.height, rs.format.z16, config.rate_hz)
    settings.enable_stream(rs.stream.color, config.width, config.height, rs.format.rgb8, config.rate_hz)
    try:
        pipeline.start(settings)
    except RuntimeError as error:
        raise InputError(f"the RealSense camera does not stream: {error}; check its USB 3 cable") from error
    try:
        motion = _MotionPipeline(rs, config.serial) if inertial else None
    except RuntimeError as error:
        pipeline.stop()
        raise InputError(
            f"the RealSense camera tells no motion: {error}; only models with an i, such as the D435i, have inertial "
            "sensors: with another one set [bridge] inertial = false"
        ) from error
    return RealSense(_Pipeline(pipeline), rs.align(rs.stream.color), motion)
