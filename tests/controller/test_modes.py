import random

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from controller.supervision import modes
from controller.supervision.modes import ANYBODY, MOVING, OPERATOR, SEVERITY, SYSTEM, Event
from rolling_panda.mode_table import FIRST

ALL = SYSTEM | OPERATOR
EVENTS = tuple(Event)
RIGHTS = (ANYBODY, SYSTEM, OPERATOR, frozenset({"anyone", "operator"}), frozenset({"anyone", "operator", "holder"}))

#: Written out by hand beside the table itself: one slip in one of them is seen.
EXPECTED = {
    ("IDLE", Event.ARM): ("READY", "holder"),
    ("READY", Event.HOLD): ("TELEOP", "holder"),
    ("READY", Event.START): ("AUTO", "holder"),
    ("READY", Event.PROTECT): ("PROTECTIVE_STOP", "system"),
    ("TELEOP", Event.RELEASE): ("READY", "system"),
    ("TELEOP", Event.PAUSE): ("PAUSED", "operator"),
    ("TELEOP", Event.LOST): ("PAUSED", "system"),
    ("TELEOP", Event.PROTECT): ("PROTECTIVE_STOP", "system"),
    ("AUTO", Event.FINISHED): ("READY", "system"),
    ("AUTO", Event.PAUSE): ("PAUSED", "operator"),
    ("AUTO", Event.LOST): ("PAUSED", "system"),
    ("AUTO", Event.PROTECT): ("PROTECTIVE_STOP", "system"),
    ("PAUSED", Event.RESUME): ("READY", "holder"),
    ("PROTECTIVE_STOP", Event.ACKNOWLEDGE): ("PAUSED", "holder"),
    ("FAULT", Event.ACKNOWLEDGE): ("IDLE", "supervisor"),
    ("ESTOP_LATCHED", Event.RESET): ("IDLE", "supervisor"),
}


def expected(mode, event):
    if event is Event.STOP:
        return "ESTOP_LATCHED", "anyone"
    if event is Event.FAULT and mode not in ("FAULT", "ESTOP_LATCHED"):
        return "FAULT", "system"
    return EXPECTED.get((mode, event), (mode, "anyone"))


def reach(mode):
    """A state in a mode, on the way a robot gets there, with a cause that has been gone for long."""
    ways = {
        "IDLE": [],
        "READY": [Event.ARM],
        "TELEOP": [Event.ARM, Event.HOLD],
        "AUTO": [Event.ARM, Event.START],
        "PAUSED": [Event.ARM, Event.START, Event.PAUSE],
        "PROTECTIVE_STOP": [Event.ARM, Event.START, Event.PROTECT],
        "FAULT": [Event.FAULT],
        "ESTOP_LATCHED": [Event.STOP],
    }
    state = modes.boot()
    for event in ways[mode]:
        state = modes.step(state, event, 0.0, by=ALL).state
    assert state.mode == mode
    return modes.observe(state, "", -9.0)


def test_boot_is_idle_or_still_stopped():
    assert modes.boot().mode == "IDLE"
    stopped = modes.boot("ada stopped it")
    assert (stopped.mode, stopped.reason) == ("ESTOP_LATCHED", "ada stopped it")


@pytest.mark.parametrize("mode", SEVERITY)
@pytest.mark.parametrize("event", EVENTS)
@pytest.mark.parametrize("by", RIGHTS)
def test_exactly_the_listed_transitions_are_taken_by_exactly_those_who_may(mode, event, by):
    after, who = expected(mode, event)
    taken = modes.step(reach(mode), event, 0.0, by=by)
    if who in by:
        assert taken.state.mode == after
    else:
        assert taken.state.mode == mode and taken.refused
    if taken.state.mode == mode and event not in (Event.STOP, Event.FAULT, Event.PROTECT):
        assert taken.refused


def test_a_refusal_says_what_to_do_or_whose_it_is():
    refused = modes.step(reach("IDLE"), Event.START, 0.0, by=OPERATOR).refused
    assert refused == "start is not possible in IDLE: arm the robot first"
    assert "reset the stop first" in modes.step(reach("ESTOP_LATCHED"), Event.ARM, 0.0, by=OPERATOR).refused
    assert modes.step(reach("READY"), Event.START, 0.0, by=ANYBODY).refused == "start in READY is for who holds control"
    assert "for a supervisor" in modes.step(reach("FAULT"), Event.ACKNOWLEDGE, 0.0, by=ANYBODY).refused


def test_acknowledging_needs_the_cause_gone_for_a_second():
    def acknowledge(state, now):
        return modes.step(state, Event.ACKNOWLEDGE, now, by=OPERATOR)

    state = modes.observe(reach("PROTECTIVE_STOP"), "joint states are old", 5.0)
    assert "still there" in acknowledge(state, 9.0).refused
    state = modes.observe(state, "", 10.0)
    assert acknowledge(state, 10.9).refused
    flicker = modes.observe(modes.observe(state, "again", 10.95), "", 11.0)
    assert acknowledge(flicker, 11.5).refused
    assert acknowledge(state, 11.0).state.mode == "PAUSED"


