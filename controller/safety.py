"""What the freshness of the inputs demands: pure checks, each with its reason in words."""

import math
from dataclasses import dataclass
from typing import Literal

from controller.config import ControllerConfig
from controller.interface import Inputs
from rolling_panda.messages import Mode

Action = Literal["none", "pause", "protect", "fault"]


@dataclass(frozen=True)
class Health:
    """How fresh everything is, in seconds on this process's clock; infinite where nothing ever came.

    Attributes:
        joints: Age of the newest joint state.
        odometry: Age of the newest odometry.
        bridge: Age of the newest bridge state.
        server: Age of the server's newest heartbeat.
        perception: Age of perception's newest heartbeat.
        present: Processes connected now.
        watchdog: The bridge says that its watchdog holds the robot.
        overruled: The bridge has accepted a newer controller than this one.
        ledger: Why what is done cannot be recorded; empty when it can.
    """

    joints: float
    odometry: float
    bridge: float
    server: float
    perception: float
    present: frozenset[str]
    watchdog: bool
    overruled: bool
    ledger: str = ""


def health(inputs: Inputs, epoch: int | None, now: float, ledger: str = "") -> Health:
    """How fresh the inputs are.

    Args:
        inputs: Newest of everything.
        epoch: Of this controller, None before the first bridge state.
        now: Monotonic time (s).
        ledger: Why what is done cannot be recorded.
    """

    def age(at: float | None) -> float:
        return math.inf if at is None else now - at

    bridge = inputs.bridge
    return Health(
        joints=age(inputs.joints.at if inputs.joints is not None else None),
        odometry=age(inputs.odometry.at if inputs.odometry is not None else None),
        bridge=age(bridge.at if bridge is not None else None),
        server=age(inputs.server_seen),
        perception=age(inputs.perception_seen),
        present=inputs.present,
        watchdog=bridge is not None and bridge.message.watchdog,
        overruled=bridge is not None and epoch is not None and bridge.message.epoch > epoch,
        ledger=ledger,
    )


@dataclass(frozen=True)
class Verdict:
    """What to do, and why. `none` with an empty reason when all is well."""

    action: Action
    reason: str = ""


FINE = Verdict("none")


def check(mode: Mode, moving: bool, health: Health, config: ControllerConfig) -> Verdict:
    """The most severe thing that the inputs demand in a mode.

    Args:
        mode: Of the machine.
        moving: True where motion may be under way outside AUTO and TELEOP (bringing the arm home).
        health: Of the inputs.
        config: Ages allowed.
    """
    if health.overruled:
        return Verdict("fault", "another controller commands this robot")
    if health.ledger:
        return Verdict("fault", health.ledger)
    if not moving and mode not in ("AUTO", "TELEOP"):
        return FINE
    cause = sensors(health, config)
    if cause:
        return Verdict("protect", cause)
    if health.watchdog:
        return Verdict("protect", "the bridge's watchdog holds the robot: no valid command reached it in time")
    cause = supervision(health, config, teleoperated=mode == "TELEOP")
    if not cause and mode == "AUTO":
        cause = perception(health, config)
    return Verdict("pause", cause) if cause else FINE


def sensors(health: Health, config: ControllerConfig) -> str:
    """Why the robot's own data do not allow motion; empty when they do."""
    if health.joints > config.joints_max_age_s:
        return f"joint states are {_age(health.joints)} old, allowed are {config.joints_max_age_s} s"
    if health.odometry > config.odometry_max_age_s:
        return f"odometry is {_age(health.odometry)} old, allowed are {config.odometry_max_age_s} s"
    if health.bridge > config.bridge_max_age_s:
        return f"the bridge's state is {_age(health.bridge)} old, allowed are {config.bridge_max_age_s} s"
    return ""


def supervision(health: Health, config: ControllerConfig, teleoperated: bool) -> str:
    """Why the server does not allow motion; empty when it does.

    Args:
        health: Of the inputs.
        config: Ages allowed.
        teleoperated: A hand's motion needs a fresher link than work that somebody only watches. Either way a server
            that has ended, instead of being slow, is noticed at once by its absence.
    """
    allowed = config.hold_link_max_age_s if teleoperated else config.server_max_age_s
    return _process("server", health.server, allowed, health.present)


def perception(health: Health, config: ControllerConfig) -> str:
    """Why perception does not allow automatic work; empty when it does."""
    return _process("perception", health.perception, config.perception_max_age_s, health.present)


def _process(name: str, age: float, allowed: float, present: frozenset[str]) -> str:
    if name not in present:
        return f"the {name} process is gone"
    if age > allowed:
        return f"the {name} process is silent for {_age(age)}, allowed are {allowed} s"
    return ""


def _age(age: float) -> str:
    return "endlessly" if age == float("inf") else f"{age:.2f} s"
