"""How a process starts and ends: by signal, with its parent, and with one clear line when it cannot start."""

import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import pytest

import bridge.__main__ as bridge
import controller.__main__ as controller
import perception.__main__ as perception
import server.__main__ as server
from rolling_panda import __version__
from rolling_panda.runtime.process import ProcessContext, run_process

pytestmark = pytest.mark.processes

ROOT = Path(__file__).resolve().parents[2]
WAITING = """
import sys
from rolling_panda.runtime.process import run_process

def run(context):
    print("running", flush=True)
    context.stopping.wait()
    print("ended in order", flush=True)

sys.exit(run_process("bridge", "waits", run))
"""
HANGING = """
import sys, time
from rolling_panda.runtime.process import run_process

def run(context):
    print("running", flush=True)
    while True:
        time.sleep(1.0)

sys.exit(run_process("bridge", "hangs", run))
"""

SIGNALLED_WHILE_IT_WAITS = """
import random, signal
from rolling_panda.runtime.process import stop_on_signals

chance = random.Random(0)
for _ in range(1000):
    stopping = stop_on_signals()
    signal.signal(signal.SIGALRM, signal.getsignal(signal.SIGINT))
    signal.setitimer(signal.ITIMER_REAL, chance.uniform(1e-5, 3e-4))
    while not stopping.wait(1e-6):
        pass
"""


class Child:
    """A process under test; leaves nothing behind."""

    def __init__(self, code: str, *words: str) -> None:
        self.popen = subprocess.Popen(
            [sys.executable, "-c", code, *words],
            cwd=ROOT,
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
        )
        assert self.popen.stdout is not None and self.popen.stdin is not None
        self.stdin, self.stdout = self.popen.stdin, self.popen.stdout

    def __enter__(self) -> "Child":
        assert self.stdout.readline() == "running\n"
        return self

    def __exit__(self, *_: object) -> None:
        self.popen.kill()
        self.popen.communicate()


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_ends_it_in_order(endpoint: str, number: signal.Signals) -> None:
    with Child(WAITING, "--connect", endpoint, "--plain-wire") as child:
        child.popen.send_signal(number)
        assert child.popen.wait(5.0) == 0
        assert child.stdout.read() == "ended in order\n"


def test_it_ends_with_its_parent_only_when_asked_to(endpoint: str) -> None:
    with (
        Child(WAITING, "--connect", endpoint, "--plain-wire") as alone,
        Child(WAITING, "--connect", endpoint, "--plain-wire", "--exit-with-parent") as tied,
    ):
        alone.stdin.close()
        tied.stdin.close()
        assert tied.popen.wait(5.0) == 0
        assert alone.popen.poll() is None
        alone.popen.stdin = None
        tied.popen.stdin = None


def test_a_loop_that_hangs_does_not_outlive_its_parent(endpoint: str) -> None:
    with Child(HANGING, "--connect", endpoint, "--plain-wire", "--exit-with-parent") as child:
        began = time.monotonic()
        child.stdin.close()
        assert child.popen.wait(6.0) == 1
        assert time.monotonic() - began < 4.0
        child.popen.stdin = None


def test_without_a_router_it_says_so_in_one_line(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    config = tmp_path / "robot.toml"
    config.write_text('[transport]\nconnect = ["tcp/127.0.0.1:9"]\nconnect_timeout_s = 0.2\n')
    assert run_process("controller", "", never, argv=["--config", str(config), "--plain-wire"]) == 1
    error = capsys.readouterr().err
    assert error.startswith("rolling-panda controller: no wire at tcp/127.0.0.1:9") and error.count("\n") == 1


def test_a_mistake_in_the_configuration_is_one_line(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    config = tmp_path / "robot.toml"
    config.write_text("[robots]\n")
    assert run_process("controller", "", never, argv=["--config", str(config)]) == 1
    error = capsys.readouterr().err
    assert "[robots]" in error and "'robot'" in error and error.count("\n") == 1


@pytest.mark.parametrize(
    ("main", "words", "section", "line"),
    [
        (controller.main, [], "controller", "deadline_s = 60.0"),
        (controller.main, [], "controller", 'rate_hz = "fast"'),
        (controller.main, [], "robot", "track = -1.0"),
        (perception.main, [], "perception", "threads = 0.5"),
        (perception.main, [], "robot", "track = -1.0"),
        (server.main, [], "server", "page_rate_hz = 0.0"),
        (bridge.main, [], "bridge", "timeout = 0.2"),
        (bridge.main, [], "robot", "track = -1.0"),
        (bridge.main, [], "vineyard", "vines = -1"),
        (bridge.main, [], "camera", "width = 0"),
        (bridge.main, ["real"], "bridge", "timeout = 0.2"),
        (bridge.main, ["real"], "real.base", "colour = 3"),
        (bridge.main, [], "transport", "connect_timeout_s = 0.0"),
    ],
)
def test_a_wrong_value_is_said_where_there_is_no_wire_either(
    capsys: pytest.CaptureFixture[str], tmp_path: Path, main: Any, words: list[str], section: str, line: str
) -> None:
    config = tmp_path / "robot.toml"
    quick = "" if section == "transport" else "[transport]\nconnect_timeout_s = 0.2\n"
    config.write_text(f"{quick}[{section}]\n{line}\n")
    wire = ["--connect", "tcp/127.0.0.1:9", "--plain-wire"]
    assert main([*words, "--config", str(config), *wire, "--state", str(tmp_path)]) == 1
    error = capsys.readouterr().err
    assert line.split(" = ")[0] in error and section.split(".")[0] in error and error.count("\n") == 1
    assert "no wire" not in error and list(tmp_path.iterdir()) == [config]


def test_a_name_that_no_robot_can_have_is_said_where_there_is_no_wire_either(
    capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    config = tmp_path / "robot.toml"
    config.write_text("[transport]\nconnect_timeout_s = 0.2\n")
    words = ["--config", str(config), "--connect", "tcp/127.0.0.1:9", "--plain-wire", "--also-robot-id", "../rp2"]
    assert server.main(words) == 1
    assert "a robot cannot be called '../rp2'" in capsys.readouterr().err


def test_version(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as end:
        run_process("controller", "", never, argv=["--version"])
    assert end.value.code == 0
    assert capsys.readouterr().out == f"rolling-panda {__version__}\n"


def never(context: ProcessContext) -> None:
    raise AssertionError("must not start")


def test_a_signal_is_heard_at_whatever_instant_it_comes() -> None:
    """Setting an event in a handler that has interrupted a wait for that event hangs, now and then."""
    subprocess.run([sys.executable, "-c", SIGNALLED_WHILE_IT_WAITS], cwd=ROOT, timeout=30, check=True)
