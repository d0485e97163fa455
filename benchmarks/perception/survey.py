"""`rolling-panda bench perception`: surveys of rows that nobody has seen, and the judge's opinion of every point.

The robot drives along rows of up to three vines in its survey posture. Over Guyot vines the camera is farther away, and
low on the way back. Every frame goes through perception as it would on the wire. All figures are on accepted points,
that is, on every point shown; what perception left undecided is told apart.
"""

import argparse
import resource
import time
from collections.abc import Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import get_args

import msgspec
import numpy as np
from msgspec.structs import replace
from numpy.typing import NDArray

from benchmarks.common.documents import bench_parser, write
from benchmarks.common.intervals import Figure, quantile, share
from benchmarks.perception.confusion import Confusion, no_counts, shares
from benchmarks.perception.gallery import save_failure
from benchmarks.perception.growth import grow_long, table
from benchmarks.perception.guyot_judge import GuyotJudge
from benchmarks.perception.judge import JudgedPoint, RowJudge
from benchmarks.perception.looks import CloseCamera, Looks, look_again, summarise_looks
from bridge.sim.camera.config import CameraConfig
from bridge.sim.camera.frame import camera_frame, camera_pose, survey_place
from bridge.sim.camera.renderer import Camera
from bridge.sim.vineyard.config import GUYOT_ROW, VineyardConfig
from bridge.sim.vineyard.grow import grow
from bridge.sim.world.config import CALM, PRESETS, WorldConfig, only
from bridge.sim.world.growth import overgrown
from controller.config import WorkConfig
from perception.config import PerceptionConfig, RuleConfig
from perception.pipeline import Perception
from perception.segmentation.frame import decode_frame
from perception.segmentation.segmenter import SEGMENTERS, choose_segmenter
from rolling_panda import messages as m
from rolling_panda.model.robot import RobotModel

#: Vines of a row, and the way between two frames (m): two a second at the survey's default speed (m/s).
ROW_VINES, STEP = 3, 0.125
SPEED = 0.25
#: What disturbs the colour picture, for `--light`.
LIGHT = ("sunlight", "glare", "wet", "exposure")
#: What grows and hangs on the canes, for `--shoots`.
SHOOTS = ("laterals", "tendrils", "leaves", "drooping")
#: Nodes that stay, by the kind of cut.
KEPT = {"spur cut": 2, "cane cut": 8}
#: Kinds of which each is told by itself.
KINDS = (*KEPT, "removal")
#: The camera stands so far ahead of the base in the survey posture (m), and begins before the first trunk.
_CAMERA_AHEAD = 0.5


@dataclass
class Survey:
    """What came of one or more rows.

    Attributes:
        points: Every point shown at the end.
        spurs: Spurs in view: seed, vine, spur, how visible, what is in the blades' way wherever the right cut may be
            made (empty for nothing), and whether they got a point, and a right one.
        frame_ms: Time of each frame through segmentation, plant model and rule, on a wall clock.
        undecided_sites: What every row left open at the end.
        confusion: Pixels by true class and by the class told.
    """

    points: list[JudgedPoint] = field(default_factory=list)
    spurs: list[dict[str, int | bool | str]] = field(default_factory=list)
    frame_ms: list[float] = field(default_factory=list)
    undecided_sites: list[m.UndecidedSite] = field(default_factory=list)
    confusion: NDArray[np.int64] = field(default_factory=no_counts)


