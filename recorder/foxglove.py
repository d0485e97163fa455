"""Poses and images in Foxglove's well-known schemas, for its 3-D and image panels.

The schemas are `foxglove.FrameTransform`, `foxglove.PoseInFrame` and `foxglove.CompressedImage`.
"""

import base64
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from rolling_panda import messages as m
from rolling_panda.messages.perception import Localisation
from rolling_panda.messages.robot import CameraFrame
from rolling_panda.model.base_attitude import T_odom_base
from rolling_panda.model.robot import pose_message

_VECTOR = {"type": "object", "properties": {name: {"type": "number"} for name in "xyz"}}
_QUATERNION = {"type": "object", "properties": {name: {"type": "number"} for name in "xyzw"}}
_TIME = {"type": "object", "title": "time", "properties": {"sec": {"type": "integer"}, "nsec": {"type": "integer"}}}
_TEXT = {"type": "string"}


@dataclass(frozen=True)
class FoxgloveChannel:
    """A channel, its schema, and the conversion of a message and its stamp (ns); None if there is nothing to show."""

    name: str
    schema_name: str
    properties: dict[str, Any]
    convert: Callable[[Any, int], dict[str, Any] | None]

    @property
    def schema(self) -> dict[str, Any]:
        """The JSON schema."""
        return {"title": self.schema_name, "type": "object", "properties": self.properties}


def _time(stamp_ns: int) -> dict[str, int]:
    return {"sec": stamp_ns // 10**9, "nsec": stamp_ns % 10**9}


def _base_transform(message: m.Odometry, stamp_ns: int) -> dict[str, Any]:
    # Level, as the pose of the tool is told.
    return _transform("odom", "base_link", pose_message(T_odom_base(message.pose)), stamp_ns)


def _map_transform(message: Localisation, stamp_ns: int) -> dict[str, Any]:
    return _transform("map", "odom", message.T_map_odom, stamp_ns)


def _transform(parent: str, child: str, pose: m.Pose, stamp_ns: int) -> dict[str, Any]:
    return {
        "timestamp": _time(stamp_ns),
        "parent_frame_id": parent,
        "child_frame_id": child,
        "translation": dict(zip("xyz", pose.position, strict=True)),
        "rotation": dict(zip("xyzw", pose.quat_xyzw, strict=True)),
    }


def _tool_pose(message: m.ControllerState, stamp_ns: int) -> dict[str, Any] | None:
    pose = message.T_odom_tool
    if pose is None:
        return None
    converted = {
        "position": dict(zip("xyz", pose.position, strict=True)),
        "orientation": dict(zip("xyzw", pose.quat_xyzw, strict=True)),
    }
    return {"timestamp": _time(stamp_ns), "frame_id": "odom", "pose": converted}


def _image(message: CameraFrame, stamp_ns: int) -> dict[str, Any]:
    data = base64.b64encode(message.color_jpeg).decode()
    return {"timestamp": _time(stamp_ns), "frame_id": "camera", "data": data, "format": "jpeg"}


_TRANSFORM: dict[str, Any] = {
    "timestamp": _TIME,
    "parent_frame_id": _TEXT,
    "child_frame_id": _TEXT,
    "translation": _VECTOR,
    "rotation": _QUATERNION,
}
#: By message type.
CHANNELS: dict[type[m.Message], FoxgloveChannel] = {
    m.Odometry: FoxgloveChannel("tf", "foxglove.FrameTransform", _TRANSFORM, _base_transform),
    Localisation: FoxgloveChannel("tf_map", "foxglove.FrameTransform", _TRANSFORM, _map_transform),
    m.ControllerState: FoxgloveChannel(
        "tool",
        "foxglove.PoseInFrame",
        {
            "timestamp": _TIME,
            "frame_id": _TEXT,
            "pose": {"type": "object", "properties": {"position": _VECTOR, "orientation": _QUATERNION}},
        },
        _tool_pose,
    ),
    CameraFrame: FoxgloveChannel(
        "camera",
        "foxglove.CompressedImage",
        {
            "timestamp": _TIME,
            "frame_id": _TEXT,
            "data": {"type": "string", "contentEncoding": "base64"},
            "format": _TEXT,
        },
        _image,
    ),
}
