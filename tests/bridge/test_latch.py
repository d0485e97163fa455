from hypothesis import given
from hypothesis import strategies as st

from bridge.core.latch import StopLatch
from rolling_panda import reasons
from rolling_panda.messages.robot import ReleaseStop, StopRequest
from rolling_panda.messages.supervision import StopRecord
from rolling_panda.reasons import said

RELEASED = reasons.stop_reset("ada", "checked")


def stop(stop_id: str) -> StopRequest:
    return StopRequest(stop_id=stop_id, source="page", user="ada", reason=said("button"))


def release(stop_id: str) -> ReleaseStop:
    return ReleaseStop(stop_id=stop_id, user="ada", reason="checked")


def test_every_stop_is_kept_and_all_hold_until_the_newest_is_released() -> None:
    latch = StopLatch()
    assert latch.stop(stop("a"), 10.0)
    assert latch.stop(stop("b"), 11.0)
    assert not latch.stop(stop("a"), 12.0)
    assert [(each.stop_id, each.wall_time) for each in latch.stops] == [("b", 11.0), ("a", 10.0)]
    assert latch.stops[0] == StopRecord("b", "page", "ada", said("button"), 11.0)
    assert latch.stop_id == "b" and latch.released_by is None
    assert latch.stopped_by == reasons.software_stop("ada", said("button"))
    assert latch.release(release("a")) == reasons.another_stop_latched("b", "a")
    assert latch.stop_id == "b"
    assert latch.release(release("b")) is None
    assert latch.stop_id == "" and latch.stops == () and latch.released_by == RELEASED


def test_a_clock_before_1970_and_a_long_reason_spoil_no_message() -> None:
    latch = StopLatch()
    for stop_id, wall_time in (("a", -5.0), ("b", 0.5)):
        latch.stop(StopRequest(stop_id=stop_id, source="page", user="ada", reason=said("x" * 500)), wall_time)
    assert [each.wall_time for each in latch.stops] == [0.5, 0.0]
    assert latch.stopped_by == reasons.software_stop("ada", said("x" * 500))
    latch.release(ReleaseStop(stop_id="b", user="ada", reason="y" * 500))
    assert latch.released_by == reasons.stop_reset("ada", "y" * 500)


def test_late_repetitions_of_released_stops_do_not_latch_again() -> None:
    latch = StopLatch()
    latch.stop(stop("a"))
    latch.stop(stop("b"))
    latch.release(release("b"))
    assert not latch.stop(stop("a")) and not latch.stop(stop("b"))
    assert latch.stop(stop("c"))


def test_a_restart_releases_nothing_and_forgets_nothing() -> None:
    latch = StopLatch()
    latch.stop(stop("a"))
    latch.release(release("a"))
    latch.stop(stop("b"))
    again = StopLatch(latch.stops, latch.over, latch.released_by)
    assert again.stop_id == "b" and again.released_by == RELEASED
    assert not again.stop(stop("a"))


def test_of_very_many_stops_the_newest_and_the_first_are_told() -> None:
    latch = StopLatch()
    for count in range(1, 121):
        assert latch.stop(stop(f"s{count}"))
        told = [each.stop_id for each in latch.stops]
        newest = [f"s{number}" for number in range(count, 0, -1)]
        assert told == (newest if count <= 50 else [*newest[:49], "s1"])


def test_of_very_many_released_stops_the_last_thousand_are_remembered() -> None:
    latch = StopLatch()
    for number in range(1005):
        latch.stop(stop(f"s{number}"))
        assert latch.release(release(f"s{number}")) is None
    assert latch.over == tuple(f"s{number}" for number in range(5, 1005))
    assert not latch.stop(stop("s5")) and latch.stop(stop("s4"))


def test_without_a_user_the_process_is_told_and_the_button_as_an_emergency_stop() -> None:
    latch = StopLatch()
    assert latch.stopped_by is None
    latch.stop(StopRequest(stop_id="a", source="page", user="", reason=said("button")))
    assert latch.stopped_by == reasons.software_stop("page", said("button"))
    latch.stop(StopRequest(stop_id="b", source="hardware", user="", reason=reasons.button_pressed()))
    assert latch.stopped_by == reasons.emergency_stop(reasons.button_pressed())


def test_while_the_button_is_pressed_nothing_is_released() -> None:
    latch = StopLatch()
    latch.stop(stop("a"))
    latch.hardware = True
    assert latch.release(release("a")) == reasons.emergency_button_pressed()
    latch.hardware = False
    assert latch.release(release("a")) is None


def test_there_is_nothing_to_release_without_a_stop() -> None:
    assert StopLatch().release(release("a")) == reasons.no_stop_latched()


@given(st.lists(st.tuples(st.booleans(), st.integers(0, 80)), max_size=200))
def test_it_is_open_only_after_a_release_of_the_newest(script: list[tuple[bool, int]]) -> None:
    latch = StopLatch()
    newest, over = "", set()
    for pressed, number in script:
        name = f"s{number}"
        if pressed:
            known = {each.stop_id for each in latch.stops}
            if latch.stop(stop(name)):
                assert name not in over and name not in known
                newest = name
        elif latch.release(release(name)) is None:
            assert name == newest
            over |= {name}
            newest = ""
        assert latch.stop_id == newest
        assert len(latch.stops) <= 50
