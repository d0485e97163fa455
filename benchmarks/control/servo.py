"""`rolling-panda bench servo`: pictures on the last way to a cut, and where the blades close with and without them.

`--pictures`: rendered pictures of right cuts from the way in, with all errors of the camera: how far the tracker is
off, and its time. `--cuts`: the controller with a robot that has no mass, before a cane that sways and a camera that
errs as in a rough world. Its pictures are as exact as the rendered ones. The same cuts are made with and without
the pictures on the way.
"""

import time
from collections import Counter
from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from typing import Any

import numpy as np
import pinocchio as pin

from benchmarks.common.documents import bench_parser, write
from benchmarks.common.intervals import quantile
from bridge.sim.camera.config import CameraConfig
from bridge.sim.camera.frame import camera_frame, survey_place
from bridge.sim.camera.renderer import Camera
from bridge.sim.vineyard.config import VineyardConfig
from bridge.sim.vineyard.grow import grow
from bridge.sim.vineyard.row import Array
from bridge.sim.vineyard.truth import judge
from bridge.sim.world.config import CALM, PRESETS, WorldConfig
from bridge.sim.world.wind import bend
from controller.config import ControllerConfig
from controller.core import Controller
from controller.work.posture_search import cut_poses
from perception.config import PerceptionConfig
from perception.segmentation.frame import decode_frame
from perception.segmentation.segmenter import SEGMENTERS, choose_segmenter
from perception.tracking.cut_sight import CutFollower
from rolling_panda import commands as intents
from rolling_panda import messages as m
from rolling_panda.config import RobotConfig
from rolling_panda.messages.perception import ON_THE_WAY, CloseUpRequest, CloseUpResult, CutSight
from rolling_panda.model.robot import RobotModel, configuration
from rolling_panda.model.wire_values import vector3
from tests.support.controller_config import controller_config
from tests.support.points import point
from tests.support.worlds.kinematic_robot import KinematicRobot

_LEFT = np.array([0.0, 1.0, 0.0])
#: The tool's distances from the cut in the rendered pictures (m).
WAY = (0.22, 0.16, 0.10, 0.07, 0.05, 0.03)
#: In a rendered picture the cane was last seen so far aside (m), so long ago (s).
_ASIDE, _AGO_S = 0.003, 0.1


@dataclass(frozen=True)
class Picture:
    """One rendered picture: the tool's distance (m), what it told, its error across the cane (m) and its time (ms)."""

    away: float
    told: str
    off: float | None
    ms: float


def pictures(seeds: Sequence[int], segmenter: str) -> list[Picture]:
    """Look at every second right cut of rows from the way in."""
    model, config, sees = RobotModel(), PerceptionConfig(), choose_segmenter(segmenter)
    base, posture = survey_place()
    q = configuration(base, posture)
    T_tool_camera = model.pose(q, model.tool_id).inverse() * model.pose(q, model.camera_id)
    found = []
    for seed in seeds:
        row, camera = grow(VineyardConfig(vines=1), seed), Camera(CameraConfig(), seed)
        for number, cut in enumerate([truth.cut for truth in judge(row) if truth.cut is not None][::2]):
            side = np.cross(cut.tangent, _LEFT)
            expected = cut.best + _ASIDE * side / np.linalg.norm(side)
            for away in WAY:
                pose = (cut_poses(cut.best, cut.tangent, _LEFT, 0.15, away).clear * T_tool_camera).homogeneous
                frame = camera_frame(camera.render(row, pose, number), camera, base, posture, number)
                follower = CutFollower(config)
                check = CloseUpResult(
                    header=m.Header(-_AGO_S, "odom"),
                    point_id="p",
                    number=1,
                    finding="seen",
                    position=vector3(expected),
                    tangent=vector3(cut.tangent),
                )
                follower.begin(check, "spur cut")
                begin = time.perf_counter()
                view = replace(decode_frame(frame, model), R=pose[:3, :3], t=pose[:3, 3], stamp=0.0)
                sight = follower.look(view, sees, "p", 2)
                ms = 1e3 * (time.perf_counter() - begin)
                off = None
                if sight.position is not None:
                    apart = np.array(sight.position) - cut.best
                    off = float(np.linalg.norm(apart - cut.tangent * (apart @ cut.tangent)))
                found.append(Picture(away, "" if sight.reason is None else sight.reason.code, off, ms))
    return found


#: Worlds in which cuts are made: only wind, and what else moves a cane in a picture.
_CAMERA = ("hand_eye_angle", "hand_eye_shift", "frame_delay", "frame_jitter", "sway")
WORLDS: dict[str, WorldConfig] = {
    "calm": CALM,
    "wind 5 mm": WorldConfig(sway=0.005),
    "wind 10 mm": WorldConfig(sway=0.010),
    "wind 20 mm": WorldConfig(sway=0.020),
    "field": WorldConfig(**{name: getattr(PRESETS["field"], name) for name in _CAMERA}),
    "storm": WorldConfig(**{name: getattr(PRESETS["storm"], name) for name in _CAMERA}),
}
#: SD of a cane's place in a rendered picture (m), across the view and in depth, and what the calm camera is turned by.
_NOISE, _TURNED = (0.0004, 0.0004, 0.0002), 0.001
#: A close-up and a picture on the way are answered after this (s), and the blades have closed after this (s).
_CLOSE_UP_S, _SIGHT_S, _CLOSING_S = 0.08, 0.06, 0.3
#: Longest work for a cut (s).
_LIMIT_S = 30.0


