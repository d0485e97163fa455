"""Fake control box of the arm, for the unmodified libfranka.

It checks every command as the control box does: a velocity, acceleration or jerk beyond the data sheet triggers a
reflex; a missing command is extrapolated with the last acceleration; 20 missing ones in a row stop the motion. A cycle
waits for its command up to `COMMAND_TIMEOUT_S`, so that a busy machine loses no packets, and longer while the client
waits for a processor core.
"""

import contextlib
import select
import socket
import struct
import threading
import time
from collections import deque

import numpy as np
import psutil

from bridge.fakes import control_box_protocol as p
from bridge.fakes.bodies import TICK_S, ArmBody
from rolling_panda.errors import InputError
from rolling_panda.model.differential_drive import Array

COMMAND_TIMEOUT_S = 0.03
# Cycles missed by more than this are skipped (s).
_MAX_DELAY_S = 0.005
_MAX_CONSECUTIVE_LOST = 20
_RECOVERY_TICKS = 50
# Data sheet of the Panda.
_VELOCITY = np.array([2.175] * 4 + [2.61] * 3)
_ACCELERATION = np.array([15.0, 7.5, 10.0, 12.5, 15.0, 20.0, 20.0])
_JERK = 500.0 * _ACCELERATION
_LOWER = np.array([-2.8973, -1.7628, -2.8973, -3.0718, -2.8973, -0.0175, -2.8973])
_UPPER = np.array([2.8973, 1.7628, 2.8973, -0.0698, 2.8973, 3.7525, 2.8973])
_LIMITS = (
    ("velocity", p.VELOCITY_LIMIT, _VELOCITY),
    ("acceleration", p.VELOCITY_STEP, _ACCELERATION),
    ("jerk", p.ACCELERATION_STEP, _JERK),
)
# Tolerance for rounding errors of the client.
_TOLERANCE = 1.0 + 1e-6
# Largest speed at standstill (rad/s).
_STANDSTILL = 1e-3


