"""`rolling-panda bench record`: what a recorder on the wire costs the control, with and without it by turns.

The demo moves as a person would see it move. An onlooker, there all the time, measures how long the controller takes
from each joint state to the command that answers it; a recorder is there for every other stretch. What else the machine
does meets both alike.
"""

import math
import signal
import subprocess
import tempfile
import threading
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import psutil

from benchmarks.common.documents import bench_parser, one_row_a_line, write
from benchmarks.control.live import configured, watch
from rolling_panda import messages as m
from rolling_panda.config import TransportConfig
from rolling_panda.errors import InputError
from rolling_panda.runtime.launch import child_environment, python_command
from rolling_panda.runtime.process import ROBOT_ID
from rolling_panda.topics import JOINTS, MOTION
from rolling_panda.transport.access import RECORDER
from rolling_panda.transport.zenoh import Onlooker
from tests.support.processes.demo import Demo

#: What recording may add to the 99th percentile of the answers (s).
LIMIT_S = 0.002
# Joint states that no command has answered are forgotten after so many.
_WAITING = 400


class Answers:
    """Pairs commands with the joint states that they answer. Both come on threads of the transport."""

    def __init__(self) -> None:
        """Nothing has come."""
        self._lock = threading.Lock()
        self._asked: dict[int, float] = {}
        self._took: list[float] = []

    def on_joints(self, state: m.JointState, at: float) -> None:
        """A joint state came at `at` (s)."""
        with self._lock:
            self._asked[state.sequence] = at
            if len(self._asked) > _WAITING:
                del self._asked[next(iter(self._asked))]

    def on_motion(self, command: m.MotionCommand, at: float) -> None:
        """A command came at `at` (s); only the first that answers a state counts."""
        with self._lock:
            asked = self._asked.pop(command.echo, None)
            if asked is not None:
                # The two come over different sessions, and the answer may overtake what it answers.
                self._took.append(max(0.0, at - asked))

    def take(self) -> list[float]:
        """How long the answers since the last call took (s)."""
        with self._lock:
            took, self._took = self._took, []
        return took


@contextmanager
def recorder(wire: TransportConfig, file: Path) -> Iterator[psutil.Process]:
    """A recorder that has begun; ended with all on disk.

    Raises:
        InputError: It did not begin, or did not end well.
    """
    process = subprocess.Popen(
        python_command(
            "recorder.record",
            ["--connect", wire.connect[0], "--certificates", wire.certificates, "--out", str(file)],
        ),
        stdout=subprocess.PIPE,
        text=True,
        env=child_environment(),
    )
    assert process.stdout is not None
    try:
        if "recording" not in process.stdout.readline():
            raise InputError("the recorder did not begin")
        yield psutil.Process(process.pid)
    finally:
        process.send_signal(signal.SIGINT)
        said, _ = process.communicate(timeout=30)
    if process.returncode != 0 or "were lost" in said:
        raise InputError(f"the recorder ended with {process.returncode}: {said}")


def percentile(values: Sequence[float], share: float) -> float:
    """The value that `share` (0…1) of them do not exceed; NaN of none."""
    return sorted(values)[max(0, math.ceil(share * len(values)) - 1)] if values else math.nan


def summary(without: Sequence[float], beside: Sequence[float]) -> dict[str, Any]:
    """Figures for people and for the file; times in s."""
    figures: dict[str, Any] = {}
    for name, took in (("without", without), ("recording", beside)):
        figures[name] = {
            "answers": len(took),
            "median_s": round(percentile(took, 0.5), 5),
            "p99_s": round(percentile(took, 0.99), 5),
        }
    added = percentile(beside, 0.99) - percentile(without, 0.99)
    return {**figures, "p99_added_s": round(added, 5), "within": added <= LIMIT_S}


def measure(demo: Demo, pairs: int, stretch_s: float, folder: Path) -> dict[str, Any]:
    """So many stretches of each kind by turns, each pair beginning with the other one."""
    answers, size = Answers(), 0
    took: tuple[list[float], list[float]] = ([], [])
    cores: list[float] = []
    with Onlooker(demo.wire, ROBOT_ID, RECORDER) as wire:
        wire.subscribe(JOINTS, answers.on_joints)
        wire.subscribe(MOTION, answers.on_motion)
        for turn in range(2 * pairs):
            recording = turn % 4 in (1, 2)
            if not recording:
                answers.take()
                watch(demo, stretch_s)
                took[0].extend(answers.take())
                continue
            file = folder / f"{turn}.mcap"
            with recorder(demo.wire, file) as process:
                before = sum(process.cpu_times()[:2])
                answers.take()
                watch(demo, stretch_s)
                took[1].extend(answers.take())
                cores.append((sum(process.cpu_times()[:2]) - before) / stretch_s)
            size += file.stat().st_size
    used = {"recorder_cores": round(sum(cores) / len(cores), 3), "bytes_a_second": round(size / pairs / stretch_s)}
    return {"stretches": pairs, "stretch_s": stretch_s, **summary(*took), **used}


def main(argv: Sequence[str]) -> int:
    """Run the benchmark; returns the exit code: 1 where recording costs too much."""
    parser = bench_parser("record", __doc__)
    parser.add_argument("--pairs", type=int, default=10, help="stretches with and without a recorder (default: 10)")
    parser.add_argument("--seconds", type=float, default=6.0, help="of each stretch (default: 6)")
    parser.add_argument("--rate", type=float, default=100.0, help="of arm and joint states in Hz (default: 100)")
    parser.add_argument("--seed", type=int, default=0, help="row to grow (default: 0)")
    parser.add_argument("--port", type=int, default=8767, help="port of the page (default: %(default)s)")
    arguments = parser.parse_args(argv)
    with tempfile.TemporaryDirectory() as folder:
        config = Path(folder) / "record.toml"
        config.write_text(configured(arguments.rate, min(50.0, arguments.rate)), encoding="utf-8")
        demo = Demo(arguments.port, arguments.seed, config)
        try:
            demo.begin_work()
            figures = measure(demo, arguments.pairs, arguments.seconds, Path(folder))
        finally:
            demo.close()
    document = {"rate_hz": arguments.rate, **figures}
    print(one_row_a_line(document))
    write(arguments.json, document)
    return 0 if figures["within"] else 1
