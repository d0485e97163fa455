"""Moving in a recording over REST."""

from rolling_panda import topics
from rolling_panda.messages.commands import SeekReplay
from rolling_panda.messages.supervision import ReplayState
from tests.support.fake_wire import FakeWire
from tests.support.running_server import eventually, running_server


def test_a_recording_is_moved_in_and_a_robot_is_not():
    wire = FakeWire()
    with running_server(wire) as server, server.client("viewer") as client:
        refused = client.post("/api/replay", json={"position_s": 3.0})
        assert refused.status_code == 409 and "no recording" in refused.json()["reason"]
        assert wire.asked == []
        state = ReplayState(name="a.mcap", begins_at=1.8e9, duration_s=9.0, position_s=0.0, playing=True)
        wire.deliver(topics.REPLAY, state)
        assert client.post("/api/replay", json={"position_s": 3.0, "playing": False}).status_code == 200
        assert wire.asked == [SeekReplay(position_s=3.0, playing=False)]
        assert client.post("/api/replay", json={"position_s": -1.0}).status_code == 422
        assert eventually(lambda: client.get("/api/state").json()["replay"])["name"] == "a.mcap"
