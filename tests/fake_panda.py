"""An arm's control box that the unmodified libfranka connects to, run as a process of its own.

`python fake_panda.py ADDRESS` prints a line when it listens, then takes one command a line on standard input and
answers each with JSON: `report`, `collide`, `press`, `free`, `drop N`, `clear`.

It moves exactly as commanded, and judges every command as the control box does: velocity, acceleration and jerk within
the data sheet, or a reflex; a missing command is extrapolated with the last acceleration; after 20 in a row it stops.
Its millisecond lasts until the command has come, for `PATIENCE_S` at most, so that a busy machine loses no packets.
"""

import json
import select
import socket
import struct
import sys
import threading
import time

import fake_panda_protocol as p
import numpy as np

TICK_S, PATIENCE_S = 0.001, 0.03
LOST_IN_A_ROW = 20
RECOVERY_TICKS = 50
# Data sheet of the Panda.
VELOCITY = np.array([2.175] * 4 + [2.61] * 3)
ACCELERATION = np.array([15.0, 7.5, 10.0, 12.5, 15.0, 20.0, 20.0])
JERK = 500.0 * ACCELERATION
LOWER = np.array([-2.8973, -1.7628, -2.8973, -3.0718, -2.8973, -0.0175, -2.8973])
UPPER = np.array([2.8973, 1.7628, 2.8973, -0.0698, 2.8973, 3.7525, 2.8973])
START = np.array([-0.2784, -0.1128, -0.0354, -2.0055, 1.6759, 1.2124, -0.269])
# Rounding of the client's arithmetic.
SLACK = 1.0 + 1e-6