def survey_row(
    seed: int,
    vines: int,
    perception: Perception,
    model: RobotModel,
    camera_config: CameraConfig,
    into: Survey,
    gallery: Path | None = None,
    looks: Looks | None = None,
    step: float = STEP,
    world: WorldConfig = CALM,
) -> None:
    """Drive along one row.

    Args:
        seed: Of row and camera.
        vines: How many.
        perception: Fresh; it knows no row yet.
        model: For the camera's place.
        camera_config: Of the camera.
        into: Takes the result.
        gallery: Folder for pictures of wrong points.
        looks: Takes what a second look at each point comes to; None leaves it at the survey.
        step: Way between two frames (m).
        world: Disturbances of row and camera.
    """
    guyot = perception.config.rule.system == "guyot"
    config = replace(GUYOT_ROW if guyot else VineyardConfig(), vines=vines)
    row = overgrown(grow(config, seed), world, seed)
    camera = Camera(camera_config, seed, world)
    opinion = GuyotJudge(row, seed) if guyot else RowJudge(row, seed)
    first = config.first_vine_x - config.vine_spacing / 2
    last = first + vines * config.vine_spacing
    points: tuple[m.PruningPoint, ...] = ()
    left_open: tuple[m.UndecidedSite, ...] = ()
    way: list[tuple[float, tuple[float, ...] | None, float]]
    places = (np.arange(first, last + step, step) - _CAMERA_AHEAD).tolist()
    work = WorkConfig()
    way = [(x, work.survey_far if guyot else None, 1.0) for x in places]
    if guyot:
        way += [(x, work.survey_low, -1.0) for x in reversed(places)]
    for sequence, (x, arm, sense) in enumerate(way):
        base, position = survey_place(x, arm)
        place = camera_pose(model, base, position)
        image = camera.render(row, place, sequence, np.array([sense * SPEED, *[0.0] * 5]))
        frame = camera_frame(image, camera, base, position, sequence)
        opinion.look(image, camera.intrinsics, place)
        began = time.perf_counter()
        result = perception.process(frame)
        into.frame_ms.append(1000 * (time.perf_counter() - began))
        points = result.points
        left_open = result.undecided_sites
    judged = [opinion.point(point) for point in points]
    for point, verdict in zip(points, judged, strict=True):
        if gallery is not None and not verdict.right:
            base, position = survey_place(point.position[0] - _CAMERA_AHEAD)
            place = camera_pose(model, base, position)
            image = camera.render(row, place, 10**6)
            view = decode_frame(camera_frame(image, camera, base, position, 0), model)
            save_failure(gallery, verdict, point, row, camera, place, perception.segmenter.segment(view), image.color)
    if looks is not None:
        eye = CloseCamera(camera, perception.segmenter, perception.config, model, perception.plant_map)
        look_again(points, row, eye, opinion, looks)
    into.points += judged
    into.undecided_sites += left_open
    for vine, spur in opinion.spurs():
        own = [p for p in judged if (p.vine, p.spur, p.kind) == (vine, spur, opinion.kind(spur))]
        into.spurs.append(
            {
                "seed": seed,
                "vine": vine,
                "spur": spur,
                "kind": opinion.kind(spur),
                "visibility": opinion.visibility(vine, spur),
                "blocked": opinion.blocked(vine, spur),
                "point": bool(own),
                "right": any(p.right for p in own),
            }
        )


def summarise(survey: Survey, visibility: str | None = None) -> dict[str, Figure]:
    """The figures, for all spurs or for those of one class of visibility."""
    chosen = [p for p in survey.points if visibility in (None, p.visibility)]
    cuts = [p for p in chosen if p.kind in KINDS]
    renewals = [p for p in chosen if p.kind == "renewal cut"]
    on_cane = [p for p in cuts if p.right_cane]
    counted = [p for p in on_cane if p.kind in KEPT]
    along = [abs(p.along_error) for p in on_cane if p.along_error is not None]
    spurs = [s for s in survey.spurs if visibility in (None, s["visibility"])]
    # A spur that was hidden all along is no spur that one could have found.
    visible = [s for s in spurs if s["visibility"] == (visibility or "clear")]
    free = [s for s in visible if not s["blocked"]]
    return {
        "right_cane": share(len(on_cane), len(cuts)),
        "along_error_median_m": quantile(along, 0.5),
        "along_error_p95_m": quantile(along, 0.95),
        "node_count_right": share(sum(p.nodes_left == KEPT[p.kind] for p in counted), len(counted)),
        "plane_within_15_deg": share(sum((p.plane_error or 0.0) <= 15.0 for p in on_cane), len(on_cane)),
        "right": share(sum(p.right for p in cuts), len(cuts)),
        "renewal_right": share(sum(p.right for p in renewals), len(renewals)),
        "undecided": share(sum(not s["point"] for s in visible), len(visible)),
        "recall": share(sum(bool(s["right"]) for s in visible), len(visible)),
        "blocked": share(len(visible) - len(free), len(visible)),
        "undecided_unblocked": share(sum(not s["point"] for s in free), len(free)),
        "recall_unblocked": share(sum(bool(s["right"]) for s in free), len(free)),
        "frame_ms_median": quantile(survey.frame_ms, 0.5),
    } | _by_kind(spurs)


def _by_kind(spurs: list[dict[str, int | bool | str]]) -> dict[str, Figure]:
    """Where vines have cuts of several kinds: of all of each, out of view too, those with a right point."""
    kinds = [kind for kind in KINDS if any(spur["kind"] == kind for spur in spurs)]
    if len(kinds) < 2:
        return {}
    own = {kind: [bool(spur["right"]) for spur in spurs if spur["kind"] == kind] for kind in kinds}
    return {f"right_of_all_{kind.replace(' ', '_')}s": share(sum(right), len(right)) for kind, right in own.items()}


