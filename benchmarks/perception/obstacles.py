"""`rolling-panda bench obstacles`: ten minutes before a row, and what perception takes for posts, trunks and wires.

The simulated camera and perception's obstacles run one after the other on a simulated clock, without processes:
standing, surveying up and down the row, and at work. Every frame counts that perception would have had, half a picture
a second at rest and two in motion; but of these only some are rendered and segmented, and are taken for the others:
standing in turn, on a survey and at work whenever the camera comes to the same place again. At work it goes along
places that were recorded in a closed loop (`--record`), again and again.
"""

import time
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

import msgspec
import numpy as np
from numpy.typing import NDArray

from benchmarks.common.documents import bench_parser, write
from benchmarks.common.intervals import quantile
from benchmarks.perception.obstacle_judge import KINDS, ObstacleJudge, Verdict
from benchmarks.perception.obstacle_track import Place, Track, record
from bridge.sim.camera.config import CameraConfig
from bridge.sim.camera.frame import camera_frame, camera_pose, survey_place
from bridge.sim.camera.renderer import Camera
from bridge.sim.vineyard.config import VineyardConfig
from bridge.sim.vineyard.grow import grow
from bridge.sim.vineyard.row import Array
from perception.config import PerceptionConfig
from perception.obstacles.obstacle_map import ObstacleMap
from perception.segmentation.frame import View, decode_frame
from perception.segmentation.segmenter import SEGMENTERS, Segmenter, choose_segmenter
from rolling_panda import messages as m
from rolling_panda.model.robot import RobotModel

CONDITIONS = ("standing", "survey", "work")
#: Two that were seen to go wrong, and eight that nobody had looked at.
SEEDS = (0, 11, 211, 212, 213, 214, 215, 216, 217, 218)
#: Pictures a second, at rest and in motion, and the survey's speed (m/s), as the demo has them.
_RESTING_HZ, _MOVING_HZ, _SPEED = 0.5, 2.0, 0.15
#: A survey's base goes from here to there (m); the camera stands half a metre ahead of it.
_FROM, _TO = -0.9, 4.5
#: Where the robot stands by turns (m): where the demo starts, and where the row's first post is in view.
_PLACES = (0.0, -0.5)
#: What is told is judged so many times in the run.
_JUDGED = 20
_TRACK = Path(__file__).parents[1] / "results" / "obstacle_work.json"


@dataclass(frozen=True)
class Outcome:
    """What came of one row in one condition."""

    condition: str
    seed: int
    frames: int
    pictures: int
    verdict: Verdict
    frame_ms: float
    left_out: dict[str, int]


def places_of(condition: str, number: int, seconds: float) -> list[Place]:
    """Where the camera takes each picture in so many seconds of a condition.

    Args:
        condition: One of `CONDITIONS`.
        number: Of the row in this run.
        seconds: Simulated.
    """
    _, position = survey_place()
    if condition == "standing":
        return [Place(m.PlanarPose(_PLACES[number % len(_PLACES)]), position)] * round(seconds * _RESTING_HZ)
    frames = round(seconds * _MOVING_HZ)
    if condition == "survey":
        # Pictures on the way back are taken at other places than on the way there.
        way = (np.arange(frames) + 0.25) * _SPEED / _MOVING_HZ % (2 * (_TO - _FROM))
        along = (_FROM + np.where(way < _TO - _FROM, way, 2 * (_TO - _FROM) - way)).round(6)
        return [Place(m.PlanarPose(float(x)), position) for x in along]
    track = msgspec.json.decode(_TRACK.read_bytes(), type=Track)
    # Between two recorded places the robot has been at either as long.
    often = frames / _MOVING_HZ / track.seconds * len(track.places)
    return [track.places[int(k * often / frames) % len(track.places)] for k in range(frames)]


def pictured(places: Sequence[Place], most: int) -> Iterator[tuple[int, Place]]:
    """Which picture, of `most` at most, each frame shows, and where that was taken.

    Standing, pictures of the same place are shown in turn, since their noise is all that differs.
    """
    distinct = list(dict.fromkeys(places))
    if len(distinct) == 1:
        yield from ((k % most, place) for k, place in enumerate(places))
        return
    # Going over the same ground again shows the same pictures again.
    step = max(1.0, len(distinct) / most)
    number = {place: int(k / step) for k, place in enumerate(distinct)}
    shown = {number[place]: place for place in reversed(distinct)}
    yield from ((number[place], shown[number[place]]) for place in places)


