"""Whether a client on this machine is silent by itself, or because the machine has given it no processor.

A control box has a computer of its own, and so has the driver that talks to it, one that keeps time. Where both share
the cores of one ordinary machine with everything else, the driver may wait for a core for longer than 20 packets last,
which is no fault of the driver's and would never happen beside a real arm.
"""

import socket

import psutil


class ClientProcess:
    """The process at the other end of a connection, where it runs on this machine and may be looked at."""

    def __init__(self, connection: socket.socket) -> None:
        """Find it, once.

        Args:
            connection: An accepted TCP connection.
        """
        self._process: psutil.Process | None = None
        self._used = 0.0
        try:
            here, there = connection.getsockname(), connection.getpeername()
            for found in psutil.net_connections("tcp4"):
                if found.pid is not None and (tuple(found.laddr), tuple(found.raddr)) == (there, here):
                    self._process = psutil.Process(found.pid)
        except (OSError, psutil.Error):
            # It has gone already, or belongs to somebody else: then it is judged by the clock alone.
            pass

    def watch(self) -> None:
        """It has kept somebody waiting: what it computes from now on counts."""
        self._used = self._processor_s()

    def waits_for_a_core(self, budget_s: float) -> bool:
        """Whether it would go on if it got a core, and has had less than `budget_s` of one since `watch`.

        A process that sleeps, is stopped or has ended is silent by itself, and so is one that computes something else.
        """
        if self._process is None:
            return False
        try:
            runnable = self._process.status() == psutil.STATUS_RUNNING
        except psutil.Error:
            return False
        return runnable and self._processor_s() - self._used < budget_s

    def _processor_s(self) -> float:
        try:
            times = self._process.cpu_times() if self._process is not None else None
        except psutil.Error:
            times = None
        return 0.0 if times is None else float(times.user + times.system)
