"""`rolling-panda bridge real --check`: the table, and an exit code for scripts."""

import contextlib
from pathlib import Path

from bridge.real.build import open_devices, wait_for_states
from bridge.real.commissioning import inspect, table
from bridge.real.config import RealConfig
from rolling_panda.config import RobotConfig, TransportConfig, load_section
from rolling_panda.errors import InputError
from rolling_panda.model.robot import RobotModel

# Long enough for the arm's process to start and connect.
_SETTLE_S = 6.0


def check(config_path: Path, wire: TransportConfig, fakes: bool = False) -> None:
    """Print what was found.

    Raises:
        InputError: Something is not as it has to be; the text counts how many.
    """
    model = RobotModel(load_section(config_path, "robot", RobotConfig))
    devices = open_devices(config_path, wire, model, False, fakes)
    try:
        # Which of them is silent is in the table.
        with contextlib.suppress(InputError):
            wait_for_states(devices, _SETTLE_S)
        findings = inspect(devices, load_section(config_path, "real", RealConfig), model.limits)
    finally:
        devices.close()
    print(table(findings), flush=True)
    bad = sum(not finding.good for finding in findings)
    if bad:
        raise InputError(f"{bad} of {len(findings)} are not as they have to be; nothing was moved")