def run(
    condition: str, number: int, seed: int, seconds: float, pictures: int, segmenter: Segmenter, model: RobotModel
) -> Outcome:
    """One row in one condition.

    Args:
        condition: One of `CONDITIONS`.
        number: Of the row in this run.
        seed: Of row and camera.
        seconds: Simulated.
        pictures: Rendered at most.
        segmenter: Tells the classes.
        model: For the camera's place.
    """
    row, camera, config = grow(VineyardConfig(), seed), Camera(CameraConfig(), seed), PerceptionConfig()
    known, judge = ObstacleMap(config.obstacles), ObstacleJudge(row, config.obstacles)
    places = places_of(condition, number, seconds)
    taken: dict[int, tuple[View, NDArray[np.uint8]]] = {}
    spent, left_out = 0.0, dict[str, int]()
    shown = list(pictured(places, pictures))
    last = {picture: k for k, (picture, _) in enumerate(shown)}
    for k, (picture, place) in enumerate(shown):
        if picture not in taken:
            true = _camera(place, model)
            image = camera.render(row, true, picture)
            view = decode_frame(camera_frame(image, camera, place.base, place.position, picture), model)
            taken[picture] = view, segmenter.segment(view)
            judge.see(image, camera.intrinsics, true)
        view, labels = taken[picture]
        if last[picture] == k:
            del taken[picture]
        if -view.R[2, 1] < config.min_upright:
            continue
        began = time.perf_counter()
        capsules = known.update(view, labels)
        spent += time.perf_counter() - began
        if (k + 1) % max(1, len(shown) // _JUDGED) == 0 or k + 1 == len(shown):
            judge.judge(capsules, final=k + 1 == len(shown))
            for (kind, reason), count in known.rejected.items():
                name = f"{kind} {reason}"
                left_out[name] = max(left_out.get(name, 0), count)
    return Outcome(condition, seed, len(shown), len(last), judge.verdict(), 1000 * spent / max(1, len(shown)), left_out)


def _camera(place: Place, model: RobotModel) -> Array:
    if place.camera:
        return np.array(place.camera).reshape(4, 4)
    return camera_pose(model, place.base, place.position)


def summarise(outcomes: Sequence[Outcome]) -> dict[str, float | int | None]:
    """The worst over the rows of one condition, and shares over all."""
    verdicts = [outcome.verdict for outcome in outcomes]
    told = [each for verdict in verdicts for each in verdict.told]
    uprights = [each for each in told if each.kind in ("post", "trunk")]
    seen = {kind: sum(verdict.seen.get(kind, 0.0) for verdict in verdicts) for kind in KINDS}
    missing = {kind: sum(verdict.missing.get(kind, 0.0) for verdict in verdicts) for kind in KINDS}
    return {
        "rows": len(outcomes),
        "uprights_told": len(uprights),
        "greatest_angle_deg": max((each.angle_deg for each in uprights), default=None),
        "greatest_thickness_ratio": max((each.thickness for each in uprights), default=None),
        "obstacles_told": len(told),
        "greatest_p95_m": max((each.p95 for each in told), default=None),
        "median_p95_m": quantile([each.p95 for each in told], 0.5).value,
        "beyond_30_mm": sum(each.p95 > 0.03 for each in told),
        "greatest_p95_any_kind_m": max((each.any_p95 for each in told), default=None),
        **{f"missing_{kind}": missing[kind] / seen[kind] if seen[kind] else None for kind in KINDS},
        "frame_ms": float(np.mean([outcome.frame_ms for outcome in outcomes])),
    }


def main(argv: Sequence[str]) -> int:
    """Run the benchmark; returns the exit code."""
    parser = bench_parser("obstacles", __doc__)
    parser.add_argument("--seeds", type=int, nargs="+", default=list(SEEDS), help="rows (default: %(default)s)")
    parser.add_argument(
        "--condition", action="append", choices=CONDITIONS, help="may be given several times (default: all of them)"
    )
    parser.add_argument("--minutes", type=float, default=10.0, help="simulated, of each (default: %(default)s)")
    parser.add_argument(
        "--pictures",
        type=int,
        default=100,
        help="rendered at most for a row in a condition, half as many standing (default: %(default)s)",
    )
    parser.add_argument("--segmenter", choices=SEGMENTERS, default="network", help="what tells classes")
    parser.add_argument("--record", type=int, metavar="SEED", help="record places of work in this row, and end")
    words = parser.parse_args(argv)
    if words.minutes <= 0.0 or words.pictures < 2 or any(seed < 0 for seed in words.seeds):
        parser.error("give more than 0 minutes, at least 2 pictures, and seeds of 0 or more")
    if words.record is not None:
        print(record(words.record, _TRACK))
        return 0
    segmenter = choose_segmenter(words.segmenter)
    model, outcomes, begin = RobotModel(), [], time.monotonic()
    conditions = words.condition or CONDITIONS
    for number, seed in enumerate(words.seeds):
        for condition in conditions:
            pictures = words.pictures // 2 if condition == "standing" else words.pictures
            outcome = run(condition, number, seed, 60.0 * words.minutes, pictures, segmenter, model)
            outcomes.append(outcome)
            print(_line(outcome, time.monotonic() - begin), flush=True)
        # After each row, so that a run which is broken off has told what it had.
        document = {
            "minutes": words.minutes,
            "pictures": words.pictures,
            "segmenter": words.segmenter,
            "summary": _summary(outcomes, conditions),
            "results": [asdict(outcome) for outcome in outcomes],
        }
        write(words.json, document)
    summary = _summary(outcomes, conditions)
    print()
    print(f"{'':<26}" + "".join(f"{name:>12}" for name in conditions))
    for name in next(iter(summary.values())):
        print(f"{name:<26}" + "".join(f"{_short(summary[each][name]):>12}" for each in conditions))
    return 0


def _summary(outcomes: Sequence[Outcome], conditions: Sequence[str]) -> dict[str, dict[str, float | int | None]]:
    return {name: summarise([each for each in outcomes if each.condition == name]) for name in conditions}


def _short(value: float | int | None) -> str:
    return "–" if value is None else str(value) if isinstance(value, int) else f"{value:.4f}"


def _line(outcome: Outcome, seconds: float) -> str:
    figures = summarise([outcome])
    angle, thick, p95 = (
        _short(figures[name]) for name in ("greatest_angle_deg", "greatest_thickness_ratio", "greatest_p95_m")
    )
    return (
        f"{seconds:6.0f} s  seed {outcome.seed}, {outcome.condition}: {outcome.frames} frames of {outcome.pictures} "
        f"pictures; angle {angle}°, thickness ×{thick}, p95 {p95} m, left out {outcome.left_out}"
    )
