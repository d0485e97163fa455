"""Checks of `rolling-panda bridge real --check`: every device, without moving any."""

import contextlib
import time
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from bridge.real import mp500
from bridge.real.build import Devices, NoCutter, open_devices, wait_for_states
from bridge.real.config import RealConfig
from rolling_panda.config import RobotConfig, TransportConfig, load_section
from rolling_panda.errors import InputError
from rolling_panda.messages.types import Reason
from rolling_panda.model.robot import ARM_Q, Limits, RobotModel
from rolling_panda.reasons import text_of

_WATCH_S = 2.0
# Long enough for the arm's process to start and connect.
_SETTLE_S = 6.0
# Half of the default rate of the maker's node.
_LEAST_WHEELS_HZ = 40.0
_LEAST_BATTERY = 0.2
_AT_REST = 0.02
_JOINT_MARGIN = 0.05
_REALTIME = Path("/sys/kernel/realtime")


@dataclass(frozen=True)
class Finding:
    """One row of the table: name of the check, measured value, required value, verdict."""

    what: str
    found: str
    wanted: str
    good: bool


def check(config_path: Path, wire: TransportConfig, fakes: bool = False) -> None:
    """Print the result.

    Raises:
        InputError: Some checks failed; the text has their number.
    """
    model = RobotModel(load_section(config_path, "robot", RobotConfig))
    devices = open_devices(config_path, wire, model, False, fakes)
    try:
        # The table shows which of them is silent.
        with contextlib.suppress(InputError):
            wait_for_states(devices, _SETTLE_S)
        findings = inspect(devices, load_section(config_path, "real", RealConfig), model.limits)
    finally:
        devices.close()
    print(table(findings), flush=True)
    bad = sum(not finding.good for finding in findings)
    if bad:
        raise InputError(f"{bad} of {len(findings)} checks failed; nothing was moved")


def inspect(devices: Devices, config: RealConfig, limits: Limits) -> list[Finding]:
    """Watch the devices for a while and judge them.

    Args:
        devices: Opened without permission to move.
        config: What they should be.
        limits: Of the robot, over q.
    """
    before, began = dict(devices.base.heard), time.monotonic()
    frames = 0 if devices.camera is None else devices.camera.taken
    time.sleep(_WATCH_S)
    lasted = time.monotonic() - began
    rates = {name: (count - before.get(name, 0)) / lasted for name, count in devices.base.heard.items()}
    return [
        *_base(devices.base, rates),
        *_arm(devices, config, limits),
        *_hand(devices, config, frames, lasted),
        _kernel(config),
    ]


def table(findings: list[Finding]) -> str:
    """The findings for people, one a line."""
    rows = [("", "what", "found", "wanted")]
    rows += [("ok" if f.good else "NO", f.what, f.found, f.wanted) for f in findings]
    widths = [max(len(row[i]) for row in rows) for i in range(4)]
    return "\n".join("  ".join(cell.ljust(width) for cell, width in zip(row, widths, strict=True)) for row in rows)


def _base(base: mp500.Mp500, rates: dict[str, float]) -> list[Finding]:
    state = base.read()
    wheels, speed = rates.get(mp500.WHEELS, 0.0), float(np.abs(state.velocity).max())
    monitored, odometry = rates.get(mp500.EMERGENCY, 0.0), rates.get(mp500.ODOMETRY, 0.0)
    charge = "unknown" if np.isnan(state.battery) else f"{100 * state.battery:.0f} %"
    return [
        Finding("base: wheel speeds", f"{wheels:.0f} a second", f"{_LEAST_WHEELS_HZ:.0f}", wheels >= _LEAST_WHEELS_HZ),
        Finding("base: at rest", f"{speed:.3f} rad/s", f"under {_AT_REST}", wheels > 0.0 and speed < _AT_REST),
        Finding("base: emergency-stop state", f"{monitored:.0f} a second", "1 or more", monitored >= 1.0),
        Finding("base: free to move", _told(state.fault), "no stop pressed", state.fault is None),
        Finding("base: own odometry", f"{odometry:.0f} a second", "1 or more", odometry >= 1.0),
        Finding("base: battery", charge, f"{100 * _LEAST_BATTERY:.0f} % or more", state.battery >= _LEAST_BATTERY),
        Finding("base: unreadable messages", str(base.rejected), "0", base.rejected == 0),
    ]


def _arm(devices: Devices, config: RealConfig, limits: Limits) -> list[Finding]:
    arm, told = devices.arm.read(), devices.arm.told
    q = arm.position
    margin = float(np.minimum(q - limits.lower[ARM_Q], limits.upper[ARM_Q] - q).min())
    speed = float(np.abs(arm.velocity).max())
    return [
        Finding("arm: ready to move", _told(arm.fault), f"{config.arm.address} answers", told and arm.fault is None),
        Finding(
            "arm: distance to a joint's limit",
            f"{margin:.2f} rad" if told else "unknown",
            f"{_JOINT_MARGIN} or more",
            told and margin >= _JOINT_MARGIN,
        ),
        Finding("arm: at rest", f"{speed:.3f} rad/s", f"under {_AT_REST}", told and speed < _AT_REST),
    ]


def _hand(devices: Devices, config: RealConfig, frames: int, lasted: float) -> list[Finding]:
    camera, wanted = devices.camera, config.camera.rate_hz
    rate = 0.0 if camera is None else (camera.taken - frames) / lasted
    findings = [Finding("camera", f"{rate:.0f} frames a second", f"about {wanted}", rate >= 0.8 * wanted)]
    if camera is None:
        findings = [Finding("camera", "switched off", "[real.camera] enabled = true", False)]
    if isinstance(devices.blades, NoCutter):
        return [*findings, Finding("cutter", "none", '[real.cutter] service = "…"', False)]
    # Any request would move the blades.
    return [*findings, Finding("cutter", f"{config.cutter.service}, not asked", "try it with the blades guarded", True)]


def _told(fault: Reason | None) -> str:
    return "yes" if fault is None else text_of(fault)


def _kernel(config: RealConfig) -> Finding:
    realtime = _REALTIME.exists() and _REALTIME.read_text().strip() == "1"
    wanted = "real-time (PREEMPT_RT)" if config.arm.realtime == "enforce" else "any"
    return Finding("kernel", "real-time" if realtime else "ordinary", wanted, realtime or wanted == "any")
