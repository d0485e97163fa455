"""`python -m bridge.fakes`: fake devices of the robot in a process.

It prints `ready`, and ends when its standard input closes. Each line of input commands a device (`base press`,
`base free`, `base mute TOPIC`, `base stuck`, `arm collide`, `arm press`, `arm drop COUNT`, `report`, …). The answer is
a line of JSON with the state of every device and the findings of its monitor.
"""

import argparse
import json
import sys
import threading
from collections.abc import Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol

from bridge.fakes.bodies import ArmBody, BladeBody, FirstOrderWheels, FreeBlades, IdealArm, WheelBody
from bridge.fakes.control_box import ControlBox
from bridge.fakes.cutter import FakeCutter
from bridge.fakes.mp500 import FakeMp500
from bridge.real.config import RealConfig
from bridge.real.picture_link import INERTIAL_KEY, KEY, pack, pack_inertial
from rolling_panda import topics
from rolling_panda.config import RobotConfig, TransportConfig, load_section
from rolling_panda.errors import InputError, RollingPandaError
from rolling_panda.model.robot import RobotModel
from rolling_panda.resources import resource
from rolling_panda.runtime.process import ROBOT_ID, stop_on_signals
from rolling_panda.runtime.scheduling import set_priority
from rolling_panda.transport.access import DEVICES
from rolling_panda.transport.settings import add_wire_arguments
from rolling_panda.transport.zenoh import ForeignWire, Onlooker


class Device(Protocol):
    """Interface of every fake device."""

    def tell(self, words: list[str]) -> None:
        """Execute a command."""

    def report(self) -> dict[str, object]:
        """State, and findings of the monitor."""

    def close(self) -> None:
        """Close connections."""


def main(argv: Sequence[str] | None = None) -> int:
    """Run the fakes; returns the exit code."""
    arguments = _parser().parse_args(argv)
    try:
        _run(arguments)
    except RollingPandaError as error:
        print(f"fakes: {error}", file=sys.stderr)
        return 1
    return 0


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog="python -m bridge.fakes", description=__doc__)
    default = resource("assets/config/fakes.toml")
    parser.add_argument("--config", type=Path, default=default, help="TOML configuration (default: the fakes')")
    parser.add_argument(
        "--connect", metavar="ENDPOINT", help="router that base and cutter are behind; without it none is"
    )
    add_wire_arguments(parser)
    parser.add_argument(
        "--arm", metavar="ADDRESS", help="loopback address of the arm's control box (with --seed: the configuration's)"
    )
    parser.add_argument("--seed", type=int, help="all devices on one simulated robot beside the row of this seed")
    parser.add_argument("--trace", type=Path, metavar="FILE", help="record what the simulation actuates")
    return parser


@dataclass(frozen=True)
class _Bodies:
    """Mechanics of the devices."""

    arm: ArmBody
    wheels: WheelBody
    blades: BladeBody


def _bodies(arguments: argparse.Namespace, picture_hz: float, stack: ExitStack) -> _Bodies:
    if arguments.seed is None:
        return _Bodies(IdealArm(), FirstOrderWheels(), FreeBlades())
    # Imported here: without --seed no simulator is needed.
    from bridge.fakes.vineyard_plant import VineyardPlant
    from bridge.sim.build import simulated_robot

    wire = ForeignWire(_wire(arguments), DEVICES)
    stack.callback(wire.close)
    send, send_inertial = wire.publisher(KEY), wire.publisher(INERTIAL_KEY)
    robot = simulated_robot(arguments.config, arguments.seed, arguments.trace, "device")
    plant = VineyardPlant(
        robot,
        picture_hz,
        lambda picture, at: send(pack(picture, at)),
        lambda sample: send_inertial(pack_inertial(sample)),
    )
    stack.callback(plant.close)
    return _Bodies(plant, plant, plant)


def _wire(arguments: argparse.Namespace) -> TransportConfig:
    return TransportConfig(
        connect=(arguments.connect,),
        certificates="" if arguments.certificates is None else str(arguments.certificates),
        plain_wire=arguments.plain_wire,
    )


def _run(arguments: argparse.Namespace) -> None:
    ended = stop_on_signals()
    # Real devices have computers of their own.
    set_priority("control")
    # Shorter waits of the control box for other threads.
    sys.setswitchinterval(0.0005)
    if arguments.seed is not None and arguments.connect is None:
        raise InputError("--seed puts all devices on one robot: give --connect too")
    real = load_section(arguments.config, "real", RealConfig)
    address = arguments.arm or (None if arguments.seed is None else real.arm.address)
    devices: dict[str, Device] = {}
    box: ControlBox | None = None
    with ExitStack() as stack:
        bodies = _bodies(arguments, real.camera.rate_hz, stack)
        if address is not None:
            box = devices["arm"] = ControlBox(address, bodies.arm)
            stack.callback(box.close)
        if arguments.connect is not None:
            wire = _wire(arguments)
            drive = RobotModel(load_section(arguments.config, "robot", RobotConfig)).drive
            base = devices["base"] = FakeMp500(ForeignWire(wire, DEVICES), bodies.wheels, drive)
            stack.callback(base.close)
            cutter = devices["cutter"] = FakeCutter(ForeignWire(wire, DEVICES), real.cutter.service, bodies.blades)
            stack.callback(cutter.close)
            buttons = Onlooker(wire, ROBOT_ID, DEVICES)
            stack.callback(buttons.close)
            buttons.subscribe(topics.HARDWARE_STOP, lambda said, _: base.tell(["press" if said.pressed else "free"]))
            turning = threading.Thread(target=base.run, args=(ended,), name="mp500")
            turning.start()
            stack.callback(turning.join)
            stack.callback(ended.set)
        threading.Thread(target=_listen, args=(devices, ended), name="lines", daemon=True).start()
        print("ready", flush=True)
        if box is not None:
            box.run(ended)
        ended.wait()


def _listen(devices: dict[str, Device], ended: threading.Event) -> None:
    for line in sys.stdin:
        name, *words = line.split()
        if name in devices:
            devices[name].tell(words)
        print(json.dumps({name: device.report() for name, device in devices.items()}), flush=True)
    ended.set()


if __name__ == "__main__":
    sys.exit(main())
