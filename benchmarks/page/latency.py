"""The operator's page in a real browser on the running demo: how soon what a hand does arrives at the robot, and back.

Headless Chromium opens the page as a person would. The gizmo is dragged with the browser's mouse, and the simulator's
own record says when an actuator moved; the software stop is pressed, and the bridge says when it latched it; states are
followed from the robot to the screen. With `--viewers` the same is done while others look on.
"""

import argparse
import tempfile
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import psutil

from benchmarks.common.documents import bench_parser, write
from benchmarks.page.browser import chromium, put_first
from benchmarks.page.crowd import looked_at
from benchmarks.page.hands import Drags, Heap, drag, first_paints, open_page, press_stop, signed_in, watch_screen
from benchmarks.page.latencies import Spread, ages, spread
from rolling_panda.errors import InputError, RollingPandaError
from tests.support.processes.demo import Demo

if TYPE_CHECKING:
    from playwright.sync_api import Page

#: States are followed to the screen for so long (s).
_WATCH_S = 20.0


@dataclass(frozen=True)
class Figures:
    """Of one situation; times in s.

    Attributes:
        drag_told: From the movement of the hand until the 3-D view was told.
        drag_sent: Until the view had sent it.
        drag_setpoint: Until an actuator's setpoint changed: all but the servo.
        drag_motion: Until an actuator moved.
        servo_lag: Between the two.
        drags_left_out: Movements that are not counted, as the robot was not at rest or the hold had ended.
        drags_unanswered: Movements that nothing followed.
        stop_latched: From the press until the bridge had latched the stop.
        stop_answered: Until the page had the answer of bridge and controller.
        stops_unanswered: Presses that were not confirmed within 5 s.
        state_painted: From the measurement of the robot's posture until the page had painted it.
        screen_age: Age of what the page shows, at any moment.
        server_mib: Memory of the server, shared pages counted once (MiB).
        drag_trouble: Why dragging ended early; empty when it did not.
    """

    drag_told: Spread | None
    drag_sent: Spread | None
    drag_setpoint: Spread | None
    drag_motion: Spread | None
    servo_lag: Spread | None
    drags_left_out: int
    drags_unanswered: int
    stop_latched: Spread | None
    stop_answered: Spread | None
    stops_unanswered: int
    state_painted: Spread | None
    screen_age: Spread | None
    server_mib: float
    drag_trouble: str


def measured(page: "Page", demo: Demo, record: Path, arguments: argparse.Namespace) -> Figures:
    """Drag, watch, press."""
    trouble, drags = "", Drags()
    try:
        if arguments.drags:
            drag(page, demo, record, arguments.drags, arguments.seed, drags)
    except InputError as error:
        # What else is measured took minutes too.
        trouble = f"{error}; the last of the log: {' | '.join(demo.log(6))}"
        print(trouble, flush=True)
    show("until an actuator moved", _plain(spread(drags.motion)))
    shown = watch_screen(page, record, _WATCH_S)
    show("age of the screen", _plain(spread(ages(shown))))
    stops = press_stop(page, demo, arguments.stops, arguments.seed)
    return Figures(
        spread(drags.told),
        spread(drags.sent),
        spread(drags.setpoint),
        spread(drags.motion),
        spread(drags.servo),
        drags.left_out,
        drags.unanswered,
        spread(stops.latched),
        spread(stops.answered),
        stops.unanswered,
        spread([painted - at for at, painted in shown]),
        spread(ages(shown)),
        server_memory(demo),
        trouble,
    )


def server_memory(demo: Demo) -> float:
    """Of the server's process (MiB)."""
    (server,) = [each for each in demo.tree.children(recursive=True) if _is_server(each)]
    return round(float(server.memory_full_info().pss) / 2**20, 1)


def _is_server(process: psutil.Process) -> bool:
    words = process.cmdline()
    return "-m" in words and words[words.index("-m") + 1] == "server"


def run(demo: Demo, record: Path, arguments: argparse.Namespace) -> dict[str, Any]:
    """All that was asked for, as it goes into the file."""
    found: dict[str, Any] = {}
    with chromium() as browser:
        context = signed_in(browser, demo, arguments.scale)
        if arguments.paints:
            print(f"opening the page {arguments.paints} times", flush=True)
            paints, filled = first_paints(context, arguments.paints)
            found["first_paint"], found["first_state"] = _plain(spread(paints)), _plain(spread(filled))
        page = open_page(context)
        found["browser_first"] = not arguments.last and put_first() > 0
        memory = Heap(page)
        if arguments.drags or arguments.stops:
            print(f"{arguments.drags} drags, {arguments.stops} stops", flush=True)
            found["alone"] = asdict(measured(page, demo, record, arguments))
            memory.read()
        if arguments.viewers:
            print(f"the same with {arguments.viewers} pages that look on", flush=True)
            try:
                cookie = demo.guest("onlooker", "viewer")
                with looked_at(demo.url, cookie, arguments.viewers, arguments.slow, whole=not arguments.plain):
                    seen = measured(page, demo, record, arguments)
                    found["viewers"] = asdict(seen) | {"pages_open_at_the_end": demo.state()["viewers"]}
            except RollingPandaError as error:
                found["viewers_trouble"] = str(error)
            memory.read()
        memory.watch(arguments.minutes)
    found["heap_mb"], found["heap_growth_mb"] = memory.readings, memory.growth_mb
    return found


def _plain(found: Any) -> Any:
    return None if found is None else asdict(found)


def show(name: str, value: Any) -> None:
    """One line a figure, times in ms."""
    if isinstance(value, dict) and "median" in value:
        ranks = ", ".join(f"{rank} {1000 * value[rank]:.1f}" for rank in ("median", "p95", "p99", "most"))
        print(f"{name:<32} {ranks} ms (n {value['n']})")
    elif isinstance(value, dict):
        for key, each in value.items():
            show(f"{name}.{key}", each)
    else:
        print(f"{name:<32} {value}")


def main(argv: Sequence[str]) -> int:
    """Run the benchmark; returns the exit code."""
    parser = bench_parser("page", __doc__)
    parser.add_argument(
        "--drags", type=int, default=100, help="movements of the gizmo in each situation (default: 100)"
    )
    parser.add_argument("--stops", type=int, default=110, help="presses of the stop in each (default: 110)")
    parser.add_argument("--paints", type=int, default=10, help="how often the page is opened anew (default: 10)")
    parser.add_argument("--viewers", type=int, default=0, help="pages that look on (default: 0)")
    parser.add_argument("--slow", type=int, default=10, help="how many of them never read (default: 10)")
    parser.add_argument("--plain", action="store_true", help="these pages have no 3-D view and no camera image")
    parser.add_argument(
        "--minutes", type=float, default=0.0, help="open for this long at least, its heap watched (default: 0)"
    )
    parser.add_argument("--last", action="store_true", help="the browser's threads keep their usual priority")
    parser.add_argument("--scale", type=float, default=0.25, help="pixels drawn of each of the page's (default: 0.25)")
    parser.add_argument("--seed", type=int, default=0, help="row to grow (default: 0)")
    parser.add_argument("--port", type=int, default=8767, help="port of the page (default: 8767)")
    arguments = parser.parse_args(argv)
    with tempfile.TemporaryDirectory() as folder:
        record = Path(folder) / "trace"
        print("starting the demo", flush=True)
        demo = Demo(arguments.port, arguments.seed, None, "--trace", str(record))
        try:
            found = run(demo, record, arguments)
        finally:
            demo.close()
    show("", found)
    write(arguments.json, {"viewport": [1280, 800], "scale": arguments.scale, **found})
    return 0
