from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from perception.config import TrackerConfig
from perception.plant.model import Cane, Plant, Spur
from perception.plant.numbering import SpurNumber, SpurNumbering

CONFIG = TrackerConfig()
STEM = Cane(np.array([[0.0, 0.85, 1.0], [0.0, 0.85, 1.5]]), np.array([0.0, 0.5]), 0.004, (), (), "free", 0.0)
#: Along the row.
ALONG = np.array([1.0, 0.0, 0.0])


def frame(*spurs, noise=0.0):
    """The plant of a frame: of each spur its place along the row, its height and how many canes it has."""
    places = np.array([[x, 0.85, z] for x, z, _ in spurs]) + noise
    made = (Spur(place, None, 0.0, (STEM,) * count) for place, (_, _, count) in zip(places, spurs, strict=True))
    return Plant(tuple(made), np.array([[0.45, 0.85, 0.7]]), ())


def test_spurs_keep_their_numbers_while_the_robot_drives_on():
    rng = np.random.default_rng(1)
    numbers = SpurNumbering(CONFIG.spur_separation, CONFIG.vine_spacing)

    def told(*xs):
        return numbers.numbered(frame(*((x, 0.95, 1) for x in xs), noise=rng.normal(0.0, 0.003, (len(xs), 3))), ALONG)[
            1
        ]

    first = told(0.2, 0.32, 0.44)
    assert first == (SpurNumber(1, 1), SpurNumber(1, 2), SpurNumber(1, 3))
    for _ in range(10):
        assert told(0.32, 0.44, 0.6) == (*first[1:], SpurNumber(1, 4))
    assert told(2.2) == (SpurNumber(2, 1),)


@pytest.mark.parametrize("others", [(), ((0.6, 0.95, 2),), ((0.6, 0.95, 2), (0.72, 0.95, 2))])
def test_a_piece_of_wood_beside_a_spur_does_not_get_its_number(others):
    numbers = SpurNumbering(CONFIG.spur_separation, CONFIG.vine_spacing)
    numbers.numbered(frame((0.2, 0.95, 2), (0.32, 0.95, 2), *others), ALONG)
    # Nearer to where the second spur was than the spur itself.
    plant, told = numbers.numbered(frame((0.2, 0.95, 2), (0.31, 0.96, 0), (0.345, 0.93, 2)), ALONG)
    assert told == (SpurNumber(1, 1), SpurNumber(1, 2))
    assert [round(float(spur.position[0]), 3) for spur in plant.spurs] == [0.2, 0.345]


def test_a_known_spur_without_canes_in_a_frame_keeps_its_number_whatever_is_new_there():
    numbers = SpurNumbering(CONFIG.spur_separation, CONFIG.vine_spacing)
    numbers.numbered(frame((0.2, 0.95, 2)), ALONG)
    _, told = numbers.numbered(frame((0.203, 0.95, 0), (0.5, 0.95, 2)), ALONG)
    assert told == (SpurNumber(1, 1), SpurNumber(1, 2))


@pytest.mark.parametrize("seen_before", [False, True])
def test_a_spur_that_a_frame_divides_is_one_with_all_of_its_canes(seen_before):
    numbers = SpurNumbering(CONFIG.spur_separation, CONFIG.vine_spacing)
    if seen_before:
        numbers.numbered(frame((0.2, 0.95, 2)), ALONG)
    plant, told = numbers.numbered(frame((0.2, 0.94, 1), (0.21, 1.0, 1), (0.3, 0.95, 1)), ALONG)
    assert told == (SpurNumber(1, 1), SpurNumber(1, 2))
    assert [len(spur.canes) for spur in plant.spurs] == [2, 1]


def test_wood_without_canes_near_a_known_spur_is_no_spur_and_a_spur_beside_it_is_one():
    numbers = SpurNumbering(CONFIG.spur_separation, CONFIG.vine_spacing)
    numbers.numbered(frame((0.2, 0.95, 2)), ALONG)
    plant, told = numbers.numbered(frame((0.25, 0.92, 0), (0.29, 0.95, 0)), ALONG)
    assert told == (SpurNumber(1, 2),) and plant.spurs[0].position[0] == 0.29


#: A known cane that leans over the place of the next spur, and a cane that continues it.
LEANING = np.array([[0.2 + 0.2 * t, 0.85, 0.95 + 0.3 * t] for t in np.linspace(0.2, 1.0, 60)])
ALONG_IT = replace(STEM, axis=LEANING[30:], arc=np.linspace(0.0, 0.2, 30))


@pytest.mark.parametrize(
    ("canes", "nothing"), [((), True), ((ALONG_IT,), True), ((STEM,), False), ((ALONG_IT, STEM), False)]
)
def test_what_continues_a_known_cane_is_no_spur_but_one_with_a_cane_of_its_own_is(canes, nothing):
    numbers = SpurNumbering(CONFIG.spur_separation, CONFIG.vine_spacing)
    numbers.numbered(frame((0.2, 0.95, 2)), ALONG)
    seen = frame((0.2, 0.95, 2), (0.3, 1.1, 0))
    seen = replace(seen, spurs=(seen.spurs[0], replace(seen.spurs[1], canes=canes)))
    plant, told = numbers.numbered(seen, ALONG, LEANING)
    assert len(told) == len(plant.spurs) == (1 if nothing else 2)
    assert len(plant.unrooted) == (len(canes) if nothing else 0), "its wood stays in the way of cuts"


def test_a_known_spur_is_one_though_a_known_cane_passes_it():
    numbers = SpurNumbering(CONFIG.spur_separation, CONFIG.vine_spacing)
    numbers.numbered(frame((0.2, 0.95, 2)), ALONG)
    _, told = numbers.numbered(frame((0.2, 0.95, 0)), ALONG, np.array([[0.2, 0.85, 0.95]]))
    assert told == (SpurNumber(1, 1),)


@given(
    st.lists(st.tuples(st.floats(0.0, 1.0), st.floats(0.85, 1.05), st.integers(0, 2)), max_size=6), st.integers(1, 3)
)
def test_no_number_is_given_twice_and_no_cane_is_lost(spurs, frames):
    numbers = SpurNumbering(CONFIG.spur_separation, CONFIG.vine_spacing)
    for _ in range(frames):
        plant, told = numbers.numbered(frame(*spurs) if spurs else Plant((), np.zeros((0, 3)), ()), ALONG)
        assert len(set(told)) == len(told) == len(plant.spurs)
        assert sum(len(spur.canes) for spur in plant.spurs) == sum(count for _, _, count in spurs)
