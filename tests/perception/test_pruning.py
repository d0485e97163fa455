from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from perception.config import RuleConfig
from perception.plant.model import Cane, Node, Span, Spur
from perception.rules.keep_out import NO_KEEP_OUT, KeepOut
from perception.rules.pruning import Decision, apply_rule, choose_keeper, count_nodes, cut_arc, cutting_force
from rolling_panda import reasons
from rolling_panda.commands import SURE
from rolling_panda.messages import Reason

RULE = RuleConfig()
WIRE = reasons.wire_near_cut(6.0)


def cane(nodes=(0.02, 0.10, 0.18, 0.26), length=0.5, radius=0.004, base=(0.0, 0.0, 1.0), **changes):
    arc = np.linspace(0.0, length, 101)
    axis = np.array(base) + arc[:, None] * np.array([0.0, 0.0, 1.0])
    values = {"hidden": (), "end": "image border", "base_gap": 0.0, **changes}
    return Cane(axis, arc, radius, tuple(Node(node, 30) for node in nodes), **values)


def spur(*canes):
    stub = np.array([[0.0, 0.0, 0.92], [0.0, 0.0, 0.99]])
    return Spur(np.array([0.0, 0.0, 0.95]), stub, 0.007, tuple(canes))


def test_a_single_cane_is_cut_two_centimetres_past_the_second_count_node():
    decision = apply_rule(spur(cane()), RULE)
    (cut,) = decision.cuts
    assert cut.kind == "spur cut" and not decision.undecided
    np.testing.assert_allclose(cut.position, [0.0, 0.0, 1.20], atol=1e-9)
    np.testing.assert_allclose(cut.tangent, [0.0, 0.0, 1.0], atol=1e-9)
    assert (cut.nodes_seen, cut.nodes_kept) == (3, 2)
    assert cut.reason == reasons.spur_cut_only(reasons.past_node(1000 * cut.offset, 2))
    assert cut.offset == pytest.approx(0.02)


def test_a_short_internode_is_halved():
    assert cut_arc(cane(nodes=(0.02, 0.10, 0.18, 0.214)), RULE) == pytest.approx(0.197)


def test_an_unseen_basal_bud_changes_nothing():
    assert cut_arc(cane(nodes=(0.10, 0.18, 0.26)), RULE) == cut_arc(cane(), RULE)


def test_a_spur_that_was_not_seen_enough_stays_undecided():
    assert cut_arc(cane(nodes=(0.02, 0.1)), RULE) == reasons.nodes_lacking(1, 2)
    assert cut_arc(cane(nodes=(0.02, 0.1, 0.18), length=0.19), RULE) == reasons.beyond_node_hidden(2)
    pruned = cut_arc(cane(nodes=(0.02, 0.1, 0.18), length=0.2, end="free"), RULE)
    assert pruned.code == "pruned_already" and dict(pruned.values) == {"distance_mm": pytest.approx(20.0), "node": 2}
    assert cut_arc(cane(nodes=(0.02, 0.1, 0.22), hidden=(Span(0.15, 0.17),)), RULE) == reasons.node_may_be_hidden()
    assert cut_arc(cane(hidden=(Span(0.195, 0.205),)), RULE) == reasons.cut_place_hidden()
    assert cut_arc(cane(nodes=(0.02, 0.1, 0.12, 0.2)), RULE) == reasons.nodes_side_by_side()
    assert cut_arc(cane(base_gap=0.03), RULE) == reasons.cane_base_hidden()
    assert apply_rule(spur(), RULE) == Decision((), (reasons.no_cane_followed(),))
    edge = reasons.spur_at_image_edge()
    assert apply_rule(replace(spur(cane()), incomplete=edge), RULE) == Decision((), (edge,))
    assert apply_rule(spur(cane(radius=0.009)), RULE).undecided == (reasons.cane_beyond_shears(18.0),)


def test_nodes_too_near_or_too_far_apart_are_not_counted():
    """One of them may be another cane's where they cross; or one between them was taken for something else."""
    assert cut_arc(cane(nodes=(0.02, 0.1, 0.145, 0.2)), RULE) == reasons.nodes_side_by_side()
    assert cut_arc(cane(nodes=(0.02, 0.1, 0.26)), RULE) == reasons.nodes_far_apart()
    assert cut_arc(cane(nodes=(0.02, 0.18, 0.26)), RULE) == reasons.nodes_far_apart()
    assert cut_arc(cane(nodes=(0.19, 0.26)), RULE) == reasons.nodes_far_apart()
    near_the_cut = cut_arc(cane(nodes=(0.02, 0.1, 0.18, 0.225)), RULE)
    assert near_the_cut == cut_arc(cane(nodes=(0.02, 0.1, 0.18, 0.32)), RULE) == pytest.approx(0.2)