def test_a_protective_stop_for_another_cause_begins_its_second_anew():
    state = modes.observe(reach("PROTECTIVE_STOP"), "", 0.0)
    again = modes.step(state, Event.PROTECT, 5.0, "the link").state
    assert (again.mode, again.reason, again.clear_since) == ("PROTECTIVE_STOP", "the link", None)


def test_a_fault_is_left_to_idle_by_a_supervisor():
    state = modes.observe(reach("FAULT"), "", 0.0)
    assert modes.step(state, Event.ACKNOWLEDGE, 2.0, by=frozenset({"anyone", "operator", "holder"})).refused
    assert modes.step(state, Event.ACKNOWLEDGE, 2.0, by=OPERATOR).state.mode == "IDLE"


@given(st.permutations([Event.STOP, Event.FAULT, Event.PROTECT, Event.PAUSE, Event.LOST]))
def test_of_concurrent_faults_the_most_severe_wins_in_any_order(order):
    state = reach("AUTO")
    for event in order:
        state = modes.step(state, event, 0.0, by=ALL).state
    assert state.mode == "ESTOP_LATCHED"


@settings(max_examples=20)
@given(st.sampled_from(SEVERITY), st.lists(st.sampled_from([Event.STOP, Event.FAULT, Event.PROTECT, Event.LOST])))
def test_what_happens_by_itself_never_makes_it_less_severe(mode, events):
    state = reach(mode)
    for event in events:
        before, state = state, modes.step(state, event, 0.0).state
        assert modes.severity(state.mode) >= modes.severity(before.mode)


def random_steps(count, seed):
    """Steps with random events by random people at random times; asserts after each what must never be broken."""
    draw = random.Random(seed)
    state, now = modes.boot(), 0.0
    visited = set()
    for _ in range(count):
        now += draw.random()
        event, by = draw.choice(EVENTS), draw.choice(RIGHTS)
        if draw.random() < 0.3:
            state = modes.observe(state, draw.choice(("", "", "joint states are old")), now)
        before, taken = state, modes.step(state, event, now, by=by)
        state = taken.state
        visited.add(state.mode)
        assert state.reason
        if state.mode != before.mode:
            assert not taken.refused
            if state.mode in MOVING:
                assert before.mode == "READY" and event in (Event.START, Event.HOLD) and "holder" in by
            if modes.severity(before.mode) >= modes.severity("PAUSED") > modes.severity(state.mode):
                assert event in (Event.RESUME, Event.ACKNOWLEDGE, Event.RESET)
            if before.mode == "ESTOP_LATCHED":
                assert event is Event.RESET and "supervisor" in by and state.mode == "IDLE"
            if before.mode == "FAULT" and event is not Event.STOP:
                assert event is Event.ACKNOWLEDGE and "supervisor" in by and state.mode == "IDLE"
        if event is Event.STOP:
            assert state.mode == "ESTOP_LATCHED"
        if event is Event.FAULT and "system" in by:
            assert state.mode in ("FAULT", "ESTOP_LATCHED")
        if event is Event.PROTECT and "system" in by and before.mode in MOVING:
            assert state.mode == "PROTECTIVE_STOP"
    assert visited == set(SEVERITY)


def test_random_steps_break_nothing():
    random_steps(30_000, seed=1)


@pytest.mark.slow
def test_a_million_random_steps_break_nothing():
    random_steps(1_000_000, seed=2)


def test_severity_grows_from_idle_to_the_stop():
    ranks = [modes.severity(mode) for mode in SEVERITY]
    assert ranks == sorted(ranks)
    assert modes.severity("ESTOP_LATCHED") > modes.severity("FAULT") > modes.severity("PAUSED")


def test_a_repeated_stop_or_fault_is_no_refusal_and_a_fault_under_a_stop_says_why_it_changes_nothing():
    for mode, event in (("ESTOP_LATCHED", Event.STOP), ("FAULT", Event.FAULT)):
        state = reach(mode)
        assert modes.step(state, event, 0.0, "again") == modes.Transition(state)
    told = modes.step(reach("ESTOP_LATCHED"), Event.FAULT, 0.0, "the ledger")
    assert told.refused == "a fault changes nothing: the robot is in ESTOP_LATCHED"


def test_a_transition_without_a_reason_has_its_event_for_one():
    assert modes.step(reach("IDLE"), Event.ARM, 0.0, by=ALL).state.reason == Event.ARM.value


def test_the_second_counts_from_when_the_cause_went_away_and_in_stops_and_faults_alone():
    state = modes.observe(modes.observe(reach("PROTECTIVE_STOP"), "again", 9.0), "", 10.0)
    assert modes.observe(state, "", 10.9).clear_since == 10.0
    for mode in ("IDLE", "READY", "AUTO", "PAUSED", "ESTOP_LATCHED"):
        state = modes.State(mode, "")
        assert modes.observe(state, "", 5.0) == state


def test_where_there_is_nothing_to_advise_a_refusal_ends():
    quiet = [mode for mode in SEVERITY if not FIRST[mode]]
    assert quiet
    for mode in quiet:
        refused = modes.step(reach(mode), Event.RESET, 0.0, by=ALL).refused
        assert refused == f"{Event.RESET.value} is not possible in {mode}"
