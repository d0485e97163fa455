"""Children of the demo: each has a log, a exited is told in words, and nothing is left."""

import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import psutil
import pytest

from rolling_panda.cli.child_processes import ChildExit, ChildProcesses
from rolling_panda.runtime.launch import child_environment
from tests.support.waiting import until

pytestmark = pytest.mark.processes

PATIENT = [sys.executable, "-c", "import signal; signal.pause()"]
STUBBORN = "import signal; signal.signal(signal.SIGTERM, signal.SIG_IGN); print('deaf', flush=True); "


@pytest.fixture
def children(tmp_path: Path) -> Iterator[ChildProcesses]:
    made = ChildProcesses(tmp_path)
    yield made
    made.end()


def exit_of(children: ChildProcesses) -> ChildExit:
    until(lambda: children.exited() is not None)
    exited = children.exited()
    assert exited is not None
    return exited


def test_a_death_says_who_how_and_the_last_words(children: ChildProcesses) -> None:
    children.start("patient", PATIENT)
    code = "import sys; print('\\n'.join(map(str, range(50)))); sys.exit('the motor is on fire')"
    children.start("victim", [sys.executable, "-c", code])
    exited = exit_of(children)
    assert (exited.name, exited.cause) == ("victim", "with exit code 1")
    lines = exited.output.splitlines()
    assert lines[-1] == "the motor is on fire" and len(lines) <= 12


def test_a_kill_is_told_by_its_name(children: ChildProcesses) -> None:
    children.start("patient", PATIENT)
    assert children.exited() is None
    os.kill(children.pids()["patient"], signal.SIGKILL)
    assert exit_of(children).cause == "by signal 9 (SIGKILL)"


@pytest.mark.long
def test_end_leaves_nothing_of_those_that_will_not_and_of_their_children(children: ChildProcesses) -> None:
    family = f"import subprocess, sys; subprocess.Popen([sys.executable, '-c', {STUBBORN + 'signal.pause()'!r}]); "
    children.start("patient", PATIENT)
    children.start("stubborn", [sys.executable, "-c", STUBBORN + family + "signal.pause()"])
    until(lambda: children.log("stubborn").read_text().count("deaf") == 2)
    pids = list(children.pids().values())
    pids += [child.pid for pid in pids for child in psutil.Process(pid).children(recursive=True)]
    assert len(pids) == 3
    began = time.monotonic()
    children.end()
    until(lambda: not any(psutil.pid_exists(pid) and not _zombie(pid) for pid in pids), 1.0)
    assert time.monotonic() - began < 5.0


def test_children_that_watch_their_parent_end_when_it_is_killed(tmp_path: Path) -> None:
    code = (
        "import signal, sys, pathlib\n"
        "from rolling_panda.cli.child_processes import ChildProcesses\n"
        "from rolling_panda.runtime.launch import python_command\n"
        f"children = ChildProcesses(pathlib.Path({str(tmp_path)!r}))\n"
        "words = ['router', '--listen', 'tcp/127.0.0.1:0', '--plain-wire', '--exit-with-parent']\n"
        "children.start('router', python_command('rolling_panda', words))\n"
        "print(children.pids()['router'], flush=True)\n"
        "signal.pause()\n"
    )
    parent = subprocess.Popen([sys.executable, "-c", code], env=child_environment(), stdout=subprocess.PIPE, text=True)
    assert parent.stdout is not None
    child = int(parent.stdout.readline())
    log = tmp_path / "router.log"
    until(lambda: "listening" in log.read_text(), 20.0)
    parent.kill()
    parent.wait()
    parent.stdout.close()
    until(lambda: not psutil.pid_exists(child) or _zombie(child), 5.0)


def _zombie(pid: int) -> bool:
    try:
        return psutil.Process(pid).status() == psutil.STATUS_ZOMBIE
    except psutil.NoSuchProcess:
        return True