def test_a_hidden_stretch_too_short_for_a_node_is_no_reason():
    assert cut_arc(cane(hidden=(Span(0.12, 0.13),)), RULE) == cut_arc(cane(), RULE)


def test_the_keeper_is_the_lowest_thick_cane_else_the_thickest():
    low, high = cane(base=(0.02, 0.0, 0.93)), cane(radius=0.006, base=(0.0, 0.0, 0.99))
    assert choose_keeper(spur(high, low), RULE).cane is low
    thin = cane(radius=0.0026, base=(0.02, 0.0, 0.93))
    assert choose_keeper(spur(high, thin), RULE).cane is high
    thinner = cane(radius=0.0022, base=(0.0, 0.0, 0.99))
    assert choose_keeper(spur(thin, thinner), RULE).cane is thin


def test_a_cane_that_this_picture_hides_counts_in_the_choice():
    low, high = cane(base=(0.02, 0.0, 0.93)), cane(base=(0.0, 0.0, 0.99))
    assert apply_rule(replace(spur(high), hidden=(low,)), RULE) == Decision(undecided=(reasons.cane_base_hidden(),))
    (only,) = apply_rule(replace(spur(low), hidden=(high,)), RULE).cuts
    assert only.kind == "spur cut" and only.reason.code == "spur_cut_lowest"


def test_the_lowest_cane_is_lowest_where_it_leaves_the_spur_not_where_a_picture_first_shows_it():
    upper = cane(base=(0.02, 0.0, 1.03))
    lower = cane()
    # The picture shows the lower one from 50 mm on, and it leans to the side.
    begin = lower.arc >= 0.05
    leaning = lower.axis + np.outer(0.2 * lower.arc, [1.0, 0.0, 0.0])
    hidden = replace(lower, axis=leaning[begin], arc=lower.arc[begin])
    assert hidden.base[2] > upper.base[2] and hidden.origin == pytest.approx([0.0, 0.0, 1.0], abs=2e-3)
    assert choose_keeper(spur(upper, hidden), RULE).cane is hidden
    level = cane(base=(0.02, 0.0, 1.0))
    assert choose_keeper(spur(level, hidden), RULE) == reasons.canes_at_same_height()
    # Where it is seen from farther down than by other pictures, those tell.
    early = lower.shifted(-0.04)
    assert early.origin == pytest.approx([0.0, 0.0, 1.04], abs=1e-6)
    assert choose_keeper(spur(upper, early), RULE).cane is upper


def test_a_choice_within_the_noise_is_no_choice():
    doubtful = cane(radius=0.00305, base=(0.02, 0.0, 0.93))
    assert choose_keeper(spur(doubtful, cane(base=(0.0, 0.0, 0.99))), RULE) == reasons.low_cane_near_limit()
    twins = cane(base=(0.02, 0.0, 0.97)), cane(base=(-0.02, 0.0, 0.972))
    assert choose_keeper(spur(*twins), RULE) == reasons.canes_at_same_height()


def test_the_old_stub_goes_in_one_cut_beyond_the_keeper():
    low = cane(base=(0.025, 0.0, 0.93))
    decision = apply_rule(spur(low, cane(base=(0.0, 0.0, 0.99))), RULE)
    assert [cut.kind for cut in decision.cuts] == ["spur cut", "renewal cut"]
    position = decision.cuts[1].position
    assert 0.93 < position[2] < 0.99 and abs(position[0]) < 1e-9


def test_the_old_stub_goes_whether_or_not_the_cut_of_the_keeper_is_known():
    high = cane(base=(0.0, 0.0, 0.99))
    pruned = cane(nodes=(0.02, 0.10, 0.18), base=(0.025, 0.0, 0.93), length=0.205, end="free")
    unclear = cane(nodes=(0.02, 0.10, 0.12, 0.18), base=(0.025, 0.0, 0.93))
    whole = apply_rule(spur(cane(base=(0.025, 0.0, 0.93)), high), RULE).cuts[1]
    for keeper, why in ((pruned, "pruned_already"), (unclear, "nodes_side_by_side")):
        decision = apply_rule(spur(keeper, high), RULE)
        (cut,) = decision.cuts
        assert cut.kind == "renewal cut" and [reason.code for reason in decision.undecided] == [why]
        np.testing.assert_allclose(cut.position, whole.position)
        assert cut.confidence < SURE, "nobody accepts it without a look"
    hidden = replace(unclear, base_gap=0.03)
    decision = apply_rule(spur(hidden, high), RULE)
    assert not decision.cuts and decision.undecided == (reasons.cane_base_hidden(),) and not decision.contradicted
    assert decision.about(reasons.cane_base_hidden()) == {"spur cut"}


