"""What ties a core to a wire: newest wins or a queue, services, repetitions and the clock, by the topic table."""

import threading
import time
from contextlib import contextmanager

import pytest

from rolling_panda import messages as m
from rolling_panda import reasons, topics
from rolling_panda.messages.supervision import SessionPlan, StopState
from rolling_panda.reasons import said
from rolling_panda.transport.inbox import Answered, Inbox, Rejected, Reply
from rolling_panda.transport.runner import Runner, Standby
from tests.support.fake_wire import FakeWire, joints

STOP = m.StopRequest(stop_id="s", source="server", user="eve", reason=said("dog"))


class Core:
    """Notes what it is given and says what it is told to."""

    def __init__(self):
        self.inbox, self.times, self.says, self.ended = None, [], [], []

    def step(self, inbox, now):
        self.inbox = inbox
        self.times.append(now)
        out, self.says = self.says, []
        return out

    def end(self):
        return self.ended


class Clock:
    now = 100.0

    def __call__(self):
        return self.now


@contextmanager
def running(core, wire):
    """A loop that steps once, and again in 20 s."""
    stopping, runner = threading.Event(), Runner(core, wire, 20.0)
    thread = threading.Thread(target=runner.run, args=(stopping,))
    thread.start()
    try:
        while not core.times:
            thread.join(0.001)
        yield runner
    finally:
        stopping.set()
        runner.wake()
        thread.join(5.0)
    assert not thread.is_alive()


@pytest.fixture
def parts():
    core, wire, clock = Core(), FakeWire("controller"), Clock()
    return core, wire, clock, Runner(core, wire, 0.01, 0.05, clock=clock, wall_clock=lambda: 7.0)


def test_the_newest_wins_on_a_topic_without_a_queue_and_a_queue_keeps_the_order(parts):
    core, wire, clock, runner = parts
    for number in (1, 2):
        wire.deliver(topics.JOINTS, joints(number), clock.now - 0.02 / number)
        wire.deliver(topics.STOP, m.StopRequest(stop_id=f"s{number}", source="server", user="eve", reason=said("dog")))
    runner.turn(clock.now)
    newest = core.inbox.newest(m.JointState)
    assert (newest.message.sequence, newest.at) == (2, pytest.approx(99.99))
    assert [each.message.stop_id for each in core.inbox.drain(m.StopRequest)] == ["s1", "s2"]
    runner.turn(clock.now)
    assert core.inbox.newest(m.JointState) is newest, "it stays until there is a newer one"
    assert core.inbox.drain(m.StopRequest) == []
    assert (core.inbox.present, core.inbox.wall_time) == (wire.present(), 7.0)


def test_a_queue_that_is_full_loses_the_oldest():
    inbox = Inbox()
    for number in range(topics.STOP.queue + 3):
        inbox.put(m.StopRequest(stop_id=f"s{number}", source="server", user="eve", reason=said("dog")), 0.0)
    kept = [each.message.stop_id for each in inbox.drain(m.StopRequest)]
    assert (kept[0], len(kept)) == ("s3", topics.STOP.queue)


def test_messages_go_to_the_topic_of_their_type_and_what_is_latched_again_at_its_rate(parts):
    core, wire, clock, runner = parts
    plan = SessionPlan(header=m.Header(), state="none")
    core.says = [STOP, plan, StopState(process="controller", stops=())]
    period = 1.0 / topics.PLAN.rate_hz
    for _ in range(round(2.5 * period / 0.04)):
        runner.turn(clock.now)
        clock.now += 0.04
    assert wire.sent[topics.STOP.name] == [STOP]
    assert wire.sent[topics.PLAN.name] == [plan] * 3
    assert len(wire.sent[topics.STOPS.name]) == pytest.approx(2.5 * period * topics.STOPS.rate_hz, abs=2)
    core.says = [later := SessionPlan(header=m.Header(), state="planning")]
    runner.turn(clock.now)
    runner.turn(clock.now)
    assert wire.sent[topics.PLAN.name][3:] == [later], "what is new is sent at once, and the count begins anew"


def test_on_standby_nothing_that_is_latched_is_said_and_afterwards_the_newest_at_once(parts):
    core, wire, clock, runner = parts
    core.says = [Standby(True), SessionPlan(header=m.Header(), state="none"), STOP]
    runner.turn(clock.now)
    core.says = [newest := SessionPlan(header=m.Header(), state="planning")]
    runner.turn(clock.now + 100.0)
    assert (wire.sent[topics.PLAN.name], wire.sent[topics.STOP.name]) == ([], [STOP])
    core.says = [Standby(False)]
    runner.turn(clock.now + 100.1)
    assert wire.sent[topics.PLAN.name] == [newest]


def test_a_message_that_does_not_wait_is_handled_at_once_with_the_wall_clock():
    handled, wire = [], FakeWire("controller")
    at_once = {m.StopRequest: lambda message, wall_time: handled.append((message, wall_time))}
    core = Core()
    runner = Runner(core, wire, 0.01, at_once=at_once, wall_clock=lambda: 7.0)
    wire.deliver(topics.STOP, STOP)
    assert handled == [(STOP, 7.0)]
    runner.turn(1.0)
    assert core.inbox.drain(m.StopRequest) == []


