"""`rolling-panda bench contact`: the arm is led against what it does not know of, and works with nothing in its way.

Trials: a part of the arm moves by hand, at a drawn speed in a drawn direction, against a post, wire, cordon, trunk or
cane. In half of them perception has seen the obstacle, but farther away; in the others not at all. Work: cut after cut
beside a row without wood, in a calm and a rough world, in which nothing may stop. Forces and times are the simulator's
truth.
"""

import argparse
import math
from collections.abc import Sequence
from dataclasses import asdict, dataclass

import numpy as np

from benchmarks.common.documents import bench_parser, write
from benchmarks.common.intervals import Figure, quantile, share
from benchmarks.control.stops import TOUCH_N
from bridge.sim.vineyard.row import Rod
from bridge.sim.world.config import PRESETS, only
from controller.config import ControllerConfig
from controller.motion.contact import Spots
from controller.whole_body.collision import CollisionModel
from controller.whole_body.obstacle import Obstacle
from rolling_panda.messages.types import WoodClass
from rolling_panda.model.differential_drive import Array
from rolling_panda.model.robot import ARM_Q, RobotModel
from rolling_panda.model.wire_values import vector3
from tests.support.worlds.contact_world import ContactWorld, Moment, capsule_of

#: Radius of each obstacle (m), and whether it stands upright.
KINDS: dict[WoodClass, tuple[float, bool]] = {
    "post": (0.04, True),
    "wire": (0.00125, False),
    "cordon": (0.02, False),
    "trunk": (0.03, True),
    "cane": (0.004, True),
}
#: Parts that are led against it, and speeds (m/s) of the spot that touches.
PARTS, SPEEDS = ("link4", "link5", "link6", "cutter"), (0.05, 0.1, 0.2, 0.4)
#: Distance that the spot moves before it touches (m), half the obstacle's length, and the cane below the spot (m).
_RUN_UP, _HALF, _CANE = 0.12, 0.35, (0.05, 0.4)
#: Error of perception where it has seen the obstacle (m): beyond what the collision guard keeps.
_FARTHER = 0.03
#: Fastest joint (rad/s), and least distance of all else at the start (m).
_FASTEST, _CLEAR = 1.2, 0.03
#: From the first touch the arm is led on for so long (s). After a stop the way back has so long, and then the end (s).
_AFTER_S, _BACK_S, _END_S = 2.6, 8.0, 0.5
#: The robot is at rest where no spot of base, arm and tool is faster (m/s): what pushes it makes it creep.
AT_REST = 0.01
#: Time until an obstacle must have been met (s), and draws of a posture.
_LIMIT_S, _DRAWS = 8.0, 400


@dataclass(frozen=True)
class Trial:
    """One approach.

    Attributes:
        kind: Of the obstacle.
        part: That was led against it.
        speed: Of the spot (m/s).
        seen: Whether perception told of the obstacle, too far away.
        touched: Whether there was a contact.
        detected: Whether the robot stopped for it.
        peak_n: Largest sum of contact forces until rest (N).
        to_stop_s: From the first touch to the protective stop (s); None without one.
        to_zero_s: From the protective stop to the first command to stand (s); None without one.
        to_rest_s: From the protective stop to rest, which lasts until the way back begins (s); None without rest.
        rests_at_end: Whether the robot is at rest after the way back; None without a stop.
        back: Whether the way back was gone to its end; None where none was told.
        left_n: Force that is left after the way back (N).
        reason: Code of the reason, and what it names.
        named: The named obstacle is the right one; None where it was not seen.
        part_right: The named part is on the joint that was touched, or next to it; None without a contact.
    """

    kind: str
    part: str
    speed: float
    seen: bool
    touched: bool = False
    detected: bool = False
    peak_n: float = 0.0
    to_stop_s: float | None = None
    to_zero_s: float | None = None
    to_rest_s: float | None = None
    rests_at_end: bool | None = None
    back: bool | None = None
    left_n: float = 0.0
    reason: str = ""
    named: bool | None = None
    part_right: bool | None = None


@dataclass(frozen=True)
class Scene:
    """A posture (7, rad), velocities of the joints (7, rad/s), and the obstacle in the way."""

    arm: Array
    joints: Array
    rod: Rod
    away: Array