def leaving(base, angle, towards=1.0, deep=0.0):
    """A cane that leaves its stub at an angle (rad) along the row, or `deep` across it."""
    arc = np.linspace(0.0, 0.5, 101)
    direction = np.array([towards * np.sin(angle), deep * np.sin(angle), np.cos(angle)])
    nodes = tuple(Node(node, 30) for node in (0.02, 0.10, 0.18, 0.26))
    return Cane(np.array(base) + arc[:, None] * direction, arc, 0.004, nodes, (), "image border", 0.0)


@pytest.mark.parametrize("towards", [1.0, -1.0])
def test_a_stub_goes_where_leaning_blades_pass_the_cane_that_stays(towards):
    above = cane(base=(0.0, 0.0, 0.972))
    wide, steep = (spur(leaving((0.0, 0.0, 0.941), angle, towards), above) for angle in (0.8, 0.3))
    assert [cut.kind for cut in apply_rule(wide, RULE).cuts] == ["spur cut", "renewal cut"]
    upright = RuleConfig(blade_lean=1e-6, blade_tilt=1e-6)
    for seen, rule in ((steep, RULE), (wide, upright)):
        decision = apply_rule(seen, rule)
        assert [cut.kind for cut in decision.cuts] == ["spur cut"]
        assert decision.undecided == (reasons.other_cane_left(reasons.shears_touch_keeper()),)


@pytest.mark.parametrize("deep", [1.0, -1.0])
def test_a_stub_goes_where_tilted_blades_pass_a_cane_that_leaves_across_the_row(deep):
    seen = spur(leaving((0.0, 0.0, 0.941), 0.8, 0.0, deep), cane(base=(0.0, 0.0, 0.972)))
    assert [cut.kind for cut in apply_rule(seen, RULE).cuts] == ["spur cut", "renewal cut"]
    level = apply_rule(seen, RuleConfig(blade_turn=1e-6, blade_tilt=1e-6))
    assert level.undecided == (reasons.other_cane_left(reasons.shears_touch_keeper()),)


def test_a_cut_where_another_cane_crosses_is_left_alone():
    crossing = np.array([[0.1 * k - 0.5, 0.008, 1.2] for k in range(11)])
    assert apply_rule(spur(cane()), RULE, crossing).undecided == (reasons.cane_crosses_cut(),)
    assert apply_rule(spur(cane()), RULE, crossing + [0.0, 0.03, 0.0]).cuts
    assert apply_rule(spur(cane()), RULE, np.zeros((0, 3))).cuts


def test_a_cut_gives_way_to_a_cane_or_a_wire_that_crosses_a_little_off_and_stays_on_its_internode():
    for side in (-1, 1):
        crossing = np.array([[0.1 * k - 0.5, 0.008, 1.2 + side * 0.010] for k in range(11)])
        (cut,) = apply_rule(spur(cane()), RULE, crossing).cuts
        assert 0.0 < (1.2 - cut.position[2]) * side <= RULE.max_shift + 1e-9
        assert np.linalg.norm(crossing - cut.position, axis=1).min() >= RULE.crossing_distance
    (cut,) = apply_rule(spur(cane()), RULE, None, wire_from(1.196, 1.214)).cuts
    assert cut.position[2] == pytest.approx(1.2 - RULE.max_shift / 2)
    assert cut.reason == reasons.spur_cut_only(reasons.past_node(1000 * cut.offset, 2))
    assert cut.offset == pytest.approx(0.020 - RULE.max_shift / 2)
    assert apply_rule(spur(cane()), RULE, None, wire_from(0.0, 9.0)).undecided == (WIRE,)


@pytest.mark.parametrize(("tight", "best"), [((1.19, 1.203), 1.20425), ((1.197, 1.21), 1.19575), ((1.1, 1.3), 1.2)])
def test_where_the_blades_only_just_have_room_a_better_place_nearby_is_taken(tight, best):
    beside = KeepOut(lambda place: None, lambda place, tangent: not tight[0] < place[2] < tight[1])
    (cut,) = apply_rule(spur(cane()), RULE, None, beside).cuts
    assert cut.position[2] == pytest.approx(best)


