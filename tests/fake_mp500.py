"""A base that believes it is an MP-500: the maker's topics and services over Zenoh, run as a process of its own.

`python fake_mp500.py ENDPOINT` prints a line when it is there, then takes one command a line on standard input and
answers each on standard output: `press`, `free`, `mute NAME`, `stuck`, `report`.
"""

import json
import math
import sys
import threading
import time

import numpy as np

from bridge.real import mp500
from bridge.real import ros_messages as ros
from rolling_panda.config import TransportConfig
from rolling_panda.robot_model import RobotModel
from rolling_panda.transport import ForeignWire

DRIVE = RobotModel().drive
RATE_HZ = 50.0
LAG_S = 0.05
WATCHDOG_S = 1.0
# What the base can take (maker's figures), and what its monitor calls a breach.
SPEED, ACCELERATION = 1.5, 2.4


class Base:
    """Wheels with a first-order lag, the maker's watchdog of 1 s, and a monitor of every command that comes in."""

    def __init__(self, wire: ForeignWire) -> None:
        self.wire = wire  # Zenoh closes a session that nobody holds.
        self.lock = threading.Lock()
        self.command, self.command_at, self.commands = (0.0, 0.0), -math.inf, 0
        self.wheels, self.travel = np.zeros(2), np.zeros(2)
        self.state, self.soft, self.muted, self.stuck = mp500.FREE, False, set(), False
        self.breaches: list[str] = []
        self.still_at: float | None = None
        wire.subscribe(mp500.COMMAND, self.on_command)
        wire.serve(mp500.SOFT_STOP, lambda request: self.on_soft(request, True))
        wire.serve(mp500.SOFT_RELEASE, lambda request: self.on_soft(request, False))
        self.put = {
            name: wire.publisher(name) for name in (mp500.WHEELS, mp500.ODOMETRY, mp500.EMERGENCY, mp500.BATTERY)
        }

    def on_command(self, data: bytes, at: float) -> None:
        message = ros.decode(ros.TWIST, data)
        v, omega = message.linear.x, message.angular.z
        with self.lock:
            powered = self.state == mp500.FREE and not self.soft
            if not (math.isfinite(v) and math.isfinite(omega)) or abs(v) > SPEED:
                self.breaches.append(f"velocity {v}, {omega}")
            # Two commands may come in closer together than they were sent.
            if powered and self.commands and abs(v - self.command[0]) > 1.5 * ACCELERATION / RATE_HZ:
                self.breaches.append(f"from {self.command[0]:.3f} to {v:.3f} m/s in one command")
            self.command, self.command_at = (v, omega), at
            self.commands += 1

    def on_soft(self, request: bytes, stop: bool) -> bytes:
        assert request == b"\x00\x01\x00\x00\x00"
        with self.lock:
            self.soft = stop
        return ros.encode(ros.make(ros.SUCCESS, success=True))

    def turn(self, dt: float, now: float) -> None:
        with self.lock:
            goal = np.array(DRIVE.wheels(*self.command))
            if self.state != mp500.FREE or self.soft or now - self.command_at > WATCHDOG_S:
                goal = np.zeros(2)
            if self.stuck and not self.soft:
                goal = np.array([1.0, 1.0])
            before = self.wheels
            self.wheels = before + (goal - before) * (1.0 - math.exp(-dt / LAG_S))
            self.travel = self.travel + 0.5 * (before + self.wheels) * dt
            if np.abs(self.wheels).max() > 0.05:
                self.still_at = None
            elif self.still_at is None:
                self.still_at = now
        stamp = ros.make("builtin_interfaces/msg/Time", sec=int(now), nanosec=int(now % 1 * 1e9))
        header = ros.make("std_msgs/msg/Header", stamp=stamp, frame_id="")
        self.send(
            mp500.WHEELS,
            ros.make(
                ros.JOINT_STATE,
                header=header,
                name=["wheel_front_left_joint", "wheel_front_right_joint"],
                position=np.array([137.0, -137.0]),
                velocity=np.array([self.wheels[0], -self.wheels[1]]),
                effort=np.zeros(0),
            ),
        )
        self.send(
            mp500.EMERGENCY,
            ros.make(
                ros.EMERGENCY_STOP,
                header=header,
                emergency_button_stop=self.state == 1,
                scanner_stop=False,
                software_stop=self.soft,
                emergency_state=self.state,
            ),
        )
        self.send(mp500.BATTERY, battery(header, 0.8))

    def send(self, name: str, message: object) -> None:
        if name not in self.muted:
            self.put[name](ros.encode(message))

    def report(self, now: float) -> dict[str, object]:
        with self.lock:
            return {
                "wheels": self.wheels.tolist(),
                "travel": self.travel.tolist(),
                "command": list(self.command),
                "commands": self.commands,
                "breaches": self.breaches,
                "still_s": -1.0 if self.still_at is None else now - self.still_at,
                "soft": self.soft,
            }


def battery(header: object, share: float) -> object:
    return ros.make(
        ros.BATTERY_STATE,
        header=header,
        voltage=24.5,
        temperature=math.nan,
        current=0.0,
        charge=math.nan,
        capacity=math.nan,
        design_capacity=100.0,
        percentage=share,
        power_supply_status=2,
        power_supply_health=0,
        power_supply_technology=1,
        present=True,
        cell_voltage=np.zeros(0, np.float32),
        cell_temperature=np.zeros(0, np.float32),
        location="slot1",
        serial_number="neobattery1",
    )


def main(endpoint: str) -> None:
    base = Base(ForeignWire(TransportConfig(connect=(endpoint,))))
    ended = threading.Event()

    def listen() -> None:
        for line in sys.stdin:
            match line.split():
                case ["press"]:
                    base.state = 1
                case ["confirm"]:
                    base.state = 2
                case ["free"]:
                    base.state, base.muted, base.stuck = mp500.FREE, set(), False
                case ["mute", name]:
                    base.muted.add(name)
                case ["stuck"]:
                    base.stuck = True
                case ["clear"]:
                    base.breaches.clear()
            print(json.dumps(base.report(time.monotonic())), flush=True)
        ended.set()

    threading.Thread(target=listen, daemon=True).start()
    print("ready", flush=True)
    last = time.monotonic()
    while not ended.wait(max(0.0, last + 1 / RATE_HZ - time.monotonic())):
        now = time.monotonic()
        base.turn(now - last, now)
        last = now
    base.wire.close()


if __name__ == "__main__":
    main(sys.argv[1])
