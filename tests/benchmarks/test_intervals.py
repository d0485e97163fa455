"""Figures with their intervals."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from benchmarks.common.intervals import quantile, share


def test_a_share_has_wilsons_interval():
    # Worked in the literature: 10 of 20 gives 0.299 to 0.701.
    figure = share(10, 20)
    assert (figure.value, figure.n) == (0.5, 20)
    assert figure.low == pytest.approx(0.299, abs=5e-4) and figure.high == pytest.approx(0.701, abs=5e-4)


@given(st.integers(1, 200), st.data())
def test_a_share_lies_in_its_interval_which_lies_between_none_and_all(n, data):
    hits = data.draw(st.integers(0, n))
    figure = share(hits, n)
    assert 0.0 <= figure.low <= figure.value + 1e-12 and figure.value - 1e-12 <= figure.high <= 1.0
    assert figure.high - figure.low > 0.0


@given(st.lists(st.floats(-1e3, 1e3), min_size=1, max_size=60), st.sampled_from([0.5, 0.95]))
def test_a_quantile_lies_in_its_interval_of_members_of_the_sample(values, level):
    figure = quantile(values, level)
    assert figure.low in values and figure.high in values
    assert figure.low <= figure.value + 1e-9 and figure.value - 1e-9 <= figure.high


def test_the_median_is_in_its_interval_nineteen_times_out_of_twenty():
    rng = np.random.default_rng(3)
    held = [f.low <= 0.0 <= f.high for f in (quantile(list(rng.normal(size=40)), 0.5) for _ in range(600))]
    assert 0.93 <= np.mean(held) <= 0.99


def test_nothing_gives_no_figure():
    assert share(0, 0).value is None and quantile([], 0.5).n == 0