def wire_from(low, high):
    return KeepOut(lambda place: WIRE if low < place[2] < high else None, lambda place, tangent: True)


def room_of(*canes, **around):
    """How far the spur cut may be made before its place and past it (mm)."""
    cut = apply_rule(spur(*canes), RULE, **around).cuts[0]
    return pytest.approx((1000 * cut.inward, 1000 * cut.outward), abs=0.1)


def test_where_the_blades_have_no_room_the_cut_may_be_made_a_little_nearer_or_farther_out():
    assert room_of(cane()) == (5.0, 7.0)
    # A node 32.5 mm past the last kept one: the cut is midway, and stays 10 mm from both.
    assert room_of(cane(nodes=(0.02, 0.10, 0.18, 0.2125))) == (5.0, 6.0)
    assert room_of(cane(hidden=(Span(0.212, 0.26),))) == (5.0, 4.0)
    assert room_of(cane(nodes=(0.02, 0.10, 0.18), length=0.212, end="hidden")) == (5.0, 3.0)
    assert room_of(cane(), keep_out=wire_from(1.2035, 1.3)) == (5.0, 3.0)
    crossing = np.array([[0.1 * k - 0.5, 0.0, 1.182] for k in range(11)])
    assert room_of(cane(), other_canes=crossing) == (3.0, 7.0)
    # Where the cut has been shifted inwards by 8.5 mm already, it is not shifted farther, but back.
    assert room_of(cane(), keep_out=wire_from(1.194, 1.209)) == (0.0, 2.0)


def test_a_stub_may_be_cut_farther_out_but_not_near_the_next_cane():
    low, high = leaving((0.010, 0.0, 0.94), np.pi / 4), cane(base=(0.0, 0.0, 0.98))
    cut = apply_rule(spur(low, high), RULE).cuts[1]
    assert cut.inward == 0.0
    assert cut.position[2] + cut.outward == pytest.approx(0.93 + 0.8 * 0.05, abs=0.0015)


def test_blades_keep_10_mm_from_the_nodes():
    # Midway between nodes 30 mm apart; a cane crosses there, and to either side a node is too near.
    tight = cane(nodes=(0.02, 0.10, 0.18, 0.212))
    crossing = np.array([[0.0, 0.0145, 1.196]])
    assert apply_rule(spur(tight), RULE).cuts
    assert all(cut.node_distance >= RULE.node_distance for cut in apply_rule(spur(tight), RULE, crossing).cuts)
    nearer = replace(tight, nodes=(*tight.nodes[:3], Node(0.198, 30)))
    assert not apply_rule(spur(nearer), RULE).cuts


def test_a_diameter_seen_often_leaves_less_in_doubt():
    near = [cane(radius=0.00311, base=(0.02, 0.0, 0.93)), cane(base=(0.0, 0.0, 0.99))]
    assert choose_keeper(spur(*near), RULE) == reasons.low_cane_near_limit()
    often = [replace(each, observations=9) for each in near]
    assert choose_keeper(spur(*often), RULE).cane is often[0]
    once = choose_keeper(spur(often[0], near[1]), RULE)
    assert once == reasons.low_cane_near_limit(), "one of them was seen once only"


@pytest.mark.parametrize(
    ("low", "high", "turns_on"),
    [
        (0.0031, 0.0045, 0.2),  # The low one is hardly thick enough.
        (0.0029, 0.0045, 0.2),  # It is hardly too thin.
        (0.0028, 0.0027, 0.2),  # Both are too thin, and about as thick.
        (0.00305, 0.00295, 0.2),  # A little thinner, the low one would still be the thickest.
        (0.00308, 0.00225, None),  # So it would be in any case here.
        (0.0032, 0.0045, None),
        (0.0028, 0.0045, None),
        (0.0028, 0.0024, None),
        (0.0038, 0.0040, None),
        (0.0026, 0.00292, None),  # The high one stays whether it is thick enough or not.
    ],
)
def test_a_choice_that_little_thickness_turns_over_is_unsure_removes_no_other_cane_and_says_so(low, high, turns_on):
    """So nobody accepts it with all sure cuts of a vine at once, and no cane is gone that should have stayed."""
    canes = [cane(radius=low, base=(0.02, 0.0, 0.93)), cane(radius=high, base=(0.0, 0.0, 0.99))]
    decision = apply_rule(spur(*(replace(each, observations=9) for each in canes)), RULE)
    shorten = decision.cuts[0]
    assert shorten.kind == "spur cut" and (shorten.confidence < SURE) == (turns_on is not None)
    told = dict(shorten.reason.values).get("difference_mm")
    if turns_on is None:
        assert told is None and "keeper_close" not in repr(decision.undecided)
    else:
        assert told == pytest.approx(turns_on)
        assert len(decision.cuts) == 1 and decision.contradicted == {"renewal cut"}
        assert decision.undecided == (reasons.other_cane_left(reasons.keeper_close(told)),)


