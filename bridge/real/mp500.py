"""The Neobotix MP-500 base: ROS 2 messages through Zenoh, with its own deadline.

The maker's watchdog lets the base move for 1 s after the last command, 1.5 m at full speed. So a thread here sends
commands at a fixed rate, whatever the bridge does. A target that is not renewed fades to zero within `deadline_s`, and
so does any target while wheel speeds are missing. Commands are sent reliably, because each is one step of a ramp.

The relay board reports the right motor's velocity negated, because the motor is mounted mirrored. It reports raw
encoder counts instead of angles; the wheels' angles are integrated from their speeds.
"""

import contextlib
import threading
import time
from collections import Counter
from dataclasses import dataclass

import numpy as np

from bridge.core.limiter import Watchdog
from bridge.real import ros_messages as ros
from bridge.real.config import BaseConfig
from rolling_panda import reasons
from rolling_panda.errors import MessageError, ServiceError
from rolling_panda.messages.types import Reason
from rolling_panda.model.differential_drive import Array, DifferentialDrive
from rolling_panda.transport.zenoh import ForeignWire

COMMAND, WHEELS, ODOMETRY = "cmd_vel", "drives/joint_states", "odom"
EMERGENCY, BATTERY = "emergency_stop_state", "battery_state"
SOFT_STOP, SOFT_RELEASE = "set_EMstop", "unset_EMstop"
FREE = 0
# Speed below which a wheel is at rest (rad/s): 7 mm/s.
_REST = 0.05
# Largest difference of stamps that counts as the time between two messages (s).
_LONGEST_GAP = 0.25
_SERVICE_S = 1.0
# A service without arguments: CDR header, and one byte since a structure has at least one.
_EMPTY_REQUEST = b"\x00\x01\x00\x00\x00"
_RUNAWAY = reasons.base_runaway()


@dataclass(frozen=True)
class BaseState:
    """State of the base.

    Attributes:
        position: Angles of the wheels since the start, left and right (2, rad).
        velocity: Their speeds (2, rad/s).
        fault: Reason why the base may not move; None without a fault.
        severe: Whether a person has to release the fault.
        battery: Charge 0…1; NaN if unknown.
        emergency: Whether an emergency stop, by button or scanner, is active or not yet confirmed.
    """

    position: Array
    velocity: Array
    fault: Reason | None
    severe: bool
    battery: float
    emergency: bool


