import msgspec

from controller.stop_latch import StopLatch
from rolling_panda import intents
from rolling_panda import messages as m

BRIDGE = m.BridgeState(
    header=m.Header(),
    kind="sim",
    epoch=1,
    watchdog=False,
    stop_id="",
    stopped_by="",
    cutter="open",
    cut_id="",
    outcome="",
    real_time_factor=1.0,
)
RESET = intents.Reset(user="ada", reason="looked at it")


def stop(stop_id):
    return m.StopRequest(stop_id=stop_id, source="server", user="eve", reason="dog in the row")


def bridge(stop_id):
    return msgspec.structs.replace(BRIDGE, stop_id=stop_id, stopped_by="eve: dog in the row")


def test_a_stop_latches_once_and_says_who_and_why():
    latch = StopLatch()
    assert latch.take((stop("a"),), BRIDGE) == "software stop by eve: dog in the row"
    assert latch.take((stop("a"),), bridge("a")) == ""


def test_a_stop_that_only_the_bridge_has_seen_latches_too():
    assert "dog in the row" in StopLatch().take((), bridge("a"))


def test_reset_ends_only_when_the_bridge_shows_the_release():
    latch = StopLatch()
    latch.take((stop("a"),), bridge("a"))
    assert not latch.released(bridge("a"))
    assert latch.ask_release(RESET, bridge("a"), 1.0) == ""
    assert latch.release_due().stop_id == "a"
    assert latch.release_due() is None
    assert not latch.released(bridge("a"))
    assert latch.released(BRIDGE)
    assert not latch.released(BRIDGE)


def test_echoes_of_a_released_stop_latch_nothing_but_the_bridges_latch_always_counts():
    latch = StopLatch()
    latch.take((stop("a"),), bridge("a"))
    latch.ask_release(RESET, bridge("a"), 1.0)
    latch.release_due()
    assert latch.released(BRIDGE)
    assert latch.take((stop("a"),), BRIDGE) == ""
    assert latch.take((), bridge("a")) != ""


def test_of_two_stops_the_one_that_the_bridge_holds_is_released():
    latch = StopLatch()
    latch.take((stop("a"),), bridge("a"))
    latch.take((stop("b"),), bridge("a"))
    latch.ask_release(RESET, bridge("a"), 1.0)
    assert latch.release_due().stop_id == "a"
    assert latch.released(BRIDGE)


def test_a_stop_during_the_reset_undoes_it():
    latch = StopLatch()
    latch.take((stop("a"),), bridge("a"))
    latch.ask_release(RESET, bridge("a"), 1.0)
    assert latch.take((stop("b"),), bridge("a")) != ""
    assert latch.release_due() is None
    assert not latch.released(BRIDGE)


def test_asking_again_is_possible_when_the_bridge_did_not_answer():
    latch = StopLatch()
    latch.take((stop("a"),), bridge("a"))
    latch.ask_release(RESET, bridge("a"), 1.0)
    assert latch.ask_release(RESET, bridge("a"), 1.5) == "the reset is under way"
    assert latch.ask_release(RESET, bridge("a"), 2.1) == ""