def test_what_speaks_against_a_cut_is_told_apart_from_what_shows_too_little():
    low, high = cane(base=(0.025, 0.0, 0.93)), cane(base=(0.0, 0.0, 0.99))
    for nodes in ((0.02, 0.10, 0.12, 0.18), (0.02, 0.1, 0.26)):
        assert apply_rule(spur(replace(low, nodes=cane(nodes=nodes).nodes), high), RULE).contradicted == {"spur cut"}
    # Its axis comes out of the stub below that of the keeper, though it is seen from farther up.
    below = apply_rule(spur(low, leaving((0.02, 0.0, 0.944), 0.5)), RULE)
    assert below.undecided == (reasons.other_cane_left(reasons.cane_below_keeper()),)
    assert below.contradicted == {"renewal cut"}
    for unseen in (replace(low, base_gap=0.03), cane(nodes=(0.02, 0.10), base=(0.025, 0.0, 0.93))):
        decision = apply_rule(spur(unseen, high), RULE)
        assert decision.undecided and not decision.contradicted
    assert not apply_rule(spur(low, high), RULE).contradicted


def test_a_cane_that_runs_into_another_is_cut_where_enough_of_it_is_seen_and_a_pruned_one_never_again():
    going_on = cane(nodes=(0.02, 0.10, 0.18), length=0.212, end="hidden")
    assert cut_arc(going_on, RULE) == pytest.approx(0.20)
    assert cut_arc(replace(going_on, end="free"), RULE).code == "pruned_already"
    assert cut_arc(cane(nodes=(0.02, 0.10, 0.18), length=0.205, end="hidden"), RULE) == reasons.beyond_node_hidden(2)


def test_a_stub_is_not_cut_where_the_blades_must_not_go():
    low, high = cane(base=(0.025, 0.0, 0.93)), cane(base=(0.0, 0.0, 0.99))
    near = reasons.wood_near_cut("cordon", 30.0)
    cordon = KeepOut(lambda place: near if place[2] < 1.0 else None, lambda place, tangent: True)
    decision = apply_rule(spur(low, high), RULE, None, cordon)
    assert [cut.kind for cut in decision.cuts] == ["spur cut"] and decision.undecided == (
        reasons.other_cane_left(near),
    )


def test_a_stub_may_be_thicker_than_a_cane_but_not_than_the_shears_take():
    low, high = cane(base=(0.025, 0.0, 0.93)), cane(base=(0.0, 0.0, 0.99))
    thick, thicker = (replace(spur(low, high), radius=radius) for radius in (0.0095, 0.0105))
    assert [cut.kind for cut in apply_rule(thick, RULE).cuts] == ["spur cut", "renewal cut"]
    assert apply_rule(thicker, RULE).undecided == (reasons.other_cane_left(reasons.stub_beyond_shears(21.0)),)


def test_a_stub_is_cut_midway_between_where_its_canes_come_out_of_it():
    """Both are seen from the bark on: the lower one leaves at 45°, so that its axis comes out 10 mm farther down."""
    low, high = leaving((0.010, 0.0, 0.94), np.pi / 4), cane(base=(0.0, 0.0, 0.98))
    cut = apply_rule(spur(low, high), RULE).cuts[1]
    assert cut.position[2] == pytest.approx((0.93 + 0.98) / 2, abs=1e-3)


@pytest.mark.parametrize("hidden", [4, 8, 16])
def test_a_stub_is_cut_by_where_all_pictures_have_the_bases_of_its_canes(hidden):
    """One picture may show the lower cane from 20, 40 or 80 mm on alone, above the base of the upper one."""
    low, high = leaving((0.0, 0.0, 0.93), 0.8), cane(base=(0.0, 0.0, 0.99))
    partly = replace(low, axis=low.axis[hidden:], arc=low.arc[hidden:])
    (_, whole), (_, cut) = apply_rule(spur(low, high), RULE).cuts, apply_rule(spur(partly, high), RULE).cuts
    np.testing.assert_allclose(cut.position, whole.position, atol=1e-3)


