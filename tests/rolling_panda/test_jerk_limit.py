import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from rolling_panda.model.jerk_limit import largest_rise

rooms, steps = st.floats(0.0, 10.0), st.floats(1e-4, 1.0)


@given(rooms, steps)
def test_the_greatest_rise_keeps_the_limit_and_asks_for_no_more_than_its_step(room, step):
    """Taken in every period, for as long as there is room: no more than the room in all, and never a harder change."""
    total, last = 0.0, None
    for _ in range(50):
        rise = float(largest_rise(np.array([room - total]), np.array([step]))[0])
        assert last is None or rise >= last - step - 1e-9
        total, last = total + rise, rise
        assert total <= room + 1e-9


def test_a_rise_that_may_end_at_once_uses_all_the_room():
    assert largest_rise(np.array([0.3]), np.array([0.5]))[0] == 0.3


@pytest.mark.parametrize("room", [-0.2, -1e-6])
def test_beyond_the_limit_it_comes_back(room):
    assert largest_rise(np.array([room]), np.array([1e-3]))[0] < 0.0


def test_it_is_the_greatest():
    """Anything more, and falling by the step in each period, goes beyond the limit."""
    room, step = 1.0, 0.01
    rise = float(largest_rise(np.array([room]), np.array([step]))[0]) * 1.05
    assert sum(max(rise - i * step, 0.0) for i in range(1000)) > room


@given(rooms, steps, st.integers(0, 40), st.integers(0, 5))
def test_a_rise_that_is_repeated_against_our_will_keeps_the_limit(room, step, repeats, before):
    total = 0.0
    for _ in range(before + 1):
        rise = float(largest_rise(np.array([room - total]), np.array([step]), repeats)[0])
        total += rise
    total += repeats * rise
    while rise > 0.0:
        rise -= step
        total += max(rise, 0.0)
    assert total <= room + 1e-9


@given(rooms, steps)
def test_what_is_never_repeated_is_bound_by_the_root_of_the_room(room, step):
    args = np.array([room]), np.array([step])
    assert largest_rise(*args) == pytest.approx(max(math.sqrt(2 * step * room) - step / 2, min(room, step)), abs=1e-9)
