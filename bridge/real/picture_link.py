"""Transfer of the simulated camera's pictures to the camera's driver."""

import msgspec

from bridge.core.picture import Picture
from rolling_panda.messages.robot import Intrinsics

#: Key of the pictures.
KEY = "fake-camera/exposure"


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
