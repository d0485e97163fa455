"""A rate limit that allows a burst."""

from hypothesis import given
from hypothesis import strategies as st

from rolling_panda.runtime.token_bucket import TokenBucket, TokenBuckets


def test_a_page_at_work_is_never_refused():
    bucket = TokenBucket(200.0, 400.0)
    # Heartbeat and hold at their rates, and two seconds of them at once after a browser that hung.
    assert all(bucket.take(turn / 30) for turn in range(3000))
    assert all(bucket.take(102.0) for _ in range(60))


@given(st.lists(st.tuples(st.floats(0.0, 0.3), st.floats(0.0, 30.0)), max_size=40))
def test_no_stretch_of_time_has_more_than_the_rate_and_the_burst(asked):
    bucket, now, taken = TokenBucket(50.0, 20.0), 0.0, []
    for gap, tokens in asked:
        now += gap
        if bucket.take(now, tokens):
            taken.append((now, tokens))
    for start, _ in taken:
        for end, _ in taken:
            within = sum(tokens for at, tokens in taken if start <= at <= end)
            assert end < start or within <= 20.0 + 50.0 * (end - start) + 1e-6


def test_each_key_has_its_own_bucket_and_many_keys_do_not_fill_the_memory():
    buckets = TokenBuckets(1.0, 2.0, most=3)
    assert [buckets.take("a", 0.0) for _ in range(3)] == [True, True, False]
    assert buckets.take("b", 0.0)
    assert all(buckets.take(f"other {number}", 0.0) for number in range(100))
    assert buckets.take("a", 0.0), "forgotten"
