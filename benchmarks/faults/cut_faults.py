"""Kills, standstills and jumps of the clock at the instants around a cut, between real processes on the wire.

Each trial waits for one instant of one cut, as it is seen from outside: in the ledger's own file, on the wire and at
the blades. Where an instant would last for milliseconds only, the ledger's lock is held for a moment, as a slow disk
would. What was true when the fault came is noted with the trial, so that the aim can be judged as well. The blades' own
record says what was cut.
"""

import math
import random
import tempfile
import time
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass, replace
from pathlib import Path

from benchmarks.faults.cut_judge import Finding, judge_cuts, records
from benchmarks.faults.cut_rig import CLOSE_S, CutRig
from benchmarks.faults.state_disk import StateDisk
from rolling_panda.errors import RollingPandaError
from tests.support.processes.wall_clock import WallClock

#: The instants, in the order of a cut.
INSTANTS = ("intent unwritten", "intent written", "blades closing", "result unwritten")
_HOUR, _YEAR = 3600, 365 * 86400
_JUMPS = (_HOUR, -_HOUR, 10 * _YEAR, -10 * _YEAR)
#: How long processes stand still (s): within every deadline, beyond the watchdog's, beyond a cut's timeout.
_STILL_S = (0.05, 0.3, 1.0, 3.5)
#: The writer of the ledger stands still for so long (s): within what is a fault, and beyond it.
_WRITER_S = (0.1, 0.4, 0.8, 2.0)
#: A state folder is read-only for so long (s).
_READ_ONLY_S = (0.2, 1.0, 3.0)
#: A state is told this often at least (s), unless a record is waited for.
_PENDING_S = 0.13
_PATIENCE_S = 20.0
#: From nearer than this (m) it is a tenth of a second to the cut.
_NEAR = 0.006
#: Cuts of one start of all processes: the queue keeps every point that was ever worked on.
_BATCH = 40


@dataclass(frozen=True)
class CutFault:
    """What is done to whom: `kill` and `halt` to a process, `still` to the ledger's writer, `clock` to all."""

    name: str
    target: str
    how: str


CUT_FAULTS: tuple[CutFault, ...] = (
    CutFault("bridge killed", "bridge", "kill"),
    CutFault("bridge stands still", "bridge", "halt"),
    CutFault("controller killed", "controller", "kill"),
    CutFault("controller stands still", "controller", "halt"),
    CutFault("bridge killed as it tells of a stop", "bridge", "kill told"),
    CutFault("controller killed as it tells of a stop", "controller", "kill told"),
    CutFault("router killed", "router", "kill"),
    CutFault("router stands still", "router", "halt"),
    CutFault("ledger's writer killed as it writes", "controller", "kill writing"),
    CutFault("ledger's writer stands still", "controller", "still"),
    CutFault("state folder read-only", "all", "read-only"),
    CutFault("wall clocks jump by 1 h and 10 y", "all", "clock"),
)


class NoTrialError(RollingPandaError):
    """The instant was over before the fault came; nothing is wrong with that."""


@dataclass(frozen=True)
class Seen:
    """What was true of a cut when the fault came."""

    intent_written: bool
    closing: bool
    bitten: bool
    outcome_told: bool
    result_written: bool

    @property
    def instant(self) -> str:
        """Which of the instants this was."""
        if self.result_written:
            return "over"
        if self.outcome_told or self.bitten:
            return INSTANTS[3]
        if self.closing:
            return INSTANTS[2]
        return INSTANTS[1] if self.intent_written else INSTANTS[0]


@dataclass(frozen=True)
class CutTrial:
    """One fault at one cut: which, at what instant it was aimed and what was hit, and how the point ended."""

    fault: str
    aimed: str
    hit: str
    lasted_s: float
    point_id: str
    row: int
    ended: str = ""
    cut: bool = False


@dataclass(frozen=True)
class Report:
    """Trials, what is wrong in the records of all starts, and how the trials went."""

    trials: tuple[CutTrial, ...] = ()
    findings: tuple[Finding, ...] = ()
    cuts: int = 0
    rows: int = 0
    starts: int = 0
    missed: tuple[str, ...] = ()
    seconds: float = 0.0


