"""The bridge as a process: commands from the inbox to the core, and the due ticks of the robot."""

import time
from collections.abc import Callable, Sequence

from bridge.core.bridge import TICK_S, BridgeCore
from bridge.core.robot_time import RealTime, RobotTime, SteppedTime
from rolling_panda import messages as m
from rolling_panda.messages.perception import CloseUpRequest
from rolling_panda.messages.supervision import HardwareStop
from rolling_panda.transport.inbox import Inbox, Received, Rejected, Reply
from rolling_panda.transport.runner import Runner, Wire

# Waking twice as often as joint states go out costs a fifth of waking every millisecond. A command wakes it at once.
_WAKES = 2


class BridgeProcess:
    """Hands what has arrived to the core, and steps it to the present."""

    def __init__(self, core: BridgeCore, clock: float, press: Callable[[bool], None] = lambda pressed: None) -> None:
        """Start at `clock` (s, monotonic).

        Args:
            core: The core.
            clock: Present time (s, monotonic).
            press: Presses or releases the emergency stop button of a simulated robot.
        """
        self._core, self._press = core, press
        self._time: RobotTime = RealTime(clock, TICK_S) if core.kind != "sim" else SteppedTime(clock, TICK_S)
        self._motion: Received[m.MotionCommand] | None = None

    def step(self, inbox: Inbox, now: float) -> list[object]:
        """Take the commands, and make the ticks that are due at `now` (s, monotonic)."""
        core, out = self._core, list[object]()
        due = self._time.due(now)
        for rejected in inbox.drain(Rejected):
            core.refusals.log(rejected.message.topic, rejected.message.reason)
        for button in inbox.drain(HardwareStop):
            self._press(button.message.pressed)
        for token in inbox.drain(m.TokenRequest):
            core.on_token(token.message, self._time.now)
        motion = inbox.newest(m.MotionCommand)
        if motion is not None and motion is not self._motion:
            self._motion = motion
            core.on_motion(motion.message, self._time.now, motion.at)
        for cut in inbox.drain(m.CutCommand):
            core.on_cut(cut.message, self._time.now)
        for picture in inbox.drain(CloseUpRequest):
            core.on_picture(picture.message)
        while (request := inbox.next_request()) is not None:
            out.append(Reply(request, core.answer(request.message, self._time.now)))
        for _ in range(due):
            out += core.step(self._time.tick(), now, inbox.wall_time).messages
        return out

    def stop(self, request: m.StopRequest, wall_time: float) -> None:
        """Latch a stop at once, between two steps, at `wall_time` (s since 1970)."""
        self._core.on_stop(request, self._time.now, wall_time)

    def end(self) -> Sequence[object]:
        """Nothing: the watchdogs of the robot stop it."""
        return ()


def bridge_runner(core: BridgeCore, wire: Wire, press: Callable[[bool], None] = lambda pressed: None) -> Runner:
    """The bridge on a wire."""
    process = BridgeProcess(core, time.monotonic(), press)
    period = max(TICK_S, core.joints_s / _WAKES)
    return Runner(process, wire, period, at_once={m.StopRequest: process.stop})
