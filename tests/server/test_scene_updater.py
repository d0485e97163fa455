"""Cameras, layers and measures of the 3-D view, each for the session that asked, through the real viser."""

import time

import msgspec
import numpy as np
import pytest

from rolling_panda import messages as m
from rolling_panda import topics
from rolling_panda.messages.perception import Capsule, MovedCapsule, Scenery, SceneryMotion
from server.config import ServerConfig
from tests.server.test_camera_view import HEIGHT, WIDTH, frame
from tests.server.test_client_messages import CAMERA, CLICK, DRAG, GRAB, POINTER
from tests.server.test_proxy import (
    Holding,
    enables_clicks,
    hear,
    hear_kind,
    is_gizmo,
    never,
    page_and_view,
    replayed,
    say,
    two_views,
)
from tests.support.fake_wire import FakeWire, joints, odometry, pruning_point, pruning_points, telling
from tests.support.running_server import PATIENCE_S, running_server


@pytest.fixture(scope="module")
def server():
    wire = FakeWire()
    with running_server(wire) as running:
        wire.deliver(topics.JOINTS, joints())
        wire.deliver(topics.ODOMETRY, odometry())
        yield running


def shows(name, visible):
    wanted = ("SetSceneNodeVisibilityMessage", name, visible)
    return lambda message: (message["type"], message.get("name"), message.get("visible")) == wanted


def placed(message):
    return message["type"] == "SetCameraPositionMessage"


def test_layers_are_those_of_one_session_and_stay_for_its_next_view(server):
    with (
        server.client(user="ann") as client,
        server.client(user="bob") as other,
        server.socket(client) as page,
        server.socket(other, "/viser") as other_view,
    ):
        hear(other_view, replayed)
        say(other_view, CAMERA)
        hear(other_view, shows("/plant", True))
        with server.socket(client, "/viser") as view:
            hear(view, replayed)
            say(view, CAMERA)
            hear(view, shows("/plant", True))
            page.send('{"type":"ShowLayers","layers":["trail"]}')
            heard = hear(view, shows("/trail", True))
            assert any(map(shows("/plant", False), heard))
            never(other_view, shows("/plant", False))
        with server.socket(client, "/viser") as view:
            hear(view, replayed)
            say(view, CAMERA)
            hear(view, shows("/plant", False))


def test_a_preset_moves_the_cameras_of_who_asked_alone_and_viewers_may_too(server):
    with telling(server.wire), two_views(server, role="viewer") as (page, view, other_view):
        hear(view, shows("/plant", True))
        page.send('{"type":"PlaceCamera","preset":"top"}')
        (put,) = [message for message in hear(view, placed) if placed(message)]
        assert put["position"][2] > 3.0
        never(other_view, placed)


def test_a_chosen_point_brings_the_cameras_of_who_chose_it_alone(server):
    def looks_at(x):
        return lambda told: told["type"] == "SetCameraLookAtMessage" and np.allclose(told["look_at"], (x, 0.75, 1.0))

    far = msgspec.structs.replace(pruning_point("far"), position=(1.0, 0.75, 1.0))
    server.wire.deliver(topics.POINTS, pruning_points(far))
    with telling(server.wire), two_views(server) as (page, view, other_view):
        hear(view, shows("/plant", True))
        page.send('{"type":"Select","point_id":"far"}')
        hear(view, looks_at(1.0))
        # Chosen before it is drawn, as where somebody has placed it: brought there once it is.
        page.send('{"type":"Select","point_id":"new"}')
        new = msgspec.structs.replace(pruning_point("new"), position=(2.0, 0.75, 1.0))
        server.wire.deliver(topics.POINTS, pruning_points(far, new))
        heard = hear(view, looks_at(2.0))
        # A click onto its marker does the same, and tells the page.
        owner = next(told["owner"] for told in heard if told.get("name") == "/markers/proposed/tint")
        say(view, CLICK | {"owner": owner})
        assert hear_kind(page, "Selected")["point_id"] == "far"
        never(other_view, placed)


def test_two_clicks_are_measured_for_the_session_that_measures(server):
    down = POINTER | {"ray_origin": [0.0, -3.0, 2.0], "ray_direction": [0.0, 0.0, -1.0]}
    with telling(server.wire), page_and_view(server) as (page, view):
        page.send('{"type":"Measure","active":true}')
        hear(view, enables_clicks)
        say(view, down)
        say(view, down | {"ray_origin": [0.5, -3.0, 2.0]})
        told = hear_kind(page, "Measured")
        assert told["offset"] == pytest.approx([0.5, 0.0, 0.0]) and told["between"] == ["ground", "ground"]
        hear(view, lambda message: message.get("name") == "/measure/label")
        page.send('{"type":"Measure","active":false}')
        hear(view, lambda message: message["type"] == "RemoveSceneNodeMessage" and message["name"] == "/measure/label")


