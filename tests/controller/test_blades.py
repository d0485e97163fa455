"""A cut is asked for until the bridge says how it ended, or is unknown."""

from dataclasses import dataclass, field

from controller.config import ControllerConfig, WorkConfig
from controller.work.cutting import Blades
from controller.work.tries import Tried
from rolling_panda import reasons

TRIED = Tried((0.2, 0.0, 0.0))


@dataclass
class Bridge:
    cut_id: str = ""
    outcome: str = ""


@dataclass
class Queue:
    begun: list = field(default_factory=list)
    resolved: list = field(default_factory=list)
    put_back: list = field(default_factory=list)
    durable: int = 1000

    def begin_cut(self, point_id, cut_id):
        self.begun.append((point_id, cut_id))
        return len(self.begun)

    def recorded(self, number):
        return number <= self.durable

    def resolve(self, point_id, outcome, text):
        self.resolved.append((point_id, outcome, text))

    def put_off(self, point_id, tried, again, why):
        self.put_back.append((point_id, tried, again))
        return reasons.cut_ended(point_id, again)


def test_the_command_is_repeated_with_one_id_until_the_outcome_comes():
    queue = Queue()
    blades = Blades(WorkConfig(), queue, "run")
    blades.start("p1", TRIED, 0.0)
    asked = [blades.command(0.01 * tick) for tick in range(20)]
    told = [command for command in asked if command is not None]
    assert 3 <= len(told) <= 5 and set(told) == {("run-1", "p1")}
    assert queue.begun == [("p1", "run-1")]
    assert blades.watch(Bridge("another", "DONE"), 0.2) == () and blades.busy
    assert blades.watch(Bridge("run-1", "DONE"), 0.2) == (reasons.cut_done("p1", reasons.cutter_cut()),)
    assert not blades.busy and blades.command(0.3) is None
    assert [row[:2] for row in queue.resolved] == [("p1", "DONE")]


def test_without_a_word_the_cut_is_unknown_and_no_other_is_taken_for_it():
    config, queue = ControllerConfig(), Queue()
    blades = Blades(config.work, queue, "run")
    blades.start("p1", TRIED, 5.0)
    assert blades.command(5.0)
    assert blades.watch(Bridge(), 5.0 + config.work.cut_timeout_s) == ()
    (event,) = blades.watch(Bridge(), 5.1 + config.work.cut_timeout_s)
    assert event.code == "outcome_unknown" and queue.resolved[0][1] == "UNKNOWN"
    blades.start("p2", TRIED, 20.0)
    # The late outcome of the first is not that of the second.
    assert blades.watch(Bridge("run-1", "DONE"), 20.1) == () and blades.busy
    assert blades.command(20.1) == ("run-2", "p2")


def test_no_order_is_given_before_the_intent_is_durable():
    queue = Queue(durable=0)
    blades = Blades(WorkConfig(), queue, "run")
    blades.start("p1", TRIED, 0.0)
    assert all(blades.command(0.01 * tick) is None for tick in range(50))
    queue.durable = 1
    assert blades.command(0.5) == ("run-1", "p1")


def test_a_cut_that_was_never_ordered_is_no_unknown_one_and_is_tried_another_time():
    config, queue = ControllerConfig(), Queue(durable=0)
    blades = Blades(config.work, queue, "run")
    blades.start("p1", TRIED, 0.0)
    assert blades.command(0.1) is None
    (event,) = blades.watch(Bridge(), config.work.cut_timeout_s + 0.1)
    why = reasons.missed_once(reasons.no_order_given(config.work.cut_timeout_s))
    assert (event, queue.put_back) == (reasons.cut_ended("p1", why), [("p1", TRIED, why)])
    assert not queue.resolved and not blades.busy
