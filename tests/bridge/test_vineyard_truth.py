"""The judge of cuts, itself judged: against the rule as it is written, rod by rod."""

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from bridge.sim.vineyard.config import VineyardConfig
from bridge.sim.vineyard.grow import grow
from bridge.sim.vineyard.row import Rod, Row
from bridge.sim.vineyard.truth import judge

X, Z = np.array([1.0, 0.0, 0.0]), np.array([0.0, 0.0, 1.0])


def spur_with(radii: list[float], internode: float = 0.08) -> Row:
    """One stub along z with a cane along x every 30 mm; node middles 20 mm out and then an internode apart."""
    stub = Rod("spur", 0 * Z, 0.03 * len(radii) * Z, 0.007, 0.007, -1, 0, 0)
    rods: list[Rod | None] = [stub]
    for cane, radius in enumerate(radii):
        foot, parent, here = 0.03 * (cane + 1) * Z, 0, 0.0
        for middle in 0.02 + internode * np.arange(5):
            for kind, end in (("cane", middle - 0.005), ("node", middle + 0.005)):
                rods.append(Rod(kind, foot + here * X, foot + end * X, radius, radius, parent, 0, 0, cane))
                parent, here = len(rods) - 1, end
    return Row(tuple(rods))


def test_the_lowest_cane_that_is_thick_enough_is_kept():
    (truth,) = judge(spur_with([0.0029, 0.0031, 0.006]))
    assert (truth.canes, truth.keeper, truth.surplus) == (3, 1, (0,))


def test_the_thickest_is_kept_where_none_is_thick_enough():
    (truth,) = judge(spur_with([0.0026, 0.0029, 0.0027]))
    assert truth.keeper == 1


def test_the_cut_is_two_centimetres_past_the_second_count_node():
    (truth,) = judge(spur_with([0.004]))
    assert truth.cut is not None and truth.renewal is None
    # Basal bud at 20 mm, node 1 at 100 mm, node 2 at 180 mm.
    assert np.allclose(truth.cut.best, [0.200, 0.0, 0.03])
    assert np.allclose(truth.nodes[:2, 0], [0.1, 0.18])
    for x, right in ((0.1899, False), (0.1901, True), (0.2099, True), (0.2101, False)):
        assert truth.cut.holds(truth.cut.rod, np.array([x, 0.0, 0.03])) is right
    assert not truth.cut.holds(truth.cut.rod + 1, truth.cut.best)
    assert np.isclose(truth.cut.past_best(np.array([0.193, 0.001, 0.03])), -0.007)


def test_a_short_internode_is_halved():
    (truth,) = judge(spur_with([0.004], internode=0.03))
    assert truth.cut is not None
    assert np.allclose(truth.cut.best, [0.02 + 2.5 * 0.03, 0.0, 0.03])


def test_one_cut_through_the_stub_takes_off_every_cane_beyond_the_keeper():
    row = spur_with([0.004, 0.004, 0.004])
    (truth,) = judge(row)
    assert truth.keeper == 0 and truth.renewal is not None and truth.renewal.rod == 0
    after = row.sever(0, truth.renewal.best[2] / 0.09)
    assert {rod.cane for _, rod in after.standing()} == {-1, 0}


@given(st.integers(0, 2**31))
@settings(max_examples=10, deadline=None)
def test_the_right_cut_leaves_the_basal_bud_and_two_nodes_on_the_keeper(seed):
    row = grow(VineyardConfig(vines=1), seed)
    truths = judge(row)
    assert len(truths) >= 10
    for truth in truths:
        assert truth.cut is not None
        cut = row.rods[truth.cut.rod]
        assert cut is not None and cut.kind == "cane"
        fraction = np.linalg.norm(truth.cut.best - cut.start) / np.linalg.norm(cut.end - cut.start)
        after = row.sever(truth.cut.rod, float(fraction))
        kept = [rod for _, rod in after.standing() if (rod.spur, rod.cane) == (truth.spur, truth.keeper)]
        assert sum(rod.kind == "node" for rod in kept) == 3
        assert truth.cut.holds(truth.cut.rod, truth.cut.best)
