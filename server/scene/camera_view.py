"""The eye-in-hand camera in the 3-D view: its frustum with the image, and the point cloud of its depth."""

import io
import math
import zlib
from dataclasses import dataclass

import numpy as np
import viser
from numpy.typing import NDArray
from PIL import Image

from rolling_panda.messages.robot import CameraFrame
from rolling_panda.model.differential_drive import Array

#: Approximate number of points that are drawn, and their largest depth (m).
_POINTS, _MAX_DEPTH = 8000, 2.5
_MIN_STRIDE = 2
#: Width of the image in the frustum (px), and its distance from the camera (m).
_IMAGE_WIDTH, _FRUSTUM_SCALE = 200, 0.16
_FRUSTUM, _CLOUD = "/camera", "/cloud"


@dataclass(frozen=True)
class DecodedFrame:
    """A frame, ready to be drawn: image (H×W×3), points (n×3, m) and colours (n×3) in the camera's frame."""

    image: NDArray[np.uint8]
    fov: float
    points: NDArray[np.float32]
    colors: NDArray[np.uint8]


def decode_frame(frame: CameraFrame) -> DecodedFrame | None:
    """Decode a frame, its depth sampled evenly to some thousand points; None where it cannot be decoded."""
    lens = frame.intrinsics
    try:
        picture = Image.open(io.BytesIO(frame.color_jpeg)).convert("RGB")
        # At most a depth image of this size: a few bytes can decompress to gigabytes.
        raw = zlib.decompressobj().decompress(frame.depth_zlib, 2 * lens.width * lens.height)
        depth = np.frombuffer(raw, dtype="<u2").reshape(lens.height, lens.width)
    except (OSError, ValueError, zlib.error, Image.DecompressionBombError):
        return None
    stride = max(_MIN_STRIDE, math.ceil(math.sqrt(lens.width * lens.height / _POINTS)))
    v, u = np.mgrid[stride // 2 : lens.height : stride, stride // 2 : lens.width : stride]
    z = depth[v, u] * frame.depth_unit
    valid = (z > 0.0) & (z < _MAX_DEPTH)
    u, v, z = u[valid], v[valid], z[valid]
    points = np.stack([(u - lens.cx) / lens.fx * z, (v - lens.cy) / lens.fy * z, z], axis=1)
    colors = np.asarray(picture.resize((lens.width, lens.height)))[v, u]
    small = picture.resize((_IMAGE_WIDTH, round(_IMAGE_WIDTH * lens.height / lens.width)))
    fov = 2.0 * math.atan2(0.5 * lens.height, lens.fy)
    return DecodedFrame(np.asarray(small), fov, points.astype(np.float32), colors)


def draw_frustum(client: viser.ClientHandle, frame: DecodedFrame, wxyz: Array, position: Array) -> None:
    """Draw in one view the camera's frustum with its image; pose of the camera in map."""
    height, width = frame.image.shape[:2]
    client.scene.add_camera_frustum(
        _FRUSTUM,
        fov=frame.fov,
        aspect=width / height,
        scale=_FRUSTUM_SCALE,
        thickness=2.0,
        thickness_units="screen",
        color=(130, 188, 248),
        image=frame.image,
        format="jpeg",
        jpeg_quality=70,
        wxyz=wxyz,
        position=position,
        cast_shadow=False,
        receive_shadow=False,
    )


def draw_point_cloud(client: viser.ClientHandle, frame: DecodedFrame, wxyz: Array, position: Array) -> None:
    """Draw in one view the points of the depth, in the camera's own frame, where half precision is enough."""
    client.scene.add_point_cloud(
        _CLOUD, frame.points, frame.colors, point_size=0.006, point_shape="square", wxyz=wxyz, position=position
    )


def remove_camera_view(client: viser.ClientHandle, cloud: bool, frustum: bool) -> None:
    """Remove either from one view."""
    for wanted, name in ((cloud, _CLOUD), (frustum, _FRUSTUM)):
        if wanted and client.scene.get_handle_by_name(name) is not None:
            client.scene.remove_by_name(name)
