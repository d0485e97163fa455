import pytest
from hypothesis import given
from hypothesis import strategies as st

from benchmarks.wilson import interval


@pytest.mark.parametrize(
    ("hits", "trials", "low", "high"),
    # Published examples: Newcombe 1998, table I, and the rule that none of n has an upper end of z²/(n + z²).
    [(81, 263, 0.2553, 0.3662), (15, 148, 0.0624, 0.1605), (0, 20, 0.0, 0.1611), (1, 29, 0.0061, 0.1718)],
)
def test_it_agrees_with_published_examples(hits, trials, low, high):
    assert interval(hits, trials) == pytest.approx((low, high), abs=5e-5)


def test_nothing_tried_says_nothing():
    assert interval(0, 0) == (0.0, 1.0)


@given(st.integers(1, 500).flatmap(lambda n: st.tuples(st.integers(0, n), st.just(n))))
def test_it_holds_the_share_and_is_its_mirror(counted):
    hits, trials = counted
    low, high = interval(hits, trials)
    assert 0.0 <= low <= hits / trials + 1e-12 and hits / trials - 1e-12 <= high <= 1.0
    mirrored = interval(trials - hits, trials)
    assert mirrored == pytest.approx((1.0 - high, 1.0 - low))
