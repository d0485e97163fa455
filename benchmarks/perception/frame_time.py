"""`rolling-panda bench frame-time`: pictures that are later than their times tell, and what that does to points.

The robot surveys a row from rest to rest, 2 pictures a second; then the arm looks at it from all around while the base
stands, as for a check of the camera. Perception estimates the offset of time after each. The survey's pictures are then
looked at anew with the postures that a bridge with that `frame_time_offset` gives them: the distance of the points from
the true wood is told without and with it.
"""

import argparse
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
from msgspec.structs import replace

from benchmarks.common.documents import bench_parser, write
from benchmarks.common.intervals import quantile
from benchmarks.perception.judge import nearest_rod
from benchmarks.perception.row_drive import RowRobot
from bridge.sim.vineyard.row import Array, Row
from bridge.sim.world.config import PRESETS, WorldConfig
from controller.config import ControllerConfig
from controller.work.camera_views import ROW, view_postures
from perception.config import PerceptionConfig
from perception.pipeline import Perception
from perception.segmentation.segmenter import SEGMENTERS, choose_segmenter
from rolling_panda.messages.perception import CameraState
from rolling_panda.model.robot import RobotModel

#: Pictures a second, and the base's acceleration (m/s²) on a survey; rest at its ends (s).
_PICTURES_HZ, _ACCELERATION, _RESTS_S = 2.0, 0.4, 1.5
#: A way from one view to the next, and the rest there (s).
_MOVE_S, _LOOK_S = 1.5, 1.0
#: The points of a survey are compared with wood nearer than this (m): farther ones are on no cane.
_ON_WOOD = 0.05


@dataclass(frozen=True)
class Told:
    """What perception has told of the offset.

    Attributes:
        offset: The estimate (s); None before enough was seen.
        sd: Its standard deviation (s).
        warns: Whether the page was warned of it.
    """

    offset: float | None
    sd: float | None
    warns: bool


@dataclass(frozen=True)
class Ride:
    """A survey and a check of the camera.

    Attributes:
        seed: Of row, camera and disturbances.
        true: Mean offset (s).
        survey: Told after the survey.
        check: Told after the check too.
        points: Distances of the survey's points from the axis of the true wood (m).
        corrected: The same by a bridge that knows the last estimate; empty without one.
    """

    seed: int
    true: float
    survey: Told
    check: Told
    points: list[float]
    corrected: list[float]


def ride(seed: int, world: WorldConfig, metres: float, segmenter: str, views: Sequence[Array]) -> Ride:
    """One row; the world has the true offset, `views` are the arm's postures of the check."""
    perception, robot = _new(segmenter), RowRobot(seed, metres, world, _PICTURES_HZ)
    work = ControllerConfig().work
    frames = [each.frame for each in robot.drive(metres, work.survey_speed, _ACCELERATION, _RESTS_S)]
    for frame in frames:
        perception.process(frame)
    points, survey = _off_wood(robot.row, perception), _told(perception.camera.state)
    for posture in views:
        for each in robot.reach(posture, _MOVE_S, _LOOK_S):
            perception.process(each.frame)
    check, corrected = _told(perception.camera.state), list[float]()
    if check.offset is not None:
        perception = _new(segmenter)
        for frame in frames:
            perception.process(robot.later(frame, round(check.offset, 3)))
        corrected = _off_wood(robot.row, perception)
    robot.close()
    return Ride(seed, world.frame_delay, survey, check, points, corrected)


def _new(segmenter: str) -> Perception:
    return Perception(PerceptionConfig(), choose_segmenter(segmenter))


def _off_wood(row: Row, perception: Perception) -> list[float]:
    """Distance of each point from the axis of the nearest spur or cane (m), as far as it is on one."""
    off = [nearest_rod(row, np.array(point.position))[0] for point in perception.points().points]
    return [each for each in off if each < _ON_WOOD]


def _told(state: CameraState) -> Told:
    code = "" if state.warning is None else state.warning.code
    return Told(state.time_offset, state.time_offset_sd, code in ("frames_late", "frames_early"))


def summarise(rides: Sequence[Ride]) -> dict[str, Any]:
    """The figures of all rides with one true offset."""
    out: dict[str, Any] = {"true_s": rides[0].true, "rows": len(rides)}
    for stage in ("survey", "check"):
        told = [getattr(each, stage) for each in rides]
        known = [each for each in told if each.offset is not None]
        errors = [each.offset - rides[0].true for each in known]
        out[stage] = {
            "told": len(known),
            "error_s_mean": float(np.mean(errors)) if errors else None,
            "error_s_rms": float(np.sqrt(np.mean(np.square(errors)))) if errors else None,
            "sd_s_median": float(np.median([each.sd for each in known])) if known else None,
            "within_2_sd": sum(abs(error) <= 2 * each.sd for error, each in zip(errors, known, strict=True)),
            "warned": sum(each.warns for each in told),
        }
    for name in ("points", "corrected"):
        off = [value for each in rides for value in getattr(each, name)]
        out[name] = {"median_m": asdict(quantile(off, 0.5)), "p95_m": asdict(quantile(off, 0.95))}
    return out


def main(argv: Sequence[str]) -> int:
    """Run the benchmark; returns the exit code."""
    parser = bench_parser("frame-time", __doc__)
    parser.add_argument("--preset", default="calm", choices=tuple(PRESETS), help="world (default: %(default)s)")
    parser.add_argument("--offset", type=_offset, nargs="*", help="true offsets, ms; the jitter is a third of each")
    parser.add_argument("--seed", type=int, default=4100, help="first seed (default: %(default)s)")
    parser.add_argument("--count", type=int, default=4, help="rows for each offset (default: %(default)s)")
    parser.add_argument("--metres", type=float, default=3.0, help="length of a survey (default: %(default)s)")
    parser.add_argument("--segmenter", default="network", choices=SEGMENTERS, help="(default: %(default)s)")
    words = parser.parse_args(argv)
    world, document = PRESETS[words.preset], dict[str, Any]()
    views = view_postures(RobotModel(), np.array(ControllerConfig().work.home), ROW)
    for true in words.offset or [world.frame_delay]:
        late = replace(world, frame_delay=true, frame_jitter=true / 3)
        rides = []
        for seed in range(words.seed, words.seed + words.count):
            rides.append(ride(seed, late, words.metres, words.segmenter, views))
            print(_line(rides[-1]), flush=True)
        document[f"{1e3 * true:.0f} ms"] = summarise(rides)
        document.setdefault("results", []).extend(asdict(each) for each in rides)
        about = {"preset": words.preset, "seed": words.seed, "count": words.count, "metres": words.metres}
        write(words.json, {**about, "segmenter": words.segmenter, **document})
    return 0


def _line(each: Ride) -> str:
    def ms(told: Told) -> str:
        if told.offset is None or told.sd is None:
            return "-"
        return f"{1e3 * told.offset:.1f} ± {1e3 * told.sd:.1f}{' warned' if told.warns else ''}"

    def mm(off: list[float]) -> str:
        return f"{1e3 * np.median(off):.1f} mm ({len(off)})" if off else "-"

    return (
        f"seed {each.seed}, true {1e3 * each.true:.0f} ms: survey {ms(each.survey)}, check {ms(each.check)}; "
        f"points {mm(each.points)}, corrected {mm(each.corrected)}"
    )


def _offset(text: str) -> float:
    value = 1e-3 * float(text)
    if not 0.0 <= value <= 0.2:
        raise argparse.ArgumentTypeError(f"{text!r} is not from 0 to 200 ms")
    return value
