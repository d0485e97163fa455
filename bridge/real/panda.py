"""The Panda in the bridge: sends targets to the arm's process and reads its states."""

import importlib.util
import multiprocessing
import os
import time
from dataclasses import replace

import numpy as np

from bridge.real.arm_link import ArmLink, ArmState
from bridge.real.config import ArmConfig
from rolling_panda import reasons
from rolling_panda.errors import InputError
from rolling_panda.model.differential_drive import Array
from rolling_panda.model.robot import Limits

# Age limit of a state (s): the control box sends 1,000 a second, and stops an arm that lost 20.
_STALE_S = 0.08
_CLOSE_S = 2.0
_ENDED, _SILENT = reasons.arm_process_ended(), reasons.arm_silent()


class Panda:
    """Implements the arm's part of the robot. `read` and `write` return at once."""

    def __init__(self, config: ArmConfig, limits: Limits, moving: bool = True) -> None:
        """Start the arm's process. It connects by itself and reports its progress in its state.

        Raises:
            InputError: The driver is not installed.
        """
        if importlib.util.find_spec("panda_py") is None:
            raise InputError("the arm's driver is not installed; run: pip install 'rolling-panda[real]'")
        self._config, self._limits, self._moving = config, limits, moving
        self._releases = 0
        self._start()

    @property
    def told(self) -> bool:
        """Whether joint positions have arrived."""
        return bool(np.any(self._link.state().position))

    def read(self) -> ArmState:
        """The newest state."""
        state = self._link.state()
        if not self._process.is_alive():
            return replace(state, fault=_ENDED, severe=True)
        if time.monotonic() - state.at > _STALE_S and state.fault is None:
            return replace(state, fault=_SILENT, severe=False)
        return state

    def write(self, velocity: Array) -> None:
        """Velocities of the joints from now on (7, rad/s), until the deadline."""
        self._link.command(time.monotonic(), velocity, self._releases, closing=False)

    def release(self) -> None:
        """Allow the arm to recover from its fault; it then does so by itself, at rest."""
        self._releases += 1
        if not self._process.is_alive():
            self._start()
        self._link.command(time.monotonic(), np.zeros(7), self._releases, closing=False)

    def close(self) -> None:
        """Let the arm come to rest, and end its process; safe to call twice."""
        if self._process.is_alive():
            self._link.command(time.monotonic(), np.zeros(7), self._releases, closing=True)
            self._process.join(_CLOSE_S)
            if self._process.is_alive():
                self._process.kill()
        self._process.join()

    def _start(self) -> None:
        context = multiprocessing.get_context("spawn")
        self._link = ArmLink(context)
        self._link.command(time.monotonic(), np.zeros(7), self._releases, closing=False)
        self._process = context.Process(
            target=_serve,
            args=(self._config, self._limits, self._link, self._moving, os.getpid()),
            name="rolling-panda-arm",
            daemon=True,
        )
        self._process.start()


def _serve(config: ArmConfig, limits: Limits, link: ArmLink, moving: bool, parent: int) -> None:
    # Imported here: only the arm's process loads libfranka.
    from bridge.real.panda_process import run

    run(config, limits, link, moving, parent)
