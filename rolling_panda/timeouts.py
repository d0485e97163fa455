"""Related limits of all processes in one table, most of them times, and the relations that have to hold between them.

A limit is a key of the configuration or a constant of the program. Each process checks the relations at its start,
over all sections of its configuration, since a limit of one process may depend on that of another.
"""

import tomllib
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

from rolling_panda import topics
from rolling_panda.errors import ConfigError


@dataclass(frozen=True)
class Limit:
    """A time limit, or a period (s); or another limit with its unit.

    Attributes:
        name: Of a key of the configuration its path, `SECTION.KEY`; of a constant a name of its own.
        usual: Default of the key, or value of the constant; of a rate in Hz.
        source: Where a constant stands in the program: `FILE:NAME`; empty for a key of the configuration.
        rate: Whether the key is a rate (Hz); the limit is its period.
        unit: Of the limit.
    """

    name: str
    usual: float
    source: str = ""
    rate: bool = False
    unit: str = "s"

    @property
    def configurable(self) -> bool:
        """Whether it is a key of the configuration."""
        return not self.source

    @property
    def label(self) -> str:
        """The limit in a formula."""
        return f"1/{self.name}" if self.rate else self.name

    def seconds(self, value: float) -> float:
        """The limit (s, or its own unit) with this value of the key."""
        return 1.0 / value if self.rate else value


@dataclass(frozen=True)
class Relation:
    """`times` × `smaller` is at most `larger`, or less where `strict`.

    Attributes:
        smaller: Name of a limit.
        larger: Name of a limit.
        why: What breaks otherwise.
        times: Factor of `smaller`.
        strict: Whether both may not be equal.
    """

    smaller: str
    larger: str
    why: str
    times: int = 1
    strict: bool = False

    def holds(self, values: Mapping[str, float]) -> bool:
        """Whether it holds for these values of the limits, by name."""
        left, right = (LIMITS[name].seconds(values[name]) for name in (self.smaller, self.larger))
        # Periods are quotients: 3 / 60 Hz is 50 ms.
        return self.times * left < right - _EPSILON if self.strict else self.times * left <= right + _EPSILON

    def __str__(self) -> str:
        """The relation as a formula."""
        factor = f"{self.times} × " if self.times > 1 else ""
        return f"{factor}{LIMITS[self.smaller].label} {'<' if self.strict else '≤'} {LIMITS[self.larger].label}"


_EPSILON: Final = 1e-9


def _period(topic: topics.Topic[Any], constant: str) -> Limit:
    return Limit(f"period of {topic.name}", 1.0 / topic.rate_hz, f"rolling_panda/topics.py:{constant}")


