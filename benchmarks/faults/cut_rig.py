"""Router, controller and bridge as processes of their own, cutting one point after another, and everybody else played.

The script is server and perception on the wire: it says who is there, shows points, answers looks by what the blades
have really done, and asks for work as a person would. It keeps what it was told, to be compared with the ledger later.
"""

import contextlib
import json
import sqlite3
import threading
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Self

import msgspec

from benchmarks.faults.state_disk import StateDisk
from controller.ledger.store import FILE
from rolling_panda import commands as intents
from rolling_panda import messages as m
from rolling_panda import topics
from rolling_panda.config import TransportConfig
from rolling_panda.errors import RollingPandaError, ServiceError
from rolling_panda.messages.perception import CloseUpRequest, CloseUpResult, Obstacles, point_digest
from rolling_panda.messages.supervision import Person, Presence, StopState
from rolling_panda.reasons import said, text_of
from rolling_panda.transport import certificates
from rolling_panda.transport.access import RECORDER
from rolling_panda.transport.zenoh import Onlooker, Transport
from tests.support.points import point
from tests.support.processes.local_router import free_port
from tests.support.processes.processes import Processes
from tests.support.processes.wall_clock import WallClock, together

PROCESSES = ("router", "plant", "bridge", "controller")
#: Blades close in this time (s).
CLOSE_S = 0.3
_START_S, _BACK_S = 60.0, 90.0
_USER = "ada"
#: Points shown at a time, and the places that they are at in turn.
_SHOWN, _PLACES = 3, 12
#: States of a point that its ledger must have when somebody was told of them.
TOLD: frozenset[str] = frozenset({"ACCEPTED", "CUTTING", "DONE", "FAILED_NOT_CUT", "UNKNOWN", "REJECTED"})


@dataclass
class Told:
    """What was said on the wire.

    Attributes:
        ordered: Cuts, and when (s, monotonic).
        outcomes: Of cuts, by the bridge.
        states: Of points, by the controller.
        granted: What was asked and granted: kind and point.
        forgotten: Processes that did not know after a restart of a stop that they had told to be latched.
    """

    ordered: dict[str, float] = field(default_factory=dict)
    outcomes: dict[str, str] = field(default_factory=dict)
    states: set[tuple[str, str]] = field(default_factory=set)
    granted: list[tuple[str, str]] = field(default_factory=list)
    forgotten: list[str] = field(default_factory=list)


