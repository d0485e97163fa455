import numpy as np
import pytest

from controller.motion.body import TrackingErrorMonitor
from rolling_panda import commands as intents
from rolling_panda import messages as m
from rolling_panda.reasons import text_of
from tests.support.controller_at_work import working
from tests.support.points import point


def run(velocity_of, seconds=2.0, sent=None, step=0.01):
    monitor, now = TrackingErrorMonitor(), 0.0
    sent = np.full(9, 0.5) if sent is None else sent
    for number in range(round(seconds / step)):
        now += step
        joints = m.JointState(
            header=m.Header(now), sequence=number, position=(0.0,) * 9, velocity=tuple(velocity_of(sent, now))
        )
        monitor.update(joints, sent)
        monitor.update(joints, sent)
    return monitor.reason


def test_a_robot_that_follows_with_a_lag_is_not_astray():
    fast = np.array([2.4, 2.4, *[1.3] * 7])
    assert run(lambda sent, now: sent * (1 - np.exp(-now / 0.07)), sent=fast) is None


@pytest.mark.parametrize(("actuator", "name"), [(0, "left wheel"), (1, "right wheel"), (2, "joint 1"), (8, "joint 7")])
def test_one_actuator_that_stands_still_is_named_with_its_figure(actuator, name):
    sent = np.array([2.4, 2.4, *[0.6] * 7])

    def stuck(sent, now):
        out = sent.copy()
        out[actuator] = 0.0
        return out

    said = run(stuck, sent=sent)
    assert said.code == "tracking_error" and dict(said.values)["part"].endswith(name)


def test_one_that_moves_without_being_told_is_noticed():
    moved = run(lambda sent, now: np.array([0, 0, 0, 0, 0, 0.5, 0, 0, 0.0]), sent=np.zeros(9))
    assert ("part", "joint 4") in moved.values


def test_what_was_not_seen_is_not_judged():
    assert run(lambda sent, now: np.zeros(9), step=0.1) is None


def test_a_base_that_is_held_back_stops_the_work_with_the_figure():
    r = working((point("a", (2.0, 0.75, 1.0)),))
    r.run(3.0)
    integrate = r.integrate

    def held(command):
        stuck = command.copy()
        stuck[:2] = 0.0
        integrate(stuck)

    r.integrate = held
    r.run(1.0)
    assert r.state.mode == "PROTECTIVE_STOP"
    assert "does not follow" in text_of(r.state.reason) and "wheel" in text_of(r.state.reason)
    assert not r.ask(intents.Acknowledge(user="ada")).ok
    r.integrate = integrate
    r.run(4.0)
    assert r.ask(intents.Acknowledge(user="ada")).ok
