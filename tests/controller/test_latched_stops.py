import msgspec

from controller.supervision.latched_stops import LatchedStops
from rolling_panda import commands as intents
from rolling_panda import messages as m
from rolling_panda import reasons
from rolling_panda.messages.supervision import StopRecord
from rolling_panda.reasons import said
from tests.support.fake_wire import as_received, bridge_state

BRIDGE = bridge_state()
RESET = intents.Reset(user="ada", role="supervisor", reason="looked at it")
PRESSED = reasons.software_stop("eve", said("dog in the row"))


def stop(stop_id):
    return m.StopRequest(stop_id=stop_id, source="server", user="eve", reason=said("dog in the row"))


def bridge(stop_id):
    return msgspec.structs.replace(BRIDGE, stop_id=stop_id, stopped_by=PRESSED)


def test_a_stop_latches_once_and_says_who_and_why():
    latch = LatchedStops()
    assert latch.update((stop("a"),), BRIDGE) == reasons.software_stop("eve", said("dog in the row"))
    assert latch.update((stop("a"),), bridge("a")) is None


def test_a_stop_that_only_the_bridge_has_seen_latches_too():
    latch = LatchedStops()
    assert latch.update((), bridge("a"), 7.0) == PRESSED
    assert latch.update((), bridge("a"), 8.0) is None
    (record,) = latch.message().stops
    assert record == StopRecord("a", "bridge", "", PRESSED, 7.0)


def test_a_clock_before_1970_spoils_no_record():
    latch = LatchedStops()
    latch.update((stop("a"),), BRIDGE, -5.0)
    latch.update((), bridge("b"), -5.0)
    latch.update((stop("c"),), bridge("b"), 0.5)
    latch.update((), bridge("d"), 0.5)
    assert [record.wall_time for record in as_received(latch.message()).stops] == [0.5, 0.5, 0.0, 0.0]


def test_what_was_latched_before_a_start_is_not_released_by_itself():
    before = LatchedStops()
    before.update((stop("a"),), BRIDGE)
    latch = LatchedStops(before.message().stops)
    assert not latch.released(BRIDGE) and latch.latched == reasons.software_stop("eve", said("dog in the row"))
    assert latch.message().released_by is None


def test_an_emergency_stop_is_told_from_a_software_stop_and_a_process_stands_for_a_person():
    for source, user, told in (
        ("hardware", "", reasons.emergency_stop(said("the button"))),
        ("hardware", "eve", reasons.emergency_stop(said("the button"))),
        ("server", "", reasons.software_stop("server", said("the button"))),
        ("server", "eve", reasons.software_stop("eve", said("the button"))),
    ):
        pressed = m.StopRequest(stop_id="a", source=source, user=user, reason=said("the button"))
        assert LatchedStops().update((pressed,), BRIDGE) == told


def test_reset_ends_only_when_the_bridge_shows_the_release():
    latch = LatchedStops()
    latch.update((stop("a"),), bridge("a"))
    assert not latch.released(bridge("a"))
    assert latch.ask_release(RESET, bridge("a"), 1.0) is None
    assert latch.release_due() == m.ReleaseStop(stop_id="a", user="ada", reason="looked at it")
    assert latch.release_due() is None
    assert not latch.released(bridge("a"))
    assert latch.released(BRIDGE)
    assert not latch.released(BRIDGE)


def test_a_reset_where_nothing_is_latched_releases_nothing():
    latch = LatchedStops()
    assert latch.ask_release(msgspec.structs.replace(RESET, stop_id="a"), BRIDGE, 1.0) == reasons.stop_newer()
    assert latch.ask_release(RESET, BRIDGE, 1.0) is None
    assert latch.release_due() is None and not latch.released(BRIDGE)


def test_echoes_of_a_released_stop_latch_nothing_but_the_bridges_latch_always_counts():
    latch = LatchedStops()
    latch.update((stop("a"),), bridge("a"))
    latch.ask_release(RESET, bridge("a"), 1.0)
    latch.release_due()
    assert latch.released(BRIDGE)
    assert latch.update((stop("a"),), BRIDGE) is None
    latch.update((stop("b"),), bridge("b"))
    latch.ask_release(RESET, bridge("b"), 3.0)
    latch.release_due()
    assert latch.released(BRIDGE)
    assert latch.update((stop("a"), stop("b")), BRIDGE) is None
    assert latch.update((), bridge("a")) != ""


