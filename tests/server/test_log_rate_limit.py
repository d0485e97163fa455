"""Nobody fills the log: what one source says too often is counted, and everybody else is heard."""

from hypothesis import given
from hypothesis import strategies as st

from server.robots.log_rate_limit import AT_ONCE, LINES_HZ, LogRateLimiter


def test_what_is_said_now_and_then_is_written_as_it_is():
    quiet = LogRateLimiter()
    assert [quiet.line("ann", "held", 2.0 * turn) for turn in range(50)] == ["held"] * 50


def test_a_flood_is_cut_and_its_number_told_with_the_next_line():
    quiet = LogRateLimiter()
    lines = [quiet.line("eve", "refused", 0.0) for _ in range(10_000)]
    assert lines[:20] == ["refused"] * 20 and not any(lines[20:])
    assert quiet.line("ann", "held", 0.0) == "held"
    assert quiet.line("eve", "refused", 1.5) == "refused (and 9980 lines like it before)"
    assert quiet.line("eve", "refused", 4.0) == "refused"


def test_many_names_do_not_fill_the_memory():
    quiet = LogRateLimiter()
    for number in range(5000):
        quiet.line(f"visitor {number}", "x", 0.0)
    assert len(quiet._sources) == 1000


@given(st.lists(st.floats(0.0, 0.2), max_size=300))
def test_of_any_source_there_are_never_more_than_its_share(gaps):
    quiet, now, written = LogRateLimiter(), 0.0, 0
    for gap in gaps:
        now += gap
        written += bool(quiet.line("eve", "x", now))
    assert written <= AT_ONCE + LINES_HZ * now + 1e-6
