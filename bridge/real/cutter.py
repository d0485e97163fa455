"""Electric secateurs behind a ROS 2 service: `true` closes the blades, `false` opens them.

The service (std_srvs/SetBool) answers when the blades have reached their end position: success, or a reason. So the
device reports a jam, and a timeout detects silence. The outcome of the cut is then unknown, and a person decides.
"""

import queue
import threading
import time
from dataclasses import dataclass

from bridge.core.interface import NO_CUT, CutterState
from bridge.real import ros_messages as ros
from bridge.real.config import CutterConfig
from rolling_panda import reasons
from rolling_panda.errors import MessageError, ServiceError
from rolling_panda.messages.types import Outcome, Reason
from rolling_panda.transport.zenoh import ForeignWire


@dataclass(frozen=True)
class CutterStatus:
    """State of the blades, and the outcome of the last cut."""

    state: CutterState
    cut_id: str = ""
    outcome: Outcome = ""
    detail: Reason = NO_CUT


class Cutter:
    """Implements the cutter's part of the robot. Calls return at once; a thread calls the service."""

    def __init__(self, wire: ForeignWire, config: CutterConfig, moving: bool = True) -> None:
        """Open the blades, whatever they were at, unless `moving` is off."""
        self._wire, self._config = wire, config
        self._silent = reasons.cutter_silent(config.timeout_s)
        self._status = CutterStatus("opening" if moving else "open")
        self._enabled = False
        self._interrupted = threading.Event()
        self._orders: queue.SimpleQueue[str | None] = queue.SimpleQueue()
        self._closing = threading.Event()
        self._thread = threading.Thread(target=self._run, args=(moving,), name="cutter", daemon=True)
        self._thread.start()

    def read(self) -> CutterStatus:
        """The newest state."""
        return self._status

    def enable(self, blades: bool) -> None:
        """Whether the blades may close now; one that closes without it opens again."""
        if self._enabled and not blades and self._status.state == "closing":
            self._interrupted.set()
            # Concurrent with the request in progress: the device must get it at once.
            threading.Thread(target=self._call_service, args=(False,), name="cutter-open", daemon=True).start()
        self._enabled = blades

    def cut(self, cut_id: str) -> None:
        """Begin to close the blades."""
        self._interrupted.clear()
        self._status = CutterStatus("closing", cut_id)
        self._orders.put(cut_id)

    def close(self) -> None:
        """Let go; safe to call twice."""
        if not self._closing.is_set():
            self._closing.set()
            self._orders.put(None)
            self._thread.join()
            self._wire.close()

    def _run(self, moving: bool) -> None:
        if moving:
            self._open("")
        while (cut_id := self._orders.get()) is not None:
            if not self._enabled or self._interrupted.is_set():
                self._end(cut_id, "FAILED_NOT_CUT", reasons.inhibited_before_closing())
                continue
            failure = self._call_service(True)
            if self._interrupted.is_set():
                self._end(cut_id, "UNKNOWN", reasons.inhibited_while_closing())
            elif failure is None:
                self._end(cut_id, "DONE", reasons.blades_met())
            elif failure == self._silent:
                self._end(cut_id, "UNKNOWN", failure)
            else:
                self._end(cut_id, "FAILED_NOT_CUT", failure, "jammed")

    def _end(self, cut_id: str, outcome: Outcome, detail: Reason, state: CutterState = "opening") -> None:
        self._status = CutterStatus(state, cut_id, outcome, detail)
        self._open(cut_id)

    def _open(self, cut_id: str) -> None:
        """Open the blades, however often it takes."""
        while not self._closing.is_set():
            last = self._status
            if self._call_service(False) is None:
                self._status = CutterStatus("open", last.cut_id, last.outcome, last.detail)
                return
            self._status = CutterStatus("jammed", last.cut_id, last.outcome, last.detail)
            time.sleep(self._config.retry_s)

    def _call_service(self, shut: bool) -> Reason | None:
        """Close or open. Returns the reason of a failure, None on success."""
        config = self._config
        try:
            data = self._wire.ask(config.service, ros.encode(ros.make(ros.SET_BOOL, data=shut)), config.timeout_s)
            reply = ros.decode(ros.SET_BOOL_REPLY, data)
        except (ServiceError, MessageError):
            return self._silent
        if reply.success:
            return None
        return reasons.cutter_jam_reported(str(reply.message)) if reply.message else reasons.blades_not_closed()
