"""`rolling-panda bench world`: rows worked off as by `bench row`, in a calm and a rough world.

The judge reads the truth in the plant's own frame: which rod was severed, and where along it. A place in `odom` is no
truth where odometry drifts.
"""

import argparse
import math
import time
from collections.abc import Sequence
from dataclasses import asdict, dataclass

from msgspec.structs import replace

from benchmarks.common.documents import bench_parser, write
from benchmarks.common.intervals import Figure, quantile, share
from benchmarks.control.row import cut_row
from benchmarks.control.row_report import Cut, RowRun
from bridge.sim.vineyard.truth import KEPT_NODES
from bridge.sim.world.config import CALM, PRESETS, WorldConfig, only
from perception.segmentation.segmenter import SEGMENTERS
from rolling_panda.errors import InputError

#: Disturbances that belong together, for `--each`.
DISTURBANCES: dict[str, tuple[str, ...]] = {
    "hand-eye": ("hand_eye_angle", "hand_eye_shift"),
    "focal length": ("focal_error",),
    "frame time": ("frame_delay", "frame_jitter"),
    "joints": ("joint_offset",),
    "arm on base": ("mount_angle", "mount_shift"),
    "wheels": ("wheel_error",),
    "slip": ("slip",),
    "slope": ("slope_along", "slope_across"),
    "bumps": ("bumps",),
    "inertial sensors": ("inertial_errors",),
    "wind": ("sway",),
    "lost depth": ("depth_lost",),
    "low sun": ("sunlight", "glare"),
    "wet bark": ("wet",),
    "motion blur": ("exposure",),
    "blades": ("blade_failures",),
    "elastic canes": ("cane_modulus",),
    "hanging canes": ("hanging",),
    "lateral shoots": ("laterals",),
    "tendrils and leaves": ("tendrils", "leaves"),
    "drooping canes": ("drooping",),
}


#: What calibrations by the board leave (SD): about five times as much as they do in simulation (docs/calibration.md),
#: where nothing bends. Turn (rad) and place (m) of the camera, focal length (share), zeros of the joints (rad).
_CAMERA_TURN, _CAMERA_SHIFT, _FOCAL, _JOINTS = math.radians(0.05), 0.0005, 0.0005, math.radians(0.005)


@dataclass(frozen=True)
class Condition:
    """One world: what disturbs it, how much, and the world."""

    name: str
    level: str
    world: WorldConfig


def conditions(presets: Sequence[str], each: bool, knobs: dict[str, float]) -> list[Condition]:
    """What to run: presets as a whole, each disturbance by itself, or a calm world with some values.

    Raises:
        InputError: A knob has no such name or value.
    """
    if knobs:
        unknown = next((name for name in knobs if name not in WorldConfig.__struct_fields__ or name == "preset"), None)
        if unknown is not None:
            raise InputError(f"--knob {unknown}: known are {', '.join(WorldConfig.__struct_fields__[1:])}")
        return [Condition(", ".join(f"{k} = {v:g}" for k, v in knobs.items()), "given", replace(CALM, **knobs))]
    if not each:
        return [Condition("all", preset, PRESETS[preset]) for preset in presets]
    alone = [
        Condition(name, preset, only(knobs, preset))
        for name, knobs in DISTURBANCES.items()
        for preset in presets
        if preset != "calm"
    ]
    return [Condition("none", "calm", CALM), *alone]


def calibrated(world: WorldConfig) -> WorldConfig:
    """The same world with camera and arm as calibrations by the board leave them."""
    return replace(
        world,
        hand_eye_angle=min(world.hand_eye_angle, _CAMERA_TURN),
        hand_eye_shift=min(world.hand_eye_shift, _CAMERA_SHIFT),
        focal_error=min(world.focal_error, _FOCAL),
        joint_offset=min(world.joint_offset, _JOINTS),
    )


