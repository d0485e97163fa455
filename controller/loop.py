"""The control loop on the wire: update, step, publish, at a fixed rate."""

import queue
import statistics
import sys
import threading
import time
from collections import deque
from dataclasses import replace
from typing import Generic

from controller.command_inbox import CommandInbox, CommitBarrier
from controller.core import Controller
from controller.inputs import Sample
from controller.interface import Outputs, StepInputs
from controller.ledger.journal import LedgerState
from controller.ledger.writer import LedgerWriter
from controller.planner_process import PlannerProcess
from controller.stop_file import Stops
from rolling_panda import messages as m
from rolling_panda.errors import ServiceError
from rolling_panda.messages.supervision import StopState
from rolling_panda.runtime.latest_file import KeptValue
from rolling_panda.topics import (
    BRIDGE,
    CLOSE_UP,
    CLOSE_UP_REQUEST,
    CONTROL,
    CONTROLLER,
    CUT,
    EVENT,
    HEARTBEAT,
    INTENT,
    JOINTS,
    MOTION,
    OBSTACLES,
    ODOMETRY,
    PLAN,
    POINTS,
    PRESENCE,
    PREVIEW,
    PREVIEW_MOTION,
    RELEASE,
    REPORT,
    STOP,
    STOPS,
    TELEOP,
    TOKEN,
    Topic,
)
from rolling_panda.transport.loop_clock import LoopClock
from rolling_panda.transport.zenoh import Msg, Slot, Transport

#: Longest time that the loop's clock advances in one iteration, in periods.
_LONGEST_TURN = 5
#: Number of iterations in the median of the step time, at most.
_TIMED = 200
#: A period is late from this multiple of its nominal length.
_LATE = 1.5


class _Newest(Generic[Msg]):
    """Newest message of a topic, with its arrival time on the loop's clock."""

    def __init__(self, slot: Slot[Msg], clock: LoopClock) -> None:
        self._slot, self._clock = slot, clock
        self._held: Sample[Msg] | None = None

    def sample(self) -> Sample[Msg] | None:
        """None before the first; the same object as long as it holds the same message."""
        received = self._slot.peek()
        if received is not None and (self._held is None or self._held.message is not received.message):
            self._held = Sample(received.message, self._clock.of(received.at))
        return self._held