_ALL: Final = (
    # The bridge's watchdog, and those of the drivers.
    Limit("bridge.fade_s", 0.07),
    Limit("bridge.deadline_s", 0.19),
    Limit("bridge.max_age_s", 0.2),
    Limit("bridge.joints_hz", 100.0, rate=True),
    Limit("bridge.camera_resting_hz", 0.5, rate=True),
    Limit("bridge.close_s", 0.3),
    Limit("real.base.fade_s", 0.07),
    Limit("real.base.deadline_s", 0.2),
    Limit("real.base.command_hz", 50.0, rate=True),
    Limit("real.arm.fade_s", 0.07),
    Limit("real.arm.deadline_s", 0.2),
    Limit("real.cutter.timeout_s", 2.0),
    Limit("silence that frees the token", 1.0, "bridge/core/validator.py:SILENT_S"),
    # The controller's age limits.
    Limit("controller.rate_hz", 100.0, rate=True),
    Limit("controller.supervision.joints_max_age_s", 0.2),
    Limit("controller.supervision.odometry_max_age_s", 0.25),
    Limit("controller.supervision.bridge_max_age_s", 0.5),
    Limit("controller.supervision.server_max_age_s", 2.0),
    Limit("controller.supervision.supervision_s", 2.0),
    Limit("controller.supervision.hold_link_max_age_s", 0.3),
    Limit("controller.supervision.perception_max_age_s", 1.0),
    Limit("controller.supervision.ledger_max_age_s", 0.6),
    Limit("controller.supervision.obstacles_max_age_s", 6.0),
    Limit("controller.supervision.picture_wait_s", 15.0),
    Limit("controller.teleoperation.hold_max_age_s", 0.15),
    # What the arm feels, and what stops it in its control box.
    Limit("controller.contact.light_force", 8.0, unit="N"),
    Limit("controller.contact.stop_force", 20.0, unit="N"),
    Limit("controller.contact.stop_torque", 10.0, unit="N·m"),
    Limit("controller.contact.cane_force", 28.0, unit="N"),
    Limit("controller.contact.cane_torque", 18.0, unit="N·m"),
    Limit("real.arm.contact_force", 30.0, unit="N"),
    Limit("real.arm.contact_torque", 20.0, unit="N·m"),
    Limit("controller.work.cut_timeout_s", 3.0),
    Limit("controller.work.close_up_timeout_s", 8.0),
    Limit("controller.work.servo_rate_hz", 10.0, rate=True),
    Limit("controller.work.servo_max_age_s", 0.3),
    Limit("lost close-up", 1.5, "controller/work/close_up.py:_LOST_S"),
    Limit("repetition of a close-up request", 0.05, "controller/work/close_up.py:_REPEAT_S"),
    Limit("planner: settling", 0.3, "controller/planning/plan_manager.py:_SETTLED_S"),
    Limit("planner: pause", 2.0, "controller/planning/plan_manager.py:_PAUSE_S"),
    Limit("planner: pause after a failure", 10.0, "controller/planning/plan_manager.py:_AGAIN_S"),
    Limit("planner: wait at the end of the work", 15.0, "controller/work/cutting.py:_PLAN_WAIT_S"),
    Limit("lease", 1.0, "controller/supervision/lease.py:LIFE_S"),
    Limit("reply of a command", topics.INTENT.timeout_s, "rolling_panda/topics.py:INTENT"),
    # The server, and its page.
    Limit("server.page_rate_hz", 10.0, rate=True),
    Limit("server.teleop_rate_hz", 30.0, rate=True),
    Limit("server.hold_timeout_s", 0.15),
    Limit("server.hold_resume_s", 1.0),
    Limit("server.view_timeout_s", 0.5),
    Limit("server.stop_confirm_s", 0.5),
    Limit("repetition of a stop", 0.025, "server/robots/link.py:_STOP_SPACING_S"),
    Limit("absence of a session", 1.0, "server/robots/presence.py:PRESENT_S"),
    Limit("renewal of a hold by the page", 0.05, "web/js/control/teleoperation.js:PERIOD_MS"),
    Limit("ping of the page", 0.1, "web/js/link/socket.js:PING_MS"),
    Limit("renewal of the lease by the page", 0.3, "web/js/control/lease-worker.js:EVERY_MS"),
    _period(topics.ODOMETRY, "ODOMETRY"),
    _period(topics.BRIDGE, "BRIDGE"),
    _period(topics.HEARTBEAT, "HEARTBEAT"),
    _period(topics.PRESENCE, "PRESENCE"),
    _period(topics.TOKEN, "TOKEN"),
)
#: All limits, by name.
LIMITS: Final[dict[str, Limit]] = {limit.name: limit for limit in _ALL}

