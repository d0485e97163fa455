"""What perception says will still stand of the canes once the row is pruned."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from bridge.sim.camera.config import CameraConfig
from bridge.sim.camera.frame import survey_frame
from bridge.sim.camera.renderer import Camera
from bridge.sim.vineyard.config import VineyardConfig
from bridge.sim.vineyard.grow import grow
from bridge.sim.vineyard.truth import staying_rods
from perception.config import ObstacleConfig, PerceptionConfig, RuleConfig
from perception.pipeline import Perception
from perception.plant.map import PlantMap
from perception.plant.model import Cane, Node, Plant, Spur
from perception.plant.numbering import SpurNumber
from perception.rules.pruning import Cut
from perception.segmentation.frame import View
from perception.segmentation.segmenter import LabelImageSegmenter
from perception.skeleton.fragments import CANE
from perception.tracking.retained_canes import RetainedCanes
from perception.tracking.tracker import Proposal
from rolling_panda import messages as m
from rolling_panda.commands import SetRule
from rolling_panda.messages.robot import Intrinsics
from rolling_panda.model.robot import RobotModel

CONFIG, RULE = ObstacleConfig(), RuleConfig()
GUYOT = RuleConfig(system="guyot")
NUMBER = SpurNumber(2, 3)
NODES = (0.02, 0.10, 0.18, 0.26)
#: The camera stands at the origin and looks along z; canes grow towards −y, 0.8 m before it.
BASE, UP = np.array([0.0, 0.2, 0.8]), np.array([0.0, -1.0, 0.0])


def cane(x=0.0, nodes=NODES, length=0.35, bend=0.0, end="image border"):
    arc = np.linspace(0.0, length, 71)
    axis = BASE + arc[:, None] * UP
    axis[:, 0] += x + bend * (arc / length) ** 2
    return Cane(axis, arc, 0.004, tuple(Node(node, 30) for node in nodes), (), end, 0.0)


def known(*canes, looks=3, number=NUMBER):
    plants = PlantMap()
    for _ in range(looks):
        plants.update(Plant((Spur(BASE, None, 0.007, tuple(canes)),), np.zeros((0, 3)), ()), (number,))
    return plants


def cut(arc, x=0.0, kind="spur cut", number=NUMBER):
    return Proposal(Cut(kind, BASE + [x, 0.0, 0.0] + arc * UP, UP, 0.004, 0.9, 4, 2, "Because."), number)


def view(*columns):
    """What the camera sees of upright canes at these places beside its axis (m); none is seen as gone."""
    labels, depth = np.zeros((240, 320), np.uint8), np.full((240, 320), 3.0, np.float32)
    for x in columns:
        middle = round(159.5 + 300.0 * x / 0.8)
        labels[:, middle - 2 : middle + 3], depth[:, middle - 2 : middle + 3] = CANE, 0.8
    lens = Intrinsics(320, 240, 300.0, 300.0, 159.5, 119.5)
    return View(0, 0.0, lens, depth, labels, b"", np.eye(3), np.zeros(3))


def told(plants, *cuts, rule=RULE, staying=None, seen=None, most=200):
    seen = seen or view(*(c.best.axis[0, 0] for spur in plants.spurs for c in spur.canes))
    return (staying or RetainedCanes(CONFIG)).update(seen, seen.labels, plants.spurs, list(cuts), rule, most)


def top(capsules):
    """How far above the base the highest end is (m)."""
    return max((float((np.array(c.end) - BASE) @ UP) for c in capsules), default=0.0)


def test_what_stays_is_the_keeper_to_just_below_its_cut():
    capsules = told(known(cane(), cane(0.05)), cut(0.20))
    assert {(c.kind, c.vine, c.spur) for c in capsules} == {("cane", 2, 3)}
    assert top(capsules) == pytest.approx(0.19, abs=0.002)
    assert all(abs(c.start[0]) < 0.01 and abs(c.end[0]) < 0.01 for c in capsules), "the other cane goes"
    assert capsules[0].start_radius == pytest.approx(0.004)


def test_where_the_choice_is_open_every_cane_counts_as_far_as_the_rule_would_leave_it():
    capsules = told(known(cane(), cane(0.05, nodes=(0.02, 0.09, 0.15, 0.22))))
    assert all(c.undecided for c in capsules) and not any(c.undecided for c in told(known(cane()), cut(0.2)))
    ends = sorted({(round(c.end[0], 2), round(top([c]), 3)) for c in capsules})
    assert ends == [(0.0, 0.19), (0.05, 0.16)]
    # Nodes that were not seen may be farther up than those that were.
    assert top(told(known(cane(nodes=(0.02, 0.1))))) == pytest.approx(RULE.basal_bud_distance + 0.2, abs=0.002)


def test_a_guyot_spur_keeps_both_canes():
    plants = known(cane(), cane(0.05))
    capsules = told(plants, cut(0.20), cut(0.30, 0.05, "cane cut"), rule=GUYOT)
    assert {(round(c.end[0], 2), round(top([c]), 2)) for c in capsules} == {(0.0, 0.19), (0.05, 0.29)}
    assert not any(c.undecided for c in capsules)
    # The fruiting cane stays where no cut on it was found, as long as it is known.
    assert top(told(plants, cut(0.20), rule=GUYOT)) == pytest.approx(0.35, abs=0.002)


def test_a_cut_by_hand_lower_down_shortens_what_stays_and_does_not_choose():
    both = known(cane(), cane(0.05))
    assert top(told(both, cut(0.20), cut(0.08, kind="by hand"))) == pytest.approx(0.07, abs=0.002)
    assert {round(c.end[0], 2) for c in told(both, cut(0.08, kind="by hand"))} == {0.0, 0.05}


def test_a_renewal_cut_beside_a_cane_shortens_nothing():
    assert top(told(known(cane(), cane(0.05)), cut(0.2), cut(0.01, kind="renewal cut"))) == pytest.approx(
        0.19, abs=2e-3
    )


def test_a_renewal_cut_tells_which_cane_stays_though_its_own_cut_is_unknown():
    renewal = cut(0.01, kind="renewal cut")
    renewal = replace(renewal, cut=replace(renewal.cut, cane=1))
    capsules = told(known(cane(), cane(0.05)), renewal)
    assert {round(c.end[0], 2) for c in capsules} == {0.05} and not any(c.undecided for c in capsules)
    assert {c.cane for c in capsules} == {1}
    assert top(capsules) == pytest.approx(0.19, abs=0.002), "as far as the rule would leave it"


def test_cuts_on_other_spurs_say_nothing():
    assert told(known(cane()), cut(0.05, number=SpurNumber(2, 4))) == told(known(cane()))


def test_a_cane_whose_end_is_hidden_goes_on_and_one_that_ends_does_not():
    tops = {end: top(told(known(cane(nodes=(0.02, 0.1), length=0.2, end=end)))) for end in ("hidden", "free")}
    assert tops["free"] == pytest.approx(0.2, abs=0.002)
    assert tops["hidden"] == pytest.approx(0.255, abs=0.006), "as far as the rule may leave it"
    far = top(told(known(cane(nodes=(0.02,), length=0.1, end="hidden"))))
    assert far == pytest.approx(0.16, abs=0.006), "nobody knows where it goes farther on"


def test_nodes_too_near_to_each_other_do_not_tell_how_much_stays():
    assert top(told(known(cane(nodes=(0.02, 0.08, 0.11, 0.19))))) == pytest.approx(0.255, abs=0.002)


def test_a_cane_that_a_cut_is_for_counts_though_most_looks_did_not_show_it():
    plants = known(cane(), cane(0.05), looks=3)
    for _ in range(5):
        plants.update(Plant((Spur(BASE, None, 0.007, (cane(),)),), np.zeros((0, 3)), ()), (NUMBER,))
    assert {round(c.end[0], 2) for c in told(plants, cut(0.2, 0.05))} == {0.05}


@pytest.mark.parametrize("aside", [0.003, 0.02])
def test_a_cane_that_two_spurs_show_in_the_same_place_is_one(aside):
    plants = known(cane(), looks=6)
    again = Plant((Spur(BASE, None, 0.007, (cane(aside),)),), np.zeros((0, 3)), ())
    for _ in range(3):
        plants.update(again, (SpurNumber(2, 9),))
    assert {c.spur for c in told(plants, cut(0.2))} == ({3} if aside < 0.008 else {3, 9})


def test_a_cane_is_believed_after_enough_looks():
    assert told(known(cane(), looks=CONFIG.min_hits - 1)) == ()
    assert told(known(cane(), looks=CONFIG.min_hits)) != ()


def test_noise_moves_nothing_and_a_cane_that_has_moved_is_told_anew():
    staying = RetainedCanes(CONFIG)
    first = told(known(cane()), cut(0.2), staying=staying)
    rng = np.random.default_rng(0)
    for _ in range(20):
        shifted = known(cane(x=float(rng.uniform(-0.005, 0.005))))
        again = told(shifted, cut(0.2 + float(rng.uniform(-0.005, 0.005))), staying=staying)
        assert again == first
    moved = told(known(cane(x=0.012)), cut(0.2, 0.012), staying=staying)
    assert moved != first and all(abs(c.end[0] - 0.012) < 0.001 for c in moved)


def test_a_proposal_that_is_taken_back_is_no_cut_and_one_that_was_made_is():
    staying, plants = RetainedCanes(CONFIG), known(cane(), cane(0.05))
    assert {round(c.end[0], 2) for c in told(plants, cut(0.2), staying=staying)} == {0.0}
    open_again = told(plants, staying=staying)
    assert {round(c.end[0], 2) for c in open_again} == {0.0, 0.05} and all(c.undecided for c in open_again)
    before = told(plants, cut(0.2), staying=staying)
    assert not any(c.undecided for c in before)
    assert plants.sever(cut(0.2).cut.position)
    assert told(plants, staying=staying) == before, "the keeper's stump stands, the other cane still goes"


def test_a_cane_that_is_seen_to_have_gone_is_in_nobodys_way_until_it_is_seen_again():
    staying, plants = RetainedCanes(CONFIG), known(cane(), cane(0.05))
    assert {round(c.end[0], 2) for c in told(plants, staying=staying)} == {0.0, 0.05}
    for _ in range(2):
        told(plants, staying=staying, seen=view(0.0))
    # One look that shows it again, and counting begins anew.
    told(plants, staying=staying)
    for left in (2, 2, 1):
        places = {round(c.end[0], 2) for c in told(plants, staying=staying, seen=view(0.0))}
        assert len(places) == left
    assert {round(c.end[0], 2) for c in told(plants, staying=staying)} == {0.0}, "no new look has shown it"
    for _ in range(CONFIG.min_hits):
        plants.update(Plant((Spur(BASE, None, 0.007, (cane(0.05), cane())),), np.zeros((0, 3)), ()), (NUMBER,))
    assert {round(c.end[0], 2) for c in told(plants, staying=staying)} == {0.0, 0.05}


def test_what_is_hidden_stands():
    staying, plants = RetainedCanes(CONFIG), known(cane())
    before = told(plants, staying=staying)
    near = view()
    hidden = replace(near, depth=np.full_like(near.depth, 0.4))
    for _ in range(6):
        assert told(plants, staying=staying, seen=hidden) == before


@settings(deadline=None)
@given(bend=st.floats(-0.15, 0.15), arc=st.floats(0.08, 0.33))
def test_capsules_follow_the_axis(bend, arc):
    bent = cane(bend=bend)
    plants = known(bent)
    capsules = told(plants, Proposal(Cut("spur cut", bent.at(arc), UP, 0.004, 0.9, 4, 2, "."), NUMBER))
    axis = bent.axis[bent.arc < arc - 0.011]
    starts, ends = np.array([c.start for c in capsules]), np.array([c.end for c in capsules])
    np.testing.assert_array_equal(starts[np.argsort(-starts[:, 1])][1:], ends[np.argsort(-ends[:, 1])][:-1])
    along = ends - starts
    share = np.clip(np.sum((axis[:, None] - starts) * along, axis=2) / np.sum(along**2, axis=1), 0.0, 1.0)
    away = np.linalg.norm(axis[:, None] - starts - share[:, :, None] * along, axis=2).min(axis=1)
    assert away.max() < 0.006


@pytest.fixture(scope="module")
def surveyed():
    """A row as it grew, and perception after five frames from the start posture."""
    model, row, camera = RobotModel(), grow(VineyardConfig(), 3), Camera(CameraConfig(), 3)
    seen = Perception(PerceptionConfig(), LabelImageSegmenter(), model)
    for k in range(5):
        seen.process(survey_frame(camera, row, model, k))
    return row, seen


def canes(seen):
    return [capsule for capsule in seen.obstacles if capsule.kind == "cane"]


def distances(points, starts, ends):
    """Of each point from the nearest of the segments (m)."""
    along = ends - starts
    share = np.sum((points[:, None] - starts) * along, axis=2) / np.maximum(np.sum(along**2, axis=1), 1e-12)
    nearest = starts + np.clip(share, 0.0, 1.0)[:, :, None] * along
    return np.linalg.norm(points[:, None] - nearest, axis=2).min(axis=1)


def samples(starts, ends):
    return np.concatenate([a + np.linspace(0.0, 1.0, 12)[:, None] * (b - a) for a, b in zip(starts, ends, strict=True)])


def test_of_a_rendered_row_wood_is_told_that_stands_and_what_the_judge_keeps_is_among_it(surveyed):
    row, seen = surveyed
    starts, ends = (np.array([getattr(c, end) for c in canes(seen)]) for end in ("start", "end"))
    wood = [rod for _, rod in row.standing() if rod.kind in ("cane", "node", "spur")]
    away = distances(samples(starts, ends), np.array([r.start for r in wood]), np.array([r.end for r in wood]))
    assert np.quantile(away, 0.95) < 0.006 and away.max() < 0.02
    numbers = staying_rods(row)
    kept = [rod for number, rod in row.standing() if number in numbers and -0.1 < rod.start[0] < 1.1]
    assert len(kept) > 20
    found = distances(np.array([rod.end for rod in kept]), starts, ends) < 0.01
    assert found.mean() > 0.85


def test_a_new_rule_leaves_other_wood(surveyed):
    _, seen = surveyed
    model, camera = RobotModel(), Camera(CameraConfig(), 3)
    before = max(c.end[2] for c in canes(seen))
    assert seen.answer(SetRule(user="ada", rule=m.PruningRule(nodes_kept=3))).ok
    # The canes need not be in view for that.
    elsewhere = grow(VineyardConfig(first_vine_x=500.0), 0)
    seen.process(survey_frame(camera, elsewhere, model, 9))
    assert max(c.end[2] for c in canes(seen)) > before + 0.04, "a node more stays"


@pytest.mark.long
def test_without_canes_rods_alone_are_told(surveyed):
    row, _ = surveyed
    config = PerceptionConfig(obstacles=ObstacleConfig(canes=False))
    model, camera = RobotModel(), Camera(CameraConfig(), 3)
    seen = Perception(config, LabelImageSegmenter(), model)
    for k in range(4):
        seen.process(survey_frame(camera, row, model, k))
    assert seen.obstacles and not canes(seen)


def test_of_too_many_the_nearest_canes_are_told_in_an_order_that_stays():
    staying, plants = RetainedCanes(CONFIG), known(cane(0.3), cane(-0.05), cane(0.02))
    everything = told(plants, staying=staying)
    assert [round(c.end[0], 2) for c in everything] == [0.3, -0.05, 0.02]
    assert told(plants, staying=staying, most=2) == everything[1:]
    elsewhere = replace(view(), t=np.array([0.3, 0.0, 0.9]))
    assert told(plants, staying=staying, seen=elsewhere) == everything
    assert told(plants, staying=staying, seen=elsewhere, most=1) == everything[:1]


def test_of_the_cane_that_stays_on_a_stub_the_hidden_base_is_told():
    """It is seen from 20 mm beside the stub on, and comes out of it below."""
    arc = np.linspace(0.0, 0.35, 71)
    beside = np.array([0.02, -0.01, 0.0])
    seen = Cane(BASE + beside + arc[:, None] * UP, arc, 0.004, tuple(Node(node, 30) for node in NODES), (), "free", 0.0)
    leaning = replace(seen, axis=seen.axis + 0.5 * np.minimum(arc, 0.05)[:, None] * [1.0, 0.0, 0.0])
    stub = np.array([BASE, BASE + 0.05 * UP])
    plants = PlantMap()
    for _ in range(3):
        plants.update(Plant((Spur(BASE, stub, 0.007, (leaning, cane(-0.02))),), np.zeros((0, 3)), ()), (NUMBER,))
    number = next(each.number for each in plants.spurs[0].canes if each.best.axis[0, 0] > 0.0)
    renewal = Cut("renewal cut", BASE + 0.03 * UP, UP, 0.007, 0.9, 4, 2, "Because.", cane=number)
    shorten = Cut("spur cut", leaning.at(0.2), UP, 0.004, 0.9, 4, 2, "Because.")
    staying = RetainedCanes(CONFIG)
    without = told(plants, Proposal(shorten, NUMBER), staying=staying)
    hidden, *rest = told(plants, Proposal(shorten, NUMBER), Proposal(renewal, NUMBER), staying=staying)
    assert [(each.start, each.end) for each in rest] == [(each.start, each.end) for each in without]
    assert hidden.undecided and hidden.end == rest[0].start and hidden.cane == rest[0].cane
    begin = np.array(hidden.start) - BASE
    # On the stub, where the cane leads back to.
    assert np.linalg.norm(begin - (begin @ UP) * UP) < 1e-6 and -0.01 <= begin @ UP < 0.01
    # It goes with the renewal cut.
    staying = RetainedCanes(CONFIG)
    assert len(told(plants, Proposal(shorten, NUMBER), Proposal(renewal, NUMBER), staying=staying)) == 1 + len(without)
    assert told(plants, Proposal(shorten, NUMBER), staying=staying) == without
