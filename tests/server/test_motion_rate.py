"""A session asks for motion at most 60 times a second."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from rolling_panda.errors import InputError
from server.robots.motion_rate import MotionRate


def granted(rate, now, session="a"):
    try:
        rate.count(session, now)
    except InputError:
        return False
    return True


def test_a_held_button_is_never_refused():
    rate = MotionRate()
    assert all(granted(rate, number / 50) for number in range(1000))


@given(st.lists(st.floats(0.0, 0.1), max_size=300))
def test_no_second_has_more_than_sixty_beside_what_was_kept_back(gaps):
    rate, now, times = MotionRate(), 0.0, []
    for gap in gaps:
        now += gap
        if granted(rate, now):
            times.append(now)
    for start in times:
        assert sum(start <= at < start + 1.0 for at in times) <= 80


def test_one_session_does_not_use_up_anothers_share():
    rate = MotionRate()
    assert sum(granted(rate, 0.0, "a") for _ in range(100)) == 20
    assert granted(rate, 0.0, "b")
    with pytest.raises(InputError, match="at most 60 requests for motion a second"):
        rate.count("a", 0.0)
