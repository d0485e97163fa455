"""Freshness limits of the inputs and the reaction to stale data."""

import math
from dataclasses import dataclass
from typing import Literal

from msgspec import Struct

from controller.config import SupervisionConfig
from rolling_panda import topics
from rolling_panda.messages.perception import Obstacles
from rolling_panda.messages.robot import BridgeState, JointState, Odometry
from rolling_panda.messages.types import Mode
from rolling_panda.transport.inbox import Inbox, Received

Action = Literal["none", "pause", "protect", "fault"]


class Health(Struct, frozen=True):
    """Ages of the inputs (s, on this process's clock), infinite before the first; and other conditions.

    Attributes:
        joints: Age of the newest joint state.
        odometry: Age of the newest odometry.
        bridge: Age of the newest bridge state.
        server: Age of the server's newest heartbeat.
        perception: Age of perception's newest heartbeat.
        present: Processes connected now.
        watchdog: Whether the bridge's watchdog holds the robot.
        overruled: Whether another controller has the bridge's token.
        refused: Number of motion commands that the bridge has refused since its start.
        ledger: Reason why the ledger cannot record; empty if it can.
        tracking_error: Description of a tracking error above its limit; empty without one.
        obstacles: Age of the camera frame behind the obstacles.
    """

    joints: float
    odometry: float
    bridge: float
    server: float
    perception: float
    present: frozenset[str]
    watchdog: bool
    overruled: bool
    refused: int = 0
    ledger: str = ""
    tracking_error: str = ""
    obstacles: float = 0.0


def health(inbox: Inbox, overruled: bool, now: float, ledger: str = "", tracking_error: str = "") -> Health:
    """Compute the health of the inputs.

    Args:
        inbox: What has arrived.
        overruled: Whether another controller has the bridge's token.
        now: Monotonic time (s).
        ledger: Reason why the ledger cannot record.
        tracking_error: Description of a tracking error above its limit.
    """

    def age(at: float | None) -> float:
        return math.inf if at is None else now - at

    joints, odometry, bridge = inbox.newest(JointState), inbox.newest(Odometry), inbox.newest(BridgeState)
    return Health(
        joints=age(joints.at if joints is not None else None),
        odometry=age(odometry.at if odometry is not None else None),
        bridge=age(bridge.at if bridge is not None else None),
        server=age(inbox.heard("server")),
        perception=age(inbox.heard("perception")),
        present=inbox.present,
        watchdog=bridge is not None and bridge.message.watchdog,
        overruled=overruled,
        refused=0 if bridge is None else _refused(bridge.message),
        ledger=ledger,
        tracking_error=tracking_error,
        obstacles=_picture_age(inbox.newest(Obstacles), joints, now),
    )


def _refused(bridge: BridgeState) -> int:
    return sum(each.count for each in bridge.rejections if each.topic == topics.MOTION.name)


def _picture_age(obstacles: Received[Obstacles] | None, joints: Received[JointState] | None, now: float) -> float:
    """Age of the obstacles: the larger of the time since their arrival and their frame's stamp relative to the joints'.

    Both stamps are of the bridge's clock. Perception repeats its newest message, so the arrival alone is not enough.
    A stamp from the future counts like an old one.
    """
    if obstacles is None or joints is None:
        return math.inf
    return max(now - obstacles.at, abs(joints.message.header.stamp - obstacles.message.header.stamp))


@dataclass(frozen=True)
class Verdict:
    """Reaction to the health, with its reason. `none` with an empty reason if all is well."""

    action: Action
    reason: str = ""


FINE = Verdict("none")
OVERRULED = "another controller commands this robot"


def check(mode: Mode, moving: bool, health: Health, config: SupervisionConfig) -> Verdict:
    """The most severe thing that the inputs demand in a mode.

    Args:
        mode: Of the machine.
        moving: True where motion may be under way outside AUTO and TELEOP (bringing the arm home).
        health: Health of the inputs.
        config: Age limits.
    """
    if health.overruled and mode != "IDLE":
        return Verdict("fault", OVERRULED)
    if health.ledger:
        return Verdict("fault", health.ledger)
    if not moving and mode not in ("AUTO", "TELEOP"):
        return FINE
    why = sensors(health, config)
    if why:
        return Verdict("protect", why)
    if health.watchdog:
        return Verdict("protect", "the bridge's watchdog holds the robot: no valid command reached it in time")
    why = supervision(health, config, teleoperated=mode == "TELEOP")
    if not why and mode == "AUTO":
        why = perception(health, config)
    return Verdict("pause", why) if why else FINE


def cause(health: Health, config: SupervisionConfig) -> str:
    """Cause that still blocks the end of a PROTECTIVE_STOP or FAULT; empty if it is gone."""
    return health.ledger or sensors(health, config) or ("watchdog" if health.watchdog else "")


def sensors(health: Health, config: SupervisionConfig) -> str:
    """Reason why the robot's own data forbid motion; empty if they allow it."""
    if health.overruled:
        return OVERRULED
    if health.tracking_error:
        return health.tracking_error
    if health.joints > config.joints_max_age_s:
        return f"joint states are {_age(health.joints)} old; the limit is {config.joints_max_age_s} s"
    if health.odometry > config.odometry_max_age_s:
        return f"odometry is {_age(health.odometry)} old; the limit is {config.odometry_max_age_s} s"
    if health.bridge > config.bridge_max_age_s:
        return f"the bridge's state is {_age(health.bridge)} old; the limit is {config.bridge_max_age_s} s"
    return ""


def supervision(health: Health, config: SupervisionConfig, teleoperated: bool) -> str:
    """Reason why the server's state forbids motion; empty if it allows it.

    Args:
        health: Health of the inputs.
        config: Age limits.
        teleoperated: Motion by hand needs a fresher connection than supervised work. In both cases a server
            that has ended, as opposed to a slow one, is detected at once by its absence.
    """
    allowed = config.hold_link_max_age_s if teleoperated else config.server_max_age_s
    return _process("server", health.server, allowed, health.present)


def perception(health: Health, config: SupervisionConfig) -> str:
    """Reason why perception's state forbids automatic work; empty if it allows it."""
    if health.obstacles > config.obstacles_max_age_s:
        return (
            f"the newest camera frame with the obstacles is {_age(health.obstacles)} old; "
            f"the limit is {config.obstacles_max_age_s} s"
        )
    return _process("perception", health.perception, config.perception_max_age_s, health.present)


def _process(name: str, age: float, allowed: float, present: frozenset[str]) -> str:
    if name not in present:
        return f"the {name} process is gone"
    if age > allowed:
        return f"the {name} process is silent for {_age(age)}; the limit is {allowed} s"
    return ""


def _age(age: float) -> str:
    return "endlessly" if age == float("inf") else f"{age:.2f} s"
