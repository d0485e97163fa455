import msgspec
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from viser import _messages
from viser.infra._messages import wire_field_names

from server.scene.viser_adapter.client_messages import Admitted, admit, message_type

CAMERA = {
    "type": "ViewerCameraMessage", "wxyz": [1, 0, 0, 0], "position": [0, 0, 1.5], "fov": 1.0, "near": 0.01,
    "far": 100, "image_height": 800, "image_width": 1280, "look_at": [0, 0, 0], "up_direction": [0, 0, 1],
}  # fmt: skip
CLICK = {
    "type": "SceneNodeClickMessage", "name": "/markers/proposed/tint", "instance_index": 0, "ray_origin": [0, 0, 0],
    "ray_direction": [1, 0, 0], "screen_pos": [0.5, 0.5], "modifier": None, "owner": "",
}  # fmt: skip
DRAG = {
    "type": "TransformControlsUpdateMessage", "name": "/gizmo", "wxyz": [1, 0, 0, 0], "position": [0.1, 0.2, 0.3],
    "owner": "client",
}  # fmt: skip
GRAB = {"type": "TransformControlsDragStartMessage", "name": "/gizmo", "owner": "client"}
LET_GO = {"type": "TransformControlsDragEndMessage", "name": "/gizmo", "owner": "client"}
POINTER = {
    "type": "ScenePointerMessage", "event_type": "click", "ray_origin": [0, 0, 1.5], "ray_direction": [0, 1, 0],
    "screen_pos": [[0.4, 0.6]], "modifier": None,
}  # fmt: skip
FORGED = {"type": "GuiUpdateMessage", "uuid": "x", "updates": {"value": 1e6}}


def frame(message):
    return msgspec.msgpack.encode(message)


@pytest.mark.parametrize("message", [CAMERA, CLICK, POINTER])
def test_what_an_operator_may_say_reaches_viser_unchanged(message):
    admitted = admit(frame(message), may_operate=True)
    assert msgspec.msgpack.decode(admitted.frame) == message
    assert admitted.gizmo is None
    assert type(_messages.Message.deserialize(admitted.frame)).__name__ == message["type"]


@pytest.mark.parametrize("message", [CLICK, POINTER, DRAG, GRAB, LET_GO])
def test_a_viewer_may_only_look(message):
    assert admit(frame(message), may_operate=False) is None
    assert admit(frame(CAMERA), may_operate=False) is not None


def test_the_gizmo_is_led_by_who_holds_control_alone_and_viser_hears_nothing_of_it():
    assert admit(frame(DRAG), may_operate=True).gizmo.position == (0.1, 0.2, 0.3)
    assert admit(frame(DRAG), may_operate=True, may_move=False) == Admitted(b"")
    assert admit(frame(LET_GO), may_operate=True, may_move=False).gizmo is not None, "to let go is always heard"
    for message in (DRAG, GRAB, LET_GO):
        assert not admit(frame(message), may_operate=True).frame
    for message in (CAMERA, CLICK, POINTER):
        assert admit(frame(message), may_operate=True, may_move=False).frame


#: Every message of viser, by its name.
MESSAGES = {each.__name__: each for each in _messages.Message.get_subclasses()}


@pytest.mark.parametrize("name", sorted(MESSAGES))
def test_every_other_message_that_viser_knows_is_dropped(name):
    allowed = {message["type"] for message in (CAMERA, CLICK, POINTER, DRAG, GRAB, LET_GO)}
    if name not in allowed:
        kind_fields = wire_field_names(MESSAGES[name])
        for message in ({"type": name}, {"type": name} | dict.fromkeys(kind_fields, 0), CAMERA | {"type": name}):
            assert admit(frame(message), may_operate=True) is None


@pytest.mark.parametrize(
    "message",
    [
        FORGED,
        POINTER | {"event_type": "rect-select"},
        POINTER | {"screen_pos": [[0.4, 0.6], [0.5, 0.7]]},
        POINTER | {"ray_direction": [float("nan"), 0, 1]},
        DRAG | {"position": [float("nan"), 0, 0]},
        DRAG | {"position": [1e308, 0, 0]},
        DRAG | {"position": [0, 0]},
        DRAG | {"position": [True, 0, 0]},
        DRAG | {"name": "/robot"},
        DRAG | {"extra": 1},
        CAMERA | {"fov": "wide"},
        CLICK | {"name": "x" * 1000},
        [FORGED],
        "text",
        {"no": "type"},
    ],
)
def test_what_is_not_exactly_right_is_dropped(message):
    assert admit(frame(message), may_operate=True) is None


def test_a_second_value_for_a_key_cannot_hide_behind_the_first():
    sneaky = b"\x83" + frame("type") + frame("GuiUpdateMessage") + frame(GRAB)[1:]
    admitted = admit(sneaky, may_operate=True)
    assert admitted is None or msgspec.msgpack.decode(admitted.frame)["type"] != "GuiUpdateMessage"


@settings(max_examples=200)
@given(st.binary(max_size=300))
def test_noise_is_dropped_and_can_be_named(data):
    assert admit(data, may_operate=True) is None
    assert isinstance(message_type(data), str)


def test_the_fields_are_those_of_this_viser():
    for message in (CAMERA, CLICK, DRAG, GRAB, LET_GO):
        assert set(wire_field_names(MESSAGES[message["type"]])) == set(message) - {"type"}


def test_a_dropped_frame_says_what_it_was():
    assert message_type(frame(FORGED)) == "GuiUpdateMessage"
