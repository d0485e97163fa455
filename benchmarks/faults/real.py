"""`rolling-panda bench real`: random commands to the real bridge, whose devices are fakes with monitors.

The drivers are the makers' own: libfranka at 1 kHz against a control box that judges every command by the data sheet,
ROS 2 messages over Zenoh against a base that judges every `cmd_vel`. Every ten seconds a device fails or somebody
presses a stop; measured is when base and arm are at rest, and whether the page says why.
"""

import random
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from benchmarks.common.documents import bench_parser, one_row_a_line, write
from benchmarks.faults.real_site import RealSite
from bridge.real import mp500
from rolling_panda import messages as m
from rolling_panda import topics
from rolling_panda.config import TransportConfig
from rolling_panda.model.robot import RobotModel
from rolling_panda.model.wire_values import actuated
from rolling_panda.runtime.scheduling import set_priority
from rolling_panda.transport.zenoh import Transport

_REST: m.Actuated = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
# Between two faults (s), and how long one is watched.
_CALM_S, _WATCHED_S = 7.0, 1.5
# Work goes on at these shares of what wheels (0.3 m/s) and joints can do; the rest of the time anything is commanded.
_WORK = np.array([0.2] * 2 + [0.6] * 7)
#: From the fault until base and arm rest (s).
LIMIT_S = 0.4
# Words of the fakes' monitors for what was injected; everything else that they say is a breach.
_INJECTED = ("collision", "20 packets lost in a row")


@dataclass(frozen=True)
class Fault:
    """What goes wrong, the code that the page's log has for it, how it begins and ends, and the device's own words."""

    name: str
    code: str
    begin: Callable[[RealSite], None]
    end: Callable[[RealSite], None] = lambda site: None
    words: str = ""

    def named_by(self, reason: m.Reason) -> bool:
        """Whether a line of the log, or a cause in it, is about this."""
        causes = [value for _, value in reason.values if isinstance(value, m.Reason)]
        here = reason.code == self.code and self.words in str(reason.values)
        return here or any(map(self.named_by, causes))


@dataclass(frozen=True)
class Trial:
    """One fault: how long base (s) and arm (s of its control box) moved on; whether the page said why."""

    fault: str
    base_s: float
    arm_s: float
    told: bool


@dataclass
class Found:
    """What the monitors have seen."""

    commands: int = 0
    arm_commands: int = 0
    base_commands: int = 0
    breaches: list[str] = field(default_factory=list)
    worst_arm: tuple[float, float, float] = (0.0, 0.0, 0.0)
    worst_base: tuple[float, float] = (0.0, 0.0)
    trials: list[Trial] = field(default_factory=list)
    at_rest: int = 0


def _tells(line: str) -> Callable[[RealSite], None]:
    return lambda site: (site.tell(line), None)[1]


FAULTS = (
    Fault("no commands any more", "setpoints_missing", lambda site: None),
    Fault(
        "the arm's callback stalls",
        "arm_silent",
        lambda site: site.arm_process().suspend(),
        lambda site: site.arm_process().resume(),
    ),
    Fault(
        "25 packets in a row are lost",
        "device_fault",
        _tells("arm drop 25"),
        words="communication_constraints_violation",
    ),
    Fault("a reflex of the arm", "device_fault", _tells("arm collide"), words="reflex"),
    Fault("the arm's user stop", "arm_user_stopped", _tells("arm press"), _tells("arm free")),
    Fault("no wheel speeds from the base", "base_silent", _tells(f"base mute {mp500.WHEELS}"), _tells("base free")),
    Fault("the base's emergency stop", "base_stopped", _tells("base press"), _tells("base free")),
)


class Commander:
    """Stands where the controller would: answers every joint state with a command."""

    def __init__(self, endpoint: str, rng: random.Random) -> None:
        """Connect."""
        self.transport = Transport(TransportConfig(connect=(endpoint,), plain_wire=True), "controller", "rp1")
        self.state = self.transport.slot(topics.BRIDGE)
        self._joints, self._motion = self.transport.slot(topics.JOINTS), self.transport.publisher(topics.MOTION)
        self._tokens = self.transport.publisher(topics.TOKEN)
        self._rng, self._limits = rng, RobotModel().limits
        self._sequence, self._until = 0, 0.0
        self._xi = _REST
        self.silent = self.at_work = False

    def run(self, seconds: float, moving: bool) -> None:
        """Command for a while: at random, or to rest."""
        end = time.monotonic() + seconds
        while time.monotonic() < end:
            if (got := self._joints.take()) is not None and not self.silent:
                self._sequence += 1
                # After any silence, of a device too, the robot waits for a command at rest.
                xi = self._random(time.monotonic()) if moving and self.follows() else _REST
                echo = got.message.sequence
                self._tokens.put(m.TokenRequest(token="bench", echo=echo, mode="AUTO"))
                state = self.state.peek()
                epoch = 0 if state is None else state.message.epoch
                self._motion.put(m.MotionCommand(epoch=epoch, token="bench", sequence=self._sequence, echo=echo, xi=xi))
            time.sleep(0.002)

    @property
    def sent(self) -> int:
        """Commands so far."""
        return self._sequence

    def release(self) -> None:
        """A person lets the robot go on."""
        state = self.state.peek()
        if state is not None and state.message.stop_id:
            request = m.ReleaseStop(stop_id=state.message.stop_id, user="bench", reason="the next trial")
            self.transport.call(topics.RELEASE, request)

    def follows(self) -> bool:
        """Whether the robot takes commands, and no stop is latched."""
        state = self.state.peek()
        return state is not None and not state.message.watchdog and not state.message.stop_id

    def _random(self, now: float) -> m.Actuated:
        if now >= self._until:
            share = self._rng.choice([0.1, 0.5, 1.0])
            most = self._limits.velocity * (_WORK if self.at_work else share)
            self._xi = actuated(np.array([self._rng.uniform(-v, v) for v in most.tolist()]))
            self._until = now + self._rng.choice([0.01, 0.05, 0.2, 0.5])
        return self._xi