def run_cut_faults(
    faults: Sequence[CutFault],
    trials: int,
    seed: int,
    folder: Path,
    told: Callable[[str], None] = print,
    keep: Callable[[Report], None] = lambda _: None,
    before: Report = Report(),
) -> Report:
    """So many trials of each fault, dealt out to the instants.

    Args:
        faults: Which.
        trials: Of each.
        seed: Of the order, and of the moments within an instant.
        folder: For state and logs of each start.
        told: Hears how it goes.
        keep: Is given all that is done, after each start of the processes.
        before: What was done already: it counts, and is not done again.
    """
    draw, began = random.Random(seed + len(before.trials)), time.monotonic()
    had = Counter((trial.fault, trial.aimed) for trial in before.trials)
    due = [
        (fault, instant)
        for fault in faults
        for place, instant in enumerate(INSTANTS)
        for _ in range(len(range(place, trials, len(INSTANTS))) - had[fault.name, instant])
    ]
    draw.shuffle(due)
    report = before
    while due and len(report.missed) - len(before.missed) < 10 + len(due) // 4:
        place = Path(tempfile.mkdtemp(dir=folder))
        batch: list[CutTrial] = []
        missed: list[str] = []
        with CutRig(place, WallClock(place), StateDisk(place)) as rig:
            while due and len(batch) + len(missed) < _BATCH:
                fault, instant = due.pop()
                try:
                    batch.append(_trial(rig, fault, instant, draw))
                except NoTrialError as error:
                    due.insert(0, (fault, instant))
                    missed.append(f"{fault.name}, {instant}: {error}")
                except RollingPandaError as error:
                    missed.append(f"{fault.name}, {instant}: {error}")
                    told(f"the robot does not come back: {missed[-1]}")
                    break
            left = records(rig)
            found = judge_cuts(left)
            batch = [_ended(trial, rig) for trial in batch]
        cuts = sum(event["event"] == "bite" for event in left.blades)
        report = Report(
            (*report.trials, *batch),
            (*report.findings, *found),
            report.cuts + cuts,
            report.rows + left.rows,
            report.starts + 1,
            (*report.missed, *missed),
            round(before.seconds + time.monotonic() - began, 1),
        )
        keep(report)
        told(f"start {report.starts}: {len(report.trials)} trials, {len(due)} to go, {report.seconds:.0f} s; {place}")
        for each in found:
            told(f"  {each.kind}: {each.text}")
    return report


def table(report: Report) -> Iterator[str]:
    """The report for people, a line at a time."""
    yield f"{'fault':38} {'trials':>6}  hit, by instant; how the points ended"
    for name in dict.fromkeys(trial.fault for trial in report.trials):
        those = [trial for trial in report.trials if trial.fault == name]
        hit, ended = Counter(trial.hit for trial in those), Counter(trial.ended for trial in those)
        words = ", ".join(f"{instant} {hit[instant]}" for instant in (*INSTANTS, "over") if hit[instant])
        states = ", ".join(f"{state} {count}" for state, count in sorted(ended.items()))
        yield f"{name:38} {len(those):6}  {words}; {states}"
    kinds = Counter(finding.kind for finding in report.findings)
    yield f"{report.cuts} cuts, {report.rows} rows of ledgers, {report.starts} starts, {report.seconds:.0f} s"
    for kind in (
        "double cut",
        "lost row",
        "damaged ledger",
        "untrue state",
        "certain of the unknown",
        "forgotten stop",
    ):
        yield f"{kind:24} {kinds[kind]}"
    if report.missed:
        yield f"not tried: {len(report.missed)}"


# --- one trial -------------------------------------------------------------------------------------------------------


def _trial(rig: CutRig, fault: CutFault, instant: str, draw: random.Random) -> CutTrial:
    rig.at_work()
    point = _before_the_cut(rig)
    holds = instant in (INSTANTS[0], INSTANTS[3]) and fault.how != "still"
    with _Instant(rig, point, instant, holds) as let_go:
        if instant == INSTANTS[2]:
            time.sleep(draw.uniform(0.0, 0.9 * CLOSE_S))
        if fault.how == "kill writing":
            let_go()
            if instant != INSTANTS[1]:
                _until(rig.wal_grown(), 1.0)
            time.sleep(draw.choice((0.0, 0.0, 0.0005, 0.002)))
        seen, row = _seen(rig, point), rig.newest_row()
        if seen.instant == "over":
            raise NoTrialError("the cut was over")
        lasted = _strike(rig, fault, draw, let_go)
    # The next fault comes when this one's cut is decided, or was never begun.
    end = time.monotonic() + _PATIENCE_S
    while not rig.decided(point, row) and time.monotonic() < end:
        rig.at_work()
        time.sleep(0.02)
    rig.at_work()
    return CutTrial(fault.name, instant, seen.instant, lasted, point, row)


def _strike(rig: CutRig, fault: CutFault, draw: random.Random, let_go: Callable[[], None]) -> float:
    """The fault, and its end; how long it lasted (s)."""
    if fault.how == "kill told":
        let_go()
        return _kill_as_it_tells(rig, fault.target)
    if fault.how == "read-only":
        let_go()
        lasts = draw.choice(_READ_ONLY_S)
        rig.disk.set_read_only(True)
        time.sleep(lasts)
        rig.disk.set_read_only(False)
        return lasts
    if fault.how.startswith("kill"):
        rig.kill(fault.target)
        let_go()
        pause = draw.choice((0.0, 0.0, 1.0, 3.5))
        time.sleep(pause)
        rig.start(fault.target)
        return pause
    if fault.how == "halt":
        lasts = draw.choice(_STILL_S)
        rig.halt(fault.target)
        let_go()
        time.sleep(lasts)
        rig.go_on(fault.target)
        return lasts
    if fault.how == "still":
        lasts = draw.choice(_WRITER_S)
        with rig.writer_stands_still():
            time.sleep(lasts)
        return lasts
    ahead = draw.choice(_JUMPS)
    rig.clock.set(ahead)
    let_go()
    return float(ahead)