def test_a_cane_that_goes_on_along_its_stub_grows_from_below_the_end_of_it():
    """The stub ends at 0.99 m and has a radius of 7 mm. What is seen of the cane begins at the end, or past it."""
    low = leaving((0.010, 0.0, 0.94), np.pi / 4)
    for seen_from in (0.99, 1.0, 1.02):
        (_, renewal) = apply_rule(spur(low, cane(base=(0.0, 0.0, seen_from))), RULE).cuts
        assert renewal.position[2] == pytest.approx((0.93 + 0.983) / 2, abs=0.001)


def test_a_cane_below_the_keeper_is_left_for_a_person():
    thin = cane(radius=0.0025, base=(0.02, 0.0, 0.93))
    decision = apply_rule(spur(thin, cane(base=(0.0, 0.0, 0.99))), RULE)
    assert len(decision.cuts) == 1
    assert decision.undecided == (reasons.other_cane_left(reasons.cane_below_keeper()),)


internodes = st.lists(st.floats(0.012, 0.12), min_size=0, max_size=8)


@settings(max_examples=60, deadline=None)
@given(basal=st.floats(0.01, 0.04), gaps=internodes, length=st.floats(0.05, 1.0), at=st.floats(0.0, 0.6))
def test_a_cut_lies_between_its_nodes_and_never_past_what_was_seen(basal, gaps, length, at):
    arcs = [arc for arc in np.cumsum([basal, *gaps]) if arc < length]
    hidden = (Span(at, at + 0.02),) if at + 0.02 < length else ()
    seen = cane(nodes=arcs, length=length, hidden=hidden)
    arc = cut_arc(seen, RULE)
    if isinstance(arc, Reason):
        return
    counted = count_nodes(seen, RULE)
    assert counted[1].arc < arc < length
    assert arc - counted[1].arc <= RULE.offset + 1e-12
    if len(counted) > 2:
        assert arc < counted[2].arc
    assert not any(span.overlaps(arc - 0.005, arc + 0.005) for span in hidden)


@settings(max_examples=40, deadline=None)
@given(radii=st.lists(st.floats(0.002, 0.0074), min_size=1, max_size=4), shift=st.floats(-5.0, 5.0))
def test_a_decision_does_not_depend_on_order_or_place(radii, shift):
    def row(x):
        return [cane(radius=radius, base=(x, 0.0, 0.93 + 0.02 * k)) for k, radius in enumerate(radii)]

    def moved(x):
        stub = np.array([[x, 0.0, 0.92], [x, 0.0, 1.02]])
        return row(x), stub

    here, there = moved(0.0), moved(shift)
    first = apply_rule(Spur(here[1][0], here[1], 0.006, tuple(here[0])), RULE)
    second = apply_rule(Spur(there[1][0], there[1], 0.006, tuple(reversed(there[0]))), RULE)
    assert [cut.kind for cut in first.cuts] == [cut.kind for cut in second.cuts]
    for a, b in zip(first.cuts, second.cuts, strict=True):
        np.testing.assert_allclose(a.position + [shift, 0.0, 0.0], b.position, atol=1e-9)
        assert a.reason == b.reason and 0.0 <= a.confidence <= 1.0


GUYOT = RuleConfig(system="guyot")
TEN = tuple(0.02 + 0.08 * k for k in range(11))


def guyot_cane(nodes, x, height, radius=0.004, length=1.0):
    arc = np.linspace(0.0, length, 201)
    axis = np.array([x, 0.0, height]) + arc[:, None] * np.array([0.0, 0.0, 1.0])
    return Cane(axis, arc, radius, tuple(Node(node, 30) for node in nodes), (), "image border", 0.0)


def guyot_spur(*canes, incomplete=None):
    return Spur(np.array([0.0, 0.0, 0.9]), None, 0.0, tuple(canes), incomplete)


LOWER, UPPER = guyot_cane(TEN, 0.0, 0.90), guyot_cane(TEN, 0.06, 0.93)


def test_the_lower_cane_keeps_two_nodes_and_the_upper_one_eight():
    decision = apply_rule(guyot_spur(UPPER, LOWER), GUYOT)
    assert [(cut.kind, cut.nodes_kept) for cut in decision.cuts] == [("spur cut", 2), ("cane cut", 8)]
    short, long = decision.cuts
    # 20 mm past the second and the eighth node; the basal bud is not counted.
    np.testing.assert_allclose(short.position, [0.0, 0.0, 0.90 + 0.18 + 0.02], atol=1e-9)
    np.testing.assert_allclose(long.position, [0.06, 0.0, 0.93 + 0.66 + 0.02], atol=1e-9)
    assert decision.undecided == (reasons.old_cane_unseen(),)
    assert [cut.reason.code for cut in decision.cuts] == ["guyot_cut_lower", "guyot_cut_upper"]


