"""Points that a person places."""

import numpy as np
import pytest

from perception.config import RuleConfig
from perception.rules.manual import move_cut, place_cut
from rolling_panda import reasons
from rolling_panda.messages.perception import Capsule
from tests.perception.test_plant_map import NUMBER, cane, known, plant

RULE = RuleConfig()
MAP = known(*[plant(cane(), cane(x=0.06))] * 3)
TOWARDS = np.array([0.0, 1.0, 0.0])


def place(x, height, known_map=MAP, obstacles=()):
    return place_cut(known_map, np.array([x, -0.7, height]), TOWARDS, RULE, obstacles, "Ada")


def test_a_click_beside_a_cane_snaps_to_its_axis_and_counts_its_nodes():
    cut, number = place(0.008, 0.95 + 0.22)
    np.testing.assert_allclose(cut.position, [0.0, 0.0, 1.17], atol=1e-3)
    np.testing.assert_allclose(cut.tangent, [0.0, 0.0, 1.0], atol=1e-9)
    # The bud at 20 mm is the basal one and is not counted.
    assert (cut.kind, cut.nodes_kept, cut.nodes_seen, number) == ("by hand", 2, 3, NUMBER)
    assert cut.reason == reasons.placed_past_node("Ada", 1000 * cut.offset, 2) and cut.offset == pytest.approx(
        0.04, abs=5e-4
    )
    assert cut.radius == pytest.approx(0.004)


def test_the_nearer_of_two_canes_is_meant():
    cut, _ = place(0.05, 1.17)
    assert cut.position[0] == pytest.approx(0.06)


@pytest.mark.parametrize(
    ("x", "height", "code"),
    [(0.15, 1.17, "click_beside_cane"), (0.5, 1.17, "row_unseen_there")],
)
def test_where_no_cane_is_it_says_what_to_do(x, height, code):
    refused = place(x, height)
    assert refused.code == code and dict(refused.values).get("distance_mm", 90.0) == pytest.approx(90.0, abs=1.0)


@pytest.mark.parametrize("beside", [-0.009, -0.004, 0.004, 0.009])
def test_a_click_at_a_node_slides_along_the_cane_until_the_blades_have_room(beside):
    node = 0.95 + 0.18
    cut, _ = place(0.0, node + beside)
    assert 0.010 <= abs(cut.position[2] - node) <= 0.0115
    assert np.sign(cut.position[2] - node) == np.sign(beside)


def test_no_slide_leads_past_two_nodes_side_by_side():
    crowded = known(*[plant(cane(nodes=(0.02, 0.10, 0.112, 0.124, 0.136)))] * 3)
    refused = dict(place(0.0, 0.95 + 0.118, crowded).values)
    assert refused["why"].code == "node_too_near" and refused["distance_mm"] == 16.0


def test_from_afar_a_click_may_be_farther_beside_the_cane():
    far = place_cut(MAP, np.array([-0.04, -3.5, 1.17]), TOWARDS, RULE, (), "Ada")
    assert isinstance(far, tuple)
    near = place_cut(MAP, np.array([-0.04, -0.7, 1.17]), TOWARDS, RULE, (), "Ada")
    assert near.code == "click_beside_cane" and dict(near.values)["distance_mm"] == pytest.approx(40.0)


def test_a_click_beside_a_wire_slides_away_from_it_as_long_as_that_is_near():
    wire = Capsule("wire", (-1.0, 0.0, 1.18), (1.0, 0.0, 1.18), 0.002, 0.002)
    cut, _ = place(0.0, 1.163, obstacles=(wire,))
    assert cut.position[2] <= 1.18 - 0.002 - RULE.wire_distance + 1e-9


def test_a_wire_a_thick_cane_and_a_cut_one_are_refused():
    wire = Capsule("wire", (-1.0, 0.0, 1.18), (1.0, 0.0, 1.18), 0.002, 0.002)
    away = dict(place(0.0, 1.18, obstacles=(wire,)).values)
    assert away == {"why": reasons.wire_passes_there(1000 * RULE.wire_distance), "distance_mm": 16.0}
    assert place(0.0, 1.17, known(plant(cane(radius=0.009)))) == reasons.click_elsewhere(
        reasons.cane_beyond_shears(18.0), 16.0
    )
    cut = known(*[plant(cane())] * 3)
    cut.sever(np.array([0.0, 0.0, 1.10]))
    assert dict(place(0.0, 1.17, cut).values)["why"] == reasons.cut_there_already()


def move(from_height, along, known_map=MAP, obstacles=()):
    return move_cut(known_map, np.array([0.003, 0.002, from_height]), along, RULE, obstacles, "Ada")


@pytest.mark.parametrize("along", [0.005, -0.01, 0.02])
def test_a_point_is_moved_along_its_cane_and_judged_anew(along):
    cut = move(1.17, along)
    np.testing.assert_allclose(cut.position, [0.0, 0.0, 1.17 + along], atol=1.5e-3)
    assert cut.kind == "by hand" and cut.nodes_kept == 2
    assert cut.offset == pytest.approx(0.04 + along, abs=1.5e-3)
    assert cut.reason == reasons.moved_past_node("Ada", 1000 * cut.offset, 2)


def test_where_it_cannot_be_moved_to_there_is_a_reason():
    assert move(1.17, -0.035).code == "node_too_near"
    assert move(1.17, 2.0) == reasons.cut_there_already()
    assert move(1.17, -0.5) == reasons.cane_begins_there()
    assert move_cut(MAP, np.array([0.5, 0.0, 1.17]), 0.01, RULE, (), "Ada") == reasons.on_no_cane()


def test_a_cane_behind_the_viewer_is_not_meant():
    assert place_cut(MAP, np.array([0.0, 0.7, 1.17]), TOWARDS, RULE, (), "Ada") == reasons.row_unseen_there()