class CutRig(Processes):
    """Use as a context manager; `folder` keeps state, logs and the blades' record."""

    def __init__(self, folder: Path, clock: WallClock, disk: StateDisk) -> None:
        """Start nothing yet; the processes see this clock, and their state folder is on this disk."""
        super().__init__(folder)
        self.clock, self.disk = clock, disk
        self.environment |= together(clock.environment, disk.environment)
        self.state_folder = disk.folder
        self.endpoint = f"tls/127.0.0.1:{free_port()}"
        certificates.make(folder / "certificates", ("127.0.0.1",), None)
        self.told = Told()
        self.controller: m.ControllerState | None = None
        self.controller_at = 0.0
        self.bridge: m.BridgeState | None = None
        self.latched: dict[str, set[str]] = {}
        self._joints: m.JointState | None = None
        self._ending = threading.Event()
        self._made = 0
        self._shown: dict[str, m.PruningPoint] = {}
        self._wires = contextlib.ExitStack()
        self._ledger: sqlite3.Connection | None = None

    def __enter__(self) -> Self:
        """Start everything."""
        try:
            for name in PROCESSES:
                self.start(name)
            self._connect()
            self.wait(lambda: self.controller is not None and self.bridge is not None, _START_S, "the first states")
        except BaseException:
            self.close()
            raise
        return self

    # --- processes ---------------------------------------------------------------------------------------------------

    def start(self, name: str) -> None:
        """Start (or start again) one process."""
        closed = ["--certificates", str(self.folder / "certificates")]
        kept = ["--connect", self.endpoint, "--state", str(self.state_folder), *closed]
        plant = self.folder / "plant"
        words = {
            "router": ("rolling_panda", ["router", "--listen", self.endpoint, *closed]),
            "plant": ("benchmarks.faults.cut_plant", [str(plant), str(self.folder / "blades"), str(CLOSE_S)]),
            "bridge": (
                "benchmarks.faults.cut_bridge",
                [*kept, "--plant", str(plant), "--posture", str(self.folder / "posture")],
            ),
            "controller": ("controller", kept),
        }[name]
        self.launch(name, *words, answers=name == "plant")
        if name == "plant":
            self.answer(name)

    def kill(self, name: str) -> float:
        """Kill -9, and wait until it is gone; returns when (s, monotonic)."""
        at = super().kill(name)
        # What it said last is not what it says once it is back.
        self.latched.pop(name, None)
        if name == "controller":
            self.controller = None
        elif name == "bridge":
            self.bridge = None
        return at

    def close(self) -> None:
        """End everything."""
        self._ending.set()
        self._wires.close()
        if self._ledger is not None:
            self._ledger.close()
        super().close()

    def describe(self) -> str:
        """What the controller says it does."""
        state = self.controller
        if state is None:
            return "no controller was heard"
        rows = ", ".join(f"{each.point_id} {each.state}" for each in state.queue if each.state != "DONE")
        age_s = time.monotonic() - self.controller_at
        return f"{state.mode} {state.phase} ({text_of(state.reason)}), {age_s:.1f} s ago: {rows}"

    # --- the wire ----------------------------------------------------------------------------------------------------

    def _connect(self) -> None:
        config = TransportConfig(
            connect=(self.endpoint,), connect_timeout_s=20.0, certificates=str(self.folder / "certificates")
        )
        self._server = self._wires.enter_context(Transport(config, "server", topics.ROBOT_ID))
        self._perception = self._wires.enter_context(Transport(config, "perception", topics.ROBOT_ID))
        hears = self._wires.enter_context(Onlooker(config, topics.ROBOT_ID, RECORDER))
        hears.subscribe(topics.CONTROLLER, self._on_controller)
        hears.subscribe(topics.BRIDGE, self._on_bridge)
        hears.subscribe(topics.CUT, self._on_cut)
        hears.subscribe(topics.STOPS, self._on_stops)
        hears.subscribe(topics.JOINTS, self._on_joints)
        hears.subscribe(topics.CLOSE_UP_REQUEST, self._on_picture)
        self._stop = self._server.publisher(topics.STOP)
        self._look = self._perception.publisher(topics.CLOSE_UP)
        threading.Thread(target=self._play, name="everybody else", daemon=True).start()

    def _on_controller(self, state: m.ControllerState, at: float) -> None:
        for entry in state.queue:
            if entry.state in TOLD:
                self.told.states.add((entry.point_id, entry.state))
        self.controller, self.controller_at = state, at

    def _on_bridge(self, state: m.BridgeState, at: float) -> None:
        if state.cut_id and state.outcome:
            self.told.outcomes[state.cut_id] = state.outcome
        self.bridge = state

    def _on_cut(self, command: m.CutCommand, at: float) -> None:
        self.told.ordered.setdefault(command.cut_id, at)

    def _on_stops(self, state: StopState, at: float) -> None:
        self.latched[state.process] = {stop.stop_id for stop in state.stops}

    def _on_joints(self, joints: m.JointState, at: float) -> None:
        self._joints = joints

    def _on_picture(self, request: CloseUpRequest, at: float) -> None:
        """A camera that always sees the point: standing, or off once the blades have bitten."""
        point, joints = self._shown.get(request.point_id), self._joints
        if joints is None:
            return
        off = request.point_id in self.bitten()
        seen = point is not None and not off
        self._look.put(
            CloseUpResult(
                header=m.Header(joints.header.stamp, "odom"),
                point_id=request.point_id,
                number=request.number,
                finding="severed" if off else "seen" if seen else "unseen",
                position=point.position if seen and point is not None else None,
                tangent=point.tangent if seen and point is not None else None,
            )
        )

    def _play(self) -> None:
        """Server and perception, at the rates of the table of topics."""
        server, perception = self._server, self._perception
        beats = server.publisher(topics.HEARTBEAT), perception.publisher(topics.HEARTBEAT)
        presence, points = server.publisher(topics.PRESENCE), perception.publisher(topics.POINTS)
        obstacles = perception.publisher(topics.OBSTACLES)
        turn = 0
        while not self._ending.wait(0.05):
            turn += 1
            beats[0].put(m.Heartbeat(process="server", sequence=turn))
            beats[1].put(m.Heartbeat(process="perception", sequence=turn))
            if turn % 4 == 0:
                person = Person(_USER, _USER, "supervisor", 0.0, 0.0)
                presence.put(Presence(sequence=turn, people=(person,)))
            joints = self._joints
            if joints is None:
                continue
            header = m.Header(joints.header.stamp, "odom")
            if turn % 4 == 1:
                shown = tuple(self._shown.values())
                points.put(m.PruningPoints(header=header, segmenter="played", frames=turn, points=shown))
            if turn % 10 == 2:
                obstacles.put(Obstacles(header=header, capsules=()))

    def press_stop(self) -> str:
        """The software stop, as the page sends it; its id."""
        stop_id = f"trial-{time.monotonic_ns()}"
        for _ in range(3):
            self._stop.put(m.StopRequest(stop_id=stop_id, source="server", user=_USER, reason=said("trial")))
        return stop_id

    def ask(self, intent: intents.Intent) -> m.Answer | None:
        """What an operator asks; None where nobody answered."""
        intent = msgspec.structs.replace(intent, role="supervisor", client=_USER, view_age_s=0.0)
        try:
            answer = self._server.call(topics.INTENT, intent)
        except ServiceError:
            return None
        if answer.ok:
            self.told.granted.append((type(intent).__name__, getattr(intent, "point_id", "")))
        return answer

    # --- points and what became of them ------------------------------------------------------------------------------

    def blades(self) -> list[dict[str, Any]]:
        """What the blades have really done."""
        path = self.folder / "blades"
        text = path.read_text() if path.exists() else ""
        return [json.loads(line) for line in text.splitlines() if line.endswith("}")]

    def bitten(self) -> set[str]:
        """Points that are really cut off."""
        return {event["point_id"] for event in self.blades() if event["event"] == "bite"}

    def states(self) -> dict[str, str]:
        """State of each point, as the controller says it now."""
        return {} if self.controller is None else {entry.point_id: entry.state for entry in self.controller.queue}

    def offer(self) -> None:
        """Show as many points as there should be, and take away what is settled."""
        states = self.states()
        settled = ("DONE", "FAILED_NOT_CUT", "REJECTED")
        shown = {name: point for name, point in self._shown.items() if states.get(name) not in settled}
        while len(shown) < _SHOWN:
            self._made += 1
            point = self._point(self._made)
            shown[point.point_id] = point
        self._shown = shown

    def shown(self, point_id: str) -> m.PruningPoint | None:
        """A point as perception shows it now."""
        return self._shown.get(point_id)

    def offer_and_accept(self) -> None:
        """Show new points for settled ones, and accept what is proposed."""
        self.offer()
        state = self.controller
        for entry in () if state is None else state.queue:
            if entry.state == "PROPOSED" and entry.point_id in self._shown:
                self.ask(intents.AcceptPoint(user=_USER, point_id=entry.point_id, revision=1))

    @staticmethod
    def _point(number: int) -> m.PruningPoint:
        place = number % _PLACES
        made = point(f"p{number}", (0.30 + 0.02 * place, 0.80, 0.95), vine=1, spur=1 + place)
        return msgspec.structs.replace(made, digest=point_digest(made))

    def lead_on(self) -> str:
        """Do what a person would do next to have the points cut; returns what was refused, for reports."""
        self.offer()
        state = self.controller
        if state is None:
            return ""
        steps: dict[str, intents.Intent] = {
            "IDLE": intents.Arm(user=_USER),
            "FAULT": intents.Acknowledge(user=_USER),
            "PROTECTIVE_STOP": intents.Acknowledge(user=_USER),
            "PAUSED": intents.Resume(user=_USER),
            "READY": intents.Start(user=_USER),
            "ESTOP_LATCHED": intents.Reset(user=_USER, reason="end of a trial"),
        }
        for entry in state.queue:
            if entry.state == "UNKNOWN":
                cut = entry.point_id in self.bitten()
                looked = intents.ResolvePoint(
                    user=_USER, point_id=entry.point_id, outcome="DONE" if cut else "FAILED_NOT_CUT", reason="looked"
                )
                self.ask(looked)
            elif entry.state == "PROPOSED" and entry.point_id in self._shown:
                self.ask(intents.AcceptPoint(user=_USER, point_id=entry.point_id, revision=1))
        intent = steps.get(state.mode)
        if intent is None:
            return ""
        answer = self.ask(intent)
        return "nobody answered" if answer is None or answer.reason is None else text_of(answer.reason)

    def at_work(self) -> None:
        """Lead the robot on until it works.

        Raises:
            RollingPandaError: It does not come to that.
        """
        end, said = time.monotonic() + _BACK_S, ""
        while True:
            state = self.controller
            fresh = time.monotonic() - self.controller_at < 0.5
            waits = state is not None and any(entry.state in ("UNKNOWN", "PROPOSED") for entry in state.queue)
            if fresh and state is not None and state.mode == "AUTO" and not waits:
                self.offer()
                return
            if (ended := self.ended()) or time.monotonic() > end:
                why = f"{', '.join(ended)} ended" if ended else f"it does not work again: {said}"
                raise RollingPandaError(f"{why}; {self.describe()}\n{self.logs()}")
            if fresh:
                said = self.lead_on() or said
            time.sleep(0.1)

    # --- the ledger, from outside ------------------------------------------------------------------------------------

    def _reader(self) -> sqlite3.Connection:
        if self._ledger is None:
            path = (self.state_folder / FILE).resolve()
            self._ledger = sqlite3.connect(f"{path.as_uri()}?mode=ro", uri=True, check_same_thread=False)
        return self._ledger

    def ticket(self, point_id: str) -> str:
        """State of a point's newest row in the ledger; empty where there is none."""
        found = self._reader().execute(
            "SELECT json_extract(body, '$.state') FROM audit WHERE kind = 'ticket' AND name = ? "
            "ORDER BY number DESC LIMIT 1",
            (point_id,),
        )
        row = found.fetchone()
        return "" if row is None else str(row[0])

    def decided(self, point_id: str, row: int) -> bool:
        """Whether the ledger says, after this row, how a cut ended, or that the point still waits for one."""
        states = [body["state"] for number, name, body in self.rows("ticket") if name == point_id and number > row]
        return self.ticket(point_id) != "CUTTING" and (bool(states) or self.states().get(point_id) == "ACCEPTED")

    def newest_row(self) -> int:
        """Number of the newest row."""
        return int(self._reader().execute("SELECT coalesce(max(number), 0) FROM audit").fetchone()[0])

    def rows(self, kind: str) -> list[tuple[int, str, dict[str, Any]]]:
        """Every row of a kind: number, name, body."""
        found = self._reader().execute("SELECT number, name, body FROM audit WHERE kind = ? ORDER BY number", (kind,))
        return [(number, name, json.loads(body)) for number, name, body in found]

    @contextlib.contextmanager
    def writer_stands_still(self) -> Iterator[None]:
        """Hold the ledger's own lock, so that its writer waits as it does for a disk."""
        holder = sqlite3.connect(self.state_folder / FILE, timeout=1.0, isolation_level=None)
        try:
            holder.execute("BEGIN IMMEDIATE")
            yield
            holder.execute("ROLLBACK")
        finally:
            holder.close()

    def wal_grown(self) -> Callable[[], bool]:
        """Whether the ledger's log has been written to since now."""
        path = self.state_folder / f"{FILE}-wal"

        def mark() -> tuple[int, int]:
            try:
                found = path.stat()
            except FileNotFoundError:
                return 0, 0
            return found.st_size, found.st_mtime_ns

        before = mark()
        return lambda: mark() != before