class Scenes:
    """Draws scenes: nothing but the wanted spot comes near the obstacle first."""

    def __init__(self) -> None:
        """Build the robot's model."""
        self._model = RobotModel()
        self._spots, self._collision = Spots(self._model), CollisionModel(self._model)

    def draw(self, kind: WoodClass, part: str, speed: float, rng: np.random.Generator) -> Scene | None:
        """A scene; None where none is found."""
        home, limits = np.array(ControllerConfig().work.home), self._model.limits
        for _ in range(_DRAWS):
            q = np.zeros(12)
            q[ARM_Q] = home + rng.uniform(-0.5, 0.5, 7)
            spot = int(rng.choice([k for k, name in enumerate(self._spots.parts) if name == part]))
            joints = rng.normal(size=7)
            velocity = joints @ self._spots.at(q)[1][spot]
            joints *= speed / max(float(np.linalg.norm(velocity)), 1e-6)
            ends = q[ARM_Q] + joints * (_RUN_UP + 0.1) / speed
            inside = (np.minimum(q[ARM_Q], ends) > limits.lower[ARM_Q] + 0.1) & (
                np.maximum(q[ARM_Q], ends) < limits.upper[ARM_Q] - 0.1
            )
            if np.abs(joints).max() > _FASTEST or not inside.all():
                continue
            there = q.copy()
            there[ARM_Q] += joints * _RUN_UP / speed
            scene = self._scene(kind, spot, q, there, joints, rng)
            if scene is not None:
                return scene
        return None

    def _scene(
        self, kind: WoodClass, spot: int, q: Array, there: Array, joints: Array, rng: np.random.Generator
    ) -> Scene | None:
        places, velocities = self._spots.at(there)
        ahead = joints @ velocities[spot]
        ahead /= float(np.linalg.norm(ahead))
        radius, upright = KINDS[kind]
        # Nearly upright or level, and square to the way.
        wish = (np.array([0.0, 0.0, 1.0]) if upright else np.array([1.0, 0.0, 0.0])) + rng.normal(0.0, 0.15, 3)
        axis = wish - (wish @ ahead) * ahead
        if float(np.linalg.norm(axis)) < 0.5:
            return None
        axis /= float(np.linalg.norm(axis))
        middle = places[spot] + (self._spots.radii[spot] + radius) * ahead
        below = float(rng.uniform(*_CANE)) if kind == "cane" else _HALF
        start, end = middle - below * axis, middle + _HALF * axis
        obstacle = Obstacle("it 0", kind, vector3(start), vector3(end), radius)
        self._collision.set_obstacles((obstacle,))
        if self._collision.least(q).distance < _CLEAR:
            return None
        gaps = self._gaps(obstacle, places)
        if gaps.argmin() != spot and self._spots.parts[int(gaps.argmin())] != self._spots.parts[spot]:
            return None
        numbers = (0, 0, 0) if kind == "cane" else (-1, -1, -1)
        return Scene(q[ARM_Q], joints, Rod(kind, start, end, radius, radius, -1, *numbers), ahead)

    def _gaps(self, obstacle: Obstacle, places: Array) -> Array:
        start, along = np.array(obstacle.start), np.array(obstacle.end) - np.array(obstacle.start)
        at = np.clip((places - start) @ along / (along @ along), 0.0, 1.0)
        gaps: Array = np.linalg.norm(places - start - at[:, None] * along, axis=1) - self._spots.radii
        return gaps


def run_trial(scene: Scene, trial: Trial, seed: int) -> Trial:
    """Lead the arm against the obstacle and judge."""
    rod = scene.rod
    seen = (capsule_of(rod, _FARTHER * scene.away),) if trial.seen else ()
    loop = ContactWorld((rod,), seen, scene.arm.tolist(), only(("cane_modulus",), "field"), seed)
    loop.hold(joints=scene.joints)
    loop.run_until(lambda: bool(_hard(loop)) or loop.touch is not None, _LIMIT_S)
    if _hard(loop) and loop.run_until(lambda: loop.touch is not None, _AFTER_S):
        loop.run_until(lambda: _way_back(loop) is not None, _BACK_S)
        loop.run(_END_S)
    touches = _hard(loop)
    if not touches:
        return trial
    began = touches[0][0]
    stopped = next((at for at, mode in loop.modes if mode == "PROTECTIVE_STOP" and at >= began), None)
    standing = Standing() if stopped is None else standing_after(loop.stopped, stopped)
    # Forces on the way back are not counted here: `left_n` tells what is left after it.
    hardest = max((each for each in touches if each[0] <= standing.until), key=lambda each: each[1])
    told = loop.touch
    values = {} if told is None else dict(told.values)
    last = loop.stopped[-1] if loop.stopped else None
    return Trial(
        trial.kind,
        trial.part,
        trial.speed,
        trial.seen,
        touched=True,
        detected=told is not None and told.code.startswith("touched"),
        peak_n=hardest[1],
        to_stop_s=None if stopped is None else stopped - began,
        to_zero_s=standing.zero_s,
        to_rest_s=standing.rest_s,
        rests_at_end=None if last is None else not last.commanded and last.speed < AT_REST,
        back=_way_back(loop),
        left_n=max((force for at, force, _ in touches if at > loop.now - 0.2), default=0.0),
        reason="" if told is None else f"{told.code} {values.get('part', '')} {values.get('other', '')}".strip(),
        named=str(values.get("other", "")).startswith(trial.kind) if trial.seen and told is not None else None,
        part_right=None if told is None else abs(_joint(str(values.get("part", ""))) - _joint(hardest[2])) <= 1,
    )


