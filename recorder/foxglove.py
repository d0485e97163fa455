"""Poses and images in Foxglove's own well-known schemas, so that its 3-D and image panels show them unasked.

Field names are those of Foxglove's published JSON schemas `foxglove.FrameTransform`, `foxglove.PoseInFrame` and
`foxglove.CompressedImage`.
"""

import base64
import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from rolling_panda import messages as m
from rolling_panda.messages.robot import CameraFrame

_VECTOR = {"type": "object", "properties": {name: {"type": "number"} for name in "xyz"}}
_QUATERNION = {"type": "object", "properties": {name: {"type": "number"} for name in "xyzw"}}
_TIME = {"type": "object", "title": "time", "properties": {"sec": {"type": "integer"}, "nsec": {"type": "integer"}}}
_TEXT = {"type": "string"}


@dataclass(frozen=True)
class View:
    """One of Foxglove's schemas, the channel for it, and how a message of ours becomes one; None for nothing."""

    channel: str
    name: str
    properties: dict[str, Any]
    make: Callable[[Any, int], dict[str, Any] | None]

    @property
    def schema(self) -> dict[str, Any]:
        """The JSON schema."""
        return {"title": self.name, "type": "object", "properties": self.properties}


def _time(stamp_ns: int) -> dict[str, int]:
    return {"sec": stamp_ns // 10**9, "nsec": stamp_ns % 10**9}


def _base(message: m.Odometry, stamp_ns: int) -> dict[str, Any]:
    half = message.pose.phi / 2
    return {
        "timestamp": _time(stamp_ns),
        "parent_frame_id": "odom",
        "child_frame_id": "base_link",
        "translation": {"x": message.pose.x, "y": message.pose.y, "z": 0.0},
        "rotation": {"x": 0.0, "y": 0.0, "z": math.sin(half), "w": math.cos(half)},
    }


def _tool(message: m.ControllerState, stamp_ns: int) -> dict[str, Any] | None:
    pose = message.T_odom_tool
    if pose is None:
        return None
    placed = {
        "position": dict(zip("xyz", pose.position, strict=True)),
        "orientation": dict(zip("xyzw", pose.quat_xyzw, strict=True)),
    }
    return {"timestamp": _time(stamp_ns), "frame_id": "odom", "pose": placed}


def _image(message: CameraFrame, stamp_ns: int) -> dict[str, Any]:
    data = base64.b64encode(message.color_jpeg).decode()
    return {"timestamp": _time(stamp_ns), "frame_id": "camera", "data": data, "format": "jpeg"}


#: By the type of our message.
VIEWS: dict[type[m.Message], View] = {
    m.Odometry: View(
        "tf",
        "foxglove.FrameTransform",
        {
            "timestamp": _TIME,
            "parent_frame_id": _TEXT,
            "child_frame_id": _TEXT,
            "translation": _VECTOR,
            "rotation": _QUATERNION,
        },
        _base,
    ),
    m.ControllerState: View(
        "tool",
        "foxglove.PoseInFrame",
        {
            "timestamp": _TIME,
            "frame_id": _TEXT,
            "pose": {"type": "object", "properties": {"position": _VECTOR, "orientation": _QUATERNION}},
        },
        _tool,
    ),
    CameraFrame: View(
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
