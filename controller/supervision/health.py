"""Freshness limits of the inputs and the reaction to stale data."""

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

from msgspec import Struct

from controller.config import SupervisionConfig
from rolling_panda import reasons, topics
from rolling_panda.messages.perception import Localisation, Obstacles
from rolling_panda.messages.robot import BridgeState, JointState, Odometry
from rolling_panda.messages.types import Mode, Reason
from rolling_panda.transport.inbox import Inbox, Received


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
        ledger: Reason why the ledger cannot record; None if it can.
        tracking_error: Tracking error above its limit; None without one.
        obstacles: Age of the camera frame behind the obstacles.
        lost: Why the place in the row is unknown.
        unfelt: Why contacts are no longer felt; None if they are, or never were.
        contact: What was touched beyond a limit, until the robot has gone back from it; None without one.
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
    ledger: Reason | None = None
    tracking_error: Reason | None = None
    obstacles: float = 0.0
    lost: Reason | None = None
    unfelt: Reason | None = None
    contact: Reason | None = None


def health(
    inbox: Inbox,
    overruled: bool,
    now: float,
    ledger: Reason | None = None,
    tracking_error: Reason | None = None,
    unfelt: Reason | None = None,
    contact: Reason | None = None,
) -> Health:
    """Compute the health of the inputs.

    Args:
        inbox: What has arrived.
        overruled: Whether another controller has the bridge's token.
        now: Monotonic time (s).
        ledger: Reason why the ledger cannot record.
        tracking_error: Tracking error above its limit.
        unfelt: Why contacts are no longer felt.
        contact: What was touched beyond a limit.
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
        lost=_lost(inbox.newest(Localisation)),
        unfelt=unfelt,
        contact=contact,
    )


def _refused(bridge: BridgeState) -> int:
    return sum(each.count for each in bridge.rejections if each.topic == topics.MOTION.name)


def _lost(localisation: Received[Localisation] | None) -> Reason | None:
    return None if localisation is None else localisation.message.reason


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
    """Reaction to the health, with its reason. `wait`: the robot stands, and goes on by itself."""

    action: Literal["wait", "pause", "protect", "fault"]
    reason: Reason


def check(mode: Mode, moving: bool, health: Health, config: SupervisionConfig) -> Verdict | None:
    """The most severe reaction that the inputs demand in a mode; None if all is well.

    Args:
        mode: Of the machine.
        moving: True where motion may be under way outside AUTO and TELEOP (bringing the arm home, going back after a
            contact).
        health: Health of the inputs.
        config: Age limits.
    """
    if health.overruled and mode != "IDLE":
        return Verdict("fault", reasons.other_controller())
    if health.ledger is not None:
        return Verdict("fault", health.ledger)
    if not moving and mode not in ("AUTO", "TELEOP"):
        return None
    why = sensors(health, config)
    if why is None and health.watchdog:
        why = reasons.watchdog_holds()
    if why is None and mode != "PROTECTIVE_STOP":
        why = health.contact
    if why is not None:
        return Verdict("protect", why)
    why = supervision(health, config, teleoperated=mode == "TELEOP")
    if why is None and mode == "AUTO":
        why = perception(health, config)
    if why is not None:
        return Verdict("pause", why)
    if mode == "AUTO" and health.obstacles > config.obstacles_max_age_s:
        return Verdict("wait", reasons.waits_for_picture(config.obstacles_max_age_s))
    return None


def cause(health: Health, config: SupervisionConfig) -> Reason | None:
    """Cause that still blocks the end of a PROTECTIVE_STOP or FAULT; None if it is gone."""
    held = reasons.watchdog_holds() if health.watchdog else None
    return health.ledger or sensors(health, config) or held or health.contact


def sensors(health: Health, config: SupervisionConfig) -> Reason | None:
    """Reason why the robot's own data forbid motion; None if they allow it."""
    if health.overruled:
        return reasons.other_controller()
    if health.tracking_error is not None:
        return health.tracking_error
    if health.unfelt is not None:
        return health.unfelt
    if health.joints > config.joints_max_age_s:
        return _stale(reasons.joints_stale, health.joints, config.joints_max_age_s, topics.JOINTS.name)
    if health.odometry > config.odometry_max_age_s:
        return _stale(reasons.odometry_stale, health.odometry, config.odometry_max_age_s, topics.ODOMETRY.name)
    if health.bridge > config.bridge_max_age_s:
        return _stale(reasons.bridge_stale, health.bridge, config.bridge_max_age_s, topics.BRIDGE.name)
    return None


def supervision(health: Health, config: SupervisionConfig, teleoperated: bool) -> Reason | None:
    """Reason why the server's state forbids motion; None if it allows it.

    Args:
        health: Health of the inputs.
        config: Age limits.
        teleoperated: Motion by hand needs a fresher connection than supervised work. In both cases a server
            that has ended, as opposed to a slow one, is detected at once by its absence.
    """
    allowed = config.hold_link_max_age_s if teleoperated else config.server_max_age_s
    return _process("server", health.server, allowed, health.present)


def perception(health: Health, config: SupervisionConfig) -> Reason | None:
    """Reason why perception's state forbids automatic work; None if it allows it, even if only to wait for a frame."""
    if health.obstacles > config.obstacles_max_age_s + config.picture_wait_s:
        return _stale(reasons.obstacles_stale, health.obstacles, config.obstacles_max_age_s, topics.OBSTACLES.name)
    why = _process("perception", health.perception, config.perception_max_age_s, health.present)
    return why or health.lost


def _stale(too_old: Callable[[float, float], Reason], age: float, limit: float, topic: str) -> Reason:
    return reasons.nothing_received(topic) if age == math.inf else too_old(age, limit)


def _process(name: str, age: float, limit: float, present: frozenset[str]) -> Reason | None:
    if name not in present:
        return reasons.process_gone(name)
    if age == math.inf:
        return reasons.process_unheard(name)
    return reasons.process_silent(name, age, limit) if age > limit else None
