"""The command line as a person meets it: help, versions, and one clear line for every mistake."""

import os
import socket
import subprocess
import sys
from collections.abc import Iterator
from importlib.util import find_spec
from pathlib import Path

import pytest

from rolling_panda import __version__
from rolling_panda.cli import main as cli
from rolling_panda.runtime.launch import child_environment, python_command

ROOT = Path(__file__).resolve().parents[2]


def rolling_panda(*words: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, "-m", "rolling_panda", *words], cwd=ROOT, capture_output=True, text=True, timeout=30
    )


@pytest.fixture
def busy_port() -> Iterator[int]:
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        yield taken.getsockname()[1]


def assert_one_clear_line(capsys: pytest.CaptureFixture[str], words: list[str], *parts: str) -> None:
    assert cli.main(words) != 0
    error = capsys.readouterr().err
    assert error.count("\n") == 1 and error.startswith("rolling-panda "), error
    for part in parts:
        assert part in error


def test_version_and_help_of_the_command() -> None:
    assert rolling_panda("--version").stdout == f"rolling-panda {__version__}\n"
    text = rolling_panda("--help").stdout
    for command in ("demo", "router", "bridge", "controller", "perception", "server", "bench"):
        assert command in text


def test_an_unknown_command_is_refused_with_the_known_ones() -> None:
    done = rolling_panda("prune")
    assert done.returncode == 2
    assert "demo" in done.stderr and "Traceback" not in done.stderr


def test_a_process_replaces_the_command_with_all_its_arguments(monkeypatch: pytest.MonkeyPatch) -> None:
    calls = []
    monkeypatch.setattr(os, "execve", lambda *call: calls.append(call))
    monkeypatch.delenv("OMP_NUM_THREADS", raising=False)
    monkeypatch.delenv("MALLOC_ARENA_MAX", raising=False)
    with pytest.raises(SystemExit):
        cli.main(["bench", "tick", "--json", "x.json"])
    program, command, environment = calls[0]
    assert program == sys.executable
    assert command[1:] == ["-P", "-m", "benchmarks", "tick", "--json", "x.json"]
    assert environment["OMP_NUM_THREADS"] == "1"
    assert environment["MALLOC_ARENA_MAX"] == "2"


def test_linear_algebra_stays_on_one_thread_unless_the_user_says_otherwise(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("OMP_NUM_THREADS", "4")
    monkeypatch.delenv("OPENBLAS_NUM_THREADS", raising=False)
    environment = child_environment()
    assert environment["OMP_NUM_THREADS"] == "4"
    assert environment["OPENBLAS_NUM_THREADS"] == "1"


def test_a_folder_of_the_users_is_not_started_instead_of_the_process(tmp_path: Path) -> None:
    (tmp_path / "rolling_panda").mkdir()
    (tmp_path / "rolling_panda" / "__init__.py").write_text("raise SystemExit('the wrong one')")
    done = subprocess.run(
        python_command("rolling_panda", ["--version"]),
        cwd=tmp_path,
        env=child_environment(),
        capture_output=True,
        text=True,
        timeout=30,
    )
    assert done.stdout.startswith("rolling-panda "), done.stderr


def test_demo_refuses_a_port_in_use(capsys: pytest.CaptureFixture[str], busy_port: int) -> None:
    assert_one_clear_line(capsys, ["demo", "--port", str(busy_port)], str(busy_port), "--port")


def test_demo_refuses_a_missing_configuration(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    assert_one_clear_line(capsys, ["demo", "--config", str(tmp_path / "none.toml")], "none.toml", "No such file")


def test_demo_refuses_a_configuration_with_a_mistake(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    config = tmp_path / "bad.toml"
    config.write_text('[transport]\nconect = ["tcp/127.0.0.1:1"]\n')
    assert_one_clear_line(capsys, ["demo", "--config", str(config)], "conect", "'connect'")


@pytest.mark.parametrize("port", ["0", "-1", "65536"])
def test_demo_refuses_what_is_no_port(capsys: pytest.CaptureFixture[str], port: str) -> None:
    assert_one_clear_line(capsys, ["demo", "--port", port], port)


def test_demo_refuses_a_negative_seed(capsys: pytest.CaptureFixture[str]) -> None:
    assert_one_clear_line(capsys, ["demo", "--seed", "-1"], "--seed -1")


def test_demo_refuses_a_trace_that_cannot_be_written(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    assert_one_clear_line(capsys, ["demo", "--trace", str(tmp_path)], "is a folder")
    assert_one_clear_line(capsys, ["demo", "--trace", str(tmp_path / "no" / "x")], "there is no folder")


@pytest.mark.parametrize("words", [["--bridge", "real"], ["--fakes"]])
def test_demo_moves_no_real_robot(capsys: pytest.CaptureFixture[str], words: list[str]) -> None:
    assert_one_clear_line(capsys, ["demo", *words], "--bridge real --fakes")


def test_router_refuses_a_port_in_use(capsys: pytest.CaptureFixture[str], busy_port: int) -> None:
    endpoint = f"tcp/127.0.0.1:{busy_port}"
    assert_one_clear_line(capsys, ["router", "--plain-wire", "--listen", endpoint], endpoint, "another port")


def test_router_refuses_what_is_no_endpoint(capsys: pytest.CaptureFixture[str]) -> None:
    assert_one_clear_line(capsys, ["router", "--plain-wire", "--listen", "localhost"], "localhost")


def test_an_installed_package_says_that_it_has_no_benchmarks(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(cli, "find_spec", lambda name: None)
    assert_one_clear_line(capsys, ["bench", "tick"], "checkout")


def test_training_says_how_to_get_what_it_needs(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(cli, "find_spec", lambda name: None if name == "torch" else find_spec(name))
    assert_one_clear_line(capsys, ["train", "--help"], "PyTorch", "make training")
