"""The log of the page, and the rate limit of each source of lines."""

from hypothesis import given
from hypothesis import strategies as st

from server.robots.event_log import BURST, RATE_HZ, EventLog, LogRateLimiter


def filled(lines, count):
    log = EventLog(lines)
    for number in range(1, count + 1):
        log.add("bridge", "info", f"line {number}", 0.0)
    return log


def test_only_new_lines_come_oldest_first():
    log = filled(1000, 5)
    assert [event.text for event in log.after(3, 200)] == ["line 4", "line 5"]
    assert log.after(5, 200) == ()


def test_old_lines_go_when_it_is_full():
    log = filled(10, 25)
    assert [event.number for event in log.after(0, 200)] == list(range(16, 26))


def test_a_reader_gets_the_newest_when_there_are_too_many():
    assert [event.number for event in filled(1000, 500).after(0, 200)] == list(range(301, 501))


def test_a_reader_from_before_a_restart_gets_nothing():
    assert filled(10, 3).after(99, 200) == ()


def test_what_is_said_now_and_then_is_written_as_it_is():
    limiter = LogRateLimiter()
    assert [limiter.line("ann", "held", 2.0 * turn) for turn in range(50)] == ["held"] * 50


def test_a_flood_is_cut_and_its_number_told_with_the_next_line():
    limiter = LogRateLimiter()
    lines = [limiter.line("eve", "refused", 0.0) for _ in range(10_000)]
    assert lines[:20] == ["refused"] * 20 and not any(lines[20:])
    assert limiter.line("ann", "held", 0.0) == "held"
    assert limiter.line("eve", "refused", 1.5) == "refused (and 9980 lines like it before)"
    assert limiter.line("eve", "refused", 4.0) == "refused"


def test_many_names_do_not_fill_the_memory():
    limiter = LogRateLimiter()
    for _ in range(30):
        limiter.line("visitor 0", "x", 0.0)
    assert not limiter.line("visitor 0", "x", 0.0)
    for number in range(1, 1001):
        limiter.line(f"visitor {number}", "x", 0.0)
    assert limiter.line("visitor 0", "x", 0.0), "the oldest is forgotten, with what it wrote"


@given(st.lists(st.floats(0.0, 0.2), max_size=300))
def test_of_any_source_there_are_never_more_than_its_share(gaps):
    limiter, now, written = LogRateLimiter(), 0.0, 0
    for gap in gaps:
        now += gap
        written += bool(limiter.line("eve", "x", now))
    assert written <= BURST + RATE_HZ * now + 1e-6