RELATIONS: Final = (
    Relation(
        "bridge.fade_s",
        "bridge.deadline_s",
        "the base brakes before the deadline; without a fade it would be stopped at once",
        strict=True,
    ),
    Relation("real.base.fade_s", "real.base.deadline_s", "the base brakes before its driver's deadline", strict=True),
    Relation("real.arm.fade_s", "real.arm.deadline_s", "the arm brakes before its driver's deadline", strict=True),
    Relation("controller.rate_hz", "bridge.fade_s", "two motion commands may be lost in a row", times=3),
    Relation("real.base.command_hz", "real.base.deadline_s", "two commands to the base may be lost in a row", times=3),
    Relation(
        "bridge.deadline_s",
        "silence that frees the token",
        "the robot is at rest before another controller gets the token",
        strict=True,
    ),
    Relation(
        "period of command/token",
        "silence that frees the token",
        "two requests of the token's holder may be lost in a row",
        times=3,
    ),
    Relation(
        "bridge.deadline_s", "lease", "the robot is at rest before a controller that is gone loses control", strict=True
    ),
    Relation(
        "controller.supervision.joints_max_age_s",
        "bridge.max_age_s",
        "the controller stops with a cause before the bridge refuses its commands without one",
    ),
    Relation(
        "bridge.joints_hz",
        "controller.supervision.joints_max_age_s",
        "four joint states may be lost in a row",
        times=5,
    ),
    Relation(
        "period of state/odometry",
        "controller.supervision.odometry_max_age_s",
        "two odometry messages may be lost in a row",
        times=3,
    ),
    Relation(
        "period of state/bridge",
        "controller.supervision.bridge_max_age_s",
        "two states of the bridge may be lost in a row",
        times=3,
    ),
    Relation(
        "period of heartbeat",
        "controller.supervision.hold_link_max_age_s",
        "two heartbeats of the server may be lost in a row",
        times=3,
    ),
    Relation(
        "controller.supervision.hold_link_max_age_s",
        "controller.supervision.server_max_age_s",
        "motion by hand needs the server at least as much as automatic work",
    ),
    Relation(
        "period of heartbeat",
        "controller.supervision.perception_max_age_s",
        "two heartbeats of perception may be lost in a row",
        times=3,
    ),
    Relation("renewal of a hold by the page", "server.hold_timeout_s", "one renewal of a hold may be lost", times=2),
    Relation(
        "server.hold_timeout_s",
        "controller.teleoperation.hold_max_age_s",
        "the server ends a hold, and tells the page, before the controller ends it silently",
    ),
    Relation(
        "server.teleop_rate_hz",
        "controller.teleoperation.hold_max_age_s",
        "one target may be lost",
        times=2,
    ),
    Relation(
        "server.hold_timeout_s", "server.hold_resume_s", "a hold that has just lapsed can be resumed", strict=True
    ),
    Relation("server.page_rate_hz", "server.view_timeout_s", "a page that has rendered every state may hold", times=2),
    Relation(
        "server.view_timeout_s",
        "controller.supervision.supervision_s",
        "motion by hand needs a view at least as fresh as automatic work",
    ),
    Relation("ping of the page", "server.view_timeout_s", "one report of the page about its view may be lost", times=2),
    Relation("repetition of a stop", "server.stop_confirm_s", "a stop is confirmed after all its repetitions", times=5),
    Relation("renewal of the lease by the page", "lease", "two renewals of the lease may be lost in a row", times=3),
    Relation("period of operator/presence", "lease", "two reports of presence may be lost in a row", times=3),
    Relation("absence of a session", "lease", "a session that is absent keeps no lease"),
    Relation(
        "controller.supervision.ledger_max_age_s",
        "reply of a command",
        "a hung ledger is a fault before the caller of a command gives up",
        strict=True,
    ),
    Relation(
        "bridge.close_s",
        "controller.work.cut_timeout_s",
        "the simulated blades close and open before the cut is UNKNOWN",
        times=2,
        strict=True,
    ),
    Relation(
        "real.cutter.timeout_s",
        "controller.work.cut_timeout_s",
        "the cutter reports its own timeout before the cut is UNKNOWN",
        strict=True,
    ),
    Relation(
        "repetition of a close-up request", "lost close-up", "two requests of a close-up may be lost in a row", times=3
    ),
    Relation(
        "controller.work.servo_rate_hz",
        "controller.work.servo_max_age_s",
        "a picture on the way in counts while the next one is taken and looked at",
        times=2,
    ),
    Relation(
        "planner: settling", "planner: pause", "a plan is requested when decisions have settled, also during work"
    ),
    Relation(
        "planner: pause", "planner: pause after a failure", "a planner that fails is asked less often", strict=True
    ),
    Relation(
        "planner: pause",
        "planner: wait at the end of the work",
        "before the work ends a plan from the last cut can be requested, made, and made again",
        times=3,
    ),
    Relation(
        "lost close-up",
        "controller.work.close_up_timeout_s",
        "a lost close-up is requested again before its time limit",
        times=2,
    ),
    Relation(
        "controller.contact.light_force",
        "controller.contact.stop_force",
        "a push is told before it stops the robot",
        strict=True,
    ),
    Relation(
        "controller.contact.stop_force",
        "real.arm.contact_force",
        "the robot stops and goes back before the arm's control box stops it for good",
        strict=True,
    ),
    Relation(
        "controller.contact.stop_torque",
        "real.arm.contact_torque",
        "the robot stops and goes back before the arm's control box stops it for good",
        strict=True,
    ),
    Relation(
        "controller.contact.stop_force",
        "controller.contact.cane_force",
        "a known cane may push as hard as anything else before a person is asked for",
    ),
    Relation(
        "controller.contact.stop_torque",
        "controller.contact.cane_torque",
        "a known cane may push as hard as anything else before a person is asked for",
    ),
    Relation(
        "controller.contact.cane_force",
        "real.arm.contact_force",
        "the robot gives way to a cane before the arm's control box stops it for good",
        strict=True,
    ),
    Relation(
        "controller.contact.cane_torque",
        "real.arm.contact_torque",
        "the robot gives way to a cane before the arm's control box stops it for good",
        strict=True,
    ),
    Relation(
        "bridge.camera_resting_hz",
        "controller.supervision.obstacles_max_age_s",
        "one frame of the resting camera may be lost",
        times=2,
    ),
    Relation(
        "bridge.camera_resting_hz",
        "controller.supervision.picture_wait_s",
        "a robot that stands waits for more than one frame of the resting camera",
        times=2,
    ),
)


