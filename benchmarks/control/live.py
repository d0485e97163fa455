"""The real processes over the real wire for a while: do control periods come on time, and where is the tool meanwhile?

The demo runs as a person would start it, at the rates asked for. Accepted points keep it moving; when none is left, the
tool is led to and fro by a held target, as an operator would. Figures come from the bridge's and the controller's own
counters and, for the tool, from the simulator's trace.
"""

import math
import re
import statistics
import tempfile
import time
from collections.abc import Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

from benchmarks.common.documents import bench_parser, write
from benchmarks.page.load import cores_between, processor_times
from rolling_panda.resources import resource
from tests.support.processes.demo import Demo

#: How far a held target swings to either side of where the tool was (m), and how fast it goes round (s).
_SWING, _ROUND_S = 0.08, 6.0
_POLL_S = 0.05


@dataclass
class Watched:
    """What was seen while the robot moved.

    Attributes:
        ticks: Control periods.
        late: Those that lasted more than 1.5 times as long as they should.
        seconds: How long it was watched (s).
        round_trip: Medians of a second each, from joint state to the command that answers it (s).
        round_trip_worst: The longest of each of those seconds (s).
        tool_error: Of the tool against its trajectory in automatic work, at each poll (m).
        modes: Polls by mode.
        factor: Real-time factors.
        cores: Processors used meanwhile, by process.
    """

    ticks: int = 0
    late: int = 0
    seconds: float = 0.0
    round_trip: list[float] = field(default_factory=list)
    round_trip_worst: list[float] = field(default_factory=list)
    tool_error: list[float] = field(default_factory=list)
    modes: dict[str, int] = field(default_factory=dict)
    factor: list[float] = field(default_factory=list)
    cores: dict[str, float] = field(default_factory=dict)


@dataclass(frozen=True)
class Figures:
    """The result; times in s, distances in m."""

    rate_hz: float
    base_rate_hz: float
    achieved_hz: float
    on_time_share: float
    late_ticks: int
    round_trip_median_s: float
    round_trip_worst_s: float
    tool_error_rms_m: float | None
    tool_error_p95_m: float | None
    real_time_factor: float
    seconds: float
    modes: dict[str, int]
    cores: float
    cores_by_process: dict[str, float]


def configured(rate_hz: float, base_rate_hz: float) -> str:
    """The simulation's configuration with the arm and joint states at `rate_hz` and the base at `base_rate_hz`."""
    text = resource("assets/config/sim.toml").read_text(encoding="utf-8")
    text = re.sub(r"^(base_)?rate_hz = .*\n", "", text, flags=re.MULTILINE)
    text = text.replace(
        "[controller.work]\n",
        f"[controller]\nrate_hz = {rate_hz}\nbase_rate_hz = {base_rate_hz}\n\n[controller.work]\n",
    )
    return text.replace("[bridge]\n", f"[bridge]\njoints_hz = {rate_hz}\n")


def watch(demo: Demo, seconds: float) -> Watched:
    """Keep the robot moving and note what it tells of itself."""
    seen = Watched()
    begin = demo.state()
    before = processor_times(demo.tree)
    started = time.monotonic()
    centre: dict[str, Any] | None = None
    while time.monotonic() - started < seconds:
        state = demo.state()
        controller, bridge = state["controller"], state["bridge"]
        seen.modes[controller["mode"]] = seen.modes.get(controller["mode"], 0) + 1
        seen.round_trip.append(bridge["round_trip_s"])
        seen.round_trip_worst.append(bridge["round_trip_worst_s"])
        seen.factor.append(bridge["real_time_factor"])
        if controller["mode"] == "AUTO" and controller["T_odom_tool_desired"] is not None:
            seen.tool_error.append(controller["position_error"])
        if controller["mode"] in ("READY", "TELEOP"):
            centre = centre or controller["T_odom_tool"]
            swing = _SWING * math.sin(2 * math.pi * (time.monotonic() - started) / _ROUND_S)
            x, y, z = centre["position"]
            demo.client.post("/api/teleop", json={"hold": True, "target": {**centre, "position": [x + swing, y, z]}})
        time.sleep(_POLL_S)
    end = demo.state()
    seen.seconds = time.monotonic() - started
    seen.cores = cores_between(before, processor_times(demo.tree), seen.seconds)
    seen.ticks = end["controller"]["ticks"] - begin["controller"]["ticks"]
    seen.late = end["controller"]["late_ticks"] - begin["controller"]["late_ticks"]
    return seen


def figures(seen: Watched, rate_hz: float, base_rate_hz: float) -> Figures:
    """Shares and percentiles."""
    errors = sorted(seen.tool_error)
    return Figures(
        rate_hz=rate_hz,
        base_rate_hz=base_rate_hz,
        achieved_hz=round(seen.ticks / seen.seconds, 1),
        on_time_share=round(1 - seen.late / max(seen.ticks, 1), 5),
        late_ticks=seen.late,
        round_trip_median_s=round(statistics.median(seen.round_trip), 5),
        round_trip_worst_s=round(max(seen.round_trip_worst), 5),
        tool_error_rms_m=round(math.sqrt(statistics.fmean(e * e for e in errors)), 5) if errors else None,
        tool_error_p95_m=round(errors[int(0.95 * len(errors))], 5) if errors else None,
        real_time_factor=round(statistics.median(seen.factor), 3),
        seconds=round(seen.seconds, 1),
        modes=seen.modes,
        cores=round(sum(seen.cores.values()), 2),
        cores_by_process=seen.cores,
    )


def main(argv: Sequence[str]) -> int:
    """Run the benchmark; returns the exit code."""
    parser = bench_parser("live", __doc__)
    parser.add_argument("--seconds", type=float, default=60.0, help="how long to watch (default: 60)")
    parser.add_argument("--rate", type=float, default=1000.0, help="of the arm in Hz, 50 to 1000 (default: 1000)")
    parser.add_argument("--base-rate", type=float, default=50.0, help="of the base in Hz, 50 to --rate (default: 50)")
    parser.add_argument("--seed", type=int, default=0, help="row to grow (default: 0)")
    parser.add_argument("--port", type=int, default=8766, help="port of the page (default: 8766)")
    arguments = parser.parse_args(argv)
    if not 50.0 <= arguments.rate <= 1000.0:
        parser.error(f"--rate {arguments.rate:g} is outside 50 to 1000")
    if not 50.0 <= arguments.base_rate <= arguments.rate:
        parser.error(f"--base-rate {arguments.base_rate:g} is outside 50 to {arguments.rate:g}")
    with tempfile.TemporaryDirectory() as folder:
        config = Path(folder) / "live.toml"
        config.write_text(configured(arguments.rate, arguments.base_rate), encoding="utf-8")
        print("starting the demo", flush=True)
        demo = Demo(arguments.port, arguments.seed, config)
        try:
            demo.begin_work()
            print(f"watching for {arguments.seconds:.0f} s", flush=True)
            found = figures(watch(demo, arguments.seconds), arguments.rate, arguments.base_rate)
        finally:
            demo.close()
    for name, value in asdict(found).items():
        print(f"{name:<22} {value}")
    write(arguments.json, asdict(found))
    return 0
