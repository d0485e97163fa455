"""What was severed is judged by the simulator's truth, not by where the program wanted to cut."""

import numpy as np
import pytest

from benchmarks.control.cut_truth import true_cut, wanted_cuts
from bridge.sim.vineyard.config import VineyardConfig
from bridge.sim.vineyard.grow import grow
from bridge.sim.vineyard.truth import judge

ROW = grow(VineyardConfig(vines=1), 11)
TRUTHS, WANTED = judge(ROW), wanted_cuts(ROW)
WITH_RENEWAL = next(truth for truth in TRUTHS if truth.cut is not None and truth.renewal is not None)


def piece(truth, kind, point, cane=-1):
    return {"vine": truth.vine, "spur": truth.spur, "cane": cane, "kind": kind, "point": list(map(float, point))}


@pytest.mark.parametrize(("along", "right", "harm"), [(0.0, True, False), (-0.06, False, True), (0.3, False, False)])
def test_a_cut_on_the_cane_that_stays(along, right, harm):
    cut = WITH_RENEWAL.cut
    result = true_cut(WANTED, [piece(WITH_RENEWAL, "cane", cut.best + along * cut.tangent, WITH_RENEWAL.keeper)])
    assert (result.right, bool(result.harm)) == (right, harm)


def test_the_stub_beyond_the_cane_that_stays_may_go_and_below_it_not():
    cut = WITH_RENEWAL.renewal
    assert true_cut(WANTED, [piece(WITH_RENEWAL, "spur", cut.best)]).right
    below = true_cut(WANTED, [piece(WITH_RENEWAL, "spur", cut.least - 0.01 * cut.tangent)])
    assert not below.right and "stays" in below.harm


def test_another_cane_is_neither_right_nor_harm_and_one_harm_outweighs_what_is_right():
    cut, other = WITH_RENEWAL.cut, WITH_RENEWAL.keeper + 50
    assert true_cut(WANTED, [piece(WITH_RENEWAL, "cane", cut.best, other)]) == true_cut(WANTED, [])
    both = [piece(WITH_RENEWAL, "cane", cut.best + np.array(d) * cut.tangent, WITH_RENEWAL.keeper) for d in (0, -0.06)]
    result = true_cut(WANTED, both)
    assert not result.right and result.harm
