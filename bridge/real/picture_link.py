"""Transfer of the simulated camera's pictures and inertial samples to the camera's driver."""

import msgspec
import numpy as np

from bridge.core.attitude import Inertial
from bridge.core.picture import Picture
from rolling_panda.messages.robot import Intrinsics

#: Keys of the pictures, and of the inertial samples.
KEY, INERTIAL_KEY = "fake-camera/exposure", "fake-camera/inertial"


class Exposure(msgspec.Struct, frozen=True):
    """Colour (JPEG) and depth (zlib, uint16, in `depth_unit` metres), exposed at `at` (s since 1970)."""

    at: float
    intrinsics: Intrinsics
    color_jpeg: bytes
    depth_zlib: bytes
    depth_unit: float


def pack(picture: Picture, at: float) -> bytes:
    """An exposure on the wire; labels, which no real camera has, are left out."""
    exposure = Exposure(at, picture.intrinsics, picture.color_jpeg, picture.depth_zlib, picture.depth_unit)
    return msgspec.msgpack.encode(exposure)


def unpack(data: bytes) -> Exposure:
    """The exposure that `pack` has packed."""
    return msgspec.msgpack.decode(data, type=Exposure)


def pack_inertial(sample: Inertial) -> bytes:
    """A sample on the wire: time, angular velocity and specific force, 7 numbers."""
    return np.concatenate([[sample.at], sample.rate, sample.force]).astype("<f8").tobytes()


def unpack_inertial(data: bytes) -> Inertial:
    """The sample that `pack_inertial` has packed."""
    values = np.frombuffer(data, "<f8", 7)
    return Inertial(float(values[0]), values[1:4].copy(), values[4:].copy())