@dataclass(frozen=True)
class Standing:
    """How the robot stood after a stop, before it went back.

    Attributes:
        zero_s: From the stop to the first command to stand (s); None without one.
        rest_s: From the stop to rest (s); None without rest.
        until: When the way back began (s); infinite without one.
    """

    zero_s: float | None = None
    rest_s: float | None = None
    until: float = math.inf


def standing_after(moments: Sequence[Moment], stop: float) -> Standing:
    """How the robot stood after a stop at `stop` (s).

    Rest that is broken again before the way back is none: an arm that swings has moments without speed. Without a way
    back rest lasts until the end.
    """
    after = [each for each in moments if each.at >= stop]
    zero = next((k for k, each in enumerate(after) if not each.commanded), None)
    if zero is None:
        return Standing()
    back = next((k for k, each in enumerate(after) if k > zero and each.commanded), len(after))
    rest = back
    while rest > zero and after[rest - 1].speed < AT_REST:
        rest -= 1
    return Standing(
        after[zero].at - stop,
        after[rest].at - stop if rest < back else None,
        after[back].at if back < len(after) else math.inf,
    )


def _way_back(loop: ContactWorld) -> bool | None:
    """Whether the way back was gone to its end; None before it has ended."""
    codes = {event.code for event in loop.events}
    return True if "backed_off" in codes else False if "not_backed_off" in codes else None


def _hard(loop: ContactWorld) -> list[tuple[float, float, str]]:
    return [each for each in loop.touches if each[1] > TOUCH_N]


def _joint(name: str) -> int:
    """Number of the joint that carries a part, or that a body of the simulator is named by."""
    digits = "".join(letter for letter in name if letter.isdigit())
    return int(digits) if digits else 7


@dataclass(frozen=True)
class Work:
    """Automatic work with nothing in the way.

    Attributes:
        preset: World.
        seed: Of the disturbances.
        seconds: Simulated.
        cuts: Orders to the blades.
        stops: Protective stops.
        force_n: Largest force at the tool that was felt in motion (N).
        force_p99: Its 99th percentile (N).
        torques: Largest torque of each joint of the arm that was taken for touch in motion (7, N·m).
    """

    preset: str
    seed: int
    seconds: float
    cuts: int
    stops: int
    force_n: float
    force_p99: float
    torques: tuple[float, ...]


def undisturbed(preset: str, seconds: float, seed: int) -> Work:
    """Work for so long, or until it stops."""
    loop = ContactWorld(world=PRESETS[preset], seed=seed)
    loop.work()
    begun, forces, torques = loop.now, [], np.zeros(7)
    while loop.now - begun < seconds and loop.controller.mode == "AUTO":
        for _ in range(100):
            loop.run(0.01)
            felt = loop.controller.contact
            forces.append(felt.force or 0.0)
            np.maximum(torques, np.abs(felt.torque), out=torques)
        loop.offer()
    return Work(
        preset,
        seed,
        loop.now - begun,
        len(loop.cut_ids),
        sum(mode == "PROTECTIVE_STOP" for _, mode in loop.modes),
        max(forces),
        float(np.quantile(forces, 0.99)),
        tuple(torques.tolist()),
    )


