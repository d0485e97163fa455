"""What the camera on the hand sees, in the 3-D view: where it looks from, its image, and the points of its depth."""

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

#: About so many points of a frame are drawn, none of them farther away than this (m).
_POINTS, _FARTHEST = 8000, 2.5
#: Width of the image in the frustum (px), and how far in front of the camera it is drawn (m).
_WIDTH, _AHEAD = 200, 0.16
_FRUSTUM, _CLOUD = "/camera", "/cloud"
_EVERY = 2


@dataclass(frozen=True)
class Sight:
    """One frame, ready to be drawn: its image (H×W×3), and points (n×3, m) with colours (n×3) in the camera's frame."""

    image: NDArray[np.uint8]
    fov: float
    points: NDArray[np.float32]
    colors: NDArray[np.uint8]


def sight_of(frame: CameraFrame) -> Sight | None:
    """Decode a frame; its depth thinned evenly to some thousand points. None where it cannot be decoded."""
    lens = frame.intrinsics
    try:
        picture = Image.open(io.BytesIO(frame.color_jpeg)).convert("RGB")
        # No more than a depth image of this size: a short text can unfold to gigabytes.
        unfolded = zlib.decompressobj().decompress(frame.depth_zlib, 2 * lens.width * lens.height)
        depth = np.frombuffer(unfolded, dtype="<u2").reshape(lens.height, lens.width)
    except (OSError, ValueError, zlib.error, Image.DecompressionBombError):
        return None
    every = max(_EVERY, math.ceil(math.sqrt(lens.width * lens.height / _POINTS)))
    v, u = np.mgrid[every // 2 : lens.height : every, every // 2 : lens.width : every]
    z = depth[v, u] * frame.depth_unit
    seen = (z > 0.0) & (z < _FARTHEST)
    u, v, z = u[seen], v[seen], z[seen]
    points = np.stack([(u - lens.cx) / lens.fx * z, (v - lens.cy) / lens.fy * z, z], axis=1)
    colors = np.asarray(picture.resize((lens.width, lens.height)))[v, u]
    small = picture.resize((_WIDTH, round(_WIDTH * lens.height / lens.width)))
    fov = 2.0 * math.atan2(0.5 * lens.height, lens.fy)
    return Sight(np.asarray(small), fov, points.astype(np.float32), colors)


def draw_frustum(client: viser.ClientHandle, sight: Sight, wxyz: Array, position: Array) -> None:
    """Draw in one view where the camera looked from, with what it saw; pose of the camera in odom."""
    height, width = sight.image.shape[:2]
    client.scene.add_camera_frustum(
        _FRUSTUM,
        fov=sight.fov,
        aspect=width / height,
        scale=_AHEAD,
        thickness=2.0,
        thickness_units="screen",
        color=(130, 188, 248),
        image=sight.image,
        format="jpeg",
        jpeg_quality=70,
        wxyz=wxyz,
        position=position,
        cast_shadow=False,
        receive_shadow=False,
    )


def draw_cloud(client: viser.ClientHandle, sight: Sight, wxyz: Array, position: Array) -> None:
    """Draw in one view the points of the depth; in the camera's own frame, where half precision is fine enough."""
    client.scene.add_point_cloud(
        _CLOUD, sight.points, sight.colors, point_size=0.006, point_shape="square", wxyz=wxyz, position=position
    )


def remove(client: viser.ClientHandle, cloud: bool, frustum: bool) -> None:
    """Take either out of one view."""
    for gone, name in ((cloud, _CLOUD), (frustum, _FRUSTUM)):
        if gone and client.scene.get_handle_by_name(name) is not None:
            client.scene.remove_by_name(name)