def main(argv: Sequence[str]) -> int:
    """Run the benchmark; returns the exit code."""
    parser = bench_parser("perception", __doc__)
    parser.add_argument("--seed", type=int, default=100, help="of the first row (default: %(default)s)")
    parser.add_argument("--vines", type=int, default=12, help="vines to survey (default: %(default)s)")
    parser.add_argument(
        "--segmenter", choices=SEGMENTERS, default="network", help="what tells classes (default: %(default)s)"
    )
    parser.add_argument("--weights", type=Path, help="ONNX file for the network (default: the one that is shipped)")
    parser.add_argument(
        "--training-system", choices=("spur", "guyot"), default="spur", help="how the vines are (default: %(default)s)"
    )
    parser.add_argument("--fuse", action="store_true", help="apply the rule to what all frames have shown of a spur")
    parser.add_argument(
        "--looks", choices=("one", "two"), default="one", help="look at each point again from near, and after its cut"
    )
    parser.add_argument(
        "--step", type=float, default=STEP, metavar="METRES", help="way between two frames (default: %(default)s)"
    )
    parser.add_argument(
        "--growth",
        action="store_true",
        help="survey one row of so many vines instead, and tell what each vine's frames cost",
    )
    parser.add_argument(
        "--light", choices=tuple(PRESETS), default="calm", help="sun, glare, wet bark and blur of a preset"
    )
    parser.add_argument(
        "--shoots",
        choices=tuple(PRESETS),
        default="calm",
        help="laterals, tendrils, leaves, drooping canes of a preset",
    )
    parser.add_argument("--gallery", type=Path, metavar="DIR", help="put pictures of wrong points here")
    words = parser.parse_args(argv)
    if words.seed < 0 or words.vines < 1:
        parser.error(f"--seed {words.seed} --vines {words.vines}: give a seed of 0 or more and at least one vine")
    if not words.step > 0.0:
        parser.error(f"--step {words.step}: give a way of more than 0 m")
    model, survey = RobotModel(), Survey()
    if words.growth:
        return _growth(words)
    looks = Looks() if words.looks == "two" else None
    grown = {knob: getattr(PRESETS[words.shoots], knob) for knob in SHOOTS}
    world = msgspec.structs.replace(only(LIGHT, words.light), **grown)
    for number, done in enumerate(range(0, words.vines, ROW_VINES)):
        segmenter = Confusion(choose_segmenter(words.segmenter, words.weights), survey.confusion)
        rule = RuleConfig(system=words.training_system)
        perception = Perception(PerceptionConfig(fuse=words.fuse, rule=rule), segmenter, model)
        seed, vines = words.seed + number, min(ROW_VINES, words.vines - done)
        before = len(survey.points)
        survey_row(seed, vines, perception, model, CameraConfig(), survey, words.gallery, looks, words.step, world)
        new = survey.points[before:]
        print(f"seed {seed}: {vines} vines, {len(new)} points, {sum(p.right for p in new)} right", flush=True)
    summary = summarise(survey) | ({} if looks is None else summarise_looks(looks))
    for name, figure in summary.items():
        print(_line(name, figure))
    for need in get_args(m.Need):
        print(f"{f'open for {need}':24} {sum(each.needs == need for each in survey.undecided_sites):8}")
    document = {
        "seed": words.seed,
        "vines": words.vines,
        "segmenter": words.segmenter,
        "step_m": words.step,
        "light": words.light,
        "shoots": words.shoots,
        "fuse": words.fuse,
        "training_system": words.training_system,
        "looks": words.looks,
        "voided": [] if looks is None else [*looks.right_voided, *looks.wrong_voided],
        "summary": {name: asdict(figure) for name, figure in summary.items()},
        "by_visibility": {
            kind: {name: asdict(figure) for name, figure in summarise(survey, kind).items()}
            for kind in ("clear", "partly", "hidden")
        },
        "memory_mib": resource.getrusage(resource.RUSAGE_SELF).ru_maxrss // 1024,
        "confusion": shares(survey.confusion),
        "results": [asdict(point) for point in survey.points],
        "spurs": survey.spurs,
        "open": {need: sum(a.needs == need for a in survey.undecided_sites) for need in get_args(m.Need)},
        "undecided": [msgspec.to_builtins(each) for each in survey.undecided_sites],
    }
    write(words.json, document)
    return 0


def _growth(words: argparse.Namespace) -> int:
    perception = Perception(PerceptionConfig(fuse=words.fuse), choose_segmenter(words.segmenter, words.weights))
    stretches = grow_long(words.seed, words.vines, words.step, perception, RobotModel())
    print(table(stretches))
    document = {
        "seed": words.seed,
        "segmenter": words.segmenter,
        "step_m": words.step,
        "stretches": [asdict(stretch) for stretch in stretches],
    }
    write(words.json, document)
    return 0


def _line(name: str, figure: Figure) -> str:
    if figure.value is None:
        return f"{name:24} –"
    return f"{name:24} {figure.value:8.4f}   95 % {figure.low:.4f} … {figure.high:.4f}   n {figure.n}"