def summarise(trials: Sequence[Trial]) -> dict[str, Figure]:
    """Figures of trials with a contact."""
    met = [trial for trial in trials if trial.touched]
    found = [trial for trial in met if trial.detected]
    hard = [trial for trial in met if trial.peak_n >= ControllerConfig().contact.stop_force]
    named = [trial.named for trial in found if trial.named is not None]
    rests = [trial.to_rest_s for trial in found if trial.to_rest_s is not None]
    zeros = [trial.to_zero_s for trial in found if trial.to_zero_s is not None]
    return {
        "detected": share(len(found), len(met)),
        "detected_of_hard": share(sum(trial.detected for trial in hard), len(hard)),
        "peak_n_median": quantile([trial.peak_n for trial in met], 0.5),
        "peak_n_p95": quantile([trial.peak_n for trial in met], 0.95),
        "to_stop_s_median": quantile([t.to_stop_s for t in found if t.to_stop_s is not None], 0.5),
        "to_zero_s_median": quantile(zeros, 0.5),
        "to_zero_s_p95": quantile(zeros, 0.95),
        "to_rest_s_median": quantile(rests, 0.5),
        "to_rest_s_p95": quantile(rests, 0.95),
        "rests_before_way_back": share(len(rests), len(found)),
        "rests_at_end": share(sum(bool(trial.rests_at_end) for trial in found), len(found)),
        "way_back_gone": share(sum(bool(trial.back) for trial in found), len(found)),
        "free_after": share(sum(trial.left_n <= 1.0 for trial in found), len(found)),
        "named_right": share(sum(map(bool, named)), len(named)),
        "part_right": share(sum(bool(trial.part_right) for trial in found), len(found)),
    }


def _told(figure: Figure, scale: float = 1.0, unit: str = "") -> str:
    return "-" if figure.value is None else f"{scale * figure.value:.0f}{unit}"


def main(argv: Sequence[str]) -> int:
    """Run the benchmark; returns the exit code: 0 without a false stop."""
    parser = bench_parser("contact", __doc__)
    parser.add_argument("--kind", action="append", choices=tuple(KINDS), help="may be given several times; all")
    parser.add_argument("--preset", action="append", choices=tuple(PRESETS), help="worlds to work in; all")
    parser.add_argument("--count", type=int, default=40, help="trials of each kind (default: %(default)s)")
    parser.add_argument(
        "--every", type=int, default=1, metavar="N", help="only each N-th trial of a kind (default: all)"
    )
    parser.add_argument("--seconds", type=float, default=600.0, help="work in each world (default: %(default)s)")
    parser.add_argument("--seed", type=int, default=0, help="first seed (default: %(default)s)")
    words: argparse.Namespace = parser.parse_args(argv)
    scenes, trials, works = Scenes(), list[Trial](), list[Work]()

    def keep() -> None:
        groups: dict[str, list[Trial]] = {kind: [each for each in trials if each.kind == kind] for kind in KINDS}
        summary = {
            name: {key: asdict(figure) for key, figure in summarise(group).items()}
            for name, group in (groups | {"all": trials}).items()
            if group
        }
        document = {"work": [asdict(each) for each in works], "summary": summary}
        write(words.json, {**document, "trials": [asdict(each) for each in trials]})

    for preset in (words.preset or PRESETS) if words.seconds > 0.0 else ():
        found = undisturbed(preset, words.seconds, words.seed)
        works.append(found)
        print(
            f"{preset}: {found.seconds:.0f} s of work, {found.cuts} cuts, {found.stops} stops; felt at most "
            f"{found.force_n:.1f} N, {', '.join(f'{torque:.1f}' for torque in found.torques)} N·m",
            flush=True,
        )
        keep()
    kinds: tuple[WoodClass, ...] = tuple(words.kind or KINDS)
    # All kinds in turn: a run that is ended early has something of each.
    for number in range(0, words.count, max(1, words.every)):
        for kind in kinds:
            rng = np.random.default_rng([words.seed + number, list(KINDS).index(kind)])
            part, speed = PARTS[number % len(PARTS)], SPEEDS[(number // len(PARTS)) % len(SPEEDS)]
            scene = scenes.draw(kind, part, speed, rng)
            if scene is not None:
                seen = bool(rng.integers(2))
                trials.append(run_trial(scene, Trial(kind, part, speed, seen), words.seed + number))
                print(f"  {trials[-1]}", flush=True)
                keep()
    for kind in kinds:
        group = [trial for trial in trials if trial.kind == kind]
        figures = summarise(group)
        print(
            f"{kind}: {sum(trial.touched for trial in group)} contacts, "
            f"detected {_told(figures['detected'], 100, ' %')}, "
            f"peak {_told(figures['peak_n_median'])} N, p95 {_told(figures['peak_n_p95'])} N, "
            f"told to stand after {_told(figures['to_zero_s_median'], 1000)} ms, "
            f"p95 {_told(figures['to_zero_s_p95'], 1000)} ms, "
            f"at rest before the way back {_told(figures['rests_before_way_back'], 100, ' %')}, "
            f"after {_told(figures['to_rest_s_median'], 1000)} ms, "
            f"p95 {_told(figures['to_rest_s_p95'], 1000)} ms, named {_told(figures['named_right'], 100, ' %')}",
            flush=True,
        )
    return 1 if any(each.stops for each in works) else 0
