"""The systemd units, as systemd's own tools read them; none is started, which takes systemd as the first process."""

import shutil
import subprocess
from pathlib import Path

import pytest
import yaml

ROOT = Path(__file__).resolve().parents[2]
UNITS = ROOT / "deploy/systemd"
ANALYZE = shutil.which("systemd-analyze")


def analyze(*words: str | Path) -> subprocess.CompletedProcess[str]:
    assert ANALYZE is not None, "systemd-analyze is not installed: sudo apt-get install systemd"
    return subprocess.run([ANALYZE, *words], capture_output=True, text=True, timeout=60, check=False)


@pytest.fixture
def units(tmp_path: Path) -> Path:
    """The units as an administrator would install them, with a program where they look for one."""
    folder = tmp_path / "units"
    shutil.copytree(UNITS, folder)
    program = tmp_path / "rolling-panda"
    program.write_text("#!/bin/sh\n")
    program.chmod(0o755)
    for unit in folder.rglob("*.*"):
        if unit.is_file():
            unit.write_text(unit.read_text().replace("/opt/rolling-panda/bin/rolling-panda", str(program)))
    return folder


def test_every_container_has_its_unit() -> None:
    wanted = (UNITS / "rolling-panda.target").read_text()
    # An administrator makes the certificates (docs/deployment.md).
    for name in set(yaml.safe_load((ROOT / "compose.yaml").read_text())["services"]) - {"certificates"}:
        assert f"rolling-panda@{name}.service" in wanted


@pytest.mark.parametrize("name", ["router", "bridge", "controller", "perception", "server"])
def test_systemd_understands_the_unit(units: Path, name: str) -> None:
    checked = analyze("verify", units / f"rolling-panda@{name}.service")
    assert (checked.returncode, checked.stdout + checked.stderr) == (0, "")


def test_systemd_understands_the_real_bridge(units: Path) -> None:
    drop_in = units / "rolling-panda@bridge.service.d"
    drop_in.mkdir()
    shutil.copy(units / "real-bridge.conf", drop_in / "real.conf")
    checked = analyze("verify", units / "rolling-panda@bridge.service")
    assert (checked.returncode, checked.stdout + checked.stderr) == (0, "")
    # Before the drop-in counts, what it replaces does not.
    (drop_in / "real.conf").write_text("[Service]\nExecStart=relative/path\n")
    assert analyze("verify", units / "rolling-panda@bridge.service").stderr


def test_a_process_may_do_little() -> None:
    # Exposure as systemd reckons it, ten times: 0 = none, 100 = all; a unit without any hardening has 96.
    judged = analyze("security", "--offline=true", "--threshold=20", UNITS / "rolling-panda@.service")
    assert judged.returncode == 0, judged.stdout
    assert analyze("security", "--offline=true", "--threshold=5", UNITS / "rolling-panda@.service").returncode != 0
