"""The log of the page, and the rate limit of each source of lines."""

from hypothesis import given
from hypothesis import strategies as st

from rolling_panda import reasons
from server.robots.event_log import BURST, RATE_HZ, EventLog, LogRateLimiter

HELD, REFUSED = reasons.said("held"), reasons.unexplained()


def filled(lines, count):
    log = EventLog(lines)
    for number in range(1, count + 1):
        log.add("bridge", reasons.said(f"line {number}"), 0.0)
    return log


def test_only_new_lines_come_oldest_first():
    log = filled(1000, 5)
    assert [(event.text, event.reason) for event in log.after(3, 200)] == [
        (line, reasons.said(line)) for line in ("line 4", "line 5")
    ]
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
    assert [limiter.line("ann", HELD, 2.0 * turn) for turn in range(50)] == [HELD] * 50


def test_a_flood_is_cut_and_its_number_told_with_the_next_line():
    limiter = LogRateLimiter()
    lines = [limiter.line("eve", REFUSED, 0.0) for _ in range(10_000)]
    assert lines[:20] == [REFUSED] * 20 and lines[20:] == [None] * 9980
    assert limiter.line("ann", HELD, 0.0) == HELD
    assert limiter.line("eve", REFUSED, 1.5) == reasons.lines_left_out(REFUSED, 9980)
    assert limiter.line("eve", REFUSED, 4.0) == REFUSED


def test_many_names_do_not_fill_the_memory():
    limiter = LogRateLimiter()
    for _ in range(30):
        limiter.line("visitor 0", HELD, 0.0)
    assert limiter.line("visitor 0", HELD, 0.0) is None
    for number in range(1, 1001):
        limiter.line(f"visitor {number}", HELD, 0.0)
    assert limiter.line("visitor 0", HELD, 0.0) == HELD, "the oldest is forgotten, with what it wrote"


@given(st.lists(st.floats(0.0, 0.2), max_size=300))
def test_of_any_source_there_are_never_more_than_its_share(gaps):
    limiter, now, written = LogRateLimiter(), 0.0, 0
    for gap in gaps:
        now += gap
        written += limiter.line("eve", HELD, now) is not None
    assert written <= BURST + RATE_HZ * now + 1e-6
