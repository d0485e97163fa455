"""The fake control box: what it takes for a lost packet. No driver is needed to ask it."""

import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from rolling_panda.runtime.launch import child_environment
from tests.support.processes.device_process import DeviceProcess
from tests.support.waiting import until

ADDRESS = f"127.0.{os.getpid() % 250 + 1}.6"
CLIENT = str(Path(__file__).parents[1] / "support" / "control_client.py")
IDLE, MOVING, REFLEX = 1, 2, 4
#: Keeps a core from whoever comes after ordinary programs, until the test has ended.
GREEDY = "import os, sys\nos.sched_setaffinity(0, {int(sys.argv[1])})\nwhile os.getppid() == int(sys.argv[2]): pass"


@pytest.fixture
def box() -> Iterator[DeviceProcess]:
    box = DeviceProcess("arm", "--arm", ADDRESS)
    yield box
    box.close()


@contextmanager
def running(*command: str) -> Iterator[int]:
    process = subprocess.Popen([sys.executable, *command], env=child_environment())
    try:
        yield process.pid
    finally:
        process.kill()
        process.wait()


def commands(box: DeviceProcess) -> int:
    return int(box.tell()["commands"])


@contextmanager
def last_on_a_core(pid: int) -> Iterator[None]:
    """Meanwhile it comes after everybody else on one core, and one beside it there never pauses."""
    cores = os.sched_getaffinity(pid)
    os.sched_setaffinity(pid, {min(cores)})
    os.sched_setscheduler(pid, os.SCHED_IDLE, os.sched_param(0))
    with running("-c", GREEDY, str(min(cores)), str(os.getpid())):
        yield
    os.sched_setscheduler(pid, os.SCHED_OTHER, os.sched_param(0))
    os.sched_setaffinity(pid, cores)


@pytest.mark.long
@pytest.mark.alone  # It takes a whole core from everybody.
def test_a_client_that_waits_for_a_core_has_lost_nothing(box: DeviceProcess) -> None:
    with running(CLIENT, ADDRESS) as client:
        until(lambda: commands(box) > 0)
        before, begun = time.monotonic(), commands(box)
        with last_on_a_core(client):
            until(lambda: time.monotonic() > before + 4.0 or box.tell()["mode"] != MOVING)
            starved = commands(box) - begun
        taken = time.monotonic() - before
        until(lambda: commands(box) > begun + starved + 50)
        report = box.tell()
        assert (report["lost"], report["breaches"], report["mode"]) == (0, [], MOVING)
        assert starved < 500 * taken, "it has not waited for a core"
        os.kill(client, signal.SIGSTOP)
        until(lambda: box.tell()["mode"] == REFLEX)
        assert box.tell()["breaches"] == ["20 packets lost in a row"]


@pytest.mark.paced
def test_rows_of_packets_to_lose_are_never_one_longer_row(box: DeviceProcess) -> None:
    """A box that comes slowly through its milliseconds would otherwise lose more in a row than anybody asked for."""
    with running(CLIENT, ADDRESS):
        until(lambda: commands(box) > 0)
        for lost in (0, 15, 30):
            box.tell("drop 15")
            until(lambda least=lost: box.tell()["lost"] > least or box.tell()["mode"] != MOVING)
        until(lambda: box.tell()["lost"] >= 45 or box.tell()["mode"] != MOVING)
        report = box.tell()
        assert (report["lost"], report["breaches"], report["mode"]) == (45, [], MOVING)
        box.tell("drop 20")
        until(lambda: box.tell()["mode"] == REFLEX)


@pytest.mark.paced
def test_a_killed_client_leaves_a_box_that_the_next_one_can_move(box: DeviceProcess) -> None:
    """Also one that has not read what it was told, which breaks the connection instead of ending it."""
    for _ in range(3):
        before = commands(box)
        with running(CLIENT, ADDRESS):
            until(lambda least=before: commands(box) > least)
        until(lambda: box.tell()["mode"] == IDLE)
