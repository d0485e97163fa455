"""The judge of points on Guyot vines."""

import numpy as np
import pytest
from msgspec.structs import replace

from benchmarks.perception.guyot_judge import GuyotJudge
from bridge.sim.vineyard.config import VineyardConfig
from bridge.sim.vineyard.grow import grow
from bridge.sim.vineyard.truth import judge_guyot
from rolling_panda.messages.types import CutKind
from tests.benchmarks.test_bench_perception import point

ROW = grow(VineyardConfig(vines=2, training="guyot"), 11)
TRUTHS = [truth for truth in judge_guyot(ROW) if truth.spur_cut is not None and truth.cane_cut is not None]


def judged(place, tangent, kind: CutKind):

    return GuyotJudge(ROW, 11).point(replace(point(place, tangent), kind=kind))


@pytest.mark.parametrize("past", [0.0, 0.006, -0.006])
def test_right_cuts_of_both_canes_leave_two_and_eight_nodes(past):
    assert TRUTHS
    for truth in TRUTHS:
        for kind, cut, nodes in (("spur cut", truth.spur_cut, 2), ("cane cut", truth.cane_cut, 8)):
            told = judged(cut.best + past * cut.tangent, cut.tangent, kind)
            assert told.right_cane and told.right and told.nodes_left == nodes
            assert (told.vine, told.kind) == (truth.vine, kind)
            assert told.along_error == pytest.approx(past, abs=1e-9)


def test_the_cut_of_one_cane_on_the_other_is_on_the_wrong_cane():
    for truth in TRUTHS:
        told = judged(truth.spur_cut.best, truth.spur_cut.tangent, "cane cut")
        assert not told.right_cane and not told.right and told.along_error is None


def test_a_cut_past_the_next_node_leaves_too_many():
    truth = TRUTHS[0]
    told = judged(truth.spur_cut.best + 0.09 * truth.spur_cut.tangent, truth.spur_cut.tangent, "spur cut")
    assert told.right_cane and not told.right and told.nodes_left > 2


def test_a_removal_is_right_on_the_stretch_beside_the_head_and_nowhere_else():
    for truth in TRUTHS:
        cut = truth.removal
        for place in (cut.least, cut.best, cut.most):
            told = judged(place, cut.tangent, "removal")
            assert told.right and told.right_cane and (told.vine, told.kind) == (truth.vine, "removal")
        assert judged(cut.best, cut.tangent, "removal").along_error == pytest.approx(0.0, abs=1e-9)
        nearer = judged(cut.least - 0.005 * cut.tangent, cut.tangent, "removal")
        assert nearer.right_cane and not nearer.right
        beyond = judged(cut.most + 0.005 * cut.tangent, cut.tangent, "removal")
        assert not beyond.right, "the first shoot would stay"
        # The next rod of the same old cane, a cane of the spur, and a spur cut at the right place.
        following = next(rod for _, rod in ROW.standing() if rod.parent == cut.rod and rod.last_years)
        for place, tangent, kind in (
            (following.at(0.5)[0], following.end - following.start, "removal"),
            (truth.spur_cut.best, truth.spur_cut.tangent, "removal"),
            (cut.best, cut.tangent, "spur cut"),
        ):
            other = judged(place, tangent / np.linalg.norm(tangent), kind)
            assert not other.right_cane and not other.right and other.along_error is None


def test_what_nobody_has_seen_is_hidden_and_counted_all_the_same():
    seen = GuyotJudge(ROW, 11)
    assert len(seen.spurs()) >= 2 * len(TRUTHS)
    assert {seen.visibility(*place) for place in seen.spurs()} == {"hidden"}
    assert {seen.kind(number) for _, number in seen.spurs()} == {"spur cut", "cane cut", "removal"}
