"""Ground truth of the right cuts, for tests and benchmarks; never an input of perception.

Spur pruning with two count nodes: keep the lowest cane that is thick enough, remove the stub with its other canes in
one cut beyond it, and shorten it past its second node. The basal bud is not counted.

Guyot: the lower cane of the spur is cut to two nodes and becomes the next spur, the upper one is shortened to the
fruiting nodes, and last year's cane is removed in one cut beyond the head.

Lateral shoots are pruned away on all canes: to cut one is neither right nor harmful. Their rods come after those of all
canes and are no nodes, so that a cane is judged as without them.
"""

from dataclasses import dataclass

import numpy as np

from bridge.sim.vineyard.row import Array, Rod, Row

#: Count nodes kept; distance of the cut past the last one: best, least, most; shorter internodes are halved (m).
KEPT_NODES = 2
BEST_PAST, LEAST_PAST, MOST_PAST = 0.020, 0.010, 0.030
SHORT_INTERNODE = 0.040
#: Least diameter of a new spur (m).
GOOD_DIAMETER = 0.006
#: Wood left on either side of a cut through the stub (m).
_STUB_MARGIN = 0.004


@dataclass(frozen=True)
class RightCut:
    """A stretch of one rod where a cut is right.

    Attributes:
        rod: Index in the row.
        least: End nearer to the root (3, m, world).
        best: Where the rule puts the blades (3, m, world).
        most: End farther from the root (3, m, world).
        tangent: Unit vector along the wood, away from the root (3).
    """

    rod: int
    least: Array
    best: Array
    most: Array
    tangent: Array

    def past_best(self, point: Array) -> float:
        """Signed distance of `point` (3, m) beyond the best place along the wood (m)."""
        return float((point - self.best) @ self.tangent)

    def holds(self, rod: int, point: Array) -> bool:
        """Whether cutting rod `rod` at `point` (3, m) is right."""
        return rod == self.rod and float((point - self.least) @ self.tangent) >= 0.0 >= self.past_most(point)

    def past_most(self, point: Array) -> float:
        """Signed distance of `point` (3, m) beyond the last right place along the wood (m)."""
        return float((point - self.most) @ self.tangent)


@dataclass(frozen=True)
class SpurTruth:
    """Right cuts of one spur.

    Attributes:
        vine: Vine along the row.
        spur: Spur on the vine.
        canes: Number of its canes.
        keeper: The cane that becomes the new spur.
        diameter: Diameter of that cane in its first internode (m).
        nodes: Middles of that cane's count nodes, base first (N×3, m, world), without the basal bud.
        cut: Right cut on that cane; None if it has fewer nodes than are kept.
        renewal: Right cut on the stub beyond that cane; None if it is the last cane on the stub.
        surplus: Canes nearer to the cordon, each of which needs its own cut.
    """

    vine: int
    spur: int
    canes: int
    keeper: int
    diameter: float
    nodes: Array
    cut: RightCut | None
    renewal: RightCut | None
    surplus: tuple[int, ...]


def judge(row: Row) -> tuple[SpurTruth, ...]:
    """Truth of every spur with canes, in the order of vines and spurs, for an uncut row."""
    stubs: dict[tuple[int, int], int] = {}
    chains: dict[tuple[int, int], dict[int, list[tuple[int, Rod]]]] = {}
    for index, rod in row.standing():
        if rod.kind == "spur":
            stubs[rod.vine, rod.spur] = index
        elif rod.cane >= 0:
            chains.setdefault((rod.vine, rod.spur), {}).setdefault(rod.cane, []).append((index, rod))
    # Shoots of a Guyot vine have no stub.
    return tuple(_judge_spur(row, stubs[place], place, chains[place]) for place in sorted(chains) if place in stubs)


def staying_rods(row: Row, guyot: bool = False) -> frozenset[int]:
    """Rods of the canes that the judge keeps, below the one that is cut through.

    Args:
        row: Not cut yet.
        guyot: Whether its vines are Guyot vines, which keep two canes.
    """
    cuts: dict[tuple[int, int, int], RightCut | None]
    if guyot:
        pairs = [((v.vine, 0, v.lower), v.spur_cut) for v in judge_guyot(row)]
        cuts = dict([*pairs, *(((v.vine, 0, v.upper), v.cane_cut) for v in judge_guyot(row))])
    else:
        cuts = {(spur.vine, spur.spur, spur.keeper): spur.cut for spur in judge(row)}
    found = ((number, cuts.get((rod.vine, rod.spur, rod.cane))) for number, rod in row.standing())
    return frozenset(number for number, cut in found if cut is not None and number < cut.rod)