def test_the_lower_cane_of_a_guyot_vine_is_the_one_that_leaves_the_head_lower():
    begin = LOWER.arc >= 0.05
    hidden = replace(LOWER, axis=LOWER.axis[begin], arc=LOWER.arc[begin])
    assert hidden.base[2] > UPPER.base[2]
    short, long = apply_rule(guyot_spur(UPPER, hidden), GUYOT).cuts
    assert short.position[0] == LOWER.base[0] and long.position[0] == UPPER.base[0]
    # Seen from different places on, but from the same height of the head.
    level = replace(UPPER, axis=UPPER.axis - [0.0, 0.0, 0.03])
    assert reasons.canes_at_same_height() in apply_rule(guyot_spur(level, hidden), GUYOT).undecided


def test_the_operators_numbers_of_nodes_are_kept():
    changed = RuleConfig(system="guyot", nodes_kept=1, fruiting_nodes=5)
    assert [cut.nodes_kept for cut in apply_rule(guyot_spur(LOWER, UPPER), changed).cuts] == [1, 5]


def test_a_cane_that_leaves_the_view_too_early_is_not_tipped():
    decision = apply_rule(guyot_spur(LOWER, guyot_cane(TEN[:6], 0.06, 0.93, length=0.45)), GUYOT)
    assert [cut.kind for cut in decision.cuts] == ["spur cut"]
    assert reasons.nodes_lacking(5, 8) in decision.undecided


@pytest.mark.parametrize("canes", [(), (LOWER,), (LOWER, UPPER, guyot_cane(TEN, 0.1, 0.95))])
def test_anything_but_two_canes_is_left_for_a_person(canes):
    decision = apply_rule(guyot_spur(*canes), GUYOT)
    assert not decision.cuts and decision.undecided == (reasons.not_two_canes(len(canes)), reasons.old_cane_unseen())
    assert {kind for kind, why in decision.refused if why == decision.undecided[0]} == {"spur cut", "cane cut"}


def test_doubts_end_in_no_cut():
    assert not apply_rule(guyot_spur(LOWER, UPPER, incomplete=reasons.spur_at_image_edge()), GUYOT).cuts
    alike = guyot_spur(LOWER, guyot_cane(TEN, 0.06, 0.902))
    assert apply_rule(alike, GUYOT).undecided == (reasons.canes_at_same_height(), reasons.old_cane_unseen())
    close = apply_rule(guyot_spur(LOWER, guyot_cane(TEN, 0.01, 0.93)), GUYOT)
    assert not close.cuts and reasons.cane_crosses_cut() in close.undecided
    thick = apply_rule(guyot_spur(LOWER, guyot_cane(TEN, 0.06, 0.93, radius=0.009)), GUYOT)
    assert [cut.kind for cut in thick.cuts] == ["spur cut"]


def test_a_fruiting_cane_is_cut_farther_out_where_a_wire_is_beside_it_and_before_the_next_node():
    # The eighth node is at 0.66 m, the ninth at 0.74 m.
    def cane_cut(height):
        wire = KeepOut(lambda at: WIRE if abs(at[2] - height) < 0.0165 else None, lambda position, tangent: True)
        decision = apply_rule(guyot_spur(LOWER, UPPER), GUYOT, None, wire)
        return next((cut for cut in decision.cuts if cut.kind == "cane cut"), decision.undecided)

    free = cane_cut(0.0)
    assert free.offset == pytest.approx(0.02) and free.outward == pytest.approx(0.74 - 0.022 - 0.68, abs=0.0011)
    beside = cane_cut(0.93 + 0.68)
    assert beside.offset > 0.0365 and beside.position[2] + beside.outward < 0.93 + 0.74 - 0.02
    # Only a fruiting cane may have so long a stub.
    spur_cut = apply_rule(guyot_spur(LOWER, UPPER), GUYOT).cuts[0]
    assert spur_cut.kind == "spur cut" and spur_cut.outward < 0.0071
    low = KeepOut(lambda at: WIRE if abs(at[2] - 1.10) < 0.0165 else None, lambda position, tangent: True)
    assert WIRE in apply_rule(guyot_spur(LOWER, UPPER), GUYOT, None, low).undecided


