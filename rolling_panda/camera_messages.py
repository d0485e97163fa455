"""What the eye-in-hand camera tells: RGB-D frames with the posture they were taken at."""

from typing import Annotated

from msgspec import Meta, Struct

from rolling_panda.messages import Actuated, Count, Finite, Header, Message, NonNegative, PlanarPose


class Intrinsics(Struct, frozen=True, forbid_unknown_fields=True):
    """Pinhole camera: image size (px), focal lengths and principal point (px)."""

    width: Annotated[int, Meta(ge=1, le=4096)]
    height: Annotated[int, Meta(ge=1, le=4096)]
    fx: NonNegative
    fy: NonNegative
    cx: Finite
    cy: Finite


class CameraFrame(Message, frozen=True, kw_only=True):
    """Bridge → perception and server: one RGB-D frame with the robot's measured posture when it was taken.

    Attributes:
        header: `frame_id` is camera: z forward, x right, y down.
        sequence: Strictly increasing.
        intrinsics: Of all images in the frame.
        base: Measured base_link in odom at exposure.
        position: Measured actuated coordinates at exposure (rad).
        color_jpeg: H×W×3, JPEG.
        depth_zlib: H×W uint16 little-endian, row-major, zlib; in units of `depth_unit`; 0 = no return.
        depth_unit: Metres a count.
        labels_zlib: H×W uint8 class indices (`WOOD_CLASSES`), zlib. Empty without a label camera (a real robot).
        point_id: What the controller asked to look at; empty in a picture that nobody asked for.
        number: Of that request.
    """

    header: Header
    sequence: Count
    intrinsics: Intrinsics
    base: PlanarPose
    position: Actuated
    color_jpeg: bytes
    depth_zlib: bytes
    depth_unit: Annotated[float, Meta(gt=0.0, le=0.01)]
    labels_zlib: bytes = b""
    point_id: Annotated[str, Meta(max_length=64)] = ""
    number: Count = 0
