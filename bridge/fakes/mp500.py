"""Fake MP-500: the maker's topics and services over Zenoh, and a monitor of commands."""

import math
import threading
import time

import numpy as np

from bridge.fakes.bodies import WheelBody
from bridge.real import mp500
from bridge.real import ros_messages as ros
from rolling_panda.model.differential_drive import DifferentialDrive
from rolling_panda.transport.zenoh import ForeignWire

RATE_HZ = 50.0
# The maker's values.
_WATCHDOG_S = 1.0
# Limits of the base (maker's figures: m/s, m/s²).
_SPEED, _ACCELERATION = 1.5, 2.4
_STANDSTILL = 0.05
# CDR of a request without arguments: a header, and one byte since a structure has at least one.
_NO_ARGUMENTS = b"\x00\x01\x00\x00\x00"
_CHARGE = 0.8


class FakeMp500:
    """Follows `cmd_vel` like the maker's nodes, with a watchdog of 1 s and stops. `tell` operates the buttons."""

    def __init__(self, wire: ForeignWire, wheels: WheelBody, drive: DifferentialDrive) -> None:
        """Serve on the wire; the wheels do not move before `run`.

        Args:
            wire: Closed with the base.
            wheels: Mechanics of the wheels.
            drive: Geometry of the base.
        """
        # Zenoh closes a session without references.
        self._wire, self._wheels, self._drive = wire, wheels, drive
        self._lock = threading.Lock()
        self._command, self._command_at, self._commands = (0.0, 0.0), -math.inf, 0
        self._state, self._soft, self._stuck = mp500.FREE, False, False
        self._muted: set[str] = set()
        self._violations: list[str] = []
        self._fastest = self._steepest = 0.0
        self._standstill_since: float | None = None
        self._pose, self._turned = (0.0, 0.0, 0.0), wheels.turned
        wire.subscribe(mp500.COMMAND, self._on_command)
        wire.serve(mp500.SOFT_STOP, lambda request: self._on_soft(request, True))
        wire.serve(mp500.SOFT_RELEASE, lambda request: self._on_soft(request, False))
        names = (mp500.WHEELS, mp500.ODOMETRY, mp500.EMERGENCY, mp500.BATTERY)
        self._put = {name: wire.publisher(name) for name in names}

    def run(self, ended: threading.Event) -> None:
        """Move and publish until `ended` is set."""
        last = time.monotonic()
        while not ended.wait(max(0.0, last + 1 / RATE_HZ - time.monotonic())):
            now = time.monotonic()
            self._step(now - last, now)
            last = now

    def tell(self, words: list[str]) -> None:
        """Press, confirm or release the button, mute a topic, let the wheels run away, or reset the monitor."""
        with self._lock:
            match words:
                case ["press"]:
                    self._state = 1
                case ["confirm"]:
                    self._state = 2
                case ["free"]:
                    self._state, self._muted, self._stuck = mp500.FREE, set(), False
                case ["mute", name]:
                    self._muted.add(name)
                case ["stuck"]:
                    self._stuck = True
                case ["clear"]:
                    self._violations, self._fastest, self._steepest = [], 0.0, 0.0

    def report(self) -> dict[str, object]:
        """State, and findings of the monitor."""
        with self._lock:
            return {
                "wheels": self._wheels.speed.tolist(),
                "travel": self._wheels.turned.tolist(),
                "command": list(self._command),
                "commands": self._commands,
                "breaches": self._violations,
                "worst": [self._fastest, self._steepest],
                "still_s": -1.0 if self._standstill_since is None else time.monotonic() - self._standstill_since,
                "soft": self._soft,
            }

    def close(self) -> None:
        """Close the wire."""
        self._wire.close()

    def _on_command(self, data: bytes, at: float) -> None:
        message = ros.decode(ros.TWIST, data)
        v, omega = message.linear.x, message.angular.z
        with self._lock:
            powered = self._state == mp500.FREE and not self._soft
            if not (math.isfinite(v) and math.isfinite(omega)) or abs(v) > _SPEED:
                self._violations.append(f"velocity {v}, {omega}")
            # Commands may arrive closer together than they were sent, and some may be lost.
            passed = max(at - self._command_at, 1.0 / RATE_HZ)
            step = abs(v - self._command[0]) / passed if powered and self._commands else 0.0
            if step > 1.5 * _ACCELERATION:
                self._violations.append(f"from {self._command[0]:.3f} to {v:.3f} m/s in {passed:.3f} s")
            self._fastest = max(self._fastest, abs(v) / _SPEED)
            self._steepest = max(self._steepest, step / _ACCELERATION)
            self._command, self._command_at = (v, omega), at
            self._commands += 1

    def _on_soft(self, request: bytes, stop: bool) -> bytes:
        understood = request == _NO_ARGUMENTS
        if understood:
            with self._lock:
                self._soft = stop
        return ros.encode(ros.make(ros.SUCCESS, success=understood))

    def _step(self, dt: float, now: float) -> None:
        with self._lock:
            goal = np.array(self._drive.wheels(*self._command))
            if self._state != mp500.FREE or self._soft or now - self._command_at > _WATCHDOG_S:
                goal = np.zeros(2)
            if self._stuck and not self._soft:
                goal = np.array([1.0, 1.0])
            self._wheels.drive(goal, dt)
            if np.abs(self._wheels.speed).max() > _STANDSTILL:
                self._standstill_since = None
            elif self._standstill_since is None:
                self._standstill_since = now
            state, soft, muted = self._state, self._soft, set(self._muted)
        for name, message in self._messages(state, soft).items():
            if name not in muted:
                self._put[name](ros.encode(message))

    def _messages(self, state: int, soft: bool) -> dict[str, object]:
        own, speed = self._wheels.time, self._wheels.speed
        stamp = ros.make("builtin_interfaces/msg/Time", sec=int(own), nanosec=int(own % 1 * 1e9))
        header = ros.make("std_msgs/msg/Header", stamp=stamp, frame_id="")
        wheels = ros.make(
            ros.JOINT_STATE,
            header=header,
            name=["wheel_front_left_joint", "wheel_front_right_joint"],
            # Raw encoder counts of the relay board.
            position=np.array([137.0, -137.0]),
            velocity=np.array([speed[0], -speed[1]]),
            effort=np.zeros(0),
        )
        stop = ros.make(
            ros.EMERGENCY_STOP,
            header=header,
            emergency_button_stop=state == 1,
            scanner_stop=False,
            software_stop=soft,
            emergency_state=state,
        )
        return {
            mp500.WHEELS: wheels,
            mp500.ODOMETRY: self._odometry(header),
            mp500.EMERGENCY: stop,
            mp500.BATTERY: battery(header, _CHARGE),
        }

    def _odometry(self, header: object) -> object:
        turned, speed = self._wheels.turned, self._wheels.speed
        self._pose = self._drive.rolled(self._pose, *(turned - self._turned).tolist())
        self._turned = turned
        x, y, phi = self._pose
        v, omega = self._drive.twist(*speed.tolist())
        place, turn = "geometry_msgs/msg/Point", "geometry_msgs/msg/Quaternion"
        pose = ros.make(
            "geometry_msgs/msg/Pose",
            position=ros.make(place, x=x, y=y, z=0.0),
            orientation=ros.make(turn, x=0.0, y=0.0, z=math.sin(phi / 2), w=math.cos(phi / 2)),
        )
        twist = ros.make("geometry_msgs/msg/Twist", linear=_vector(v, 0.0), angular=_vector(0.0, omega))
        unknown = np.zeros(36)
        return ros.make(
            ros.ODOMETRY,
            header=header,
            child_frame_id="base_link",
            pose=ros.make("geometry_msgs/msg/PoseWithCovariance", pose=pose, covariance=unknown),
            twist=ros.make("geometry_msgs/msg/TwistWithCovariance", twist=twist, covariance=unknown),
        )


def _vector(x: float, z: float) -> object:
    return ros.make("geometry_msgs/msg/Vector3", x=x, y=0.0, z=z)


def battery(header: object, charge: float) -> object:
    """The maker's battery message with a charge (0…1)."""
    return ros.make(
        ros.BATTERY_STATE,
        header=header,
        voltage=24.5,
        temperature=math.nan,
        current=0.0,
        charge=math.nan,
        capacity=math.nan,
        design_capacity=100.0,
        percentage=charge,
        power_supply_status=2,
        power_supply_health=0,
        power_supply_technology=1,
        present=True,
        cell_voltage=np.zeros(0, np.float32),
        cell_temperature=np.zeros(0, np.float32),
        location="slot1",
        serial_number="neobattery1",
    )