def summarise(runs: Sequence[RowRun]) -> dict[str, Figure]:
    """The figures of rows in one world; shares are of the accepted points unless the name says otherwise."""
    cuts = [cut for run in runs for cut in run.cuts]
    made = [cut for cut in cuts if cut.past_best is not None or cut.harm]
    ends = [cut.nodes_left for cut in made if cut.nodes_left is not None]
    bitten = [cut for cut in cuts if cut.bitten]
    settled = [cut for cut in bitten if cut.state in ("DONE", "FAILED_NOT_CUT")]
    past = [abs(cut.past_best) for cut in made if cut.past_best is not None]
    possible = [cut for cut in cuts if not cut.blocked]

    def of(hits: Sequence[Cut]) -> Figure:
        return share(len(hits), len(cuts))

    return {
        "right": of([cut for cut in cuts if cut.true_right]),
        "right_of_possible": share(sum(cut.true_right for cut in possible), len(possible)),
        "right_of_made": share(sum(cut.true_right for cut in made), len(made)),
        "right_cane_of_made": share(sum(cut.right_cane for cut in made), len(made)),
        "right_nodes_of_made": share(sum(nodes == KEPT_NODES for nodes in ends), len(ends)),
        "harmed": of([cut for cut in cuts if cut.harm]),
        "void": of([cut for cut in cuts if cut.state == "PROPOSED"]),
        "refused": of([cut for cut in cuts if cut.state in ("UNREACHABLE", "FAILED_NOT_CUT")]),
        "unknown": of([cut for cut in cuts if cut.state == "UNKNOWN"]),
        "told_falsely": share(sum(not cut.told_truly for cut in settled), len(bitten)),
        "asked_of_person": share(sum(cut.state == "UNKNOWN" for cut in bitten), len(bitten)),
        "from_best_m_median": quantile(past, 0.5),
        "from_best_m_p95": quantile(past, 0.95),
        "aside_m_median": quantile([cut.aside for cut in made if cut.aside is not None], 0.5),
        "aside_m_p95": quantile([cut.aside for cut in made if cut.aside is not None], 0.95),
        "rows_with_contact": share(sum(run.contacts + run.self_contacts > 0 for run in runs), len(runs)),
        "rows_stopped": share(sum(run.stops > 0 for run in runs), len(runs)),
    }


@dataclass(frozen=True)
class Work:
    """Automatic work over all rows of one world.

    Attributes:
        minutes: Of automatic work (simulated).
        stops: Protective stops.
        false_stops: Those at which the robot touched nothing, by the truth.
        stops_cleared: Stops and pauses after which a played person let the work go on.
    """

    minutes: float
    stops: int
    stops_cleared: int
    false_stops: int = 0


def work_of(runs: Sequence[RowRun]) -> Work:
    """How long the rows were worked on, and what stopped it."""
    minutes = sum(run.auto_s for run in runs) / 60.0
    return Work(
        minutes,
        sum(run.stops for run in runs),
        sum(run.cleared for run in runs),
        sum(run.false_stops for run in runs),
    )


def told_stops(work: Work) -> str:
    """Stops and their rate as text."""
    each = f", one in {work.minutes / work.stops:.1f} min" if work.stops else ""
    return (
        f"protective stops {work.stops} in {work.minutes:.1f} min of work{each}, "
        f"{work.false_stops} of them with nothing touched; "
        f"stops and pauses a person cleared {work.stops_cleared}"
    )


def told(figure: Figure) -> str:
    """A share as text, with its interval."""
    if figure.value is None or figure.low is None or figure.high is None:
        return "-"
    return f"{100 * figure.value:3.0f} % ({100 * figure.low:.0f}-{100 * figure.high:.0f}, n {figure.n})"