class Arm:
    """The box: one client at a time."""

    def __init__(self, address: str) -> None:
        self.lock = threading.Lock()
        self.state = p.State(q=START.copy())
        self.motion: int | None = None
        self.begun = False
        self.in_a_row = self.lost = self.commands = self.to_drop = 0
        self.stopping = self.pressed = False
        self.recovery: tuple[int, int] | None = None
        self.worst = np.zeros(3)
        self.breaches: list[str] = []
        self.load = 0.0
        self.recoveries = 0
        self.still_since: float | None = None
        self.client: socket.socket | None = None
        self.listener = socket.create_server((address, p.PORT))
        self.udp = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self.udp.bind((address, 0))
        self.target: tuple[str, int] | None = None

    def run(self, ended: threading.Event) -> None:
        while not ended.is_set():
            if self.client is None:
                self.accept()
            else:
                began = time.monotonic()
                self.requests(self.client)
                self.tick()
                time.sleep(max(0.0, began + TICK_S - time.monotonic()))

    def accept(self) -> None:
        if select.select([self.listener], [], [], 0.05)[0]:
            self.client, _ = self.listener.accept()
            self.client.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)

    def gone(self) -> None:
        """The client has left: brake, as the box does."""
        assert self.client is not None
        self.client.close()
        self.client = self.target = None
        with self.lock:
            self.motion = None
            self.rest()
            if self.state.mode == p.MOVING:
                self.state.mode = p.IDLE

    def rest(self) -> None:
        self.state.dq_d, self.state.ddq_d = np.zeros(7), np.zeros(7)

    def requests(self, client: socket.socket) -> None:
        while select.select([client], [], [], 0.0)[0]:
            head = client.recv(p.HEADER.size, socket.MSG_WAITALL)
            if len(head) < p.HEADER.size:
                self.gone()
                return
            command, number, size = p.HEADER.unpack(head)
            body = client.recv(size - p.HEADER.size, socket.MSG_WAITALL) if size > p.HEADER.size else b""
            with self.lock:
                self.request(command, number, body)

    def request(self, command: int, number: int, body: bytes) -> None:
        assert self.client is not None
        if command == p.CONNECT:
            version, port = struct.unpack("<HH", body)
            self.target = (self.client.getpeername()[0], port)
            self.say(command, number, int(version != p.VERSION), struct.pack("<H", p.VERSION))
        elif command == p.MOVE:
            generator = struct.unpack_from("<II", body)[1]
            if self.state.mode != p.IDLE or generator != p.JOINT_VELOCITY:
                self.say(command, number, p.REJECTED)
                return
            self.motion, self.begun, self.in_a_row = number, False, 0
            self.state.mode, self.state.reflex = p.MOVING, frozenset()
            self.say(command, number, p.MOTION_STARTED)
        elif command == p.STOP_MOVE:
            self.finish(p.PREEMPTED)
            self.rest()
            self.say(command, number, p.SUCCESS)
        elif command == p.RECOVER:
            if self.pressed:
                self.say(command, number, p.REJECTED)
            else:
                self.state.mode, self.recovery = p.RECOVERING, (number, RECOVERY_TICKS)
        elif command in p.SETTERS:
            if command == p.SET_LOAD:
                self.load = struct.unpack_from("<d", body)[0]
            self.say(command, number, p.SUCCESS)
        else:
            raise RuntimeError(f"command {command} is not part of this control box")

    def say(self, command: int, number: int, status: int, more: bytes = b"") -> None:
        assert self.client is not None
        self.client.sendall(p.reply(command, number, status, more))

    def finish(self, status: int) -> None:
        if self.motion is not None:
            self.say(p.MOVE, self.motion, status)
            self.motion = None
            self.state.mode = p.IDLE

    def tick(self) -> None:
        if self.client is None or self.target is None:
            return
        with self.lock:
            state = self.state
            state.number += 1
            self.recover()
            message = state.pack()
            moving = state.mode == p.MOVING
        self.udp.sendto(message, self.target)
        command = self.receive() if moving else None
        with self.lock:
            if moving and self.state.mode == p.MOVING:
                self.move(command)
            speed = float(np.abs(self.state.dq_d).max())
            self.still_since = (self.still_since or time.monotonic()) if speed < 1e-3 else None

    def recover(self) -> None:
        if self.recovery is not None:
            number, left = self.recovery
            self.recovery = (number, left - 1)
            if left == 0:
                self.recovery = None
                self.state.mode, self.state.errors = p.IDLE, frozenset()
                self.recoveries += 1
                self.say(p.RECOVER, number, p.SUCCESS)

    def receive(self) -> tuple[object, ...] | None:
        """The answer to the state just sent; None when it has not come in time or gets lost."""
        end = time.monotonic() + PATIENCE_S
        while select.select([self.udp], [], [], max(0.0, end - time.monotonic()))[0]:
            command = p.COMMAND.unpack(self.udp.recv(4096))
            if command[0] == self.state.number:
                if self.to_drop > 0:
                    self.to_drop -= 1
                    return None
                return command
        return None

    def move(self, command: tuple[object, ...] | None) -> None:
        state = self.state
        if command is None:
            if not self.begun:
                return
            self.lost += 1
            self.in_a_row += 1
            state.success_rate = max(0.0, state.success_rate - 0.01)
            if self.in_a_row >= LOST_IN_A_ROW:
                self.reflex(p.COMMUNICATION, "20 packets lost in a row")
                return
            wanted = np.clip(state.dq_d + state.ddq_d * TICK_S, -VELOCITY, VELOCITY)
        else:
            self.begun, self.in_a_row = True, 0
            self.commands += 1
            state.success_rate = min(1.0, state.success_rate + 0.01)
            wanted = np.array(command[p.VELOCITY], float)
            if not self.judge(wanted):
                return
        state.ddq_d = (wanted - state.dq_d) / TICK_S
        state.q = state.q + 0.5 * (wanted + state.dq_d) * TICK_S
        state.dq_d = wanted
        if np.any(state.q < LOWER) or np.any(state.q > UPPER):
            self.reflex(p.POSITION_LIMIT, f"joints at {state.q}")
        elif command is not None and command[p.FINISHED]:
            self.rest()
            self.finish(p.SUCCESS)

    def judge(self, wanted: np.ndarray) -> bool:
        acceleration = (wanted - self.state.dq_d) / TICK_S
        jerk = (acceleration - self.state.ddq_d) / TICK_S
        shares = [np.abs(wanted) / VELOCITY, np.abs(acceleration) / ACCELERATION, np.abs(jerk) / JERK]
        names = ("velocity", "acceleration", "jerk")
        kinds = (p.VELOCITY_LIMIT, p.VELOCITY_STEP, p.ACCELERATION_STEP)
        for i, (share, name, kind) in enumerate(zip(shares, names, kinds, strict=True)):
            if not np.all(share <= SLACK):
                self.reflex(kind, f"{name} is {np.max(share):.3f} of what joint {int(np.argmax(share)) + 1} may have")
                return False
            self.worst[i] = max(self.worst[i], float(share.max()))
        return True

    def reflex(self, kind: int, why: str) -> None:
        """Stop by itself: the brakes are faster than any command."""
        self.breaches.append(why)
        self.rest()
        self.state.errors = self.state.reflex = frozenset({kind})
        self.finish(p.REFLEX_ABORTED)
        self.state.mode = p.REFLEX

    def press(self) -> None:
        self.pressed = True
        self.rest()
        self.finish(p.EMERGENCY_ABORTED)
        self.state.mode = p.USER_STOPPED

    def report(self) -> dict[str, object]:
        return {
            "q": self.state.q.tolist(),
            "dq": self.state.dq_d.tolist(),
            "mode": self.state.mode,
            "commands": self.commands,
            "lost": self.lost,
            "breaches": self.breaches,
            "worst": self.worst.tolist(),
            "load": self.load,
            "recoveries": self.recoveries,
            "ticks": self.state.number,
            "still_s": -1.0 if self.still_since is None else time.monotonic() - self.still_since,
        }

    def tell(self, words: list[str]) -> dict[str, object]:
        with self.lock:
            match words:
                case ["collide"]:
                    self.reflex(p.JOINT_REFLEX, "collision")
                case ["press"]:
                    self.press()
                case ["free"]:
                    self.pressed = False
                    if self.state.mode == p.USER_STOPPED:
                        self.state.mode = p.IDLE
                case ["drop", count]:
                    self.to_drop = int(count)
                case ["clear"]:
                    self.breaches, self.worst, self.lost = [], np.zeros(3), 0
            return self.report()


def main(address: str) -> None:
    arm, ended = Arm(address), threading.Event()

    def listen() -> None:
        for line in sys.stdin:
            print(json.dumps(arm.tell(line.split())), flush=True)
        ended.set()

    threading.Thread(target=listen, daemon=True).start()
    sys.setswitchinterval(0.0005)
    print("ready", flush=True)
    arm.run(ended)


if __name__ == "__main__":
    main(sys.argv[1])
