"""`rolling-panda bench row`: accept what was detected, cut it in physics, judge by the simulator's own trace.

Several methods work on the same accepted points: a seed's row looks the same to each before the first cut.
"""

import dataclasses
import json
import math
import re
import tempfile
import time
from collections.abc import Collection, Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np
from msgspec.structs import asdict as asdict_of
from msgspec.structs import replace

from benchmarks.common.documents import bench_parser, write
from benchmarks.control.cane_touches import Cane, CaneTouches
from benchmarks.control.cut_truth import WantedCut, true_cut, wanted_cuts
from benchmarks.control.row_report import Cut, RowRun, mean_stages, summarise, tell, tell_stages
from benchmarks.control.row_stages import StageClock
from benchmarks.control.row_supervisor import Supervisor
from benchmarks.control.row_walk import walk
from benchmarks.control.stops import stops_of
from benchmarks.peers.rows import PEERS, use_peers
from benchmarks.perception.blocked import Blocker, blocked_by
from bridge.sim.robot import trace
from bridge.sim.robot.robot import SimulatedRobot
from bridge.sim.vineyard.row import Row
from bridge.sim.vineyard.truth import staying_rods
from bridge.sim.world.config import CALM, WorldConfig
from controller.config import ControllerConfig
from controller.motion.follower import Tracking
from controller.whole_body.registry import METHODS
from perception.segmentation.segmenter import SEGMENTERS
from rolling_panda import commands as intents
from rolling_panda import messages as m
from rolling_panda import reasons
from rolling_panda.config import load_section
from rolling_panda.model.map_frame import MapFrame
from rolling_panda.model.robot import RobotModel
from rolling_panda.reasons import text_of
from rolling_panda.resources import resource
from tests.support.worlds.closed_loop import ClosedLoop

#: A point in another state than these has ended: cut, given up, or void after a closer look. What a plan cannot reach
#: may be reached by the plan from the last cut.
_OPEN: tuple[m.PointState, ...] = ("ACCEPTED", "UNREACHABLE", "CUTTING")
_SURVEY_S = 6.0
#: Most checks of the camera: after a correction the row is looked at anew.
_CHECKS = 2
_LOOK_S, _LIMIT_S = 3.0, 120.0
#: After the work, in which the last close-up is taken (s).
_AFTER_S = 3.0
#: A point is of a right cut within this (m).
_OF_POINT = 0.06
#: Periods between two looks at what touches a cane.
_LOOK_EVERY = 4


