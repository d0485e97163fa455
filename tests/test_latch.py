from bridge.latch import StopLatch
from rolling_panda.messages import ReleaseStop, StopRequest


def stop(stop_id: str) -> StopRequest:
    return StopRequest(stop_id=stop_id, source="page", user="ada", reason="button")


def release(stop_id: str) -> ReleaseStop:
    return ReleaseStop(stop_id=stop_id, user="ada", reason="checked")


def test_the_first_stop_holds_until_its_own_id_releases_it() -> None:
    latch = StopLatch()
    assert latch.stop(stop("a"))
    assert not latch.stop(stop("b"))
    assert latch.stop_id == "a"
    assert "ada" in latch.stopped_by
    assert "latched stop is a" in latch.release(release("b"))
    assert latch.stop_id == "a"
    assert latch.release(release("a")) == ""
    assert latch.stop_id == ""


def test_a_late_repetition_of_a_released_stop_does_not_latch_again() -> None:
    latch = StopLatch()
    latch.stop(stop("a"))
    latch.release(release("a"))
    assert not latch.stop(stop("a"))
    assert latch.stop(stop("b"))


def test_there_is_nothing_to_release_without_a_stop() -> None:
    assert StopLatch().release(release("a")) == "no stop is latched"