def _judge_spur(
    row: Row, stub_index: int, place: tuple[int, int], chains: dict[int, list[tuple[int, Rod]]]
) -> SpurTruth:
    stub = row.rods[stub_index]
    assert stub is not None
    along = {cane: _along(stub, chain[0][1].start) for cane, chain in chains.items()}
    upwards = sorted(chains, key=along.__getitem__)
    diameters = {cane: _diameter(chain) for cane, chain in chains.items()}
    good = [cane for cane in upwards if diameters[cane] >= GOOD_DIAMETER]
    keeper = good[0] if good else max(upwards, key=diameters.__getitem__)
    beyond = [cane for cane in upwards if along[cane] > along[keeper]]
    middles = [rod.at(0.5)[0] for _, rod in chains[keeper] if rod.kind == "node"][1:]
    return SpurTruth(
        vine=place[0],
        spur=place[1],
        canes=len(chains),
        keeper=keeper,
        diameter=diameters[keeper],
        nodes=np.array(middles).reshape(-1, 3),
        cut=shortening_cut(chains[keeper], KEPT_NODES),
        renewal=_renewal(stub_index, stub, along[keeper], along[beyond[0]]) if beyond else None,
        surplus=tuple(cane for cane in upwards if along[cane] < along[keeper]),
    )


def shortening_cut(chain: list[tuple[int, Rod]], kept: int, fruiting: bool = False) -> RightCut | None:
    """The right cut of a cane for a number of kept nodes; None where it has fewer.

    Args:
        chain: Its rods with their indices, base first.
        kept: Count nodes that stay.
        fruiting: The cane will be tied along the wire, so that any place before the next node is right.
    """
    nodes = [k for k, (_, rod) in enumerate(chain) if rod.kind == "node"]
    if len(nodes) <= kept:
        return None
    last = nodes[kept]
    index, rod = chain[last + 1]
    half = _length(chain[last][1]) / 2
    length = _length(rod)
    best, least, most = BEST_PAST - half, LEAST_PAST - half, MOST_PAST - half
    if len(nodes) > kept + 1:
        following = _length(chain[nodes[kept + 1]][1]) / 2
        if half + length + following < SHORT_INTERNODE:
            best = (half + length + following) / 2 - half
    if fruiting and len(nodes) > kept + 1:
        most = max(most, length - BEFORE_NEXT)
    least, most = max(least, 0.0), min(most, length)
    return right_cut(index, rod, least, min(max(best, least), most), most)


def _renewal(index: int, stub: Rod, keeper: float, following: float) -> RightCut:
    least, most = keeper + _STUB_MARGIN, following - _STUB_MARGIN
    if most < least:
        least = most = (keeper + following) / 2
    return right_cut(index, stub, least, (least + most) / 2, most)


def right_cut(index: int, rod: Rod, least: float, best: float, most: float) -> RightCut:
    """The right stretch of a rod, by distances from its start (m)."""
    tangent = (rod.end - rod.start) / _length(rod)
    points = [rod.start + distance * tangent for distance in (least, best, most)]
    return RightCut(index, points[0], points[1], points[2], tangent)


def _diameter(chain: list[tuple[int, Rod]]) -> float:
    # In the first internode past the basal bud.
    rod = chain[2][1] if len(chain) > 2 else chain[0][1]
    return 2.0 * rod.at(0.5)[1]


def _along(stub: Rod, point: Array) -> float:
    return float((point - stub.start) @ (stub.end - stub.start)) / _length(stub)


def _length(rod: Rod) -> float:
    return float(np.linalg.norm(rod.end - rod.start))


#: Nodes on the cane that will fruit.
FRUITING_NODES = 8
#: Wood kept before the next node of a cane that will fruit (m).
BEFORE_NEXT = 0.010
#: Old cane left at the head, and kept free before its first shoot (m).
_STUMP, _BEFORE_SHOOT = 0.03, 0.02


@dataclass(frozen=True)
class GuyotTruth:
    """Right cuts of one Guyot vine.

    Attributes:
        vine: Vine along the row.
        lower: The spur's cane that becomes the next spur.
        upper: The spur's cane that becomes the next fruiting cane.
        spur_cut: On the lower one; None where it has too few nodes.
        cane_cut: On the upper one; the same.
        removal: Of last year's cane.
    """

    vine: int
    lower: int
    upper: int
    spur_cut: RightCut | None
    cane_cut: RightCut | None
    removal: RightCut


def judge_guyot(row: Row) -> tuple[GuyotTruth, ...]:
    """Truth of every Guyot vine, in order, for an uncut row."""
    chains: dict[int, dict[int, list[tuple[int, Rod]]]] = {}
    arms: dict[int, tuple[int, Rod]] = {}
    for index, rod in row.standing():
        if rod.cane >= 0 and rod.spur == 0:
            chains.setdefault(rod.vine, {}).setdefault(rod.cane, []).append((index, rod))
        elif rod.last_years:
            arms.setdefault(rod.vine, (index, rod))
    out = []
    for vine in sorted(chains):
        lower, upper = sorted(chains[vine], key=lambda cane: float(chains[vine][cane][0][1].start[2]))
        index, arm = arms[vine]
        length = float(np.linalg.norm(arm.end - arm.start))
        out.append(
            GuyotTruth(
                vine=vine,
                lower=lower,
                upper=upper,
                spur_cut=shortening_cut(chains[vine][lower], KEPT_NODES),
                cane_cut=shortening_cut(chains[vine][upper], FRUITING_NODES, fruiting=True),
                removal=right_cut(index, arm, _STUMP, _STUMP + 0.02, length - _BEFORE_SHOOT),
            )
        )
    return tuple(out)