def test_a_picture_of_the_camera_is_drawn_for_who_wants_it(server):
    with two_views(server) as (page, view, other_view):
        for each in (view, other_view):
            hear(each, shows("/plant", True))
        page.send('{"type":"ShowLayers","layers":["camera","cloud"]}')
        hear(view, shows("/plant", False))
        server.wire.deliver(topics.CAMERA, frame(np.full((HEIGHT, WIDTH), 900)))
        heard = hear(view, lambda message: message.get("name") == "/cloud")
        assert "/camera" in {message.get("name") for message in heard}
        never(other_view, lambda message: message.get("name") in ("/camera", "/cloud"))
        page.send('{"type":"ShowLayers","layers":[]}')
        hear(view, lambda message: message["type"] == "RemoveSceneNodeMessage" and message["name"] == "/cloud")


def test_swaying_canes_are_sent_only_while_a_view_shows_the_simulated_row(server):
    foot = Capsule("cane", (0.2, 0.8, 0.5), (0.2, 0.8, 1.0), 0.005, 0.005)
    moved = (MovedCapsule(0, (0.2, 0.8, 0.5), (0.22, 0.8, 1.0)),)
    server.wire.deliver(topics.SCENERY, Scenery(header=m.Header(), revision=0, capsules=(foot,)))
    server.wire.deliver(topics.SCENERY_MOTION, SceneryMotion(header=m.Header(), revision=0, moved=moved))

    def of_motion(message):
        return message.get("name") == "/row/moved cane"

    with page_and_view(server) as (page, view):
        hear(view, lambda message: message.get("name") == "/plant")
        never(view, of_motion)
        page.send('{"type":"ShowLayers","layers":["simulated"]}')
        hear(view, of_motion)


def test_what_swayed_in_another_row_does_not_sway_in_a_new_one(server):
    def row(x):
        return Scenery(
            header=m.Header(), revision=0, capsules=(Capsule("cane", (x, 0.8, 0.5), (x, 0.8, 1.0), 5e-3, 5e-3),)
        )

    def sways(x):
        moved = (MovedCapsule(0, (x, 0.8, 0.5), (x + 0.02, 0.8, 1.0)),)
        return SceneryMotion(header=m.Header(), revision=0, moved=moved)

    def of_motion(message):
        return message.get("name") == "/row/moved cane" and message["type"] != "RemoveSceneNodeMessage"

    def removed(message):
        return message.get("name") == "/row/moved cane" and message["type"] == "RemoveSceneNodeMessage"

    server.wire.deliver(topics.SCENERY, row(2.2))
    server.wire.deliver(topics.SCENERY_MOTION, sways(2.2))
    with page_and_view(server) as (page, view):
        page.send('{"type":"ShowLayers","layers":["simulated"]}')
        hear(view, of_motion)
        # The bridge has started again with another vineyard, and nothing has moved there yet.
        server.wire.deliver(topics.SCENERY, row(3.2))
        hear(view, removed)
        never(view, of_motion)
        server.wire.deliver(topics.SCENERY_MOTION, sways(3.2))
        hear(view, of_motion)


def test_a_drag_while_holding_does_not_wait_for_the_loops_turn_and_many_drags_are_not_all_told():
    wire = FakeWire()
    sent = wire.sent[topics.TELEOP.name]
    with (
        # After its first turn the loop takes none any more.
        running_server(wire, ServerConfig(teleop_rate_hz=1e-4)) as server,
        telling(wire),
        page_and_view(server) as (page, view),
    ):
        page.send('{"type":"ShowGizmo","visible":true}')
        (gizmo,) = [each for each in hear(view, is_gizmo) if is_gizmo(each)]
        say(view, GRAB | {"owner": gizmo["owner"]})
        holding, drags, until = Holding(page), 0, time.monotonic() + PATIENCE_S
        while not any(each.hold for each in sent):
            assert time.monotonic() < until
            if not holding.answer():
                continue
            for k in range(20):
                drags += 1
                say(view, DRAG | {"owner": gizmo["owner"], "position": [0.3 + 0.001 * k, 0.5, 0.9]})
    told = [each.target.position for each in sent if each.hold]
    assert told[0][1:] == (0.5, 0.9) and 0.3 <= told[0][0] < 0.32
    assert len(told) < drags / 2