class Loop:
    """Connects one `Controller` to the wire."""

    def __init__(
        self,
        controller: Controller,
        transport: Transport,
        rate_hz: float,
        ledger: LedgerWriter,
        planner: PlannerProcess | None = None,
        stop_file: KeptValue[Stops] | None = None,
    ) -> None:
        """Create subscribers and publishers. `run` starts the loop.

        Args:
            controller: The core.
            transport: Open session.
            rate_hz: Control rate.
            ledger: Writer of the records.
            planner: Planner of plans and previews; None works without them.
            stop_file: File of the latched stops; None keeps nothing.
        """
        self._planner, self._ledger = planner, ledger
        self._barrier = CommitBarrier()
        self._commands = CommandInbox(controller, self._barrier)
        self._controller, self._transport, self._period = controller, transport, 1.0 / rate_hz
        self._clock = LoopClock(time.monotonic(), _LONGEST_TURN * self._period)
        self._joints, self._odometry = self._newest(JOINTS), self._newest(ODOMETRY)
        self._bridge, self._points = self._newest(BRIDGE), self._newest(POINTS)
        self._obstacles = self._newest(OBSTACLES)
        self._presence = self._newest(PRESENCE)
        self._teleop, self._stops = self._newest(TELEOP), transport.feed(STOP, 32)
        self._beats: dict[m.Process, tuple[int, float]] = {}
        transport.subscribe(HEARTBEAT, self._on_heartbeat)
        self._said: queue.SimpleQueue[str] = queue.SimpleQueue()
        transport.on_reject = lambda topic, reason: self._said.put(f"refused on {topic}: {reason}")
        transport.serve(INTENT, self._commands.ask)
        self._log_events = transport.feed(EVENT, 1000)
        self._close_up, self._picture = self._newest(CLOSE_UP), transport.publisher(CLOSE_UP_REQUEST)
        self._motion, self._cut = transport.publisher(MOTION), transport.publisher(CUT)
        self._token, self._stop = transport.publisher(TOKEN), transport.publisher(STOP)
        self._state, self._event = transport.publisher(CONTROLLER), transport.publisher(EVENT)
        self._plan, self._control = transport.publisher(PLAN), transport.publisher(CONTROL)
        self._preview = transport.publisher(PREVIEW)
        self._preview_motion = transport.publisher(PREVIEW_MOTION)
        self._latched, self._stop_file = transport.publisher(STOPS), stop_file or KeptValue(())
        self._stops_told: StopState | None = None
        self._report, self._report_due = transport.publisher(REPORT), 0.0
        self._ticks: deque[float] = deque(maxlen=min(round(rate_hz), _TIMED))
        self._tick_s = 0.0
        self._count = self._late = 0

    def update(self) -> StepInputs:
        """Collect the newest inputs."""
        beats = self._beats
        return StepInputs(
            joints=self._joints.sample(),
            odometry=self._odometry.sample(),
            bridge=self._bridge.sample(),
            points=self._points.sample(),
            obstacles=self._obstacles.sample(),
            teleop=self._teleop.sample(),
            presence=self._presence.sample(),
            server_seen=beats["server"][1] if "server" in beats else None,
            perception_seen=beats["perception"][1] if "perception" in beats else None,
            present=self._transport.present(),
            stops=tuple(stop.message for stop in self._stops.drain()),
            wall_time=time.time(),
            plan=None if self._planner is None else self._planner.newest,
            preview=None if self._planner is None else self._planner.newest_preview,
            ledger=self._recorded(),
            close_up=self._close_up.sample(),
            tick_s=self._tick_s,
            ticks=self._count,
            late_ticks=self._late,
        )

    def _recorded(self) -> LedgerState:
        """Durability of the ledger and of the latched stops."""
        state = self._ledger.state
        return LedgerState(state.durable, state.failure or self._stop_file.failure)

    def publish(self, outputs: Outputs, now: float) -> None:
        """Send the due messages. The state waits until its content is durable.

        While another controller commands the robot, this one sends events only.
        """
        self._ledger.write(outputs.records)
        waits = self._controller.waits
        if waits:
            outputs = replace(outputs, state=None, control=None, plan=None, preview=None, preview_motion=None)
        if outputs.token is not None:
            self._token.put(outputs.token)
        if outputs.stop is not None:
            self._stop.put(outputs.stop)
        if outputs.motion is not None:
            self._motion.put(outputs.motion)
        if outputs.cut is not None:
            self._cut.put(outputs.cut)
        if outputs.picture is not None:
            self._picture.put(outputs.picture)
        if outputs.release is not None:
            threading.Thread(target=self._release, args=(outputs.release,), daemon=True).start()
        if outputs.state is not None:
            state = outputs.state
            self._barrier.hold(self._controller.recorded, now, lambda _: self._state.put(state))
            self._tick_s = statistics.median(self._ticks) if self._ticks else 0.0
        if outputs.stops is not None:
            self._stop_file.keep(outputs.stops.stops)
            self._stops_told = outputs.stops
        # A stop is reported as latched when it is on disk, so that it is latched after a restart too.
        # If the disk fails, there is a fault.
        if self._stops_told is not None and (self._stop_file.kept or self._stop_file.failure):
            if not waits:
                self._latched.put(self._stops_told)
            self._stops_told = None
        if outputs.control is not None:
            self._control.put(outputs.control)
        if outputs.request is not None and self._planner is not None:
            self._planner.ask(outputs.request)
        if outputs.preview_request is not None and self._planner is not None:
            self._planner.ask(outputs.preview_request)
        if outputs.plan is not None:
            self._plan.put(outputs.plan)
        if outputs.preview is not None:
            self._preview.put(outputs.preview)
        if outputs.preview_motion is not None:
            self._preview_motion.put(outputs.preview_motion)
        for event in outputs.events:
            self._event.put(event)
            if waits:
                print(f"rolling-panda controller: {event.text}", file=sys.stderr, flush=True)
        if now >= self._report_due and not waits:
            self._report_due = now + 1.0 / REPORT.rate_hz
            self._report.put(self._ledger.report)

    def run(self, stopping: threading.Event) -> None:
        """Run until `stopping` is set. Late periods are counted; missed periods are skipped."""
        due = began = time.monotonic()
        while not stopping.is_set():
            started = time.monotonic()
            self._count += 1
            self._late += started - began > _LATE * self._period
            began = started
            now = self._clock.turn(started)
            self._commands.decide(now)
            outputs = self._controller.step(self.update(), now)
            self._ticks.append(time.monotonic() - started)
            self.publish(outputs, now)
            self._barrier.settle(self._ledger.state, now)
            self._record_lines()
            self._publish_said()
            due += self._period
            wait = due - time.monotonic()
            if wait > 0:
                time.sleep(wait)
            else:
                due += int(-wait / self._period) * self._period
        self._token.put(self._controller.release_token())

    def _newest(self, topic: Topic[Msg]) -> "_Newest[Msg]":
        return _Newest(self._transport.slot(topic), self._clock)

    def _on_heartbeat(self, beat: m.Heartbeat, at: float) -> None:
        last = self._beats.get(beat.process)
        # A heartbeat with an unchanged number comes from a loop that hangs.
        if last is None or last[0] != beat.sequence:
            self._beats[beat.process] = (beat.sequence, self._clock.of(at))

    def _record_lines(self) -> None:
        """Write the log lines of the other processes to the ledger. The controller's own lines are in its records."""
        for line in self._log_events.drain():
            if line.message.process != self._transport.process:
                self._ledger.note(line.message)

    def _release(self, release: m.ReleaseStop) -> None:
        """Runs on its own thread, because the service call blocks."""
        try:
            answer = self._transport.call(RELEASE, release)
        except ServiceError as error:
            self._said.put(f"the stop is not released: {error}")
            return
        if not answer.ok:
            self._said.put(f"the bridge does not release the stop: {answer.reason}")

    def _publish_said(self) -> None:
        for _ in range(20):
            if self._said.empty():
                return
            text = self._said.get()[:500]
            header = m.Header(time.monotonic())
            self._event.put(m.LogEvent(header=header, process="controller", severity="warning", text=text))
