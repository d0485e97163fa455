"""The bridge's loop: what wakes it."""

import threading
from types import SimpleNamespace

from bridge.core.bridge import BridgeOutputs
from bridge.loop import BridgeLoop
from rolling_panda import messages as m
from rolling_panda.topics import MOTION
from tests.support.fake_wire import FakeWire

COMMAND = m.MotionCommand(epoch=1, token="a", sequence=1, echo=1, xi=(0.0,) * 9)


class Wire(FakeWire):
    def serve(self, service, answer):
        pass


class SleepyCore:
    """Would have its loop wake every 20 s."""

    kind, joints_s = "sim", 40.0
    refusals = SimpleNamespace(log=lambda topic, reason: None)

    def __init__(self):
        self.heard, self.any = [], threading.Event()

    def on_motion(self, command, now, received_at):
        self.heard.append(command.sequence)
        self.any.set()

    def step(self, now, clock, wall_time):
        return BridgeOutputs()


def test_a_command_is_taken_when_it_comes_and_not_at_the_next_turn():
    core, wire, stopping = SleepyCore(), Wire(), threading.Event()
    thread = threading.Thread(target=BridgeLoop(core, wire).run, args=(stopping,))
    thread.start()
    try:
        wire.deliver(MOTION, COMMAND)
        assert core.any.wait(5.0)
        assert core.heard == [1]
    finally:
        stopping.set()
        wire.deliver(MOTION, COMMAND)
        thread.join(5.0)
    assert not thread.is_alive()
