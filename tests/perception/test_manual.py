"""Points that a person places."""

import numpy as np
import pytest

from perception.config import RuleConfig
from perception.rules.manual import move_cut, place_cut
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
    assert cut.reason == "Placed by Ada: 40 mm past node 2 on this cane." and cut.radius == pytest.approx(0.004)


def test_the_nearer_of_two_canes_is_meant():
    cut, _ = place(0.05, 1.17)
    assert cut.position[0] == pytest.approx(0.06)


@pytest.mark.parametrize(
    ("x", "height", "says"),
    [(0.15, 1.17, "90 mm beside the click: click on a blue line"), (0.5, 1.17, "not been seen yet: drive there")],
)
def test_where_no_cane_is_it_says_what_to_do(x, height, says):
    assert says in place(x, height)


@pytest.mark.parametrize("beside", [-0.009, -0.004, 0.004, 0.009])
def test_a_click_at_a_node_slides_along_the_cane_until_the_blades_have_room(beside):
    node = 0.95 + 0.18
    cut, _ = place(0.0, node + beside)
    assert 0.010 <= abs(cut.position[2] - node) <= 0.0115
    assert np.sign(cut.position[2] - node) == np.sign(beside)


def test_no_slide_leads_past_two_nodes_side_by_side():
    crowded = known(*[plant(cane(nodes=(0.02, 0.10, 0.112, 0.124, 0.136)))] * 3)
    assert "from a node" in place(0.0, 0.95 + 0.118, crowded)
    assert "16 mm or more away along the cane" in place(0.0, 0.95 + 0.118, crowded)


def test_from_afar_a_click_may_be_farther_beside_the_cane():
    far = place_cut(MAP, np.array([-0.04, -3.5, 1.17]), TOWARDS, RULE, (), "Ada")
    assert not isinstance(far, str)
    near = place_cut(MAP, np.array([-0.04, -0.7, 1.17]), TOWARDS, RULE, (), "Ada")
    assert "40 mm beside" in near


def test_a_click_beside_a_wire_slides_away_from_it_as_long_as_that_is_near():
    wire = Capsule("wire", (-1.0, 0.0, 1.18), (1.0, 0.0, 1.18), 0.002, 0.002)
    cut, _ = place(0.0, 1.163, obstacles=(wire,))
    assert cut.position[2] <= 1.18 - 0.002 - RULE.wire_distance + 1e-9


def test_a_wire_a_thick_cane_and_a_cut_one_are_refused():
    wire = Capsule("wire", (-1.0, 0.0, 1.18), (1.0, 0.0, 1.18), 0.002, 0.002)
    assert "wire" in place(0.0, 1.18, obstacles=(wire,))
    assert "thick" in place(0.0, 1.17, known(plant(cane(radius=0.009))))
    cut = known(*[plant(cane())] * 3)
    cut.sever(np.array([0.0, 0.0, 1.10]))
    assert "cut there already" in place(0.0, 1.17, cut)


def move(from_height, along, known_map=MAP, obstacles=()):
    return move_cut(known_map, np.array([0.003, 0.002, from_height]), along, RULE, obstacles, "Ada")


@pytest.mark.parametrize("along", [0.005, -0.01, 0.02])
def test_a_point_is_moved_along_its_cane_and_judged_anew(along):
    cut = move(1.17, along)
    np.testing.assert_allclose(cut.position, [0.0, 0.0, 1.17 + along], atol=1.5e-3)
    assert cut.kind == "by hand" and cut.nodes_kept == 2
    assert cut.offset == pytest.approx(0.04 + along, abs=1.5e-3)
    assert cut.reason.startswith("Moved by Ada: ")


def test_where_it_cannot_be_moved_to_there_is_a_reason():
    assert "from a node" in move(1.17, -0.035)
    assert "cut there already" in move(1.17, 2.0)
    assert "begins there" in move(1.17, -0.5)
    assert "no known cane" in move_cut(MAP, np.array([0.5, 0.0, 1.17]), 0.01, RULE, (), "Ada")


def test_a_cane_behind_the_viewer_is_not_meant():
    assert "not been seen" in place_cut(MAP, np.array([0.0, 0.7, 1.17]), TOWARDS, RULE, (), "Ada")
