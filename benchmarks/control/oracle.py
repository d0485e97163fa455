"""`rolling-panda bench oracle`: for which right cuts the search of plans finds one where everything is known.

Grown rows before the first cut, without a simulation and without perception: the search gets the right cuts and all
wood by the truth. The search and its distances are those of the controller.

The whole stretch where the removal of last year's cane of a Guyot vine is right is searched.
"""

import dataclasses
import math
import time
from collections.abc import Sequence
from dataclasses import asdict, dataclass

import numpy as np
from msgspec.structs import replace

from benchmarks.common.documents import bench_parser, write
from benchmarks.common.intervals import Figure, share
from benchmarks.control.cut_truth import STUB, WantedCut, wanted_cuts
from benchmarks.perception.blocked import Blocker, blocked_by
from bridge.sim.vineyard.config import GUYOT_ROW, VineyardConfig
from bridge.sim.vineyard.grow import grow
from bridge.sim.vineyard.row import Row
from bridge.sim.vineyard.truth import FRUITING_NODES, KEPT_NODES, RightCut, staying_rods
from controller.config import ControllerConfig
from controller.work.posture_search import CutClearance, CutPlan, PostureSearch, completed
from perception.rules.pruning import INWARD, OUTWARD
from rolling_panda import messages as m
from rolling_panda import reasons
from rolling_panda.config import RobotConfig, load_section
from rolling_panda.messages.perception import Capsule, Obstacles, point_digest
from rolling_panda.messages.types import CutKind
from rolling_panda.model.robot import ARM_Q, RobotModel
from rolling_panda.model.wire_values import vector3
from rolling_panda.reasons import text_of
from rolling_panda.resources import resource
from rolling_panda.transport.inbox import Received

#: Wood that stands in the way and is never cut.
_FIXED = ("post", "trunk", "cordon", "wire", "hose")
#: Kinds of the right cuts, by training system.
KINDS: dict[str, tuple[CutKind, ...]] = {
    "spur": ("spur cut", "renewal cut"),
    "guyot": ("spur cut", "cane cut", "removal"),
}
#: Distance of two places of a removal that are searched (m).
_REMOVAL_STEP = 0.01


@dataclass(frozen=True)
class Found:
    """A right cut.

    Attributes:
        seed: Of the row.
        spur: Spur on the vine.
        kind: What it is for.
        blocked: What leaves no room for the blades around it; empty where there is room.
        planned: Whether the search found a plan.
        reason: Why not; empty with a plan.
        along: Shift of the plan along the wood (m).
        seconds: Processor time of the search.
    """

    seed: int
    spur: int
    kind: str
    blocked: Blocker
    planned: bool
    reason: str
    along: float
    seconds: float


class Oracle:
    """The controller's search among wood that is known by the truth."""

    def __init__(self, guyot: bool = False) -> None:
        """With the configuration of the simulated robot, for spur-pruned or Guyot vines."""
        self._guyot = guyot
        path = resource("assets/config/sim.toml")
        config = load_section(path, "controller", ControllerConfig)
        robot = load_section(path, "robot", RobotConfig)
        self._clearance = CutClearance(RobotModel(robot), config.whole_body.hierarchy)
        work = replace(config.work, row_distance=GUYOT_ROW.row_distance) if guyot else config.work
        self._search = PostureSearch(RobotModel(robot), work, config.whole_body.joint_margin, self._clearance)
        self._home = np.array(config.work.home)

    def search(self, row: Row, wanted: WantedCut, cut: RightCut) -> tuple[CutPlan | None, str]:
        """The plan of a right cut, or why there is none.

        Args:
            row: Before any cut.
            wanted: What is cut.
            cut: Where it is right.
        """
        removal = wanted.kind == "removal"
        self._clearance.update(Received(obstacles_of(row, self._guyot), 0.0), cane_lines(row))
        q = np.zeros(12)
        q[0], q[ARM_Q] = float(cut.best[0]), self._home
        point, refused = point_of(row, wanted, cut, self._guyot), list[str]()
        for along in _along(cut) if removal else (0.0,):
            position = vector3(np.array(point.position) + along * cut.tangent)
            found = completed(self._search.find(replace(point, position=position), q))
            if isinstance(found, CutPlan):
                return dataclasses.replace(found, along=found.along + along), ""
            refused.append(text_of(found.reason))
        return None, refused[0]


def _along(cut: RightCut) -> list[float]:
    """Places of a removal past its best one (m), the best one first, then from the head outwards."""
    least, most = cut.past_best(cut.least), cut.past_best(cut.most)
    return [0.0, *np.arange(least, most, _REMOVAL_STEP).tolist(), most]


