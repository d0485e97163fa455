"""`rolling-panda bench localise`: out along the row and back; where is a place that was seen on the way out?

A place beside the row is known on the way out, when the robot passes it. On the way back its place before the base is
predicted, from odometry alone and from the wood that perception has recognised. The truth is the simulator's. What the
camera's calibration does to a point is the same both times and not part of it.
"""

import argparse
import time
from collections.abc import Sequence
from dataclasses import asdict, dataclass

import numpy as np
import pinocchio as pin

from benchmarks.common.documents import bench_parser, write
from benchmarks.common.intervals import Figure, quantile, share
from benchmarks.perception.row_drive import row_drive
from bridge.sim.vineyard.row import Array
from bridge.sim.world.config import PRESETS
from perception.config import PerceptionConfig
from perception.pipeline import Perception
from perception.segmentation.segmenter import SEGMENTERS, choose_segmenter
from rolling_panda.model.base_attitude import T_odom_base

#: Places that are predicted, beside the base (m): what the arm would cut.
_PLACES = np.array([[0.3, 0.75, 0.95], [0.5, 0.75, 0.90], [0.7, 0.75, 1.00]])
#: 95 % bounds of the squared Mahalanobis distance with three components.
_LOW, _HIGH = 0.216, 9.348


@dataclass(frozen=True)
class Fix:
    """A frame: where the base truly was, by odometry, by the estimate, and by the transform in use (pin.SE3)."""

    true: pin.SE3
    odometry: pin.SE3
    estimate: pin.SE3
    used: pin.SE3
    covariance: Array
    state: str
    outbound: bool


@dataclass(frozen=True)
class Prediction:
    """On the way back: errors of the places (m), and the squared Mahalanobis distance of x, y and the heading."""

    seed: int
    x: float
    odometry: float
    used: float
    nees: float


def drive(
    seed: int, metres: float, preset: str, speed: float, pictures: float, segmenter: str, inertial: bool
) -> tuple[list[Fix], list[float]]:
    """Drive out and back; returns a fix for each frame, and the processor time of each (s)."""
    perception = Perception(PerceptionConfig(localise=True), choose_segmenter(segmenter))
    fixes, times = [], []
    for each in row_drive(seed, metres, PRESETS[preset], speed, pictures, inertial):
        begin = time.process_time()
        perception.process(each.frame)
        times.append(time.process_time() - begin)
        estimate, base = perception.row_frame.estimate, each.frame.base
        odometry = T_odom_base(base, each.frame.attitude)
        fixes.append(
            Fix(
                each.T_world_base,
                odometry,
                estimate.T_map_odom * odometry,
                perception.row_frame.T_map_odom * odometry,
                estimate.covariance,
                estimate.state,
                each.outbound,
            )
        )
    return fixes, times


def predictions(seed: int, fixes: Sequence[Fix]) -> list[Prediction]:
    """What was predicted on the way back, of places known when the robot passed on the way out."""
    out, found = [fix for fix in fixes if fix.outbound], []
    for fix in (each for each in fixes if not each.outbound):
        known = min(out, key=lambda each: float(np.linalg.norm(each.true.translation - fix.true.translation)))
        there = [fix.true.actInv(known.true.act(place)) for place in _PLACES]
        errors = []
        for name in ("odometry", "used"):
            now, then = getattr(fix, name), getattr(known, name)
            off = [now.actInv(then.act(place)) - true for place, true in zip(_PLACES, there, strict=True)]
            errors.append(float(np.linalg.norm(off, axis=1).mean()))
        off = (fix.estimate.inverse() * known.estimate) * (known.true.inverse() * fix.true)
        away = np.array([off.translation[0], off.translation[1], pin.log3(off.rotation)[2]])
        P = (fix.covariance + known.covariance)[np.ix_([0, 1, 5], [0, 1, 5])]
        nees = float(away @ np.linalg.solve(P, away))
        found.append(Prediction(seed, float(fix.true.translation[0]), errors[0], errors[1], nees))
    return found


def summarise(found: Sequence[Prediction]) -> dict[str, Figure]:
    """The figures of all predictions."""
    used, odometry = [each.used for each in found], [each.odometry for each in found]
    nees = [each.nees for each in found]
    return {
        "used_m_median": quantile(used, 0.5),
        "used_m_p95": quantile(used, 0.95),
        "odometry_m_median": quantile(odometry, 0.5),
        "odometry_m_p95": quantile(odometry, 0.95),
        "nees_mean": Figure(float(np.mean(nees)) if nees else None, None, None, len(nees)),
        "nees_within_95": share(sum(_LOW <= each <= _HIGH for each in nees), len(nees)),
        "nees_above_95": share(sum(each > _HIGH for each in nees), len(nees)),
    }


def main(argv: Sequence[str]) -> int:
    """Run the benchmark; returns the exit code."""
    parser = bench_parser("localise", __doc__)
    parser.add_argument("--preset", default="field", choices=tuple(PRESETS), help="world (default: %(default)s)")
    parser.add_argument("--seed", type=int, default=2400, help="first seed (default: %(default)s)")
    parser.add_argument("--count", type=int, default=1, help="rows (default: %(default)s)")
    parser.add_argument("--metres", type=float, default=10.0, help="how far out (default: %(default)s)")
    parser.add_argument("--speed", type=_positive, default=0.15, help="of the base, m/s (default: %(default)s)")
    parser.add_argument("--pictures", type=_positive, default=1.0, help="pictures a second (default: %(default)s)")
    parser.add_argument("--inertial", action="store_true", help="with the camera's inertial sensors")
    parser.add_argument("--segmenter", default="network", choices=SEGMENTERS, help="(default: %(default)s)")
    words = parser.parse_args(argv)
    found: list[Prediction] = []
    times: list[float] = []
    lost = frames = 0
    for seed in range(words.seed, words.seed + words.count):
        fixes, took = drive(
            seed, words.metres, words.preset, words.speed, words.pictures, words.segmenter, words.inertial
        )
        found += (new := predictions(seed, fixes))
        times += took
        lost, frames = lost + sum(fix.state == "lost" for fix in fixes), frames + len(fixes)
        print(f"seed {seed}: {len(fixes)} frames, {_told(summarise(new))}", flush=True)
        document = {
            "preset": words.preset,
            "metres": words.metres,
            "speed": words.speed,
            "pictures_hz": words.pictures,
            "segmenter": words.segmenter,
            "inertial": words.inertial,
            "frames": frames,
            "frames_lost": lost,
            "frame_s_median": float(np.median(times)),
            "summary": {name: asdict(figure) for name, figure in summarise(found).items()},
            "results": [asdict(each) for each in found],
        }
        write(words.json, document)
    print(f"{_told(summarise(found))}; lost in {lost} of {frames} frames; a frame {1e3 * np.median(times):.0f} ms")
    return 0


def _told(figures: dict[str, Figure]) -> str:
    def mm(name: str) -> str:
        value = figures[name].value
        return "-" if value is None else f"{1e3 * value:.1f}"

    nees = figures["nees_mean"]
    return (
        f"median {mm('used_m_median')} mm, p95 {mm('used_m_p95')} mm (odometry {mm('odometry_m_median')}, "
        f"{mm('odometry_m_p95')}), NEES of 3 {'-' if nees.value is None else f'{nees.value:.1f}'}, n {nees.n}"
    )


def _positive(text: str) -> float:
    value = float(text)
    if not value > 0.0:
        raise argparse.ArgumentTypeError(f"{text!r} is not positive")
    return value
