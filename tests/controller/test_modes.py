import random

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from controller.supervision import modes
from controller.supervision.modes import ANYBODY, MOVING, OPERATOR, SEVERITY, SYSTEM, Event
from rolling_panda import reasons

ALL = SYSTEM | OPERATOR
EVENTS = tuple(Event)
CAUSE, OTHER = reasons.said("joint states are old"), reasons.said("the link")
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


def step(state, event, now, by=SYSTEM):
    return modes.step(state, event, now, CAUSE, by)


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
        state = step(state, event, 0.0, ALL).state
    assert state.mode == mode
    return modes.observe(state, None, -9.0)


def test_boot_is_idle_or_still_stopped():
    assert modes.boot().mode == "IDLE"
    stopped = modes.boot(CAUSE)
    assert (stopped.mode, stopped.reason) == ("ESTOP_LATCHED", CAUSE)


@pytest.mark.parametrize("mode", SEVERITY)
@pytest.mark.parametrize("event", EVENTS)
@pytest.mark.parametrize("by", RIGHTS)
def test_exactly_the_listed_transitions_are_taken_by_exactly_those_who_may(mode, event, by):
    after, who = expected(mode, event)
    taken = step(reach(mode), event, 0.0, by)
    if who in by:
        assert taken.state.mode == after
    else:
        assert taken.state.mode == mode and taken.refused
    if taken.state.mode == mode and event not in (Event.STOP, Event.FAULT, Event.PROTECT):
        assert taken.refused


def test_a_refusal_says_what_to_do_or_whose_it_is():
    def refused(mode, event, by):
        return step(reach(mode), event, 0.0, by).refused

    assert refused("IDLE", Event.START, OPERATOR) == reasons.impossible_in_idle("start")
    assert refused("ESTOP_LATCHED", Event.ARM, OPERATOR) == reasons.impossible_in_estop("arm")
    assert refused("READY", Event.START, ANYBODY) == reasons.right_missing("start", "READY", "holder")
    assert refused("FAULT", Event.ACKNOWLEDGE, ANYBODY) == reasons.right_missing("acknowledge", "FAULT", "supervisor")


def test_acknowledging_needs_the_cause_gone_for_a_second():
    def acknowledge(state, now):
        return step(state, Event.ACKNOWLEDGE, now, OPERATOR)

    state = modes.observe(reach("PROTECTIVE_STOP"), CAUSE, 5.0)
    assert acknowledge(state, 9.0).refused == reasons.cause_remains(state.reason)
    state = modes.observe(state, None, 10.0)
    assert acknowledge(state, 10.9).refused == reasons.cause_recent(1.0)
    flicker = modes.observe(modes.observe(state, CAUSE, 10.95), None, 11.0)
    assert acknowledge(flicker, 11.5).refused
    assert acknowledge(state, 11.0).state.mode == "PAUSED"


def test_a_protective_stop_for_another_cause_begins_its_second_anew():
    state = modes.observe(reach("PROTECTIVE_STOP"), None, 0.0)
    again = modes.step(state, Event.PROTECT, 5.0, OTHER).state
    assert (again.mode, again.reason, again.clear_since) == ("PROTECTIVE_STOP", OTHER, None)


def test_a_fault_is_left_to_idle_by_a_supervisor():
    state = modes.observe(reach("FAULT"), None, 0.0)
    assert step(state, Event.ACKNOWLEDGE, 2.0, frozenset({"anyone", "operator", "holder"})).refused
    assert step(state, Event.ACKNOWLEDGE, 2.0, OPERATOR).state.mode == "IDLE"


@given(st.permutations([Event.STOP, Event.FAULT, Event.PROTECT, Event.PAUSE, Event.LOST]))
def test_of_concurrent_faults_the_most_severe_wins_in_any_order(order):
    state = reach("AUTO")
    for event in order:
        state = step(state, event, 0.0, ALL).state
    assert state.mode == "ESTOP_LATCHED"


@settings(max_examples=20)
@given(st.sampled_from(SEVERITY), st.lists(st.sampled_from([Event.STOP, Event.FAULT, Event.PROTECT, Event.LOST])))
def test_what_happens_by_itself_never_makes_it_less_severe(mode, events):
    state = reach(mode)
    for event in events:
        before, state = state, step(state, event, 0.0).state
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
            state = modes.observe(state, draw.choice((None, None, CAUSE)), now)
        before, taken = state, step(state, event, now, by)
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
        assert modes.step(state, event, 0.0, CAUSE) == modes.Transition(state)
    told = step(reach("ESTOP_LATCHED"), Event.FAULT, 0.0)
    assert told.refused == reasons.fault_without_effect("ESTOP_LATCHED")


def test_a_transition_has_its_reason_and_a_refusal_keeps_the_one_before():
    idle = reach("IDLE")
    assert modes.step(idle, Event.ARM, 0.0, OTHER, ALL).state.reason == OTHER
    assert modes.step(idle, Event.START, 0.0, OTHER, ALL).state is idle
    assert modes.step(idle, Event.ARM, 0.0, OTHER, ANYBODY).state is idle


def test_the_second_counts_from_when_the_cause_went_away_and_in_stops_and_faults_alone():
    state = modes.observe(modes.observe(reach("PROTECTIVE_STOP"), CAUSE, 9.0), None, 10.0)
    assert modes.observe(state, None, 10.9).clear_since == 10.0
    for mode in ("IDLE", "READY", "AUTO", "PAUSED", "ESTOP_LATCHED"):
        state = modes.State(mode, CAUSE)
        assert modes.observe(state, None, 5.0) == state


@pytest.mark.parametrize("mode", SEVERITY)
def test_each_mode_has_its_own_refusal_with_the_step_that_comes_first(mode):
    event = Event.FINISHED if mode != "AUTO" else Event.ARM
    refused = step(reach(mode), event, 0.0, ALL).refused
    assert refused == modes.IMPOSSIBLE[mode](event.value)
    assert refused.code == f"impossible_in_{'estop' if mode == 'ESTOP_LATCHED' else mode.lower()}"