def main(argv: Sequence[str]) -> int:
    """Run the benchmark; returns the exit code."""
    parser = bench_parser("world", __doc__)
    parser.add_argument("--preset", action="append", choices=tuple(PRESETS), help="may be given several times; all")
    parser.add_argument("--each", action="store_true", help="one disturbance at a time, from calm to storm")
    parser.add_argument(
        "--knob", action="append", type=_knob, default=[], metavar="NAME=VALUE", help="a calm world but"
    )
    parser.add_argument("--seed", type=_count, default=2000, help="first seed (default: %(default)s)")
    parser.add_argument("--count", type=_count, default=20, help="rows in each world (default: %(default)s)")
    parser.add_argument("--points", type=_count, default=4, help="most points accepted in a row (default: 4)")
    parser.add_argument(
        "--pictures", type=float, default=2.0, help="pictures a second in motion (default: %(default)s, as in the demo)"
    )
    parser.add_argument("--check-camera", action="store_true", help="check the camera first, and use the correction")
    parser.add_argument(
        "--calibrated",
        action="store_true",
        help="with camera and arm calibrated by the board, and the delay of pictures corrected",
    )
    parser.add_argument("--localise", action="store_true", help="with the place in the row estimated")
    parser.add_argument(
        "--supervised", action="store_true", help="with a played person who lets the work go on after a stop"
    )
    servo = parser.add_mutually_exclusive_group()
    servo.add_argument("--servo", action="store_true", help="correct the motion on the last way to a cut")
    servo.add_argument("--no-servo", action="store_true", help="do not, whatever is configured")
    parser.add_argument("--segmenter", default="", choices=SEGMENTERS, help="in place of the configured one")
    words = parser.parse_args(argv)
    if words.each and words.knob:
        parser.error("--each and --knob exclude each other")
    summary: dict[str, dict[str, object]] = {}
    results: list[dict[str, object]] = []
    for case in conditions(words.preset or tuple(PRESETS), words.each, dict(words.knob)):
        runs: list[RowRun] = []
        for seed in range(words.seed, words.seed + words.count):
            begin = time.perf_counter()
            run = cut_row(
                seed,
                words.points,
                "hierarchy",
                words.pictures,
                segmenter=words.segmenter,
                world=calibrated(case.world) if words.calibrated else case.world,
                checked=words.check_camera,
                localise=words.localise,
                supervised=words.supervised,
                servo=True if words.servo else False if words.no_servo else None,
                frame_time_offset=case.world.frame_delay if words.calibrated else 0.0,
            )
            runs.append(run)
            results += [{"disturbance": case.name, "level": case.level, **asdict(cut)} for cut in run.cuts]
            right, harmed = sum(cut.true_right for cut in run.cuts), sum(bool(cut.harm) for cut in run.cuts)
            print(
                f"{case.name}, {case.level}, seed {seed}: {right} of {len(run.cuts)} right, {harmed} harmed, "
                f"{run.contacts} contacts, {run.stops} stops ({run.false_stops} false), {run.cleared} cleared, "
                f"{time.perf_counter() - begin:.0f} s",
                flush=True,
            )
            if run.camera_warning:
                print(f"    {run.camera_warning}", flush=True)
            for cut in run.cuts:
                if not cut.true_right:
                    past = "" if cut.past_best is None else f", {1000 * cut.past_best:+.0f} mm past the best place"
                    room = f", no room: {cut.blocked}" if cut.blocked else ""
                    print(f"    {cut.point_id}: {cut.state} {cut.reason}{past} {cut.harm}{room}", flush=True)
        figures, work = summarise(runs), work_of(runs)
        print(
            f"  right {told(figures['right'])}; where there is room {told(figures['right_of_possible'])}; "
            f"of cuts made {told(figures['right_of_made'])}; "
            f"void {told(figures['void'])}; harmed {told(figures['harmed'])}\n"
            f"  of bites: outcome told falsely {told(figures['told_falsely'])}, "
            f"asked of a person {told(figures['asked_of_person'])}\n"
            f"  {told_stops(work)}",
            flush=True,
        )
        shares = {name: asdict(figure) for name, figure in figures.items()}
        summary[f"{case.name}, {case.level}"] = {**shares, **asdict(work)}
        # A run over many worlds takes hours: what is done is on disk.
        write(
            words.json,
            {
                "pictures_hz": words.pictures,
                "segmenter": words.segmenter,
                "camera_checked": words.check_camera,
                "calibrated": words.calibrated,
                "localise": words.localise,
                "supervised": words.supervised,
                "servo": "on" if words.servo else "off" if words.no_servo else "as configured",
                "rows": words.count,
                "first_seed": words.seed,
                "summary": summary,
                "results": results,
            },
        )
    return 0


def _count(text: str) -> int:
    if not text.isdecimal():
        raise argparse.ArgumentTypeError(f"{text!r} is no count; give an integer from 0")
    return int(text)


def _knob(text: str) -> tuple[str, float]:
    name, _, value = text.partition("=")
    try:
        return name.strip(), float(value)
    except ValueError:
        raise argparse.ArgumentTypeError(f"{text!r} is no NAME=VALUE, such as hand_eye_angle=0.01") from None