def cut_row(
    seed: int,
    points: int,
    method: str,
    pictures: float,
    along: float = 0.0,
    plans: bool = True,
    looks: bool = True,
    segmenter: str = "",
    world: WorldConfig = CALM,
    checked: bool = False,
    localise: bool = False,
    supervised: bool = False,
    servo: bool | None = None,
    frame_time_offset: float = 0.0,
) -> RowRun:
    """Survey from the start posture, accept up to `points` of what was detected, work through them.

    A refused acceptance is not among the cuts, as an operator sees the refusal.

    Args:
        seed: Of the row.
        points: Most points to accept.
        method: Whole-body method.
        pictures: The camera takes a second while the robot moves; they are most of what a run costs.
        along: With a distance (m), not these points but the whole row is worked off until the base has come so far,
            with everything that is found on the way.
        plans: False works without the session's plan.
        looks: False cuts without the closer looks before and after.
        segmenter: In place of the configured one.
        checked: The camera is checked first; corrections that are offered are used, and it is checked again.
        localise: The camera's inertial sensors and the wood that it has seen correct the odometry.
        supervised: A played person lets the work go on after a stop, at most a few times.
        frame_time_offset: By how much the bridge takes pictures to be later than their times tell (s).
        servo: Whether the motion is corrected on the last way to a cut; None as configured.
        world: Disturbances. Where `odom` drifts, `distance`, `tool_error` and `path_rms` are no truth.
    """
    errors: list[float] = []
    clock = StageClock(load_section(resource("assets/config/sim.toml"), "controller", ControllerConfig))

    def watch(loop: ClosedLoop, tracking: Tracking) -> None:
        if loop.controller.mode == "AUTO":
            clock.note(loop, tracking)
            if len(errors) % _LOOK_EVERY == 0:
                row = row_of(loop)
                touches.look(loop.configuration(), row.standing(), row.revision)
            errors.append(float(np.linalg.norm(loop.true_tool() - tracking.desired.translation)))

    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "trace"
        settings: dict[str, dict[str, object]] = {
            "bridge": {"inertial": localise, "frame_time_offset": frame_time_offset},
            "perception": {"localise": localise},
        }
        if servo is not None:
            settings["controller.work"] = {"servo": servo}
        config = sim_config(Path(folder) / "row.toml", pictures, world, settings)
        with ClosedLoop(seed, path, config, method, watch, plans, looks, segmenter) as loop:
            row = row_of(loop)
            touches, wanted = CaneTouches(staying_rods(row)), wanted_cuts(row)
            warned = check_camera(loop) if checked else ""
            accepted = [] if along else _accept(loop, points)
            blocked = _blocked(loop, accepted, row, wanted)
            begin, other_s, person = loop.now, 0.0, Supervisor(path)
            if along:
                loop.run(_SURVEY_S)
                loop.command(intents.Arm(user="bench"))
                clock.begin(loop.now)
                work_s, other_s = walk(loop, along)
                auto_s = work_s
                accepted, durations = [entry for entry in loop.queue() if entry.accepted_position is not None], {}
            else:
                loop.command(intents.Start(user="bench"))
                clock.begin(begin)
                durations = _work(loop, [entry.point_id for entry in accepted], person if supervised else None)
                other_s, auto_s = person.waited_s, loop.now - begin - person.waited_s - _AFTER_S
                work_s = sum(durations.values()) if durations else auto_s
            ends = {entry.point_id: entry for entry in loop.queue()}
            events = tuple(loop.events)
        record = trace.read(path)
    stops = stops_of(events, record.rows)
    cuts = judged_cuts(method, seed, accepted, ends, wanted, record.events, durations)
    return RowRun(
        method=method,
        seed=seed,
        cuts=tuple(dataclasses.replace(cut, blocked=blocked.get(cut.point_id, "")) for cut in cuts),
        work_s=work_s,
        other_s=other_s,
        path_rms=math.sqrt(float(np.mean(np.square(errors)))) if errors else 0.0,
        contacts=int(np.count_nonzero(record.rows["contacts"])),
        self_contacts=int(np.count_nonzero(record.rows["self_contacts"])),
        stops=len(stops),
        false_stops=sum(stop.false for stop in stops),
        cleared=person.cleared,
        auto_s=auto_s,
        stages=clock.stages,
        limits=clock.limits,
        canes_touched=spared(touches, record.events),
        staying_touched=named(touches.touched_staying),
        camera_warning=warned,
    )


def judged_cuts(
    method: str,
    seed: int,
    accepted: Sequence[m.QueueEntry],
    ends: Mapping[str, m.QueueEntry],
    wanted: Collection[WantedCut],
    events: Sequence[dict[str, Any]],
    durations: Mapping[str, float],
) -> tuple[Cut, ...]:
    """Judge accepted points.

    Args:
        method: Whole-body method.
        seed: Of the row.
        accepted: The points as they were accepted.
        ends: What became of them; a point that is missing is no longer reported.
        wanted: The right cuts of the row before the first one.
        events: Of the trace.
        durations: Seconds a point, as far as they are known.
    """
    bites = [event for event in events if event["event"] == "cut"]
    last = {bite["point_id"]: bite for bite in bites}
    cuts = []
    for entry in accepted:
        bite, where = last.get(entry.point_id), entry.accepted_position
        assert where is not None
        pieces = [piece for each in bites if each["point_id"] == entry.point_id for piece in each["severed"]]
        end = ends.get(entry.point_id, replace(entry, state="PROPOSED", reason=reasons.no_longer_reported()))
        truth = true_cut(wanted, pieces)
        cuts.append(
            Cut(
                method=method,
                seed=seed,
                point_id=entry.point_id,
                state=end.state,
                reason=codes(end.reason),
                distance=min((math.dist(piece["point"], where) for piece in pieces), default=None),
                tool_error=None if bite is None else math.dist(bite["blade"], where),
                duration_s=durations.get(entry.point_id, 0.0),
                true_right=truth.right,
                harm=truth.harm,
                right_cane=truth.right_cane,
                nodes_left=truth.nodes_left,
                past_best=truth.past_best,
                aside=None if bite is None or bite["nearest"] is None else math.hypot(*bite["nearest"]),
            )
        )
    return tuple(cuts)