class Mp500:
    """Implements the base's part of the robot. `read` and `write` return at once."""

    def __init__(
        self, wire: ForeignWire, drive: DifferentialDrive, acceleration: float, config: BaseConfig, moving: bool = True
    ) -> None:
        """Subscribe, and start to send zero velocities.

        Args:
            wire: Transport of the base's ROS 2 topics; closed with the base.
            drive: Geometry of the base.
            acceleration: Acceleration limit of a wheel's command (rad/s²).
            config: Names and deadlines.
            moving: False sends nothing and reads the state only.
        """
        self._wire, self._drive, self._config = wire, drive, config
        self._step = acceleration / config.command_hz
        self._watchdog = Watchdog(config.fade_s, config.deadline_s)
        self._wheels = Watchdog(config.fade_s, config.deadline_s)
        self._lock = threading.Lock()
        self._target = self._sent = np.zeros(2)
        self._position = self._velocity = np.zeros(2)
        self._stamp = self._wheels_at = self._emergency_at = float("-inf")
        self._emergency, self._pressed = FREE, False
        self._cause: Reason | None = None
        self._rest_since: float | None = None
        self._runaway = False
        self._battery = float("nan")
        #: Number of messages by topic, and of unreadable ones.
        self.heard: Counter[str] = Counter()
        self.rejected = 0
        prefix = f"{config.namespace}/" if config.namespace else ""
        self._prefix = prefix
        self._silent = reasons.base_silent(prefix + WHEELS)
        self._unmonitored = reasons.base_unmonitored(prefix + EMERGENCY)
        wire.subscribe(prefix + WHEELS, self._on_wheels)
        wire.subscribe(prefix + EMERGENCY, self._on_emergency)
        wire.subscribe(prefix + BATTERY, self._on_battery)
        wire.subscribe(prefix + ODOMETRY, self._on_odometry)
        self._closing = threading.Event()
        self._thread: threading.Thread | None = None
        if moving:
            self._send = wire.publisher(prefix + COMMAND, lossless=True)
            self._thread = threading.Thread(target=self._command, name="mp500", daemon=True)
            self._thread.start()

    @property
    def told(self) -> bool:
        """Whether wheel speeds have arrived."""
        return self._wheels_at > float("-inf")

    def read(self) -> BaseState:
        """The newest state."""
        now = time.monotonic()
        with self._lock:
            fault, severe = self._fault(now)
            return BaseState(self._position, self._velocity, fault, severe, self._battery, self._pressed)

    def write(self, wheels: Array) -> None:
        """Speeds of the wheels from now on (2, rad/s), until the deadline."""
        with self._lock:
            self._target = wheels.copy()
            self._watchdog.feed(time.monotonic())

    def release(self) -> None:
        """Release the relay board's soft stop, on behalf of a person; returns at once."""
        with self._lock:
            self._runaway = False
            self._rest_since = None
        self._call(SOFT_RELEASE)

    def close(self) -> None:
        """Send a last zero and let go; safe to call twice."""
        if not self._closing.is_set():
            self._closing.set()
            if self._thread is not None:
                self._thread.join()
                self._send(_twist(0.0, 0.0))
            self._wire.close()

    def _command(self) -> None:
        period = 1.0 / self._config.command_hz
        due = time.monotonic()
        while not self._closing.wait(max(0.0, due - time.monotonic())):
            now = time.monotonic()
            # Missed commands are skipped: a burst of old commands is useless.
            due = max(due + period, now)
            with self._lock:
                sent = self._next(now)
                runaway = self._is_runaway(now)
            self._send(_twist(*self._drive.twist(float(sent[0]), float(sent[1]))))
            if runaway:
                self._call(SOFT_STOP)

    def _next(self, now: float) -> Array:
        fault, severe = self._fault(now)
        if severe:
            # The motors have no power: the next motion starts from zero with a ramp.
            self._sent = np.zeros(2)
        else:
            trust = 0.0 if fault else min(self._watchdog.trust(now), self._wheels.trust(now))
            goal = trust * self._target
            self._sent = self._sent + np.minimum(np.maximum(goal - self._sent, -self._step), self._step)
        if np.any(self._sent != 0.0):
            self._rest_since = None
        elif self._rest_since is None:
            self._rest_since = now
        return self._sent

    def _is_runaway(self, now: float) -> bool:
        """Whether wheels turn that were told to rest; True once."""
        if self._runaway or self._rest_since is None or now - self._rest_since < self._config.runaway_s:
            return False
        # Stale speeds show nothing.
        if now - self._wheels_at > self._config.stale_s:
            return False
        # With the motors off the base may be pushed by hand.
        if self._emergency != FREE or float(np.abs(self._velocity).max()) <= _REST:
            return False
        self._runaway = True
        return True

    def _fault(self, now: float) -> tuple[Reason | None, bool]:
        """Why the base may not move, and whether a person has to release it; None and False when it may."""
        config = self._config
        if self._runaway:
            return _RUNAWAY, True
        if self._emergency != FREE:
            return self._cause, True
        if now - self._wheels_at > config.stale_s:
            return self._silent, False
        if now - self._emergency_at > config.unmonitored_s:
            return self._unmonitored, False
        return None, False

    def _on_wheels(self, data: bytes, at: float) -> None:
        self.heard[WHEELS] += 1
        try:
            message = ros.decode(ros.JOINT_STATE, data)
        except MessageError:
            self.rejected += 1
            return
        if len(message.velocity) < 2 or not np.all(np.isfinite(message.velocity[:2])):
            self.rejected += 1
            return
        velocity = np.array([message.velocity[0], -message.velocity[1]])
        stamp = message.header.stamp.sec + message.header.stamp.nanosec * 1e-9
        with self._lock:
            gap = stamp - self._stamp
            if not 0.0 < gap < _LONGEST_GAP:
                gap = min(max(0.0, at - self._wheels_at), _LONGEST_GAP)
            self._position = self._position + 0.5 * (velocity + self._velocity) * gap
            self._velocity, self._stamp, self._wheels_at = velocity, stamp, at
            self._wheels.feed(at)

    def _on_emergency(self, data: bytes, at: float) -> None:
        self.heard[EMERGENCY] += 1
        try:
            message = ros.decode(ros.EMERGENCY_STOP, data)
        except MessageError:
            self.rejected += 1
            return
        causes = {
            "button": message.emergency_button_stop,
            "laser scanner": message.scanner_stop,
            "software": message.software_stop,
        }
        names = ", ".join(name for name, active in causes.items() if active)
        stopped = message.software_stop or message.emergency_state != FREE
        cause = reasons.base_stopped(names) if names else reasons.base_stop_unconfirmed()
        with self._lock:
            self._emergency = int(message.emergency_state) or int(message.software_stop)
            self._emergency_at, self._pressed = at, message.emergency_state != FREE
            self._cause = cause if stopped else None

    def _on_battery(self, data: bytes, at: float) -> None:
        self.heard[BATTERY] += 1
        try:
            message = ros.decode(ros.BATTERY_STATE, data)
        except MessageError:
            self.rejected += 1
            return
        with self._lock:
            self._battery = float(message.percentage)

    def _on_odometry(self, data: bytes, at: float) -> None:
        # The base's odometry is not used, because the bridge integrates the wheels. It shows that the node is alive.
        self.heard[ODOMETRY] += 1

    def _call(self, service: str) -> None:
        """Call the relay board from a thread: the answer may take a second. The stop state shows the result."""

        def ask() -> None:
            with contextlib.suppress(ServiceError):
                self._wire.ask(self._prefix + service, _EMPTY_REQUEST, _SERVICE_S)

        threading.Thread(target=ask, name=f"mp500-{service}", daemon=True).start()


def _twist(v: float, omega: float) -> bytes:
    vector = "geometry_msgs/msg/Vector3"
    linear, angular = ros.make(vector, x=v, y=0.0, z=0.0), ros.make(vector, x=0.0, y=0.0, z=omega)
    return ros.encode(ros.make(ros.TWIST, linear=linear, angular=angular))