def old_cane(begin=0.01, length=0.5, radius=0.0068, **changes):
    """From the trunk outwards and up; `begin` is hidden."""
    arc = np.linspace(begin, length, 100)
    axis = np.array([0.0, 0.0, 0.85]) + arc[:, None] * np.array([0.8, 0.0, 0.6])
    return Cane(axis, arc, radius, (), changes.pop("hidden", ()), "hidden", begin)


def removal_of(old, keep_out=NO_KEEP_OUT, *canes):
    decision = apply_rule(guyot_spur(*(canes or (LOWER, UPPER))), GUYOT, None, keep_out, old)
    return next((cut for cut in decision.cuts if cut.kind == "removal"), None), decision


def test_last_years_cane_is_cut_off_beside_the_trunk_and_keeps_no_node():
    cut, decision = removal_of(old_cane())
    np.testing.assert_allclose(cut.position, [0.8 * 0.04, 0.0, 0.85 + 0.6 * 0.04], atol=1e-6)
    np.testing.assert_allclose(cut.tangent, [0.8, 0.0, 0.6], atol=1e-6)
    assert (cut.nodes_seen, cut.nodes_kept, cut.cane, cut.offset) == (0, 0, -1, None)
    assert cut.reason == reasons.old_cane_removed(1000 * 0.04) and not decision.undecided
    # It may be cut farther out, and hardly nearer to the head.
    assert cut.inward == pytest.approx(0.01) and cut.outward == pytest.approx(0.08)
    assert cut.confidence == pytest.approx(1.0 - 0.01 / 0.12)


def test_last_years_cane_is_cut_where_it_is_seen_and_the_less_is_seen_the_less_sure_it_is():
    cut, _ = removal_of(old_cane(begin=0.06))
    assert cut.position[0] == pytest.approx(0.8 * 0.07) and cut.inward < 0.003
    assert cut.confidence == pytest.approx(0.5) and cut.confidence < SURE
    hidden, _ = removal_of(old_cane(hidden=(Span(0.035, 0.065),)))
    assert hidden.position[0] == pytest.approx(0.8 * 0.08)
    for unseen in (old_cane(begin=0.13), old_cane(length=0.04), old_cane(hidden=(Span(0.02, 0.2),))):
        cut, decision = removal_of(unseen)
        assert cut is None and decision.undecided == (reasons.cut_place_hidden(),)


def test_last_years_cane_is_cut_farther_out_where_something_is_beside_it():
    wire = KeepOut(lambda position: WIRE if position[0] < 0.05 else None, lambda position, tangent: True)
    cut, _ = removal_of(old_cane(), wire)
    assert cut.position[0] == pytest.approx(0.8 * 0.07) and cut.inward < 0.01
    everywhere = KeepOut(lambda position: WIRE, lambda position, tangent: True)
    assert removal_of(old_cane(), everywhere)[1].undecided[0] == WIRE
    crossing = guyot_cane(TEN, 0.03, 0.85)
    assert removal_of(old_cane(), NO_KEEP_OUT, crossing, UPPER)[0].position[0] > 0.03 + 0.01


def test_last_years_cane_beyond_the_shears_is_left_with_its_thickness():
    cut, decision = removal_of(old_cane(radius=0.009))
    assert cut is None and decision.undecided == (reasons.cane_beyond_shears(2000 * 0.009),)


def test_last_years_cane_goes_where_the_canes_of_the_spur_are_left_for_a_person():
    decision = apply_rule(guyot_spur(LOWER), GUYOT, old_cane=old_cane())
    assert [cut.kind for cut in decision.cuts] == ["removal"]
    assert decision.undecided == (reasons.not_two_canes(1),)
    # Spur-pruned vines have none: what looks like it is an arm.
    assert all(cut.kind != "removal" for cut in apply_rule(guyot_spur(LOWER), RuleConfig(), old_cane=old_cane()).cuts)


def test_the_spur_rule_is_the_usual_one():
    assert all(cut.kind != "cane cut" for cut in apply_rule(guyot_spur(LOWER, UPPER), RuleConfig()).cuts)


def test_a_cane_of_the_paper_needs_the_force_that_was_measured():
    # 263.5 N at 9.34 MPa: a cane of 28.2 mm², 6 mm thick.
    assert cutting_force(0.003) == pytest.approx(263.5, rel=0.01)
    assert cutting_force(0.006) == pytest.approx(4 * cutting_force(0.003))