def _blocked(
    loop: ClosedLoop, accepted: Sequence[m.QueueEntry], row: Row, wanted: Collection[WantedCut]
) -> dict[str, Blocker]:
    """What leaves no room for the right cut of each accepted point, by the point's name; empty where there is room.

    The right cut of a point is the nearest one of its kind, within `_OF_POINT`. Points without one are left out.
    """
    shown, localisation = loop.inbox.newest(m.PruningPoints), loop.inbox.newest(m.Localisation)
    if shown is None:
        return {}
    model, robot = RobotModel(), loop.bridge.robot
    assert isinstance(robot, SimulatedRobot)
    frame, odometry = MapFrame(), loop.inbox.newest(m.Odometry)
    frame = frame if localisation is None else frame.after(localisation.message)
    frame = frame if odometry is None else frame.standing(odometry.message)
    T_map_tool = frame.pose_in_map(model.pose(loop.configuration(), model.tool_id))
    T_world_map = robot.true_tool() @ T_map_tool.inverse().homogeneous
    kinds = {point.point_id: point.kind for point in shown.message.points}
    found: dict[str, Blocker] = {}
    for entry in accepted:
        place = T_world_map @ (*(entry.accepted_position or ()), 1.0)
        kind = kinds.get(entry.point_id)
        near = [(math.dist(each.cut.best, place[:3]), each.cut) for each in wanted if each.cut and each.kind == kind]
        away, cut = min(near, key=lambda each: each[0], default=(math.inf, None))
        if cut is not None and away < _OF_POINT:
            found[entry.point_id] = blocked_by(row, cut)
    return found


def codes(reason: m.Reason | None) -> str:
    """Code of a reason, with the codes of those that it gives: `acceptance_void: other_cane`."""
    if reason is None:
        return ""
    return ": ".join([reason.code, *(codes(value) for _, value in reason.values if isinstance(value, m.Reason))])


def row_of(loop: ClosedLoop) -> Row:
    """The simulated row as it stands."""
    robot = loop.bridge.robot
    assert isinstance(robot, SimulatedRobot)
    return robot.row


def sim_config(
    path: Path, pictures: float, world: WorldConfig, settings: Mapping[str, Mapping[str, object]] = MappingProxyType({})
) -> Path:
    """Write the simulation's configuration with another rate of pictures, disturbances, and settings by section."""
    text = resource("assets/config/sim.toml").read_text(encoding="utf-8")
    changes = {"world": asdict_of(world), **settings}
    changes["bridge"] = {"camera_moving_hz": pictures, **settings.get("bridge", {})}
    for section, values in changes.items():
        head, title, rest = text.partition(f"[{section}]\n")
        body, following, tail = rest.partition("\n[")
        for key, value in values.items():
            body = re.sub(rf"^{key} = .*\n", "", body + "\n", count=1, flags=re.MULTILINE)
            body = f"{key} = {json.dumps(value)}\n{body.rstrip()}"
        text = head + title + body + following + tail
    path.write_text(text, encoding="utf-8")
    return path


def spared(touches: CaneTouches, events: Sequence[dict[str, Any]]) -> dict[str, str]:
    """What was touched, but for the canes that were cut."""
    cut = {(piece["vine"], piece["spur"], piece["cane"]) for event in events for piece in event.get("severed", ())}
    return named({cane: parts for cane, parts in touches.touched.items() if cane not in cut})


def named(touched: dict[Cane, set[str]]) -> dict[str, str]:
    """Canes by their words, and the parts that touched each."""
    return {
        f"vine {vine}, spur {spur}, cane {cane}": ", ".join(sorted(parts))
        for (vine, spur, cane), parts in sorted(touched.items())
    }


def check_camera(loop: ClosedLoop) -> str:
    """Check the camera, use what corrections are offered, and check again; returns the first warning, empty without."""
    warned = ""
    loop.run(1.0)
    loop.command(intents.Arm(user="bench"))
    for _ in range(_CHECKS):
        loop.command(intents.CheckCamera(user="bench"))
        loop.run_until(lambda: loop.controller.mode != "AUTO", _LIMIT_S)
        warning = loop.perception.camera.state.warning
        warned = warned or ("" if warning is None else text_of(warning))
        if not _use_corrections(loop):
            break
    return warned


def _use_corrections(loop: ClosedLoop) -> bool:
    """Use the corrections of the camera and of its clock that are offered; whether there were any."""
    loop.run(1.0)
    offer, timing = loop.perception.camera.state.offer, loop.perception.robot_calibration.timing
    if offer is not None:
        loop.perception.answer(intents.UseCamera(user="bench", made_at=offer.made_at))
    if timing is not None:
        loop.command(intents.UseTiming(user="bench", made_at=timing.made_at))
        loop.run(1.0)
    return offer is not None or timing is not None