def test_a_process_sends_nothing_on_topics_of_others(parts):
    core, _, clock, runner = parts
    core.says = [joints()]
    with pytest.raises(KeyError):
        runner.turn(clock.now)


def test_a_stall_of_the_loop_does_not_age_what_has_arrived(parts):
    core, wire, clock, runner = parts
    runner.turn(clock.now)
    wire.deliver(topics.JOINTS, joints(), clock.now + 0.49)
    clock.now += 0.5
    runner.turn(clock.now)
    assert core.times[-1] - core.times[0] == pytest.approx(0.05)
    assert core.times[-1] - core.inbox.newest(m.JointState).at == pytest.approx(0.01)
    runner.turn(clock.now + 0.01)
    assert core.times[-1] - core.times[0] == pytest.approx(0.06)


def test_heartbeats_count_while_their_number_does(parts):
    core, wire, clock, runner = parts
    for number, later in ((1, 0.0), (2, 0.01), (2, 0.02)):
        wire.deliver(topics.HEARTBEAT, m.Heartbeat(process="server", sequence=number), clock.now + later)
        runner.turn(clock.now + later)
    assert core.inbox.heard("server") == pytest.approx(100.01)
    assert core.inbox.heard("perception") is None


def test_a_request_is_answered_by_a_step(parts):
    core, wire, clock, runner = parts
    answers = []
    ask = wire.services[topics.INTENT.name]
    caller = threading.Thread(target=lambda: answers.append(ask("please")))
    caller.start()
    while core.inbox is None or not core.inbox.requests:
        runner.turn(clock.now)
    request = core.inbox.next_request()
    assert (request.message, request.at, core.inbox.next_request()) == ("please", clock.now, None)
    core.says = [Reply(request, m.Answer(ok=True, reason=said("done")))]
    runner.turn(clock.now)
    caller.join(5.0)
    assert answers == [m.Answer(ok=True, reason=said("done"))]


def test_a_request_whose_caller_has_given_up_is_not_executed(parts, monkeypatch):
    core, wire, clock, runner = parts
    monkeypatch.setattr("rolling_panda.transport.runner._ANSWER_MARGIN_S", topics.INTENT.timeout_s)
    assert not wire.services[topics.INTENT.name]("please").ok
    runner.turn(clock.now)
    assert len(core.inbox.requests) == 1
    assert core.inbox.next_request() is None


def test_a_request_to_another_process_is_answered_in_the_inbox(parts):
    core, wire, clock, runner = parts
    core.says = [release := m.ReleaseStop(stop_id="s", user="ada", reason="gone")]
    runner.turn(clock.now)
    runner.turn(clock.now)
    (answered,) = core.inbox.drain(Answered)
    assert answered.message == Answered(release, wire.answer(release))


def test_what_arrives_starts_no_step_before_its_time(monkeypatch):
    core, wire = Core(), FakeWire("controller")
    monkeypatch.setattr("rolling_panda.transport.runner._ANSWER_MARGIN_S", topics.INTENT.timeout_s - 0.05)
    with running(core, wire):
        wire.deliver(topics.JOINTS, joints())
        wire.deliver(topics.STOP, STOP)
        assert not wire.services[topics.INTENT.name]("please").ok
        assert len(core.times) == 1


@pytest.mark.parametrize("woken", ["by a motion command", "by the process itself"])
def test_a_motion_command_and_the_process_itself_end_the_wait(woken):
    core, wire = Core(), FakeWire("bridge")
    with running(core, wire) as runner:
        if woken == "by a motion command":
            wire.deliver(topics.MOTION, m.MotionCommand(epoch=1, token="a", sequence=1, echo=1, xi=(0.0,) * 9))
        else:
            runner.wake()
        end = time.monotonic() + 5.0
        while len(core.times) < 2:
            assert time.monotonic() < end


def test_of_what_could_not_be_decoded_the_newest_is_in_the_inbox(parts):
    core, wire, clock, runner = parts
    for number in range(100):
        wire.on_reject("state/joints", reasons.message_without_type(number))
    runner.turn(clock.now)
    rejected = core.inbox.drain(Rejected)
    assert [each.message.reason for each in rejected] == [reasons.message_without_type(n) for n in range(80, 100)]


def test_the_loop_keeps_its_rate_counts_late_periods_and_sends_its_last_messages():
    core, wire, stopping = Core(), FakeWire("controller"), threading.Event()
    core.ended = [STOP]
    times = iter([0.0, 0.0, *(0.001,) * 3, 0.05, *(0.051,) * 3])
    now = [0.0]

    def clock():
        now[0] = next(times, now[0])
        if len(core.times) == 2:
            stopping.set()
        return now[0]

    Runner(core, wire, 0.01, clock=clock).run(stopping)
    assert len(core.times) == 2
    assert core.inbox.late_ticks == 1
    assert core.inbox.ticks == 2
    assert wire.sent[topics.STOP.name] == [STOP]
