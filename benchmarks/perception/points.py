"""How good the pruning points are: seeded rows, rendered views, and the judge's right cuts.

Run `python -m benchmarks.perception.points --seeds 0:10 --json FILE`.
"""

import argparse
import json
import statistics
import time
from collections.abc import Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path

import numpy as np

from bridge.sim.camera.config import CameraConfig
from bridge.sim.camera.frame import camera_frame, camera_pose, survey_place
from bridge.sim.camera.renderer import Camera
from bridge.sim.vineyard.config import VineyardConfig
from bridge.sim.vineyard.grow import grow
from bridge.sim.vineyard.row import Array, Row
from bridge.sim.vineyard.truth import SpurTruth, judge
from perception.config import PerceptionConfig
from perception.pipeline import Perception
from perception.segmentation.segmenter import LabelImageSegmenter
from rolling_panda import messages as m
from rolling_panda.model.robot import RobotModel

#: A spur is in view when its stub and its cut are this far inside the image (px).
_MARGIN = 12.0


@dataclass
class Score:
    """What came out for some views; all lengths in metres.

    Attributes:
        views: How many.
        spurs_in_view: Spurs whose stub and right cut are inside the image.
        points: Cuts on keepers that were proposed.
        right_cane: Of those, on the cane that the judge keeps.
        right_place: Of those, on the right cane, within 10 mm of its axis, 10–30 mm past node 2.
        renewals: Cuts through stubs that were proposed.
        right_renewals: Of those, between the keeper and the next cane.
        along: Signed distance beyond the best place, of points on the right cane.
        off_axis: Distance from the true axis, of points on the right cane.
        frame_ms: Processor time of each frame.
    """

    views: int = 0
    spurs_in_view: int = 0
    points: int = 0
    right_cane: int = 0
    right_place: int = 0
    renewals: int = 0
    right_renewals: int = 0
    along: list[float] = field(default_factory=list)
    off_axis: list[float] = field(default_factory=list)
    frame_ms: list[float] = field(default_factory=list)
    undecided_sites: list[str] = field(default_factory=list)

    def add(self, other: "Score") -> None:
        """Take another score in."""
        for name, value in vars(other).items():
            setattr(self, name, getattr(self, name) + value)

    def summary(self) -> dict[str, float]:
        """The figures, with lengths in millimetres."""
        along, off = np.abs(self.along or [0.0]), np.array(self.off_axis or [0.0])
        return {
            "views": self.views,
            "spurs_in_view_per_view": self.spurs_in_view / max(1, self.views),
            "points_per_view": self.points / max(1, self.views),
            "recall": self.right_place / max(1, self.spurs_in_view),
            "right_cane": self.right_cane / max(1, self.points),
            "right_place": self.right_place / max(1, self.points),
            "along_mm_median": 1000 * float(np.median(along)),
            "along_mm_p95": 1000 * float(np.percentile(along, 95)),
            "off_axis_mm_median": 1000 * float(np.median(off)),
            "off_axis_mm_p95": 1000 * float(np.percentile(off, 95)),
            "renewals": self.renewals,
            "right_renewals": self.right_renewals,
            "frame_ms_median": statistics.median(self.frame_ms or [0.0]),
        }


def evaluate(seed: int, x: float = 0.0, frames: int = 4, model: RobotModel | None = None) -> Score:
    """Look at one row from one place and compare with the judge.

    Args:
        seed: Of the row and of the camera's noise.
        x: Of the base along the row (m, odom).
        frames: How many the tracker gets; the last one counts.
        model: The robot, if one is at hand.
    """
    model = model or RobotModel()
    row = grow(VineyardConfig(), seed)
    camera = Camera(CameraConfig(), seed)
    perception = Perception(PerceptionConfig(), LabelImageSegmenter(), model)
    base, position = survey_place(x)
    T_odom_camera = camera_pose(model, base, position)
    score = Score(views=1)
    points: tuple[m.PruningPoint, ...] = ()
    for sequence in range(frames):
        frame = camera_frame(camera.render(row, T_odom_camera, sequence), camera, base, position, sequence)
        began = time.thread_time()
        result = perception.process(frame)
        score.frame_ms.append(1000 * (time.thread_time() - began))
        points, score.undecided_sites = result.points, [each.reason for each in result.undecided_sites]
    truths = {(truth.vine, truth.spur): truth for truth in judge(row)}
    k = camera.intrinsics
    for truth in truths.values():
        if truth.cut is not None:
            stub = next(rod for _, rod in row.standing() if (rod.vine, rod.spur) == (truth.vine, truth.spur))
            seen = np.stack([stub.start, truth.cut.best]) - T_odom_camera[:3, 3]
            seen = seen @ T_odom_camera[:3, :3]
            u, v = k.fx * seen[:, 0] / seen[:, 2] + k.cx, k.fy * seen[:, 1] / seen[:, 2] + k.cy
            inside = (seen[:, 2] > 0) & (np.minimum(u, k.width - u) > _MARGIN) & (np.minimum(v, k.height - v) > _MARGIN)
            score.spurs_in_view += int(inside.all())
    for point in points:
        _compare(row, truths, point, score)
    return score


def _compare(row: Row, truths: dict[tuple[int, int], SpurTruth], point: m.PruningPoint, score: Score) -> None:
    position = np.array(point.position)
    distance, rod = min(
        ((_distance(rod.start, rod.end, position), rod) for _, rod in row.standing() if rod.spur >= 0),
        key=lambda pair: pair[0],
    )
    truth = truths[rod.vine, rod.spur]
    if point.reason.startswith("Renewal"):
        score.renewals += 1
        cut = truth.renewal
        inside = cut is not None and float((position - cut.least) @ cut.tangent) >= 0.0 >= cut.past_most(position)
        score.right_renewals += int(inside and rod.kind == "spur" and distance < 0.01)
        return
    score.points += 1
    if rod.cane != truth.keeper or truth.cut is None:
        return
    score.right_cane += 1
    score.off_axis.append(distance)
    score.along.append(truth.cut.past_best(position))
    least = float((position - truth.cut.least) @ truth.cut.tangent)
    score.right_place += int(distance < 0.01 and least >= 0.0 >= truth.cut.past_most(position))


def _distance(start: Array, end: Array, point: Array) -> float:
    axis = end - start
    share = float(np.clip((point - start) @ axis / (axis @ axis), 0.0, 1.0))
    return float(np.linalg.norm(point - start - share * axis))


def main(argv: Sequence[str] | None = None) -> int:
    """Score a range of seeds from two places each; print and write the figures."""
    parser = argparse.ArgumentParser(prog="rolling-panda bench perception", description=__doc__)
    parser.add_argument("--seeds", default="0:10", help="FIRST:LAST, the last one excluded (default: %(default)s)")
    parser.add_argument("--json", type=Path, metavar="FILE", help="write the figures here")
    arguments = parser.parse_args(argv)
    first, last = (int(part) for part in arguments.seeds.split(":"))
    model, total = RobotModel(), Score()
    for seed in range(first, last):
        score = Score()
        for x in (0.0, 1.2):
            score.add(evaluate(seed, x, model=model))
        print(f"seed {seed}: {score.right_place} of {score.points} right, {score.spurs_in_view} spurs in view")
        total.add(score)
    summary = total.summary()
    print("\n".join(f"{name:24} {value:.3f}" for name, value in summary.items()))
    if arguments.json:
        arguments.json.write_text(json.dumps({"seeds": arguments.seeds, **summary, "score": asdict(total)}, indent=1))
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
