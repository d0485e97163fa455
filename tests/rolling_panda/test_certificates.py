"""Certificates and the wall clock: a run's own count whatever the clock says, and others say why they do not."""

import datetime
import subprocess
from pathlib import Path

import pytest
from cryptography import x509

from rolling_panda.runtime.launch import child_environment, python_command
from rolling_panda.transport.certificates import NAMES, make, out_of_date
from tests.support.processes.local_router import free_port
from tests.support.processes.wall_clock import WallClock

TEN_YEARS = 10 * 365 * 86400


def started(words: list[str], clock: WallClock) -> subprocess.Popen[str]:
    return subprocess.Popen(
        python_command("rolling_panda", words),
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        env=child_environment() | clock.environment,
    )


def ended(process: subprocess.Popen[str]) -> str:
    """What it said up to its end."""
    try:
        said, _ = process.communicate(timeout=60)
    finally:
        process.kill()
        process.wait()
    return said


@pytest.mark.long
@pytest.mark.processes
@pytest.mark.parametrize("ahead", [TEN_YEARS, -TEN_YEARS, 6 * TEN_YEARS, -5 * TEN_YEARS])
def test_with_a_runs_own_certificates_a_start_under_a_wrong_clock_finds_the_wire(tmp_path: Path, ahead: int) -> None:
    folder, endpoint = tmp_path / "certificates", f"tls/127.0.0.1:{free_port()}"
    make(folder, ("127.0.0.1",), None)
    clock = WallClock(tmp_path)
    router = started(["router", "--listen", endpoint, "--certificates", str(folder), "--exit-with-parent"], clock)
    try:
        assert router.stdout is not None and "listening" in router.stdout.readline()
        clock.set(ahead)
        said = ended(started(["status", "--connect", endpoint, "--certificates", str(folder)], clock))
    finally:
        ended(router)
    assert "bridge" in said and "no wire" not in said


@pytest.mark.long
@pytest.mark.processes
def test_a_certificate_that_has_ended_by_the_clock_is_said_with_both_dates(tmp_path: Path) -> None:
    folder, endpoint = tmp_path / "certificates", f"tls/127.0.0.1:{free_port()}"
    make(folder, ("127.0.0.1",), 3)
    clock = WallClock(tmp_path)
    router = started(["router", "--listen", endpoint, "--certificates", str(folder), "--exit-with-parent"], clock)
    try:
        assert router.stdout is not None and "listening" in router.stdout.readline()
        clock.set(TEN_YEARS)
        said = ended(started(["status", "--connect", endpoint, "--certificates", str(folder)], clock))
        again = ["router", "--listen", f"tls/127.0.0.1:{free_port()}", "--certificates", str(folder)]
        refused = ended(started(again, clock))
    finally:
        ended(router)
    now = datetime.datetime.now(datetime.UTC)
    last, then = now + datetime.timedelta(days=3), now + datetime.timedelta(seconds=TEN_YEARS)
    for text in (said, refused):
        assert f"to {last:%Y-%m-%d}, and this machine's clock says {then:%Y-%m-%d}" in text
        assert "set the clock, or make new ones" in text and "Traceback" not in text


def test_no_clock_is_before_the_beginning_and_the_end_is_as_asked(tmp_path: Path) -> None:
    make(tmp_path / "run", ("127.0.0.1",), None)
    make(tmp_path / "year", ("127.0.0.1",), 365)
    for name in NAMES:
        run, year = (
            x509.load_pem_x509_certificate((tmp_path / at / f"{name}.pem").read_bytes()) for at in ("run", "year")
        )
        assert run.not_valid_before_utc.year == year.not_valid_before_utc.year == 1970
        assert run.not_valid_after_utc.year == 9999
        left = year.not_valid_after_utc - datetime.datetime.now(datetime.UTC)
        assert datetime.timedelta(days=364) < left <= datetime.timedelta(days=365)
        assert out_of_date(tmp_path / "run", name) == ""


def test_a_certificate_that_cannot_be_read_is_named(tmp_path: Path) -> None:
    make(tmp_path / "run", ("127.0.0.1",), None)
    (tmp_path / "run" / "server.pem").write_text("spoilt")
    assert "server.pem cannot be read" in out_of_date(tmp_path / "run", "server")