class Scene:
    """A cane that sways, and a camera that errs, drawn from a seed."""

    def __init__(self, seed: int, world: WorldConfig) -> None:
        """Draw them: the same cane and the same directions of all errors in every world."""
        rng = np.random.default_rng([seed, 0x5E47])
        angle = float(np.hypot(world.hand_eye_angle, _TURNED))
        self.turn = pin.exp3(angle * rng.standard_normal(3))
        self.shift = world.hand_eye_shift * rng.standard_normal(3)
        azimuth, self._frequency, self._phase = rng.uniform([0.0, 0.5, 0.0], [2 * np.pi, 2.0, 2 * np.pi])
        amplitude = world.sway * bend(float(rng.uniform(0.15, 0.25)))
        self._swing = amplitude * np.array([np.cos(azimuth), np.sin(azimuth), 0.0])
        lean, turn = rng.uniform(0.0, 0.35), rng.uniform(0.0, 2 * np.pi)
        self.tangent = np.array([np.sin(lean) * np.cos(turn), np.sin(lean) * np.sin(turn), np.cos(lean)])
        self.rest = rng.uniform([0.3, 0.71, 0.98], [0.7, 0.79, 1.12])
        self._world, self.rng = world, rng

    def cane(self, at: float) -> Array:
        """Where the cut is at a time (3, m)."""
        out: Array = self.rest + self._swing * np.sin(2 * np.pi * self._frequency * at + self._phase)
        return out

    def late(self) -> float:
        """From a posture to its exposure (s)."""
        delay, jitter = self._world.frame_delay, self._world.frame_jitter
        return max(0.0, float(self.rng.normal(delay, jitter))) if delay > 0.0 else 0.0


class SeeingRobot(KinematicRobot):
    """A robot without mass whose camera looks at a scene."""

    scene: Scene
    sights = 0

    def __post_init__(self) -> None:
        """Nothing is exposed yet."""
        super().__post_init__()
        self._exposures: list[tuple[float, Any, float, CloseUpRequest]] = []
        self._answers: list[tuple[float, m.Message]] = []

    def close_up(self, request: CloseUpRequest) -> None:
        """Begin an exposure."""
        asked = self.now + self.scene.late(), self.model.pose(self.q, self.model.camera_id), self.now, request
        if asked[0] - self.now < self.dt / 2:
            self._expose(*asked)
        else:
            self._exposures.append(asked)

    def step(self) -> list[object]:
        """One period, in which pictures are exposed and answered."""
        due = [each for each in self._exposures if each[0] <= self.now]
        self._exposures = [each for each in self._exposures if each[0] > self.now]
        for each in due:
            self._expose(*each)
        for at, answer in self._answers:
            if at <= self.now:
                self.hear(answer)
        self._answers = [each for each in self._answers if each[0] > self.now]
        return super().step()

    def _expose(self, _: float, told: Any, stamp: float, request: CloseUpRequest) -> None:
        """The cane by a picture that is told with the camera's pose `told` (pin.SE3)."""
        scene, pose = self.scene, self.model.pose(self.q, self.model.camera_id)
        R, t = pose.rotation @ scene.turn, pose.act(scene.shift)
        seen = R.T @ (scene.cane(self.now) - t) + scene.rng.normal(0.0, _NOISE)
        place, header = vector3(told.act(seen)), m.Header(stamp, "odom")
        answer: m.Message
        if request.point_id.startswith(ON_THE_WAY):
            limits, across = PerceptionConfig().sight, 0.5 * float(seen[2]) / 447.0
            clear = limits.min_distance <= seen[2] <= limits.max_distance
            covariance = told.rotation @ np.diag([across**2, across**2, 0.0015**2]) @ told.rotation.T
            a, b, c, d, e, f = covariance[np.triu_indices(3)].tolist()
            answer = CutSight(
                header=header,
                point_id="p",
                number=request.number,
                position=place if clear else None,
                covariance=(a, b, c, d, e, f) if clear else None,
            )
            self.sights += clear
            self._answers.append((self.now + _SIGHT_S, answer))
        else:
            severed = bool(self.cuts)
            answer = CloseUpResult(
                header=header,
                point_id=request.point_id,
                number=request.number,
                finding="severed" if severed else "seen",
                position=None if severed else place,
                tangent=None if severed else vector3(scene.tangent),
                distance=max(0.0, float(seen[2])),
            )
            self._answers.append((self.now + _CLOSE_UP_S, answer))


@dataclass(frozen=True)
class Closing:
    """Where a cane was as the blades closed.

    Attributes:
        aside: From the middle of the blades, between them: along the tool's x (m).
        deep: The same along its z, that of the approach (m).
        time_s: Since the start (s).
        sights: Pictures on the way that told.
    """

    aside: float
    deep: float
    time_s: float
    sights: int

    @property
    def off(self) -> float:
        """Distance from the middle of the blades (m)."""
        return float(np.hypot(self.aside, self.deep))