def _moves(site: RealSite, commander: Commander) -> bool:
    commander.run(0.1, moving=True)
    report = site.tell()
    return all(report[device]["still_s"] < 0.0 for device in ("arm", "base"))


def _go_on(commander: Commander) -> None:
    """A person has looked, and lets the robot go on."""
    commander.silent = commander.at_work = False
    end = time.monotonic() + 10.0
    while not commander.follows() and time.monotonic() < end:
        commander.run(0.5, moving=False)
        commander.release()


def trial(site: RealSite, commander: Commander, fault: Fault) -> Trial | None:
    """Inject one fault into the motion, watch what comes of it, and end it; None where nothing moved before."""
    before = len(site.told_on_the_page())
    commander.at_work = True
    commander.run(1.5, moving=True)
    end = time.monotonic() + 20.0
    while not _moves(site, commander):
        if time.monotonic() > end:
            _go_on(commander)
            return None
    at, ticks = time.monotonic(), site.tell()["arm"]["ticks"]
    fault.begin(site)
    commander.silent = fault is FAULTS[0]
    commander.run(_WATCHED_S, moving=True)
    after, now = site.tell(), time.monotonic()
    told = any(map(fault.named_by, site.told_on_the_page()[before:]))
    base = now - after["base"]["still_s"] - at if after["base"]["still_s"] >= 0.0 else float("inf")
    arm = 1e-3 * (after["arm"]["moved_tick"] - ticks)
    still = after["arm"]["still_s"] >= 0.0
    fault.end(site)
    _go_on(commander)
    return Trial(fault.name, max(0.0, base), max(0.0, arm) if still else float("inf"), told)


def measure(site: RealSite, seconds: float, seed: int) -> Found:
    """Random motion for so long, with a fault now and then."""
    rng, found = random.Random(seed), Found()
    commander = Commander(site.endpoint, rng)
    end, number = time.monotonic() + seconds, 0
    try:
        site.wait(lambda: commander.state.peek() is not None, 60.0, "the bridge")
        commander.run(1.0, moving=False)
        while time.monotonic() < end:
            commander.run(min(_CALM_S, max(0.5, end - time.monotonic())), moving=True)
            # Some lost packets are part of every day.
            site.tell(f"arm drop {rng.randrange(1, 19)}")
            commander.run(0.3, moving=True)
            judged = trial(site, commander, FAULTS[number % len(FAULTS)])
            if judged is None:
                found.at_rest += 1
            else:
                found.trials.append(judged)
            number += 1
    finally:
        commander.transport.close()
    report = site.tell()
    arm, base = report["arm"], report["base"]
    found.commands, found.arm_commands, found.base_commands = commander.sent, arm["commands"], base["commands"]
    found.breaches = [why for why in arm["breaches"] if why not in _INJECTED] + base["breaches"]
    found.worst_arm, found.worst_base = tuple(arm["worst"]), tuple(base["worst"])
    return found


def summary(found: Found, seconds: float) -> dict[str, Any]:
    """Figures for people and for the file."""
    rows = []
    for fault in FAULTS:
        of = [one for one in found.trials if one.fault == fault.name]
        if of:
            base, arm = max(one.base_s for one in of), max(one.arm_s for one in of)
            rows.append(
                {
                    "fault": fault.name,
                    "n": len(of),
                    "base_s": base,
                    "arm_s": arm,
                    "within": max(base, arm) <= LIMIT_S,
                    "told": sum(one.told for one in of),
                }
            )
    return {
        "seconds": seconds,
        "commands": found.commands,
        "arm_commands": found.arm_commands,
        "base_commands": found.base_commands,
        "breaches": len(found.breaches),
        "trials_without_motion": found.at_rest,
        "worst_arm": dict(zip(("velocity", "acceleration", "jerk"), found.worst_arm, strict=True)),
        "worst_base": dict(zip(("velocity", "acceleration"), found.worst_base, strict=True)),
        "faults": rows,
    }


def main(argv: Sequence[str]) -> int:
    """Run the benchmark; returns the exit code: 1 for a breach, a late stop or a reason that was not told."""
    parser = bench_parser("real", __doc__)
    parser.add_argument("--minutes", type=float, default=10.0, help="how long (default: 10)")
    parser.add_argument("--seed", type=int, default=0, help="of the commands (default: 0)")
    parser.add_argument("--address", default="127.0.0.42", help="of the fake arm (default: %(default)s)")
    arguments = parser.parse_args(argv)
    seconds = 60.0 * arguments.minutes
    with RealSite(arguments.address) as site:
        # As the controller, for which this stands.
        set_priority("control")
        found = measure(site, seconds, arguments.seed)
    figures = summary(found, seconds)
    print(one_row_a_line(figures))
    for line in found.breaches[:10]:
        print(f"breach: {line}")
    write(arguments.json, {"seed": arguments.seed, **figures})
    good = all(row["within"] and row["told"] == row["n"] for row in figures["faults"])
    return 0 if good and not found.breaches else 1
