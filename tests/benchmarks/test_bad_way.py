"""A bad way does to messages what it is told to, and nothing else."""

import time

import pytest

from benchmarks.faults.lossy_link import BadWay, Parcel, WayFault
from tests.support.running_server import eventually


@pytest.fixture
def way():
    way = BadWay(seed=1)
    yield way
    way.close()


def sent(way, count, topic="t"):
    """Messages 0, 1, … and the list that they arrive in."""
    out = []
    for number in range(count):
        way.send(Parcel(topic, bytes([number]), lambda payload: out.append(payload[0])))
    return out


def test_without_a_fault_everything_comes_once_and_in_order(way):
    out = sent(way, 100)
    assert eventually(lambda: len(out) == 100)
    assert out == list(range(100))


def test_a_loss_is_of_its_topic_alone(way):
    way.set("lost", WayFault(loss=1.0))
    out, lost = sent(way, 5), sent(way, 5, "lost")
    assert eventually(lambda: len(out) == 5)
    assert lost == []


def test_delay_and_jitter_let_messages_overtake_each_other(way):
    way.set("*", WayFault(delay_s=0.05, jitter_s=0.05))
    began = time.monotonic()
    out = sent(way, 50)
    assert eventually(lambda: len(out) == 50)
    assert time.monotonic() - began >= 0.05
    assert sorted(out) == list(range(50)) and out != list(range(50))


def test_some_come_twice_and_some_are_spoilt(way):
    way.set("*", WayFault(twice=1.0))
    out = sent(way, 20)
    assert eventually(lambda: len(out) == 40)
    way.set("*", WayFault(corrupt=1.0))
    spoilt = sent(way, 200)
    assert eventually(lambda: len(spoilt) == 200) and spoilt != list(range(200))


def test_what_is_held_back_comes_at_once_when_it_is_let_go(way):
    way.set("*", WayFault(held=True))
    out = sent(way, 30)
    time.sleep(0.05)
    assert out == []
    way.clear()
    assert eventually(lambda: len(out) == 30) and out == list(range(30))


def test_a_slow_reader_gets_one_after_the_other(way):
    way.set("*", WayFault(every_s=0.02))
    began = time.monotonic()
    out = sent(way, 6)
    assert eventually(lambda: len(out) == 6)
    assert time.monotonic() - began >= 0.1 and out == list(range(6))


def test_a_replay_sends_the_last_ones_once_more(way):
    out = sent(way, 3)
    assert eventually(lambda: len(out) == 3)
    assert way.replay("t") == 3 and way.replay("other") == 0
    assert eventually(lambda: len(out) == 6) and out == [0, 1, 2, 0, 1, 2]
