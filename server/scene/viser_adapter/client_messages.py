"""A filter of the browser's messages to viser. A frame that is not exactly one of the listed messages is dropped.

Viser trusts its client, which may click disabled buttons, set sliders beyond their ends, move gizmos through their
limits and open public tunnels. So each frame is decoded strictly and encoded again.
"""

from dataclasses import dataclass
from typing import Annotated, Literal, get_args

import msgspec
from msgspec import Meta, Struct

from rolling_panda.messages.types import Finite, Metre, Unit, Vector3

_QuatWxyz = tuple[Unit, Unit, Unit, Unit]
_Screen = tuple[Finite, Finite]
_NodeName = Annotated[str, Meta(max_length=200)]
_Owner = Annotated[str, Meta(max_length=100)]
_Modifier = Annotated[str, Meta(max_length=40)]
_Pixels = Annotated[int, Meta(ge=0, le=1 << 16)]


class _ClientMessage(Struct, frozen=True, tag_field="type", forbid_unknown_fields=True):
    """Root of the client's messages; the tag is viser's class name."""


class ViewerCamera(_ClientMessage, frozen=True, tag="ViewerCameraMessage"):
    """The view's camera. Every role may send it."""

    wxyz: _QuatWxyz
    position: Vector3
    fov: Finite
    near: Finite
    far: Finite
    image_height: _Pixels
    image_width: _Pixels
    look_at: Vector3
    up_direction: Vector3


class SceneNodeClick(_ClientMessage, frozen=True, tag="SceneNodeClickMessage"):
    """A click on a node of the scene."""

    name: _NodeName
    instance_index: int | None
    ray_origin: Vector3
    ray_direction: Vector3
    screen_pos: _Screen
    modifier: _Modifier | None
    owner: _Owner = ""


class ScenePointer(_ClientMessage, frozen=True, tag="ScenePointerMessage"):
    """A click anywhere in the scene, while a session places points or measures."""

    event_type: Literal["click"]
    ray_origin: Vector3
    ray_direction: Vector3
    screen_pos: tuple[_Screen]
    modifier: _Modifier | None


class GizmoUpdate(_ClientMessage, frozen=True, tag="TransformControlsUpdateMessage"):
    """The gizmo was dragged to this pose."""

    name: Literal["/gizmo"]
    wxyz: _QuatWxyz
    position: tuple[Metre, Metre, Metre]
    owner: _Owner = ""


class GizmoDragStart(_ClientMessage, frozen=True, tag="TransformControlsDragStartMessage"):
    """The gizmo was grabbed."""

    name: Literal["/gizmo"]
    owner: _Owner = ""


class GizmoDragEnd(_ClientMessage, frozen=True, tag="TransformControlsDragEndMessage"):
    """The gizmo was released."""

    name: Literal["/gizmo"]
    owner: _Owner = ""


_Message = ViewerCamera | SceneNodeClick | ScenePointer | GizmoUpdate | GizmoDragStart | GizmoDragEnd
#: Every message that a browser may send.
CLIENT_MESSAGES: tuple[type[Struct], ...] = get_args(_Message)
_DECODER: msgspec.msgpack.Decoder[_Message] = msgspec.msgpack.Decoder(_Message, strict=True)
_ENCODER = msgspec.msgpack.Encoder()


@dataclass(frozen=True)
class Admitted:
    """A valid frame.

    Attributes:
        frame: To pass on to viser; empty to pass on nothing, as with all messages about the gizmo. Viser would store
            the dragged pose late, and then not draw the gizmo back at its earlier pose.
        gizmo: The gizmo's drag, where it is permitted, or the end of one.
    """

    frame: bytes
    gizmo: GizmoUpdate | GizmoDragEnd | None = None


def admit(frame: bytes, may_operate: bool, may_move: bool = True) -> Admitted | None:
    """Check a frame for viser; None where it is forged and has to be dropped.

    Args:
        frame: One binary WebSocket frame from a browser.
        may_operate: Whether the session's role may click and drag.
        may_move: Whether it may drag the gizmo now: nobody else holds control. A release always passes.
    """
    try:
        message = _DECODER.decode(frame)
    except (msgspec.MsgspecError, UnicodeDecodeError, RecursionError):
        return None
    if not may_operate and not isinstance(message, ViewerCamera):
        return None
    match message:
        case GizmoUpdate():
            return Admitted(b"", message if may_move else None)
        case GizmoDragEnd():
            return Admitted(b"", message)
        case GizmoDragStart():
            return Admitted(b"")
    # Encoded again, so that viser reads exactly what was checked here.
    return Admitted(_ENCODER.encode(message))


def message_type(frame: bytes) -> str:
    """The type that a dropped frame claims, for the log."""
    try:
        decoded = msgspec.msgpack.decode(frame)
    except (msgspec.MsgspecError, UnicodeDecodeError, RecursionError):
        return "not a message"
    return str(decoded.get("type", "no type"))[:60] if isinstance(decoded, dict) else "not a message"