def point_of(row: Row, wanted: WantedCut, cut: RightCut, guyot: bool = False) -> m.PruningPoint:
    """A right cut as perception would tell it, if it saw everything as it is."""
    rod = row.rods[cut.rod]
    assert rod is not None
    spur = wanted.vine, wanted.spur
    own = (each for each in wanted_cuts(row, guyot) if (each.vine, each.spur) == spur)
    staying = next(each.cane for each in own if each.cane >= 0)
    removal = wanted.kind == "removal"
    kept = FRUITING_NODES if wanted.kind == "cane cut" else KEPT_NODES
    farthest = math.inf if wanted.kind == "cane cut" else OUTWARD
    point = m.PruningPoint(
        point_id="truth",
        revision=1,
        position=vector3(cut.best),
        tangent=vector3(cut.tangent),
        radius=float(rod.start_radius),
        confidence=1.0,
        nodes_seen=len(wanted.nodes),
        nodes_kept=0 if removal else kept,
        reason=reasons.said("By the truth."),
        vine=wanted.vine,
        spur=wanted.spur,
        kind=wanted.kind,
        cane=staying if wanted.cane == STUB else max(wanted.cane, -1),
        inward=0.0 if removal else min(INWARD, -cut.past_best(cut.least)),
        outward=0.0 if removal else min(farthest, cut.past_best(cut.most)),
    )
    return replace(point, digest=point_digest(point))


def obstacles_of(row: Row, guyot: bool = False) -> Obstacles:
    """All that stands in the way, and the canes that stay, in the world frame."""
    staying = staying_rods(row, guyot)
    capsules = [
        Capsule(
            "cane" if number in staying else rod.kind,
            vector3(rod.start),
            vector3(rod.end),
            float(rod.start_radius),
            float(rod.end_radius),
            max(rod.vine, -1),
            rod.spur,
            cane=rod.cane,
        )
        for number, rod in row.standing()
        if rod.kind in _FIXED or number in staying
    ]
    return Obstacles(header=m.Header(0.0, "map"), capsules=tuple(capsules))


def cane_lines(row: Row) -> tuple[tuple[m.Vector3, ...], ...]:
    """Axes of all standing canes (polylines, m, world)."""
    canes: dict[tuple[int, int, int], list[m.Vector3]] = {}
    for _, rod in row.standing():
        if rod.kind in ("cane", "node") and rod.organ < 0:
            line = canes.setdefault((rod.vine, rod.spur, rod.cane), [vector3(rod.start)])
            line.append(vector3(rod.end))
    return tuple(tuple(line) for line in canes.values())


def look(oracle: Oracle, seed: int, vines: int, guyot: bool = False) -> list[Found]:
    """Every right cut of a grown row."""
    row, found = grow(replace(GUYOT_ROW if guyot else VineyardConfig(), vines=vines), seed), list[Found]()
    for wanted in wanted_cuts(row, guyot):
        if (cut := wanted.cut) is None:
            continue
        began = time.thread_time()
        plan, reason = oracle.search(row, wanted, cut)
        took = time.thread_time() - began
        along = 0.0 if plan is None else plan.along
        blocked = blocked_by(row, cut)
        found.append(Found(seed, wanted.spur, wanted.kind, blocked, plan is not None, reason, along, took))
    return found


def summarise(found: Sequence[Found], kinds: Sequence[CutKind] = KINDS["spur"]) -> dict[str, Figure]:
    """Shares with a plan, of the cuts with room for the blades and of those without, of all and of each kind."""
    out = {}
    for name in ("room", "no room"):
        those = [each for each in found if bool(each.blocked) == (name == "no room")]
        out[name] = share(sum(each.planned for each in those), len(those))
        for kind in kinds:
            of_kind = [each for each in those if each.kind == kind]
            out[f"{name}, {kind}"] = share(sum(each.planned for each in of_kind), len(of_kind))
    return out


def main(argv: Sequence[str]) -> int:
    """Run the benchmark; returns the exit code."""
    parser = bench_parser("oracle", __doc__)
    parser.add_argument("--seed", type=int, default=0, help="first row (default: 0)")
    parser.add_argument("--count", type=int, default=10, help="rows (default: 10)")
    parser.add_argument("--vines", type=int, default=1, help="vines a row (default: 1)")
    parser.add_argument("--training-system", choices=tuple(KINDS), default="spur", help="of the vines (default: spur)")
    words = parser.parse_args(argv)
    if words.count < 1 or words.vines < 1:
        parser.error("--count and --vines must be at least 1")
    training, guyot = words.training_system, words.training_system == "guyot"
    oracle, found = Oracle(guyot), list[Found]()
    for seed in range(words.seed, words.seed + words.count):
        found += look(oracle, seed, words.vines, guyot)
    if not found:
        print("No row has a right cut: give other rows.")
    summary = summarise(found, KINDS[training])
    for name, each in summary.items():
        told = "" if each.value is None else f"{each.value:.3f}   95 % {each.low:.3f} to {each.high:.3f}   "
        print(f"{name:<24}{told}n {each.n}")
    for cut in found:
        if cut.reason and not cut.blocked:
            print(f"  {cut.seed}, spur {cut.spur}, {cut.kind}: {cut.reason}")
    results = [asdict(each) for each in found]
    figures = {name: asdict(each) for name, each in summary.items()}
    about = {"training": training, "seed": words.seed, "count": words.count}
    write(words.json, {**about, "summary": figures, "results": results})
    return 0
