"""The bridge as a process: what wakes it, and what does not wait for its next step."""

import threading
from types import SimpleNamespace

from bridge.core.bridge import BridgeOutputs
from bridge.loop import bridge_runner
from rolling_panda import messages as m
from rolling_panda.reasons import said
from rolling_panda.topics import MOTION, STOP
from tests.support.fake_wire import FakeWire

COMMAND = m.MotionCommand(epoch=1, token="a", sequence=1, echo=1, xi=(0.0,) * 9)


class SleepyCore:
    """Would have its loop wake every 20 s."""

    kind, joints_s = "sim", 40.0
    refusals = SimpleNamespace(log=lambda topic, reason: None)

    def __init__(self):
        self.heard, self.any = [], threading.Event()

    def on_motion(self, command, now, received_at):
        self.heard.append(command.sequence)
        self.any.set()

    def on_stop(self, request, now, wall_time):
        self.heard.append(request.stop_id)

    def step(self, now, clock, wall_time):
        return BridgeOutputs()


def test_a_command_is_taken_when_it_comes_and_a_stop_does_not_wait_for_a_step():
    core, wire, stopping = SleepyCore(), FakeWire("bridge"), threading.Event()
    runner = bridge_runner(core, wire)
    wire.deliver(STOP, m.StopRequest(stop_id="s", source="server", user="eve", reason=said("dog")))
    assert core.heard == ["s"]
    thread = threading.Thread(target=runner.run, args=(stopping,))
    thread.start()
    try:
        wire.deliver(MOTION, COMMAND)
        assert core.any.wait(5.0)
        assert core.heard == ["s", 1]
    finally:
        stopping.set()
        wire.deliver(MOTION, COMMAND)
        thread.join(5.0)
    assert not thread.is_alive()