def usual_values() -> dict[str, float]:
    """Every limit at its usual value, by name."""
    return {limit.name: limit.usual for limit in _ALL}


def values_in(document: Mapping[str, Any]) -> dict[str, float]:
    """Every limit with a configuration, by name; a value that is no positive number counts as the usual one."""
    values = usual_values()
    for limit in filter(lambda limit: limit.configurable, _ALL):
        found: Any = document
        for key in limit.name.split("."):
            found = found.get(key) if isinstance(found, Mapping) else None
        if isinstance(found, int | float) and not isinstance(found, bool) and found > 0.0:
            values[limit.name] = float(found)
    return values


def broken(values: Mapping[str, float]) -> list[Relation]:
    """The relations that do not hold for these values, by name."""
    return [relation for relation in RELATIONS if not relation.holds(values)]


def check(path: Path) -> None:
    """Check the relations for a configuration file whose sections are valid.

    Raises:
        ConfigError: A relation does not hold; names both limits with their values, the reason and the remedy.
    """
    values = values_in(tomllib.loads(path.read_text(encoding="utf-8")))
    for relation in broken(values):
        smaller, larger = LIMITS[relation.smaller], LIMITS[relation.larger]
        remedies = [_lower(smaller)] if smaller.configurable else []
        remedies += [_raise(larger)] if larger.configurable else []
        raise ConfigError(
            f"{path}: {_told(smaller, values)} and {_told(larger, values)}, but {relation} has to hold: "
            f"{relation.why}. To do: {' or '.join(remedies)}."
        )


def _told(limit: Limit, values: Mapping[str, float]) -> str:
    return f"{limit.name} is {values[limit.name]:.4g}{' Hz' if limit.rate else f' {limit.unit}'}"


def _lower(limit: Limit) -> str:
    return f"{'raise' if limit.rate else 'lower'} {limit.name}"


def _raise(limit: Limit) -> str:
    return f"{'lower' if limit.rate else 'raise'} {limit.name}"
