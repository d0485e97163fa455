import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from benchmarks.page.latencies import ages, onset, spread, times_of_stamps

CLOCK = np.arange(0.0, 2.0, 0.001) + 100.0


def speeds(begins, level=0.0, noise=0.0):
    out = np.full((len(CLOCK), 9), level)
    out += noise * np.sin(np.arange(len(CLOCK)))[:, None]
    out[CLOCK >= begins - 1e-9, 3] += 0.2
    return out


def test_the_answer_is_where_the_speed_leaves_its_rest():
    assert onset(CLOCK, speeds(101.037), 101.0) == pytest.approx(0.037, abs=1e-6)
    assert onset(CLOCK, speeds(101.037, level=0.02, noise=0.005), 101.0) == pytest.approx(0.037, abs=1e-6)


def test_no_answer_in_time_is_told_from_no_rest_before():
    assert onset(CLOCK, speeds(101.9), 101.0) == math.inf
    assert onset(CLOCK, speeds(100.9), 101.0) is None, "it moved already"
    assert onset(CLOCK, speeds(101.1, noise=0.06), 101.0) is None
    assert onset(CLOCK, speeds(101.1), 99.9) is None, "nothing is known of before"


def test_a_robot_that_lost_time_is_looked_up_in_its_trace():
    time = np.arange(1, 3001) * 0.001
    # Steps come in bursts of five, and after the thousandth step the simulation stood still for 0.3 s.
    clock = 50.0 + np.ceil(np.arange(1, 3001) / 5) * 0.005
    clock[1000:] += 0.3
    found = times_of_stamps(np.array([50.5, 51.0, 51.6]), time, clock)
    assert found == pytest.approx([50.5, 51.0, 51.9], abs=2e-3)


def test_the_age_on_the_screen_grows_until_the_next_state_is_painted():
    # Measured ten times a second and painted 30 ms later: between 30 and 130 ms old.
    shown = [(0.1 * k, 0.1 * k + 0.03) for k in range(100)]
    seen = ages(shown)
    assert seen.min() == pytest.approx(0.03, abs=1e-6) and 0.115 < seen.max() < 0.1301
    assert np.median(seen) == pytest.approx(0.08, abs=0.006)


@given(st.lists(st.floats(0.0, 10.0), min_size=1, max_size=300))
def test_ranks_are_values_that_were_there_in_their_order(values):
    found = spread(values)
    assert found is not None
    assert found.median <= found.p95 <= found.p99 <= found.most == round(max(values), 5)
    assert sum(value <= found.p95 + 1e-5 for value in values) >= 0.95 * len(values)
    assert spread([]) is None