def _kill_as_it_tells(rig: CutRig, name: str) -> float:
    """A stop is pressed, and the process killed with the first word that it has latched it."""
    rig.latched.pop(name, None)
    stop_id = rig.press_stop()
    _until(lambda: stop_id in rig.latched.get(name, ()), _PATIENCE_S, nap_s=0.0002)
    if stop_id not in rig.latched.get(name, ()):
        raise RollingPandaError(f"the {name} has not latched the stop; {rig.describe()}\n{rig.logs()}")
    rig.kill(name)
    rig.start(name)
    latched = rig.wait(lambda: name in rig.latched and rig.latched, _PATIENCE_S, f"the {name} to tell of its stops")
    if stop_id not in latched[name]:
        rig.told.forgotten.append(f"{name}: {stop_id}")
    return 0.0


def _ended(trial: CutTrial, rig: CutRig) -> CutTrial:
    """With how its point ended: the ledger's first word after the fault, which no person has said."""
    states = [
        body["state"] for number, name, body in rig.rows("ticket") if name == trial.point_id and number > trial.row
    ]
    ended = next((state for state in states if state != "CUTTING"), "") or rig.ticket(trial.point_id)
    return replace(trial, ended=ended, cut=trial.point_id in rig.bitten())


def _seen(rig: CutRig, point: str) -> Seen:
    written = rig.ticket(point)
    events = [event for event in rig.blades() if event["point_id"] == point]
    cut_ids = {event["cut_id"] for event in events}
    return Seen(
        intent_written=written not in ("", "ACCEPTED", "PROPOSED"),
        closing=bool(events),
        bitten=any(event["event"] != "closing" for event in events),
        outcome_told=bool(cut_ids & rig.told.outcomes.keys()),
        result_written=written in ("DONE", "FAILED_NOT_CUT", "UNKNOWN"),
    )


# --- instants --------------------------------------------------------------------------------------------------------


def _before_the_cut(rig: CutRig) -> str:
    """Wait until the tool is a moment from the next point; which."""
    last = ""
    end = time.monotonic() + 3 * _PATIENCE_S
    while time.monotonic() < end:
        state = rig.controller
        if state is None or state.mode != "AUTO":
            rig.at_work()
            continue
        if state.phase == "ADVANCE" and state.active_point_id and rig.ticket(state.active_point_id) == "ACCEPTED":
            point = rig.shown(state.active_point_id)
            tool = state.T_odom_tool
            if point is not None and tool is not None and math.dist(tool.position, point.position) < _NEAR:
                return state.active_point_id
        last = state.phase
        rig.offer_and_accept()
        time.sleep(0.005)
    raise RollingPandaError(f"no cut came in {3 * _PATIENCE_S:.0f} s ({last}); {rig.describe()}\n{rig.logs()}")


class _Instant(AbstractContextManager[Callable[[], None]]):
    """The instant has come inside; calling what it gives lets the ledger's writer go on, which the end does anyway."""

    def __init__(self, rig: CutRig, point: str, instant: str, holds: bool) -> None:
        self._rig, self._point, self._instant = rig, point, instant
        self._holds = holds
        self._lock: AbstractContextManager[None] | None = None

    def __enter__(self) -> Callable[[], None]:
        rig, point = self._rig, self._point
        if self._instant == INSTANTS[0]:
            self._hold()
            if self._holds:
                # A state is held back until all that it tells is in the ledger: none comes, so the intent waits.
                _until(lambda: time.monotonic() - rig.controller_at > _PENDING_S, _PATIENCE_S)
        elif self._instant == INSTANTS[1]:
            _until(lambda: rig.ticket(point) == "CUTTING", _PATIENCE_S, nap_s=0.0005)
        elif self._instant == INSTANTS[2]:
            _until(lambda: _closing(rig, point), _PATIENCE_S)
        else:
            _until(lambda: _closing(rig, point), _PATIENCE_S)
            self._hold()
            _until(lambda: any(e["event"] != "closing" and e["point_id"] == point for e in rig.blades()), 2.0)
        return self._let_go

    def __exit__(self, *_: object) -> None:
        self._let_go()

    def _hold(self) -> None:
        if self._holds:
            self._lock = self._rig.writer_stands_still()
            self._lock.__enter__()

    def _let_go(self) -> None:
        lock, self._lock = self._lock, None
        (lock or nullcontext()).__exit__(None, None, None)


def _closing(rig: CutRig, point: str) -> bool:
    return any(event["point_id"] == point for event in rig.blades())


def _until(condition: Callable[[], bool], limit_s: float, nap_s: float = 0.001) -> None:
    end = time.monotonic() + limit_s
    while not condition() and time.monotonic() < end:
        time.sleep(nap_s)
