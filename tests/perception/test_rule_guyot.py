import numpy as np
import pytest
from msgspec.structs import replace

from perception.config import RuleConfig
from perception.plant.model import Cane, Node, Spur
from perception.rules.registry import apply_rule

GUYOT = replace(RuleConfig(), system="guyot")
TEN = tuple(0.02 + 0.08 * k for k in range(11))


def cane(nodes, x, height, radius=0.004, length=1.0):
    arc = np.linspace(0.0, length, 201)
    axis = np.array([x, 0.0, height]) + arc[:, None] * np.array([0.0, 0.0, 1.0])
    return Cane(axis, arc, radius, tuple(Node(node, 30) for node in nodes), (), "image border", 0.0)


def spur(*canes, doubt=""):
    return Spur(np.array([0.0, 0.0, 0.9]), None, 0.0, tuple(canes), doubt)


LOWER, UPPER = cane(TEN, 0.0, 0.90), cane(TEN, 0.06, 0.93)


def test_the_lower_cane_keeps_two_nodes_and_the_upper_one_eight():
    decision = apply_rule(spur(UPPER, LOWER), GUYOT)
    assert [(cut.kind, cut.nodes_kept) for cut in decision.cuts] == [("spur cut", 2), ("cane cut", 8)]
    short, long = decision.cuts
    # 20 mm past the second and the eighth node; the basal bud is not counted.
    np.testing.assert_allclose(short.position, [0.0, 0.0, 0.90 + 0.18 + 0.02], atol=1e-9)
    np.testing.assert_allclose(long.position, [0.06, 0.0, 0.93 + 0.66 + 0.02], atol=1e-9)
    assert "person" in decision.abstained[0]


def test_the_operators_numbers_of_nodes_are_kept():
    changed = replace(GUYOT, nodes_kept=1, fruiting_nodes=5)
    assert [cut.nodes_kept for cut in apply_rule(spur(LOWER, UPPER), changed).cuts] == [1, 5]


def test_a_cane_that_leaves_the_view_too_early_is_not_tipped():
    decision = apply_rule(spur(LOWER, cane(TEN[:6], 0.06, 0.93, length=0.45)), GUYOT)
    assert [cut.kind for cut in decision.cuts] == ["spur cut"]
    assert any("only 5 of 8 nodes" in reason for reason in decision.abstained)


@pytest.mark.parametrize("canes", [(), (LOWER,), (LOWER, UPPER, cane(TEN, 0.1, 0.95))])
def test_anything_but_two_canes_is_left_for_a_person(canes):
    decision = apply_rule(spur(*canes), GUYOT)
    assert not decision.cuts and f"{len(canes)} canes" in decision.abstained[0]


def test_doubts_end_in_no_cut():
    assert not apply_rule(spur(LOWER, UPPER, doubt="edge"), GUYOT).cuts
    assert "same height" in apply_rule(spur(LOWER, cane(TEN, 0.06, 0.902)), GUYOT).abstained[0]
    close = apply_rule(spur(LOWER, cane(TEN, 0.01, 0.93)), GUYOT)
    assert not close.cuts and any("another cane passes" in reason for reason in close.abstained)
    thick = apply_rule(spur(LOWER, cane(TEN, 0.06, 0.93, radius=0.009)), GUYOT)
    assert [cut.kind for cut in thick.cuts] == ["spur cut"]


def test_the_spur_rule_is_the_usual_one():
    assert all(cut.kind != "cane cut" for cut in apply_rule(spur(LOWER, UPPER), RuleConfig()).cuts)
