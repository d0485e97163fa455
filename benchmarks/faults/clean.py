"""`rolling-panda bench clean`: automatic work for an hour, simulated, without a fault: nothing may stop by itself.

Bridge and controller in one process on a plant with servo lag, cut after cut along a row without an end. For every
other minute the ways between them have up to 100 ms of jitter. The clock is simulated.
"""

from collections.abc import Sequence
from dataclasses import asdict, dataclass

import numpy as np

from benchmarks.common.documents import bench_parser, write
from benchmarks.faults.judge import Rows, replays, violations
from rolling_panda import commands as intents
from rolling_panda import messages as m
from tests.support.controller_config import controller_config
from tests.support.points import point
from tests.support.worlds.faulty_world import FaultyWorld

_USER = "ada"
_FIRST_M, _SPACING_M, _AHEAD = 0.6, 0.12, 4
_CALM_S = 60.0
#: Slower than this (rad/s) is rest.
_REST = 1e-9


@dataclass(frozen=True)
class CleanWork:
    """What automatic work without a fault gave.

    Attributes:
        seconds: Simulated.
        jitter_s: Of the ways, in every other minute.
        cuts: Orders to the blades, each with its own id.
        stops: Modes other than AUTO after the start, each with the time (s) at which it was entered.
        longest_rest_s: For which nothing but zero was sent.
        replayed: Rows with an older token or number than a row before.
        beyond: Rows outside velocity, acceleration, jerk or joint limits.
    """

    seconds: float
    jitter_s: float
    cuts: int
    stops: tuple[tuple[float, str], ...]
    longest_rest_s: float
    replayed: int
    beyond: int


class EndlessRow(FaultyWorld):
    """A world in which there is always one more point to cut, and somebody who accepts it."""

    def __init__(self, seed: int) -> None:
        """At work on the first points. There is no camera, so that nothing is looked at from near."""
        super().__init__(seed)
        self.config = controller_config(self.config, work__pre_cut_check=False, work__post_cut_check=False)
        self.controller = self.new_controller()
        self.cut_ids: set[str] = set()
        self._shown = 0
        self.people = (_USER,)
        self.run(0.3)
        self.command(intents.Arm(user=_USER))
        self.offer()
        self.command(intents.Start(user=_USER))
        self.run(0.02)

    def offer(self) -> None:
        """Show and accept as many points as are to be ahead."""
        wanted = len(self.cut_ids) + _AHEAD
        if wanted <= self._shown:
            return
        points = tuple(_point(number) for number in range(max(0, self._shown - _AHEAD), wanted))
        self._shown = wanted
        message = m.PruningPoints(header=m.Header(self.now, "odom"), segmenter="none", frames=1, points=points)
        self.say(message)
        self.run(0.02)
        self.command(intents.AcceptAll(user=_USER, confidence=0.0))

    def say(self, message: m.Message) -> None:
        """Send a message; note the cut that is ordered."""
        super().say(message)
        if isinstance(message, m.CutCommand):
            self.cut_ids.add(message.cut_id)


def _point(number: int) -> m.PruningPoint:
    place = (_FIRST_M + number * _SPACING_M, 0.75, 1.0)
    return point(f"p{number}", place, vine=number // 8, spur=number % 8)


def work(world: EndlessRow, seconds: float, jitter_s: float) -> CleanWork:
    """Let it work for so long and judge each second of the record, with what is needed of the one before."""
    stops: list[tuple[float, str]] = []
    replayed = beyond = 0
    rest = longest = 0.0
    begun, was = world.now, "AUTO"
    world.modes.clear()
    while world.now - begun < seconds - 1e-9:
        rough = int((world.now - begun) // _CALM_S) % 2 == 1
        world.motion.jitter = world.state.jitter = world.odometry.jitter = jitter_s if rough else 0.0
        world.offer()
        world.run(1.0)
        for mode in world.modes:
            if mode not in ("AUTO", was):
                stops.append((world.now - begun, mode))
            was = mode
        world.modes.clear()
        rows = world.robot.trace().rows
        # The last rows of the second before are judged again only for what they lead to.
        replayed, beyond = replayed + replays(rows), beyond + violations(rows)
        for step in _still(rows[2:] if len(rows) > 2 else rows):
            rest = rest + 0.001 if step else 0.0
            longest = max(longest, rest)
        del world.robot.rows[:-2]
    return CleanWork(seconds, jitter_s, len(world.cut_ids), tuple(stops), longest, replayed, beyond)


def _still(rows: Rows) -> list[bool]:
    still: list[bool] = (np.abs(rows["setpoint"]).max(axis=1) <= _REST).tolist()
    return still


def main(argv: Sequence[str]) -> int:
    """Work; returns 0 when nothing stopped and no limit was broken."""
    parser = bench_parser("clean", __doc__)
    parser.add_argument("--seed", type=int, default=0, help="of the jitter (default: 0)")
    parser.add_argument("--seconds", type=float, default=3600.0, help="simulated (default: 3600)")
    parser.add_argument("--jitter", type=float, default=0.1, help="of the ways in every other minute (s; default: 0.1)")
    arguments = parser.parse_args(argv)
    found = work(EndlessRow(arguments.seed), arguments.seconds, arguments.jitter)
    print(
        f"{found.seconds:.0f} s of automatic work, {found.cuts} cuts: {len(found.stops)} stops, nothing sent but zero "
        f"for {found.longest_rest_s:.2f} s at most, {found.replayed} rows replayed, {found.beyond} beyond limits"
    )
    for at, mode in found.stops:
        print(f"  {at:8.1f} s: {mode}")
    write(arguments.json, {"seed": arguments.seed, **asdict(found)})
    return 0 if not found.stops and not found.replayed and not found.beyond else 1