class ClientProcess:
    """The local process at the other end of a connection.

    A real control box and its driver run on separate computers. If both share the cores of one busy machine, the driver
    may wait for a core for longer than 20 packets. That is not a fault of the driver.
    """

    def __init__(self, connection: socket.socket) -> None:
        """Find the process.

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
            # It has ended or belongs to another user: only the timeout applies.
            pass

    def start_counting(self) -> None:
        """Count its processor time from now on."""
        self._used = self._processor_s()

    def waits_for_a_core(self, budget_s: float) -> bool:
        """Whether it is runnable and has had less than `budget_s` of processor time since `start_counting`."""
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


class ControlBox:
    """Serves one client. `run` is the 1 kHz loop; `tell` operates the buttons."""

    def __init__(self, address: str, body: ArmBody) -> None:
        """Listen.

        Args:
            address: Loopback address for libfranka, which uses port 1337.
            body: Mechanics of the arm.

        Raises:
            InputError: The address cannot be listened on.
        """
        self._body = body
        self._lock = threading.Lock()
        self._state = p.State(q=body.q, dq=body.dq)
        self._motion: int | None = None
        self._started = self._pressed = False
        self._consecutive_lost = self._lost = self._commands = self._to_drop = self._recoveries = 0
        self._rows: deque[int] = deque()
        self._recovery: tuple[int, int] | None = None
        self._worst = np.zeros(3)
        self._violations: list[str] = []
        self._load = 0.0
        self._push = np.zeros(7)
        self._standstill_since: float | None = None
        self._moved = 0
        self._client: socket.socket | None = None
        self._process: ClientProcess | None = None
        self._target: tuple[str, int] | None = None
        try:
            self._listener = socket.create_server((address, p.PORT))
            self._udp = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
            self._udp.bind((address, 0))
        except OSError as error:
            raise InputError(
                f"the fake control box cannot listen on {address}:{p.PORT} ({error.strerror}); "
                "give another loopback address in [real.arm] address"
            ) from error

    def run(self, ended: threading.Event) -> None:
        """Run at 1 kHz until `ended` is set."""
        due = time.monotonic()
        while not ended.is_set():
            self._accept()
            self._requests()
            self._tick()
            now = time.monotonic()
            due = max(due + TICK_S, now - _MAX_DELAY_S)
            time.sleep(max(0.0, due - now))

    def tell(self, words: list[str]) -> None:
        """Trigger a collision, push joints, press or release the user stop, drop packets in a row, reset the monitor.

        A series of drops starts only after a command that was received.
        """
        with self._lock:
            match words:
                case ["collide"]:
                    self._reflex(p.JOINT_REFLEX, "collision")
                case ["push", *torques]:
                    self._push = np.array(torques, float)
                case ["press"]:
                    self._press()
                case ["free"]:
                    self._pressed = False
                    if self._state.mode == p.USER_STOPPED:
                        self._state.mode = p.IDLE
                case ["drop", count]:
                    self._rows.append(int(count))
                case ["clear"]:
                    self._violations, self._worst, self._lost = [], np.zeros(3), 0

    def report(self) -> dict[str, object]:
        """State, and findings of the monitor."""
        with self._lock:
            return {
                "q": self._state.q.tolist(),
                "dq": self._state.dq_d.tolist(),
                "mode": self._state.mode,
                "commands": self._commands,
                "lost": self._lost,
                "breaches": self._violations,
                "worst": self._worst.tolist(),
                "load": self._load,
                "recoveries": self._recoveries,
                "ticks": self._state.number,
                "moved_tick": self._moved,
                "still_s": -1.0 if self._standstill_since is None else time.monotonic() - self._standstill_since,
            }

    def close(self) -> None:
        """Close all sockets."""
        for each in (self._client, self._listener, self._udp):
            if each is not None:
                each.close()

    def _accept(self) -> None:
        if self._client is None and select.select([self._listener], [], [], 0.0)[0]:
            self._client, _ = self._listener.accept()
            self._client.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
            self._process = ClientProcess(self._client)

    def _disconnect(self, client: socket.socket) -> None:
        """The client has disconnected: brake, as the box does."""
        client.close()
        self._client = self._target = self._process = None
        with self._lock:
            self._motion = None
            self._rest()
            if self._state.mode == p.MOVING:
                self._state.mode = p.IDLE

    def _rest(self) -> None:
        self._state.dq_d, self._state.ddq_d = np.zeros(7), np.zeros(7)

    def _requests(self) -> None:
        client = self._client
        while client is not None and select.select([client], [], [], 0.0)[0]:
            try:
                head = client.recv(p.HEADER.size, socket.MSG_WAITALL)
                command, number, size = p.HEADER.unpack(head)
                body = client.recv(size - p.HEADER.size, socket.MSG_WAITALL) if size > p.HEADER.size else b""
            except (ConnectionError, struct.error):
                # The client was killed, perhaps with unread replies.
                self._disconnect(client)
                return
            with self._lock:
                self._request(client, command, number, body)

    def _request(self, client: socket.socket, command: int, number: int, body: bytes) -> None:
        if command == p.CONNECT:
            version, port = struct.unpack("<HH", body)
            self._target = (client.getpeername()[0], port)
            self._reply(command, number, int(version != p.VERSION), struct.pack("<H", p.VERSION))
        elif command == p.MOVE:
            generator = struct.unpack_from("<II", body)[1]
            if self._state.mode != p.IDLE or generator != p.JOINT_VELOCITY:
                self._reply(command, number, p.REJECTED)
                return
            self._motion, self._started, self._consecutive_lost = number, False, 0
            self._state.mode, self._state.reflex = p.MOVING, frozenset()
            self._reply(command, number, p.MOTION_STARTED)
        elif command == p.STOP_MOVE:
            self._finish(p.PREEMPTED)
            self._rest()
            self._reply(command, number, p.SUCCESS)
        elif command == p.RECOVER:
            if self._pressed:
                self._reply(command, number, p.REJECTED)
            else:
                self._state.mode, self._recovery = p.RECOVERING, (number, _RECOVERY_TICKS)
        elif command in p.SETTERS:
            if command == p.SET_LOAD:
                self._load = struct.unpack_from("<d", body)[0]
            self._reply(command, number, p.SUCCESS)
        else:
            raise RuntimeError(f"command {command} is not part of this control box")

    def _reply(self, command: int, number: int, status: int, more: bytes = b"") -> None:
        if self._client is not None:
            # A disconnect is detected on the next read.
            with contextlib.suppress(ConnectionError):
                self._client.sendall(p.reply(command, number, status, more))

    def _finish(self, status: int) -> None:
        if self._motion is not None:
            self._reply(p.MOVE, self._motion, status)
            self._motion = None
            self._state.mode = p.IDLE

    def _tick(self) -> None:
        target = self._target
        with self._lock:
            state = self._state
            state.number += 1
            self._recover()
            message = state.pack() if target is not None else b""
            moving = state.mode == p.MOVING
        if target is not None:
            self._udp.sendto(message, target)
        # While the client computes.
        self._body.move(state.dq_d)
        command = self._receive() if moving and target is not None else None
        with self._lock:
            state.q, state.dq = self._body.q, self._body.dq
            state.external_torque = self._body.external_torque + self._push
            if moving and state.mode == p.MOVING:
                self._follow(command)
            if float(np.abs(state.dq_d).max()) >= _STANDSTILL:
                self._standstill_since, self._moved = None, state.number
            elif self._standstill_since is None:
                self._standstill_since = time.monotonic()

    def _recover(self) -> None:
        if self._recovery is not None:
            number, left = self._recovery
            self._recovery = (number, left - 1)
            if left == 0:
                self._recovery = None
                self._state.mode, self._state.errors = p.IDLE, frozenset()
                self._recoveries += 1
                self._reply(p.RECOVER, number, p.SUCCESS)

    def _receive(self) -> tuple[object, ...] | None:
        """The command for the present state; None if it is late or dropped."""
        command = self._answer(COMMAND_TIMEOUT_S)
        if command is None and self._process is not None:
            self._process.start_counting()
            while command is None and self._process.waits_for_a_core(COMMAND_TIMEOUT_S):
                command = self._answer(TICK_S)
            # It may have answered between the two checks.
            command = command or self._answer(0.0)
        return None if command is None or self._drops() else command

    def _answer(self, limit_s: float) -> tuple[object, ...] | None:
        end = time.monotonic() + limit_s
        while select.select([self._udp], [], [], max(0.0, end - time.monotonic()))[0]:
            command = p.COMMAND.unpack(self._udp.recv(4096))
            if command[0] == self._state.number:
                return command
        return None

    def _drops(self) -> bool:
        """Whether to drop the received command."""
        if self._to_drop == 0 and self._rows and self._consecutive_lost == 0:
            self._to_drop = self._rows.popleft()
        if self._to_drop == 0:
            return False
        self._to_drop -= 1
        return True

    def _follow(self, command: tuple[object, ...] | None) -> None:
        state = self._state
        if command is None:
            if not self._started:
                return
            self._lost += 1
            self._consecutive_lost += 1
            state.success_rate = max(0.0, state.success_rate - 0.01)
            if self._consecutive_lost >= _MAX_CONSECUTIVE_LOST:
                self._reflex(p.COMMUNICATION, "20 packets lost in a row")
                return
            desired = np.clip(state.dq_d + state.ddq_d * TICK_S, -_VELOCITY, _VELOCITY)
        else:
            self._started, self._consecutive_lost = True, 0
            self._commands += 1
            state.success_rate = min(1.0, state.success_rate + 0.01)
            desired = np.array(command[p.VELOCITY], float)
            if not self._within_limits(desired):
                return
        state.ddq_d = (desired - state.dq_d) / TICK_S
        state.dq_d = desired
        if np.any(state.q < _LOWER) or np.any(state.q > _UPPER):
            self._reflex(p.POSITION_LIMIT, f"joints at {state.q}")
        elif command is not None and command[p.FINISHED]:
            self._rest()
            self._finish(p.SUCCESS)

    def _within_limits(self, desired: Array) -> bool:
        acceleration = (desired - self._state.dq_d) / TICK_S
        jerk = (acceleration - self._state.ddq_d) / TICK_S
        for i, (value, (name, kind, limit)) in enumerate(zip((desired, acceleration, jerk), _LIMITS, strict=True)):
            ratio = np.abs(value) / limit
            if not np.all(ratio <= _TOLERANCE):
                self._reflex(kind, f"{name} is {np.max(ratio):.3f} of what joint {int(np.argmax(ratio)) + 1} may have")
                return False
            self._worst[i] = max(self._worst[i], float(ratio.max()))
        return True

    def _reflex(self, kind: int, reason: str) -> None:
        """Stop with the brakes."""
        self._violations.append(reason)
        self._rest()
        self._state.errors = self._state.reflex = frozenset({kind})
        self._finish(p.REFLEX_ABORTED)
        self._state.mode = p.REFLEX

    def _press(self) -> None:
        self._pressed = True
        self._rest()
        self._finish(p.EMERGENCY_ABORTED)
        self._state.mode = p.USER_STOPPED
