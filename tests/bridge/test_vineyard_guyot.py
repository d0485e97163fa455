"""Guyot vines and where they are cut."""

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from bridge.sim.vineyard.config import VineyardConfig
from bridge.sim.vineyard.grow import grow
from bridge.sim.vineyard.truth import judge, judge_guyot, staying_rods

GUYOT = VineyardConfig(training="guyot")
seeds = st.integers(0, 2**31)
some = settings(max_examples=10, deadline=None)


@given(seeds)
@some
def test_a_vine_has_a_spur_of_two_canes_and_eight_shoots_on_the_cane_that_was_laid_down(seed):
    row = grow(GUYOT, seed)
    for vine in range(GUYOT.vines):
        sites = {(rod.spur, rod.cane) for _, rod in row.standing() if rod.vine == vine and rod.cane >= 0}
        assert sites == {(0, 0), (0, 1), *((k, 0) for k in range(1, 9))}
        arm = [rod for _, rod in row.standing() if rod.vine == vine and rod.kind == "cordon"]
        assert all(2 * rod.start_radius <= 0.0141 for rod in arm), "the shears can take the old cane off"
        assert abs(arm[-1].end[0] - arm[0].start[0]) < GUYOT.vine_spacing


@given(seeds)
@some
def test_the_three_right_cuts_leave_two_nodes_eight_nodes_and_no_old_cane(seed):
    row = grow(GUYOT, seed)
    for truth in judge_guyot(row):
        cuts = [cut for cut in (truth.spur_cut, truth.cane_cut, truth.removal) if cut is not None]
        assert truth.spur_cut is not None
        after = row
        for cut in cuts:
            rod = after.rods[cut.rod]
            assert rod is not None
            fraction = float(np.linalg.norm(cut.best - rod.start) / np.linalg.norm(rod.end - rod.start))
            assert 0.0 < fraction < 1.0
            after = after.sever(cut.rod, fraction)
        left = [rod for _, rod in after.standing() if rod.vine == truth.vine]
        assert not [rod for rod in left if rod.spur > 0], "no shoot of the old cane stays"
        nodes = {
            cane: sum(rod.kind == "node" and (rod.spur, rod.cane) == (0, cane) for rod in left)
            for cane in (truth.lower, truth.upper)
        }
        # The basal bud stays too and is not counted.
        assert nodes[truth.lower] == 3
        assert truth.cane_cut is None or nodes[truth.upper] == 9


def test_shoots_without_a_stub_are_not_judged_as_spurs():
    assert {(truth.vine, truth.spur) for truth in judge(grow(GUYOT, 1))} == {(0, 0), (1, 0), (2, 0)}


def test_two_nodes_of_the_lower_cane_stay_and_eight_of_the_upper_one():
    row = grow(GUYOT, 1)
    staying = [row.rods[number] for number in staying_rods(row, guyot=True)]
    for truth in judge_guyot(row):
        own = [rod for rod in staying if rod.vine == truth.vine]
        assert {(rod.spur, rod.cane) for rod in own} == {(0, truth.lower), (0, truth.upper)}
        nodes = [sum(rod.kind == "node" for rod in own if rod.cane == cane) for cane in (truth.lower, truth.upper)]
        # With the basal bud, which is not counted.
        assert truth.cane_cut is not None and nodes == [3, 9]