def _accept(loop: ClosedLoop, points: int) -> list[m.QueueEntry]:
    loop.run(_SURVEY_S)
    loop.command(intents.Arm(user="bench"))
    loop.command(intents.AcceptAll(user="bench", confidence=0.0))
    loop.run(0.2)
    accepted = list(loop.queue("ACCEPTED"))
    for entry in accepted[points:]:
        loop.command(intents.RejectPoint(user="bench", point_id=entry.point_id, reason="not in this run"))
    # An operator looks at the queue, with or without a plan, before starting.
    loop.run(_LOOK_S)
    return accepted[:points]


def _work(loop: ClosedLoop, todo: list[str], person: Supervisor | None) -> dict[str, float]:
    """Run until every point has ended or the work stands still. Returns simulated seconds of work a point."""
    durations: dict[str, float] = {}
    begin = loop.now

    def ended() -> set[str]:
        return set(todo) - set(durations) - {entry.point_id for entry in loop.queue(*_OPEN)}

    while loop.run_until(lambda: bool(ended()) or loop.controller.mode != "AUTO", _LIMIT_S):
        for point_id in (now_ended := ended()):
            durations[point_id] = loop.now - begin
            begin = loop.now
        if now_ended:
            continue
        waited = 0.0 if person is None else person.waited_s
        if person is None or not person.lets_go_on(loop):
            break
        begin += person.waited_s - waited
    loop.run(_AFTER_S)
    return durations


def main(argv: Sequence[str]) -> int:
    """Run the benchmark; returns the exit code."""
    parser = bench_parser("row", __doc__)
    parser.add_argument("--seed", type=int, default=0, help="first seed (default: 0)")
    parser.add_argument("--count", type=int, default=10, help="rows to work off (default: 10)")
    parser.add_argument("--points", type=int, default=4, help="most points accepted in a row (default: 4)")
    parser.add_argument(
        "--method",
        action="append",
        choices=(*METHODS, *PEERS),
        help="whole-body method; may be given several times (default: ours; the peers need `make peers`)",
    )
    parser.add_argument(
        "--along",
        type=float,
        default=0.0,
        metavar="METRES",
        help="work along the row until the base has come so far, with every point that is found on the way",
    )
    parser.add_argument(
        "--pictures", type=float, default=0.7, help="pictures a second while the robot moves (default: 0.7)"
    )
    parser.add_argument("--no-looks", action="store_true", help="cut without the closer looks before and after")
    parser.add_argument("--segmenter", default="", choices=SEGMENTERS, help="in place of the configured one")
    parser.add_argument("--localise", action="store_true", help="with the place in the row estimated")
    parser.add_argument("--stages", action="store_true", help="say where the time of a cut goes")
    parser.add_argument("--no-plan", action="store_true", help="work along the row without the session's plan")
    parser.add_argument("--plot", type=Path, metavar="FILE", help="draw the time of a cut by method and stage (PNG)")
    arguments = parser.parse_args(argv)
    methods = arguments.method or list(METHODS)
    use_peers(methods)
    runs: list[RowRun] = []
    print(f"{'method':<10} {'seed':>4} {'accepted':>8} {'right':>6} {'s a cut':>8} {'contacts':>8} {'× real time':>11}")
    for seed in range(arguments.seed, arguments.seed + arguments.count):
        for method in methods:
            begin = time.perf_counter()
            run = cut_row(
                seed,
                arguments.points,
                method,
                arguments.pictures,
                arguments.along,
                not arguments.no_plan,
                not arguments.no_looks,
                arguments.segmenter,
                localise=arguments.localise,
            )
            runs.append(run)
            tell(run, (run.work_s + _SURVEY_S) / (time.perf_counter() - begin))
    print()
    summary = {method: summarise([run for run in runs if run.method == method]) for method in methods}
    names = list(next(iter(summary.values())))
    print(f"{'':<18}" + "".join(f"{method:>12}" for method in methods))
    for name in names:
        print(f"{name:<18}" + "".join(f"{summary[method][name]:>12}" for method in methods))
    if arguments.stages:
        tell_stages({method: [run for run in runs if run.method == method] for method in methods})
    if arguments.plot is not None:
        # Drawing is for development; without its library the rest works.
        from benchmarks.control.row_plot import draw

        draw({method: mean_stages([run for run in runs if run.method == method]) for method in methods}, arguments.plot)
    document = {
        "pictures_hz": arguments.pictures,
        "looks": not arguments.no_looks,
        "segmenter": arguments.segmenter,
        "localise": arguments.localise,
        "summary": summary,
        "results": [asdict(run) for run in runs],
    }
    write(arguments.json, document)
    return 0