def close_blades(seed: int, world: WorldConfig, servo: bool) -> Closing | None:
    """Make one cut; None where it was not made."""
    config = controller_config(ControllerConfig(), work__servo=servo)
    robot = SeeingRobot(Controller(config, RobotConfig()), config.work.home, dt=1.0 / config.rate_hz)
    robot.scene = scene = Scene(seed, world)
    robot.step()
    robot.show((point("p", vector3(scene.rest), vector3(scene.tangent)),))
    robot.step()
    for intent in (intents.Arm(user="bench"), intents.AcceptAll(user="bench"), intents.Start(user="bench")):
        robot.ask(intent)
    while not robot.cuts:
        robot.step()
        if robot.now > _LIMIT_S:
            return None
    T = robot.cuts[0][1]
    at, along = T[:3, :3].T @ (scene.cane(robot.now + _CLOSING_S) - T[:3, 3]), T[:3, :3].T @ scene.tangent
    crossing = at - along * at[1] / along[1]
    return Closing(float(crossing[0]), float(crossing[2]), robot.now, robot.sights)


def tell_cuts(name: str, pairs: Sequence[tuple[Closing, Closing]]) -> dict[str, Any]:
    """Print cuts without and with the pictures; returns their figures."""
    out: dict[str, Any] = {}
    for servo, title in ((False, "without"), (True, "with")):
        cuts = [pair[servo] for pair in pairs]
        off, aside = [cut.off for cut in cuts], [abs(cut.aside) for cut in cuts]
        median, p95, between = quantile(off, 0.5), quantile(off, 0.95), quantile(aside, 0.95)
        out[title] = {"off_m_median": asdict(median), "off_m_p95": asdict(p95), "aside_m_p95": asdict(between)}
        texts = [
            f"{1e3 * f.value:4.1f} ({1e3 * f.low:.1f}-{1e3 * f.high:.1f})"
            for f in (median, p95, between)
            if f.value is not None and f.low is not None and f.high is not None
        ]
        told = np.mean([cut.sights for cut in cuts])
        figures = f"median {texts[0]}, p95 {texts[1]}; aside p95 {texts[2]}"
        print(f"{name:<11} {title:<8} off mm, {figures}; {told:.1f} pictures")
    changes = [with_it.off - without.off for without, with_it in pairs]
    longer = float(np.mean([with_it.time_s - without.time_s for without, with_it in pairs]))
    better, change = sum(change < 0.0 for change in changes), quantile(changes, 0.5)
    out |= {"nearer": better, "n": len(pairs), "change_m_median": asdict(change), "longer_s": longer}
    print(f"{'':<11} nearer in {better} of {len(pairs)}, {longer:+.2f} s a cut", flush=True)
    return out


def main(argv: Sequence[str]) -> int:
    """Run the benchmark; returns the exit code."""
    parser = bench_parser("servo", __doc__)
    parser.add_argument("--seed", type=int, default=3300, help="first seed (default: %(default)s)")
    parser.add_argument("--count", type=int, default=20, help="rows of pictures, or cuts in each world (default: 20)")
    parser.add_argument("--pictures", action="store_true", help="rendered pictures alone")
    parser.add_argument("--cuts", action="store_true", help="cuts alone")
    parser.add_argument("--world", action="append", choices=tuple(WORLDS), help="may be given several times; all")
    parser.add_argument("--segmenter", default="network", choices=SEGMENTERS, help="of the pictures")
    words = parser.parse_args(argv)
    seeds, document = range(words.seed, words.seed + words.count), dict[str, Any]()
    if not words.cuts:
        found = pictures(seeds, words.segmenter)
        for away in WAY:
            own = [each for each in found if each.away == away]
            off = [1e3 * each.off for each in own if each.off is not None]
            why = ", ".join(f"{count} {code}" for code, count in Counter(each.told for each in own).items() if code)
            middle, high = quantile(off, 0.5).value, quantile(off, 0.95).value
            error = "" if middle is None or high is None else f", off {middle:.2f} mm, p95 {high:.2f}"
            print(f"{1e3 * away:4.0f} mm before the cut: {len(off)} of {len(own)} seen{error}; {why or 'all seen'}")
        ms = [each.ms for each in found]
        print(f"a picture takes {np.median(ms):.1f} ms, p95 {np.quantile(ms, 0.95):.1f} ms (n {len(ms)})", flush=True)
        document["pictures"] = [asdict(each) for each in found]
    if not words.pictures:
        for name, world in WORLDS.items():
            if words.world and name not in words.world:
                continue
            both = [(close_blades(seed, world, False), close_blades(seed, world, True)) for seed in seeds]
            pairs = [(a, b) for a, b in both if a is not None and b is not None]
            if pairs:
                document[name] = tell_cuts(name, pairs) | {"not_made": len(both) - len(pairs)}
    write(words.json, {"first_seed": words.seed, "count": words.count, **document})
    return 0
