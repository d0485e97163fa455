"""`rolling-panda bench row`: accept what was detected, cut it in physics, judge by the simulator's own trace."""

import argparse
import json
import math
import platform
import sys
import tempfile
import time
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

from benchmarks.closed_loop import ClosedLoop
from bridge.sim import trace
from rolling_panda import intents
from rolling_panda import messages as m

#: A cut is at the right place when the cane was severed within this of the accepted point (m).
RIGHT_PLACE = 0.010
_ENDED: tuple[m.PointState, ...] = ("DONE", "FAILED_NOT_CUT", "UNKNOWN")
_SURVEY_S = 6.0
_LIMIT_S = 90.0


@dataclass(frozen=True)
class Cut:
    """One accepted point: how it ended, the distance from it to what was severed (m; None when nothing was)."""

    seed: int
    point_id: str
    state: str
    reason: str
    distance: float | None
    severed: int
    duration_s: float

    @property
    def right(self) -> bool:
        """Severed at the right place."""
        return self.distance is not None and self.distance <= RIGHT_PLACE


def cut_row(seed: int, points: int) -> list[Cut]:
    """Survey from the start posture, accept up to `points` of what was detected, work through them.

    Returns:
        One row for each accepted point; a refused acceptance is not among them, as an operator sees the refusal.
    """
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "trace"
        loop = ClosedLoop(seed, path)
        loop.run(_SURVEY_S)
        loop.ask(intents.Arm(user="bench"))
        loop.ask(intents.AcceptAll(user="bench"))
        loop.run(0.2)
        proposed = {point.point_id: point for point in loop.inputs.points.message.points} if loop.inputs.points else {}
        accepted = [entry for entry in loop.queue("ACCEPTED")]
        for entry in accepted[points:]:
            loop.ask(intents.RejectPoint(user="bench", point_id=entry.point_id, reason="not in this run"))
        accepted = accepted[:points]
        loop.ask(intents.Start(user="bench"))
        durations = _work(loop, [entry.point_id for entry in accepted])
        ends = {entry.point_id: entry for entry in loop.queue()}
        loop.close()
        record = trace.read(path)
    severed = {event["point_id"]: event["severed"] for event in record.events if event["event"] == "cut"}
    rows = []
    for entry in accepted:
        where = entry.accepted_position or proposed[entry.point_id].position
        pieces = severed.get(entry.point_id, [])
        distance = min((math.dist(piece["point"], where) for piece in pieces), default=None)
        end = ends[entry.point_id]
        rows.append(
            Cut(seed, entry.point_id, end.state, end.reason, distance, len(pieces), durations.get(entry.point_id, 0.0))
        )
    return rows


def _work(loop: ClosedLoop, todo: list[str]) -> dict[str, float]:
    """Run until every point has ended or the work stands still. Returns simulated seconds a point."""
    durations: dict[str, float] = {}
    begin = loop.now
    while len(durations) < len(todo):

        def ended() -> bool:
            return any(e.point_id in todo and e.point_id not in durations for e in loop.queue(*_ENDED))

        if not loop.run_until(ended, _LIMIT_S):
            break
        for entry in loop.queue(*_ENDED):
            if entry.point_id in todo and entry.point_id not in durations:
                durations[entry.point_id] = loop.now - begin
                begin = loop.now
    loop.run(3.0)
    return durations


def main(argv: Sequence[str] | None = None) -> int:
    """Run the benchmark; returns the exit code."""
    parser = argparse.ArgumentParser(prog="rolling-panda bench row", description=__doc__)
    parser.add_argument("--seed", type=int, default=0, help="first seed (default: 0)")
    parser.add_argument("--count", type=int, default=10, help="seeds to run (default: 10)")
    parser.add_argument("--points", type=int, default=4, help="most points accepted in a row (default: 4)")
    parser.add_argument("--json", type=Path, metavar="FILE", help="write the rows and the summary here")
    arguments = parser.parse_args(argv)
    cuts: list[Cut] = []
    print(f"{'seed':>4} {'accepted':>8} {'right':>6} {'s a cut':>8} {'× real time':>11}")
    for seed in range(arguments.seed, arguments.seed + arguments.count):
        begin = time.perf_counter()
        rows = cut_row(seed, arguments.points)
        simulated = sum(row.duration_s for row in rows) + _SURVEY_S
        speed = simulated / (time.perf_counter() - begin)
        right = sum(row.right for row in rows)
        each = sum(row.duration_s for row in rows) / max(len(rows), 1)
        print(f"{seed:>4} {len(rows):>8} {right:>6} {each:>8.1f} {speed:>11.1f}", flush=True)
        for row in rows:
            if not row.right:
                print(f"       {row.point_id}: {row.state}, {row.reason or 'no reason'}; distance {row.distance}")
        cuts += rows
    summary = summarise(cuts)
    print(", ".join(f"{name} {value}" for name, value in summary.items()))
    if arguments.json is not None:
        document = {"machine": platform.platform(), "summary": summary, "results": [asdict(cut) for cut in cuts]}
        arguments.json.write_text(json.dumps(document, indent=1) + "\n", encoding="utf-8")
    return 0


def summarise(cuts: list[Cut]) -> dict[str, float | int]:
    """Share severed at the right place, seconds a cut and distance, over all accepted points."""
    durations = sorted(cut.duration_s for cut in cuts if cut.right)
    distances = sorted(cut.distance for cut in cuts if cut.distance is not None)
    return {
        "accepted": len(cuts),
        "right_place": round(sum(cut.right for cut in cuts) / max(len(cuts), 1), 3),
        "cut_s_median": round(durations[len(durations) // 2], 1) if durations else 0.0,
        "distance_m_median": round(distances[len(distances) // 2], 4) if distances else 0.0,
        "distance_m_max": round(distances[-1], 4) if distances else 0.0,
    }


if __name__ == "__main__":
    sys.exit(main())
