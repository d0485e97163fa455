"""What goes wrong in a world of one process: each fault, what it tests, and how soon the robot must rest."""

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

from controller.config import ControllerConfig
from rolling_panda import commands as intents
from rolling_panda import messages as m
from tests.support.worlds.faulty_world import FaultyWorld

Inject = Callable[[FaultyWorld], None]
_GO_ON = math.inf
#: The configured speed by hand, and the most that the robot's own limits allow the base (m/s).
_HAND, _FULL = ControllerConfig().teleoperation.base_speed, ControllerConfig().whole_body.base_speed


@dataclass(frozen=True)
class Fault:
    """What goes wrong.

    Attributes:
        name: Of the fault and its hop.
        requirement: That it tests.
        limit_s: From the fault until the bridge sends zero for good; infinite where the robot must go on.
        inject: Makes it happen.
        moving: How the robot moves when it happens: in automatic work, or base or tool by an operator's hand.
        speed: Greatest of the base (m/s) where it is driven by hand.
        since: What the limit counts from: the fault, or the last command that the bridge took.
        lasts_s: How long the fault goes on (s), where it ends.
    """

    name: str
    requirement: str
    limit_s: float
    inject: Inject
    moving: Literal["work", "base", "tool"] = "work"
    speed: float = _HAND
    since: Literal["fault", "setpoint"] = "fault"
    lasts_s: float = 0.0

    @property
    def watched_s(self) -> float:
        """How long to watch after the fault (s)."""
        return self.lasts_s + (self.limit_s + 0.7 if math.isfinite(self.limit_s) else 2.0)


def _later(seconds: float, first: Inject, then: Inject) -> Inject:
    """One thing now and another one after some time."""

    def inject(world: FaultyWorld) -> None:
        first(world)
        due = world.now + seconds

        def wait(world: FaultyWorld) -> None:
            if world.now >= due:
                world.intruder = lambda _: None
                then(world)

        world.intruder = wait

    return inject


def _set(**changes: object) -> Inject:
    def inject(world: FaultyWorld) -> None:
        for name, value in changes.items():
            setattr(world, name, value)

    return inject


def _link(name: str, **changes: object) -> Inject:
    def inject(world: FaultyWorld) -> None:
        for key, value in changes.items():
            setattr(getattr(world, name), key, value)

    return inject


def _restart_bridge(world: FaultyWorld) -> None:
    world.robot.begun.append(len(world.robot.rows))
    world.bridge = world.new_bridge()


def _stop_and_restart_both(world: FaultyWorld) -> None:
    world.stop()
    _restart_bridge(world)
    world.restart_controller()


def _garbage(world: FaultyWorld) -> None:
    """Another sender with the right token and numbers far ahead, and nothing but wrong velocities."""
    values = (math.nan, math.inf, -math.inf, 1e308, 50.0)

    def send(world: FaultyWorld) -> None:
        real = world.commanded
        if world.ticks % 5 or real is None:
            return
        a, b, c, d, e, f, g, h = (world.rng.choice(values) if world.rng.random() < 0.5 else 0.1 for _ in range(8))
        xi, echo = (a, b, c, d, e, f, g, h, math.nan), world.ticks // 10
        wrong = m.MotionCommand(epoch=real.epoch, token=real.token, sequence=2**40, echo=echo, xi=xi)
        world.bridge.on_motion(wrong, world.now)

    world.intruder = send


def _commands(ahead: int, token: str = "") -> Inject:
    """Another sender, whose epoch is so far ahead, with a token of its own or the robot's."""

    def inject(world: FaultyWorld) -> None:
        def send(world: FaultyWorld) -> None:
            real = world.commanded
            if world.ticks % 10 or real is None:
                return
            command = m.MotionCommand(
                epoch=real.epoch + ahead,
                token=token or real.token,
                sequence=2**40 + world.ticks,
                echo=world.ticks // 10,
                xi=(3.0, -3.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0),
            )
            world.bridge.on_motion(command, world.now)

        world.intruder = send

    return inject


def _stuck_wheel(world: FaultyWorld) -> None:
    world.robot.follows[world.rng.randrange(2)] = 0.0


def _taken_over(world: FaultyWorld) -> None:
    world.people = (*world.people, "bob")
    world.command(intents.TakeControl(user="bob", confirm=True))


