"""What a browser may say to the 3-D view. Default-deny: a frame that is not one of these, exactly, is dropped.

Viser trusts its client: it clicks disabled buttons, sets sliders beyond their ends, moves gizmos through their limits
and opens public tunnels when told to. So each frame is decoded strictly, and what passes is encoded anew.
"""

from dataclasses import dataclass
from typing import Annotated, Literal

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
    """Where the view's camera is. Anybody who is signed in."""

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
    """A click on something in the scene."""

    name: _NodeName
    instance_index: int | None
    ray_origin: Vector3
    ray_direction: Vector3
    screen_pos: _Screen
    modifier: _Modifier | None
    owner: _Owner = ""


class ScenePointer(_ClientMessage, frozen=True, tag="ScenePointerMessage"):
    """A click anywhere into the scene, while somebody places points by hand."""

    event_type: Literal["click"]
    ray_origin: Vector3
    ray_direction: Vector3
    screen_pos: tuple[_Screen]
    modifier: _Modifier | None


class GizmoUpdate(_ClientMessage, frozen=True, tag="TransformControlsUpdateMessage"):
    """The gizmo was dragged to here."""

    name: Literal["/gizmo"]
    wxyz: _QuatWxyz
    position: tuple[Metre, Metre, Metre]
    owner: _Owner = ""


class GizmoDragStart(_ClientMessage, frozen=True, tag="TransformControlsDragStartMessage"):
    """The gizmo was grabbed."""

    name: Literal["/gizmo"]
    owner: _Owner = ""


class GizmoDragEnd(_ClientMessage, frozen=True, tag="TransformControlsDragEndMessage"):
    """The gizmo was let go."""

    name: Literal["/gizmo"]
    owner: _Owner = ""


_Message = ViewerCamera | SceneNodeClick | ScenePointer | GizmoUpdate | GizmoDragStart | GizmoDragEnd
_DECODER: msgspec.msgpack.Decoder[_Message] = msgspec.msgpack.Decoder(_Message, strict=True)
_ENCODER = msgspec.msgpack.Encoder()


@dataclass(frozen=True)
class Admitted:
    """A frame that was read and found right.

    Attributes:
        frame: To pass on to viser; empty to leave it out, as all that is said of the gizmo: viser would take where it
            was dragged for where it is drawn some time later, and after that not draw it back where it had been.
        gizmo: What it says of the gizmo, where that matters: dragged to a place, if it may be, or let go of.
    """

    frame: bytes
    gizmo: GizmoUpdate | GizmoDragEnd | None = None


def admit(frame: bytes, may_operate: bool, may_move: bool = True) -> Admitted | None:
    """What to pass on to viser; None to drop the frame as forged.

    Args:
        frame: One binary WebSocket frame from a browser.
        may_operate: May this session point at things and drag the gizmo?
        may_move: May it drag the gizmo now, or does somebody else hold control? To let go is always heard.
    """
    try:
        message = _DECODER.decode(frame)
    except (msgspec.MsgspecError, UnicodeDecodeError, RecursionError):
        return None
    if not may_operate and not isinstance(message, ViewerCamera):
        return None
    if isinstance(message, GizmoUpdate):
        return Admitted(b"", message if may_move else None)
    if isinstance(message, GizmoDragEnd):
        return Admitted(b"", message)
    if isinstance(message, GizmoDragStart):
        return Admitted(b"")
    # Encoded anew, so that viser reads what was checked here and nothing else.
    return Admitted(_ENCODER.encode(message))


def kind(frame: bytes) -> str:
    """What a dropped frame said it was, for the log."""
    try:
        said = msgspec.msgpack.decode(frame)
    except (msgspec.MsgspecError, UnicodeDecodeError, RecursionError):
        return "not a message"
    return str(said.get("type", "no type"))[:60] if isinstance(said, dict) else "not a message"
