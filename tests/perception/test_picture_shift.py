"""A shifted picture: which cane is whose, and how far the picture is off, follows from what is known around a point."""

import numpy as np
import pytest

from perception.plant.map import NOTHING_KNOWN, Surroundings
from perception.plant.model import Node
from perception.skeleton.centreline import Centreline
from perception.tracking.picture_shift import picture_shift

UP, HERE = np.array([0.0, 0.0, 1.0]), np.array([0.0, 0.75, 1.0])
#: Canes beside each other along the row (m), and their nodes by height (m).
CANES = {0.0: (0.98, 1.05), -0.025: (0.96, 1.03), 0.06: (1.01,)}


def axis(x: float) -> np.ndarray:
    return HERE + np.column_stack([np.full(29, x), np.zeros(29), np.linspace(-0.07, 0.07, 29)])


def known(canes=CANES) -> Surroundings:
    nodes = [[x, 0.75, z] for x, heights in canes.items() for z in heights]
    return Surroundings(tuple(axis(x) for x in canes), np.array(nodes))


def seen(shift, canes=CANES) -> list[Centreline]:
    """The canes in a picture that is shifted; it shows 2 cm more of them at either end."""
    lines = []
    for x, heights in canes.items():
        start = HERE + [x, 0.0, -0.09] + np.array(shift)
        arc = np.linspace(0.0, 0.18, 37)
        nodes = tuple(Node(z - 0.91, 30) for z in heights)
        lines.append(Centreline(start + arc[:, None] * UP, arc, arc[:1], arc[:1], nodes, (), ("free", "free")))
    return lines


def shift_of(known: Surroundings, lines: list[Centreline]) -> np.ndarray:
    found = picture_shift(known, lines, HERE, UP)
    assert found is not None and found.agreed
    return found.by


@pytest.mark.parametrize("shift", [(0.02, 0.0, 0.0), (0.018, 0.004, 0.012), (-0.014, 0.0, -0.02), (0.0, 0.0, 0.02)])
def test_canes_tell_the_shift_across_and_nodes_the_shift_along(shift) -> None:
    assert shift_of(known(), seen(shift)) == pytest.approx(shift, abs=1e-3)


def test_a_neighbour_that_has_come_nearer_than_the_cane_itself_is_not_taken_for_it() -> None:
    shifted = seen((0.02, 0.0, 0.0))
    nearest = min(shifted, key=lambda line: np.linalg.norm(line.axis - HERE, axis=1).min())
    assert nearest is shifted[1], "the neighbour stands 5 mm from the point"
    assert shift_of(known(), shifted)[0] == pytest.approx(0.02, abs=1e-3)


def test_what_is_nearly_where_it_is_known_counts_as_not_shifted() -> None:
    assert shift_of(known(), seen((0.005, 0.0, -0.004))) == pytest.approx(np.zeros(3))


def test_one_node_alone_shifts_nothing_along_the_cane() -> None:
    one = {0.0: (0.98,)}
    assert shift_of(known(one), seen((0.0, 0.0, 0.02), one)) == pytest.approx(np.zeros(3))


def test_nodes_that_are_not_seen_do_not_shift_the_picture_by_an_internode() -> None:
    """The two upper nodes have no depth, and one more is seen below those that are known."""
    there, picture = {0.0: (0.946, 0.974, 1.002, 1.03)}, {0.0: (0.918, 0.946, 0.974)}
    assert shift_of(known(there), seen((0.0, 0.0, 0.0), picture)) == pytest.approx(np.zeros(3))


def test_one_node_that_is_seen_is_not_several_that_are_known() -> None:
    """Looks that erred have left four nodes in a row, of which the picture shows one below."""
    there, picture = {0.0: (0.98, 1.014, 1.016, 1.018, 1.02)}, {0.0: (0.98, 0.99)}
    assert shift_of(known(there), seen((0.0, 0.0, 0.0), picture)) == pytest.approx(np.zeros(3))


def test_where_the_own_cane_contradicts_its_neighbours_nobody_knows_which_internode_is_which() -> None:
    there = {0.0: (0.98, 1.04), -0.03: (0.965, 1.005, 1.045), 0.03: (0.955, 0.99, 1.03)}
    shifted = {x: tuple(z - 0.024 for z in nodes) if x else nodes for x, nodes in there.items()}
    found = picture_shift(known(there), seen((0.0, 0.0, 0.0), shifted), HERE, UP)
    assert found is not None and not found.agreed


def test_without_anything_known_there_is_no_shift_and_what_fits_nowhere_has_none() -> None:
    assert shift_of(NOTHING_KNOWN, seen((0.02, 0.0, 0.0))) == pytest.approx(np.zeros(3))
    assert picture_shift(known(), [], HERE, UP) is None
    assert picture_shift(known(), seen((0.2, 0.0, 0.0)), HERE, UP) is None


def test_where_two_shifts_explain_the_wood_as_well_that_of_the_last_picture_counts() -> None:
    """One of two like canes hides: it may be either."""
    alone = seen((0.0, 0.0, 0.0), {0.0: ()})
    there = Surroundings((axis(0.0), axis(0.025)), np.zeros((0, 3)))
    assert picture_shift(there, alone, HERE, UP).by == pytest.approx(np.zeros(3), abs=1e-3)
    before = np.array([-0.024, 0.0, 0.0])
    assert picture_shift(there, alone, HERE, UP, before).by == pytest.approx(before, abs=2e-3)
    assert picture_shift(NOTHING_KNOWN, alone, HERE, UP, before).by == pytest.approx(before)