def _bad_link(world: FaultyWorld) -> None:
    """Every way between bridge and controller loses, repeats, delays and reorders, each by its own share."""
    for link in (world.motion, world.state, world.odometry):
        link.loss, link.twice = world.rng.uniform(0.0, 0.2), world.rng.uniform(0.0, 0.5)
        link.delay, link.jitter = world.rng.uniform(0.0, 0.03), world.rng.uniform(0.0, 0.05)


def _stop_and_another(world: FaultyWorld) -> None:
    """The stop, and in the same moment something less severe, drawn by the world's seed."""
    others = (
        _set(perception=False),
        _set(server=False),
        _set(watched=False),
        _set(heard=False),
        _link("odometry", loss=1.0),
        _link("state", jitter=0.1),
        _link("motion", loss=1.0),
    )
    world.rng.choice(others)(world)
    world.stop()


FAULTS: tuple[Fault, ...] = (
    Fault("operator's page silent", "R1", 0.4, _set(heard=False), "base"),
    Fault("controller killed", "R2", 0.2, _set(alive=False), since="setpoint"),
    Fault("controller killed, base at full speed", "R2", 0.2, _set(alive=False), "base", _FULL, "setpoint"),
    Fault("motion commands lost", "R2", 0.2, _link("motion", loss=1.0), since="setpoint"),
    Fault("software stop", "R3", 0.2, FaultyWorld.stop, "base", _FULL),
    Fault("software stop in automatic work", "R3", 0.2, FaultyWorld.stop),
    Fault("stop, then both restart", "R4", 0.2, _stop_and_restart_both, "base"),
    Fault("base from 0.3 m/s", "R5", 0.5, FaultyWorld.stop, "base", _FULL),
    Fault("arm and base in automatic work", "R5", 0.3, FaultyWorld.stop),
    Fault("commands 300 ms late", "R6", 0.4, _link("motion", delay=0.3)),
    Fault("states lost", "R6", 0.4, _link("state", loss=1.0)),
    Fault(
        "2 s held back, then flushed",
        "R6",
        0.4,
        _later(2.0, _link("motion", held=True), _link("motion", held=False)),
        lasts_s=2.0,
    ),
    Fault("duplicates and reorder", "R8", _GO_ON, _link("motion", twice=0.5, jitter=0.03)),
    Fault("loss, delay, duplicates and reorder both ways", "R8", _GO_ON, _bad_link),
    Fault("NaN, infinity, out of range", "R9", _GO_ON, _garbage),
    Fault("NaN, infinity, out of range, driven by hand", "R10", _GO_ON, _garbage, "base", _FULL),
    Fault("an older controller's commands", "R11", _GO_ON, _commands(-1, "own")),
    Fault("commands of an epoch that nobody was given", "R11", _GO_ON, _commands(1, "own")),
    Fault("commands of another sender under the robot's token", "R11", 0.8, _commands(0)),
    Fault("holder silent in automatic work", "R12", 1.5, _set(heard=False)),
    Fault("control taken by another", "R13", 0.5, _taken_over),
    Fault("release of the hold", "R15", 0.15, _set(holds=False), "base"),
    Fault("release of the tool", "R15", 0.15, _set(holds=False), "tool"),
    Fault("nobody sees the robot", "R16", 2.5, _set(watched=False)),
    Fault("server gone", "R16", 2.5, _set(server=False)),
    Fault("controller restarts", "R17", 0.3, FaultyWorld.restart_controller),
    Fault("bridge restarts", "R17", 0.3, _restart_bridge),
    Fault(
        "controller stopped for 2 s, then continues",
        "R17",
        0.3,
        _later(2.0, _set(alive=False), _set(alive=True)),
        lasts_s=2.0,
    ),
    Fault("software stop and another fault at once", "R18", 0.2, _stop_and_another),
    Fault("odometry lost", "R20", 0.6, _link("odometry", loss=1.0)),
    Fault("perception gone", "R20", 1.5, _set(perception=False)),
    Fault("a wheel does not turn", "follows", 1.5, _stuck_wheel),
    Fault("nothing, for comparison", "clean", _GO_ON, lambda world: None),
    Fault("100 ms of jitter", "clean", _GO_ON, _link("state", jitter=0.1)),
    Fault("100 ms of jitter on commands", "clean", _GO_ON, _link("motion", jitter=0.1)),
)
