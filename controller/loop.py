"""The controller as a process: its core with the ledger, the planner and the file of the latched stops."""

import sys
from collections import deque
from collections.abc import Sequence
from pathlib import Path
from typing import Any, Protocol

from controller.ledger.journal import LedgerState, Records
from controller.ledger.writer import LedgerWriter
from controller.planner_process import PlannerProcess
from controller.planning.preview_plan import PreviewRequest
from controller.planning.work_plan import PlanRequest
from rolling_panda import messages as m
from rolling_panda import reasons
from rolling_panda.messages.supervision import ControlState, PreviewMotion, PreviewState, StopRecord, StopState
from rolling_panda.reasons import text_of, with_reason
from rolling_panda.runtime.latest_file import KeptValue, LatestFileWriter
from rolling_panda.runtime.state_folder import read_kept
from rolling_panda.topics import REPORT
from rolling_panda.transport.inbox import Inbox, Reply
from rolling_panda.transport.runner import Runner, Standby, Wire

_STOPS_NAME = "controller-stops.json"
#: The newest first.
Stops = tuple[StopRecord, ...]


def open_stop_file(folder: Path) -> KeptValue[Stops]:
    """The latched stops kept in a folder.

    Raises:
        InputError: They cannot be read: a controller that does not know what was stopped must not start.
    """
    path = folder / _STOPS_NAME
    stops = read_kept(path, Stops, (), "which stops were latched", upgrade=_upgraded)
    return KeptValue(stops, LatestFileWriter(path))


def _upgraded(stops: Any) -> Any:
    return [with_reason(stop) for stop in stops] if isinstance(stops, list) else stops


#: Time limit of a record; after it the answer is "not recorded" (s).
_PATIENCE_S = 0.6


class CommitBarrier:
    """Queue of messages that wait for their records to be durable, in the order of the records. No clock."""

    def __init__(self) -> None:
        """Start with nothing to say."""
        self._waiting: deque[tuple[int, float, object]] = deque()

    def hold(self, number: int, now: float, message: object) -> None:
        """Keep a message until all records up to `number` are durable."""
        self._waiting.append((number, now, message))

    def settle(self, ledger: LedgerState, now: float) -> list[object]:
        """The messages whose records are durable. A reply without a record becomes a refusal with the cause."""
        out = []
        while self._waiting:
            number, since, message = self._waiting[0]
            why = None
            if number > ledger.durable:
                if ledger.failure is not None:
                    why = ledger.failure
                elif now - since > _PATIENCE_S:
                    why = reasons.ledger_silent(now - since)
                else:
                    break
            self._waiting.popleft()
            out.append(message if why is None else _unrecorded(message, reasons.decision_unrecorded(why)))
        return out


def _unrecorded(message: object, why: m.Reason) -> object:
    if not isinstance(message, Reply) or message.answer is None or not message.answer.ok:
        return message
    return Reply(message.request, m.Answer(ok=False, reason=why))


#: Longest time that the loop's clock advances in one iteration, in periods.
_LONGEST_TURN = 5


class Core(Protocol):
    """The part of `controller.core.Controller` that the process needs."""

    @property
    def waits(self) -> bool:
        """Whether another controller commands the robot."""

    @property
    def recorded(self) -> int:
        """Number of the newest record."""

    def step(self, inbox: Inbox, now: float) -> list[object]:
        """One control period."""

    def end(self) -> list[object]:
        """The last messages."""


class ControllerProcess:
    """Steps the core. What it says of its decisions is sent once the ledger and the file of stops hold them."""

    def __init__(
        self,
        core: Core,
        ledger: LedgerWriter,
        planner: PlannerProcess | None = None,
        stop_file: KeptValue[Stops] | None = None,
    ) -> None:
        """Bind the parts.

        Args:
            core: The core.
            ledger: Writer of the records.
            planner: Planner of plans and previews; None works without them.
            stop_file: File of the latched stops; None keeps nothing.
        """
        self._core, self._ledger, self._planner = core, ledger, planner
        self._stop_file = stop_file or KeptValue(())
        self._barrier = CommitBarrier()
        self._stops_told: StopState | None = None
        self._report_due = 0.0
        self._recorded = LedgerState()
        self._waited = False

    def step(self, inbox: Inbox, now: float) -> list[object]:
        """One control period; returns the messages for the wire.

        While another controller commands the robot, no state is told, and events are printed too.
        """
        self._gather(inbox, now)
        out: list[object] = []
        told = self._core.step(inbox, now)
        waits = self._core.waits
        for message in told:
            match message:
                case m.ControllerState() | ControlState() | PreviewState() | PreviewMotion() if waits:
                    pass
                case Records():
                    self._ledger.write(message.rows)
                case m.ControllerState() | Reply():
                    self._barrier.hold(self._core.recorded, now, message)
                case StopState():
                    self._stop_file.keep(message.stops)
                    self._stops_told = message
                case PlanRequest() | PreviewRequest():
                    if self._planner is not None:
                        self._planner.ask(message)
                case _:
                    out.append(message)
        out += self._barrier.settle(self._ledger.state, now)
        # A stop is reported as latched when it is on disk, so that it is latched after a restart too.
        # If the disk fails, there is a fault.
        if self._stops_told is not None and (self._stop_file.kept or self._stop_file.failure):
            out.append(self._stops_told)
            self._stops_told = None
        if now >= self._report_due:
            self._report_due = now + 1.0 / REPORT.rate_hz
            out += (self._ledger.report, self._ledger.timeline)
        if waits:
            for message in out:
                if isinstance(message, m.LogEvent):
                    print(f"rolling-panda controller: {text_of(message.reason)}", file=sys.stderr, flush=True)
        if waits is not self._waited:
            self._waited = waits
            out.insert(0, Standby(waits))
        return out

    def end(self) -> Sequence[object]:
        """The last messages."""
        return self._core.end()

    def _gather(self, inbox: Inbox, now: float) -> None:
        """Put what the other parts have made into the inbox, and other processes' log lines into the ledger."""
        state = self._ledger.state
        recorded = LedgerState(state.durable, state.failure or self._stop_file.failure)
        if recorded != self._recorded:
            self._recorded = recorded
            inbox.put(recorded, now)
        if self._planner is not None:
            for made in self._planner.take():
                inbox.put(made, now)
        # The controller's own lines are in its records.
        for line in inbox.drain(m.LogEvent):
            if line.message.process != "controller":
                self._ledger.note(line.message)


def controller_runner(
    core: Core,
    wire: Wire,
    rate_hz: float,
    ledger: LedgerWriter,
    planner: PlannerProcess | None = None,
    stop_file: KeptValue[Stops] | None = None,
) -> Runner:
    """The controller on a wire; arguments as of `ControllerProcess`, at `rate_hz`."""
    process = ControllerProcess(core, ledger, planner, stop_file)
    return Runner(process, wire, 1.0 / rate_hz, _LONGEST_TURN / rate_hz)
