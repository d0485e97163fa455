"""What a hand does with the gizmo is told to the robot at once."""

import json
import time

from rolling_panda import topics
from server.config import ServerConfig
from tests.server.test_viser_filter import CAMERA, DRAG, GRAB
from tests.server.test_viser_proxy import hear, is_gizmo, open_socket, open_view, replayed, say
from tests.support.fake_wire import FakeWire, telling
from tests.support.running_server import PATIENCE_S, running_server


def test_a_drag_while_holding_does_not_wait_for_the_loops_turn_and_many_drags_are_not_all_told():
    wire = FakeWire()
    sent = wire.sent[topics.TELEOP.name]
    with (
        # After its first turn the loop takes none any more.
        running_server(wire, ServerConfig(teleop_rate_hz=1e-4)) as server,
        telling(wire),
        server.client(user="ann") as client,
        open_socket(server, client, "/ws") as page,
        open_view(server, client) as view,
    ):
        hear(view, replayed)
        say(view, CAMERA)
        page.send('{"type":"ShowGizmo","visible":true}')
        (gizmo,) = [each for each in hear(view, is_gizmo) if is_gizmo(each)]
        say(view, GRAB | {"owner": gizmo["owner"]})
        sequence, drags, until = 0, 0, time.monotonic() + PATIENCE_S
        while not any(each.hold for each in sent):
            assert time.monotonic() < until
            message = json.loads(page.recv(timeout=PATIENCE_S))
            if message["type"] not in ("PageState", "HoldEnded"):
                continue
            sequence += 1
            page.send(json.dumps({"type": "Ping", "number": sequence, "rendered": message.get("number", 0)}))
            page.send(json.dumps({"type": "Hold", "sequence": sequence, "hold": message["type"] == "PageState"}))
            for k in range(20):
                drags += 1
                say(view, DRAG | {"owner": gizmo["owner"], "position": [0.3 + 0.001 * k, 0.5, 0.9]})
    told = [each.target.position for each in sent if each.hold]
    assert told[0][1:] == (0.5, 0.9) and 0.3 <= told[0][0] < 0.32
    assert len(told) < drags / 2
