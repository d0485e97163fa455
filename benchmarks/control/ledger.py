"""What recording costs the control step: without a disk, with one, and with one whose every flush takes 200 ms."""

import gc
import tempfile
import time
from collections.abc import Callable, Iterable, Sequence
from contextlib import ExitStack, closing
from dataclasses import asdict
from pathlib import Path
from typing import Any

from benchmarks.common.documents import bench_parser, write
from benchmarks.control.tick import working
from benchmarks.control.tick_parts import Times
from controller.ledger.check import verify
from controller.ledger.journal import LedgerState, Record, Records
from controller.ledger.store import Entry, Ledger
from controller.ledger.writer import LedgerWriter
from rolling_panda import commands as intents
from rolling_panda import messages as m
from rolling_panda.reasons import said
from rolling_panda.runtime.scheduling import set_priority
from tests.support.sent import every

_PERIOD_S = 0.01
_SLOW_S = 0.2
#: An operator's decision every so many periods, and a line of another process's log: more than any work gives.
_DECISION, _LINE = 20, 5
_LINE_OF_OTHERS = m.LogEvent(header=m.Header(), process="server", reason=said("bench"))


class SlowDisk(Ledger):
    """A ledger on a disk whose every flush takes its time; like a flush it waits outside of Python's lock."""

    def append(self, entries: Iterable[Entry]) -> int:
        """Add rows, slowly."""
        time.sleep(_SLOW_S)
        return super().append(entries)


class NoDisk:
    """Takes records and forgets them: what the step costs without a ledger."""

    def __init__(self) -> None:
        """Start with nothing taken."""
        self.state = LedgerState()

    def write(self, records: tuple[Record, ...]) -> None:
        """Durable at once."""
        if records:
            self.state = LedgerState(records[-1].number)

    def note(self, line: m.LogEvent) -> None:
        """Nothing is kept."""

    def close(self) -> None:
        """Nothing is open."""


class Side:
    """A robot at work and the ledger that its records go to."""

    def __init__(self, ledger: LedgerWriter | NoDisk) -> None:
        """In automatic work, with nothing recorded."""
        self.ledger, self.robot = ledger, working()
        self._steps = 0

    def step(self) -> float | None:
        """One control step with handing its records over; how long it took (s), None when the work has ended."""
        robot, ledger = self.robot, self.ledger
        if self._steps % _DECISION == 0:
            robot.ask(intents.RejectPoint(user="bench", point_id="p999"))
        robot.ledger = ledger.state
        inbox = robot.inputs()
        started = time.perf_counter()
        out = robot.controller.step(inbox, robot.now)
        for records in every(out, Records):
            ledger.write(records.rows)
        ended = time.perf_counter()
        if robot.controller.mode != "AUTO":
            return None
        self._steps += 1
        if self._steps % _LINE == 0:
            ledger.note(_LINE_OF_OTHERS)
        robot.take(out)
        return ended - started


def measure(kinds: dict[str, Callable[[], LedgerWriter | NoDisk]], steps: int) -> dict[str, list[float]]:
    """Durations (s) of up to so many control steps of each kind, side by side in the same periods of 10 ms.

    What else the machine does then meets all kinds alike. Each begins a period as often as the others. It ends early
    when one of the robots has no more work.
    """
    durations: dict[str, list[float]] = {name: [] for name in kinds}
    with ExitStack() as stack:
        sides = {name: Side(stack.enter_context(closing(make()))) for name, make in kinds.items()}
        gc.collect()
        gc.freeze()
        due = time.perf_counter()
        for turn in range(steps):
            first = turn % len(kinds)
            took = {name: sides[name].step() for name in [*kinds, *kinds][first : first + len(kinds)]}
            if None in took.values():
                break
            for name, duration in took.items():
                durations[name].append(duration or 0.0)
            due += _PERIOD_S
            time.sleep(max(0.0, due - time.perf_counter()))
        gc.unfreeze()
    return durations


def main(argv: Sequence[str]) -> int:
    """Measure, print, and write the figures. Returns the exit code."""
    parser = bench_parser("ledger", __doc__)
    parser.add_argument("--seconds", type=float, default=30.0, help="of work of each kind (default: %(default)s)")
    parser.add_argument(
        "--real-time", action="store_true", help="scheduled before other programs, as the controller is"
    )
    arguments = parser.parse_args(argv)
    if arguments.seconds <= 0.0:
        parser.error("--seconds must be positive")
    if arguments.real_time:
        set_priority("control")
    steps = round(arguments.seconds / _PERIOD_S)
    durations: dict[str, list[float]] = {"no disk": [], "disk": [], "slow disk": []}
    with tempfile.TemporaryDirectory() as folder:
        while (left := steps - len(durations["disk"])) > 0:
            # Records are numbered anew with each controller.
            place = Path(tempfile.mkdtemp(dir=folder))
            for name, those in measure({name: _ledgers(name, place / name) for name in durations}, left).items():
                durations[name] += those
                if name != "no disk":
                    _check(place / name)
    figures: dict[str, Any] = {"slow_flush_s": _SLOW_S}
    for name, each in durations.items():
        times = Times.of(each)
        figures[name] = {**asdict(times), "steps": len(each)}
        print(
            f"{name:<10} median {times.median_us} us, p99 {times.p99_us} us, max {times.max_us} us, {len(each)} steps"
        )
    write(arguments.json, figures)
    return 0


def _ledgers(name: str, place: Path) -> Callable[[], LedgerWriter | NoDisk]:
    place.mkdir()
    kinds: dict[str, Callable[[], LedgerWriter | NoDisk]] = {
        "no disk": NoDisk,
        "disk": lambda: LedgerWriter(lambda: Ledger(place)),
        "slow disk": lambda: LedgerWriter(lambda: SlowDisk(place)),
    }
    return kinds[name]


def _check(place: Path) -> None:
    verdict = verify(place)
    if verdict.problem or not verdict.rows:
        raise SystemExit(f"bench ledger: the ledger is not whole: {verdict.problem or 'it is empty'}")