def test_every_stop_is_kept_with_who_pressed_it_and_when_and_survives_a_restart():
    latch = LatchedStops()
    assert latch.changed
    latch.update((stop("a"),), BRIDGE, 100.0)
    latch.update((stop("b"), stop("a")), bridge("a"), 101.0)
    assert latch.changed
    told = latch.message()
    assert [(each.stop_id, each.user, each.wall_time) for each in told.stops] == [
        ("b", "eve", 101.0),
        ("a", "eve", 100.0),
    ]
    assert not latch.changed and told.process == "controller"
    again = LatchedStops(told.stops)
    assert again.latched == reasons.software_stop("eve", said("dog in the row"))
    assert again.message().stops == told.stops
    assert again.update((stop("b"),), BRIDGE) is None


def test_a_reset_of_a_stop_that_is_not_the_newest_any_more_is_refused():
    latch = LatchedStops()
    latch.update((stop("a"),), bridge("a"))
    latch.update((stop("b"),), bridge("b"))
    looked_at_a = intents.Reset(user="ada", role="supervisor", reason="looked at it", stop_id="a")
    assert latch.ask_release(looked_at_a, bridge("b"), 1.0) == reasons.stop_newer()
    assert latch.release_due() is None
    looked_at_b = intents.Reset(user="ada", role="supervisor", reason="looked at it", stop_id="b")
    assert latch.ask_release(looked_at_b, bridge("b"), 1.0) is None
    assert latch.release_due().stop_id == "b"
    assert latch.released(BRIDGE)
    assert latch.message().released_by == reasons.stop_reset("ada", "looked at it")


def test_a_long_reason_of_a_reset_fits_the_wire():
    latch = LatchedStops()
    latch.update((stop("a"),), bridge("a"))
    latch.ask_release(msgspec.structs.replace(RESET, reason="x" * 500), bridge("a"), 1.0)
    latch.release_due()
    assert latch.released(BRIDGE)
    assert as_received(latch.message()).released_by == reasons.stop_reset("ada", "x" * 500)


def test_before_the_bridge_has_said_what_it_holds_a_reset_is_refused_and_later_it_is_not_lost():
    latch = LatchedStops()
    latch.update((stop("a"),), None)
    assert latch.reset_refused(None, 1.0) == reasons.stop_unknown()
    assert not latch.released(None) and not latch.released(BRIDGE)
    assert latch.ask_release(RESET, bridge("a"), 1.1) is None
    assert latch.release_due().stop_id == "a"


def test_of_two_stops_the_one_that_the_bridge_holds_is_released():
    latch = LatchedStops()
    latch.update((stop("a"),), bridge("a"))
    latch.update((stop("b"),), bridge("a"))
    looked_at_a = msgspec.structs.replace(RESET, stop_id="a")
    assert latch.ask_release(looked_at_a, bridge("a"), 1.0) is None
    assert latch.release_due().stop_id == "a"
    assert latch.released(BRIDGE)


def test_a_stop_that_the_bridge_does_not_hold_is_reset_by_its_own_id():
    latch = LatchedStops()
    latch.update((stop("a"), stop("b")), BRIDGE)
    looked_at_a = msgspec.structs.replace(RESET, stop_id="a")
    assert latch.ask_release(looked_at_a, BRIDGE, 1.0) == reasons.stop_newer()
    assert latch.ask_release(msgspec.structs.replace(RESET, stop_id="b"), BRIDGE, 1.0) is None
    assert latch.released(BRIDGE)


def test_a_stop_during_the_reset_undoes_it():
    latch = LatchedStops()
    latch.update((stop("a"),), bridge("a"))
    latch.ask_release(RESET, bridge("a"), 1.0)
    assert latch.update((stop("b"),), bridge("a")) != ""
    assert latch.release_due() is None
    assert not latch.released(BRIDGE)


def test_asking_again_is_possible_when_the_bridge_did_not_answer():
    latch = LatchedStops()
    latch.update((stop("a"),), bridge("a"))
    latch.ask_release(RESET, bridge("a"), 1.0)
    assert latch.reset_refused(bridge("a"), 1.5) == reasons.reset_under_way()
    assert latch.ask_release(RESET, bridge("a"), 2.1) is None
