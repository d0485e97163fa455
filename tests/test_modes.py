from hypothesis import given, settings
from hypothesis import strategies as st

from controller import modes
from controller.modes import Event, State

events = st.sampled_from(list(Event))
MOVING = ("AUTO", "TELEOP")


def reach(mode):
    """A state in a mode, on the way a robot gets there."""
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
        state = modes.step(state, event, 0.0).state
    assert state.mode == mode
    return state


def test_boot_is_idle_or_still_stopped():
    assert modes.boot().mode == "IDLE"
    stopped = modes.boot("ada stopped it")
    assert (stopped.mode, stopped.reason) == ("ESTOP_LATCHED", "ada stopped it")


def test_exactly_the_listed_transitions_are_taken():
    allowed = {
        ("IDLE", Event.ARM): "READY",
        ("READY", Event.HOLD): "TELEOP",
        ("READY", Event.START): "AUTO",
        ("READY", Event.PROTECT): "PROTECTIVE_STOP",
        ("TELEOP", Event.RELEASE): "READY",
        ("TELEOP", Event.PAUSE): "PAUSED",
        ("TELEOP", Event.PROTECT): "PROTECTIVE_STOP",
        ("AUTO", Event.FINISHED): "READY",
        ("AUTO", Event.PAUSE): "PAUSED",
        ("AUTO", Event.PROTECT): "PROTECTIVE_STOP",
        ("PAUSED", Event.RESUME): "READY",
        ("ESTOP_LATCHED", Event.RESET): "IDLE",
    }
    for mode in modes.SEVERITY:
        for event in Event:
            before = reach(mode)
            after = modes.step(before, event, 0.0)
            if event is Event.STOP:
                expected = "ESTOP_LATCHED"
            elif event is Event.FAULT:
                expected = mode if mode == "ESTOP_LATCHED" else "FAULT"
            else:
                expected = allowed.get((mode, event), mode)
            assert after.state.mode == expected, (mode, event)
            changed = after.state.mode != mode
            again = (mode, event) in (
                ("ESTOP_LATCHED", Event.STOP),
                ("FAULT", Event.FAULT),
                ("PROTECTIVE_STOP", Event.PROTECT),
            )
            assert bool(after.refused) != (changed or again), (mode, event)


def test_a_refusal_says_what_to_do():
    refused = modes.step(reach("IDLE"), Event.START, 0.0).refused
    assert refused == "start is not possible in IDLE: arm the robot first"
    assert "reset the stop first" in modes.step(reach("ESTOP_LATCHED"), Event.ARM, 0.0).refused


def test_acknowledging_needs_the_cause_gone_for_a_second():
    state = reach("PROTECTIVE_STOP")
    state = modes.observe(state, "joint states are old", 5.0)
    assert "still there" in modes.step(state, Event.ACKNOWLEDGE, 9.0).refused
    state = modes.observe(state, "", 10.0)
    assert modes.step(state, Event.ACKNOWLEDGE, 10.9).refused
    flicker = modes.observe(modes.observe(state, "again", 10.95), "", 11.0)
    assert modes.step(flicker, Event.ACKNOWLEDGE, 11.5).refused
    assert modes.step(state, Event.ACKNOWLEDGE, 11.0).state.mode == "PAUSED"


def test_a_fault_is_left_to_idle():
    state = modes.observe(reach("FAULT"), "", 0.0)
    assert modes.step(state, Event.ACKNOWLEDGE, 2.0).state.mode == "IDLE"


@settings(max_examples=300)
@given(st.lists(events, max_size=60))
def test_no_order_of_events_wakes_motion_without_arming_and_starting(sequence):
    """Into AUTO only by a start from READY, into TELEOP only by a hold from READY, out of a stop only by a reset."""
    state = modes.boot()
    for now, event in enumerate(sequence):
        before, state = state, modes.step(state, event, float(now)).state
        if state.mode in MOVING and before.mode != state.mode:
            assert before.mode == "READY" and event in (Event.START, Event.HOLD)
        if before.mode == "ESTOP_LATCHED" and state.mode != "ESTOP_LATCHED":
            assert event is Event.RESET and state.mode == "IDLE"
        if event is Event.STOP:
            assert state.mode == "ESTOP_LATCHED"
        assert state.reason


@given(st.permutations([Event.STOP, Event.FAULT, Event.PROTECT, Event.PAUSE]))
def test_of_concurrent_faults_the_most_severe_wins_in_any_order(order):
    state = reach("AUTO")
    for event in order:
        state = modes.step(state, event, 0.0).state
    assert state.mode == "ESTOP_LATCHED"


def test_severity_grows_from_idle_to_the_stop():
    ranks = [modes.severity(mode) for mode in modes.SEVERITY]
    assert ranks == sorted(ranks)
    assert modes.severity("ESTOP_LATCHED") > modes.severity("FAULT") > modes.severity("PAUSED")
    assert State("IDLE", "x").clear_since is None
