"""Map of the vines over all frames."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from perception.plant.map import PlantMap
from perception.plant.model import Cane, Node, Plant, Span, Spur
from perception.plant.numbering import SpurNumber

NUMBER = SpurNumber(1, 4)
TRUNK = np.array([[0.1, 0.0, 0.5]])


def cane(nodes=(0.02, 0.10, 0.18, 0.26), x=0.0, radius=0.004, length=0.5, **changes):
    arc = np.linspace(0.0, length, 101)
    axis = np.array([x, 0.0, 0.95]) + arc[:, None] * np.array([0.0, 0.0, 1.0])
    values = {"hidden": (), "end": "image border", "base_gap": 0.0, **changes}
    return Cane(axis, arc, radius, tuple(Node(node, 30) for node in nodes), **values)


def plant(*canes, incomplete=""):
    stub = np.array([[0.0, 0.0, 0.91], [0.0, 0.0, 0.97]])
    return Plant((Spur(np.array([0.0, 0.0, 0.94]), stub, 0.007, tuple(canes), incomplete),), TRUNK, ())


def known(*plants) -> PlantMap:
    out = PlantMap()
    for one in plants:
        out.update(one, (NUMBER,))
    return out


def test_a_cane_seen_again_is_one_cane_and_its_measures_are_means():
    looks = [plant(cane(radius=0.004 + d, x=d)) for d in (-0.0004, 0.0, 0.0004)]
    (spur,) = known(*looks).spurs
    (only,) = spur.canes
    assert only.base.count == 3
    assert only.radius.mean[0] == pytest.approx(0.004) and only.radius.covariance[0, 0] > 0.0


def test_a_look_is_as_thick_as_most_looks_say():
    map_, looks = PlantMap(), [0.004, 0.0041, 0.0065, 0.0039]
    told = [map_.update(plant(cane(radius=radius)), (NUMBER,))[0].canes[0] for radius in looks]
    assert [only.observations for only in told] == [1, 2, 3, 4]
    assert told[0].radius == 0.004 and told[2].radius == pytest.approx(0.0041)
    assert told[3].radius == pytest.approx(0.00405) and told[3].nodes == cane().nodes


def test_a_stub_is_what_most_looks_say_also_in_one_that_does_not_show_it():
    def look(axis, radius):
        return Plant((replace(plant(cane()).spurs[0], axis=axis, radius=radius),), TRUNK, ())

    stub = plant().spurs[0].axis
    map_, looks = PlantMap(), [(stub, 0.007), (stub + 0.001, 0.0072), (stub + 0.02, 0.015), (None, 0.0)]
    told = [map_.update(look(*each), (NUMBER,))[0] for each in looks]
    assert told[0].radius == 0.007 and told[2].radius == told[3].radius == pytest.approx(0.0072)
    np.testing.assert_allclose(told[3].axis, stub + 0.001)
    nothing = PlantMap().update(look(None, 0.0), (NUMBER,))[0]
    assert nothing.axis is None and nothing.radius == 0.0


def test_canes_side_by_side_stay_two():
    (spur,) = known(*[plant(cane(), cane(x=0.03))] * 3).spurs
    assert len(spur.canes) == 2 and len(spur.as_spur().canes) == 2


@pytest.mark.parametrize("order", [1, -1])
def test_a_cane_that_sways_is_one_cane_and_never_its_neighbour_which_the_same_frames_show(order):
    """It comes nearer to where its neighbour was than to where it was itself."""
    swings = [0.0, 0.012, 0.02, 0.008, 0.02]
    looks = [plant(*[cane(x=swing, radius=0.004), cane(x=0.03, radius=0.006)][::order]) for swing in swings]
    (spur,) = known(*looks).spurs
    assert [one.base.count for one in spur.canes] == [5, 5]
    assert sorted(one.radius.mean[0] for one in spur.canes) == pytest.approx([0.004, 0.006])


def test_a_cane_that_a_third_of_the_looks_have_shown_is_known_to_be_hidden_in_one_without_it_until_it_is_cut():
    map_, both, one = PlantMap(), plant(cane(), cane(x=0.03)), plant(cane())
    told = [map_.update(each, (NUMBER,))[0] for each in (both, one, one, one, both)]
    assert [[round(float(each.base[0]), 2) for each in spur.hidden] for spur in told] == [[], [0.03], [0.03], [], []]
    assert map_.sever(np.array([0.03, 0.0, 1.1]))
    assert not map_.update(one, (NUMBER,))[0].hidden


def test_a_node_that_one_look_in_three_invents_is_not_believed_and_one_that_it_misses_is():
    right, invented, missed = cane(), cane(nodes=(0.02, 0.10, 0.14, 0.18, 0.26)), cane(nodes=(0.02, 0.18, 0.26))
    (spur,) = known(plant(right), plant(invented), plant(missed)).spurs
    (fused,) = spur.as_spur().canes
    assert [round(node.arc, 3) for node in fused.nodes] == [0.02, 0.10, 0.18, 0.26]


def later(whole, start):
    """The same cane, whose base a frame sees so much farther out (m)."""
    keep = whole.arc >= start - 1e-9
    nodes = tuple(Node(node.arc - start, node.pixels) for node in whole.nodes if node.arc > start)
    hidden = tuple(Span(span.start - start, span.end - start) for span in whole.hidden)
    return replace(whole, axis=whole.axis[keep], arc=whole.arc[keep] - start, nodes=nodes, hidden=hidden)


@settings(max_examples=30)
@given(st.lists(st.integers(0, 3), min_size=1, max_size=12))
def test_nodes_are_the_same_wherever_a_frame_sees_the_base_of_their_cane(starts):
    """Arc lengths are from the median base, and no node is counted twice."""
    map_ = PlantMap()
    whole = cane(nodes=(0.10, 0.18, 0.26))
    for start in starts:
        (told,) = map_.update(plant(later(whole, 0.01 * start)), (NUMBER,))[0].canes
    base = 0.01 * float(np.median(starts))
    (fused,) = map_.spurs[0].as_spur().canes
    for each in (told, fused):
        assert [node.arc for node in each.nodes] == pytest.approx([0.10 - base, 0.18 - base, 0.26 - base], abs=0.002)
        places = [each.at(node.arc)[2] for node in each.nodes]
        assert places == pytest.approx([1.05, 1.13, 1.21], abs=0.001)


def test_a_node_that_was_hidden_counts_also_when_its_base_is_seen_elsewhere_later():
    hides, shows = cane(nodes=(0.10, 0.26), hidden=(Span(0.16, 0.20),)), cane(nodes=(0.10, 0.18, 0.26))
    (spur,) = known(*[plant(later(hides, 0.03))] * 3, *[plant(shows)] * 4).spurs
    assert [round(node.arc, 2) for node in spur.canes[0].as_cane().nodes] == [0.10, 0.18, 0.26]


def test_a_cut_stays_where_it_was_when_the_base_is_seen_elsewhere_later():
    map_, whole = known(plant(cane())), cane()
    assert map_.sever(np.array([0.0, 0.0, 0.95 + 0.20]))
    for _ in range(3):
        map_.update(plant(later(whole, 0.02)), (NUMBER,))
    (fused,) = map_.spurs[0].as_spur().canes
    assert fused.at(fused.length)[2] == pytest.approx(1.15, abs=0.006)
    assert fused.length == pytest.approx(0.18, abs=0.006)


def test_a_node_that_few_frames_show_is_not_of_the_one_that_shows_it():
    right, invented = plant(cane()), plant(cane(nodes=(0.02, 0.10, 0.14, 0.18, 0.26)))
    map_ = known(right, right)
    (told,) = map_.update(invented, (NUMBER,))[0].canes
    assert [round(node.arc, 2) for node in told.nodes] == [0.02, 0.10, 0.18, 0.26]


def test_nodes_beyond_what_the_clearest_look_shows_are_not_put_at_its_end():
    clear, longer = cane(nodes=(0.02, 0.10), length=0.15), cane(hidden=(Span(0.3, 0.4),))
    around = known(plant(clear), plant(longer), plant(longer)).around(np.array([0.0, 0.0, 1.1]), 0.2)
    assert sorted(around.nodes[:, 2]) == pytest.approx([0.97, 1.05])


def test_a_cane_that_one_look_in_three_invents_is_not_believed():
    looks = [plant(cane()), plant(cane(), cane(x=0.04)), plant(cane())]
    (spur,) = known(*looks).spurs
    assert len(spur.as_spur().canes) == 1


def test_the_look_that_hid_less_gives_the_shape():
    hidden = cane(hidden=(Span(0.05, 0.15),), base_gap=0.02)
    (spur,) = known(plant(hidden), plant(cane())).spurs
    (fused,) = spur.as_spur().canes
    assert fused.hidden == () and fused.base_gap == 0.0


def test_what_one_look_hides_and_another_shows_is_known():
    map_, hides = PlantMap(), cane(nodes=(0.02, 0.18, 0.26), hidden=(Span(0.07, 0.13), Span(0.30, 0.36)))
    (alone,) = map_.update(plant(hides), (NUMBER,))[0].canes
    assert alone.hidden == hides.hidden and alone.nodes == hides.nodes
    map_.update(plant(cane(hidden=(Span(0.33, 0.45),))), (NUMBER,))
    (told,) = map_.update(plant(hides), (NUMBER,))[0].canes
    assert [round(node.arc, 2) for node in told.nodes] == [0.02, 0.10, 0.18, 0.26]
    (span,) = told.hidden
    assert span.start == pytest.approx(0.33, abs=0.004) and span.end == pytest.approx(0.36, abs=0.004)


def test_a_node_in_a_hidden_stretch_counts_only_if_enough_of_the_looks_that_show_it_do():
    hides = plant(cane(nodes=(0.02, 0.18), hidden=(Span(0.07, 0.13),)))
    shows, bare = plant(cane(nodes=(0.02, 0.10, 0.18))), plant(cane(nodes=(0.02, 0.18)))
    for looks, nodes in (((shows, bare, bare), 2), ((shows, hides, hides, hides), 3)):
        map_ = known(*looks)
        (told,) = map_.update(hides, (NUMBER,))[0].canes
        assert len(told.nodes) == nodes


def test_after_a_cut_what_lay_beyond_is_gone():
    map_ = known(*[plant(cane())] * 3)
    assert map_.sever(np.array([0.001, 0.0, 0.95 + 0.20]))
    (fused,) = map_.spurs[0].as_spur().canes
    assert fused.length == pytest.approx(0.2, abs=0.006) and fused.end == "free"
    assert [round(node.arc, 2) for node in fused.nodes] == [0.02, 0.10, 0.18]
    assert not map_.sever(np.array([0.5, 0.0, 1.0])), "there is no cane"


def test_a_doubtful_look_does_not_stand_for_a_clear_one():
    (spur,) = known(plant(cane(), incomplete="edge"), plant(cane())).spurs
    assert spur.as_spur().incomplete == ""
    (spur,) = known(plant(cane()), plant(cane(), incomplete="edge")).spurs
    assert spur.as_spur().incomplete == ""


def test_every_known_cane_is_a_line_along_its_axis_also_when_a_later_frame_does_not_show_it():
    both, one = plant(cane(), cane(x=0.06)), plant(cane())
    lines = known(both, both, one).cane_lines()
    assert sorted({place[0] for line in lines for place in line}) == [0.0, 0.06]
    for line in lines:
        np.testing.assert_allclose([line[0][2], line[-1][2]], [0.95, 1.45])
        assert np.all(np.diff([place[2] for place in line]) > 0.0)


def test_what_was_cut_off_is_not_drawn():
    map_ = known(plant(cane()), plant(cane()))
    map_.sever(np.array([0.0, 0.0, 1.10]))
    (line,) = map_.cane_lines()
    assert abs(line[-1][2] - 1.10) < 0.01
    map_.sever(np.array([0.0, 0.0, 0.955]))
    assert map_.cane_lines() == ()


def test_canes_above_their_spur_are_those_that_enough_frames_have_shown_near_by_as_far_as_they_stand():
    here = np.zeros(3)
    map_ = known(*[plant(cane(), cane(x=0.1))] * 4, *[plant(cane())] * 6)
    points = map_.canes_above(0.04, 3, here, 2.0)
    assert points[:, 2].min() > 0.95 + 0.04 and set(np.round(points[:, 0], 3)) == {0.0, 0.1}
    assert len(map_.canes_above(0.04, 3, here, 0.5)) == 0, "they are farther away"
    assert set(map_.canes_above(0.04, 5, here, 2.0)[:, 0]) == {0.0}
    map_ = known(*[plant(cane(), cane(x=0.1))] * 4, *[plant(cane())] * 9)
    assert set(map_.canes_above(0.04, 3, here, 2.0)[:, 0]) == {0.0}, "most frames do not show the other one"
    map_.sever(np.array([0.0, 0.0, 0.95 + 0.20]))
    assert map_.canes_above(0.04, 3, here, 2.0)[:, 2].max() < 0.95 + 0.21
