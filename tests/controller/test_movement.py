import numpy as np
import pytest

from controller.config import ControllerConfig
from controller.identity import Token
from controller.ledger.journal import EventLogger, Journal
from controller.work.movement import Movement
from controller.work.point_queue import PointQueue
from rolling_panda import messages as m
from rolling_panda.config import RobotConfig
from rolling_panda.model.robot import ARM_Q
from tests.support.controller_at_work import CONFIG, robot


@pytest.fixture(scope="module")
def movement():
    config, lines = ControllerConfig(), EventLogger(Journal())
    return Movement(config, RobotConfig(), PointQueue(config.work), lines, "run", lambda _: None)


def test_an_unmeasured_robot_is_not_moved(movement):
    moved = movement.step("AUTO", held=True, now=0.0)
    assert not moved.xi.any()
    assert moved.event is None and moved.cut is None


def test_without_a_token_nothing_is_sent_and_the_robot_counts_as_still(movement):
    joints = robot().inputs().newest(m.JointState)
    slowly = np.full(9, 1e-3)
    first = movement.send(slowly, Token(1, "t"), joints, latched=False)
    assert first.token == "t" and not any(first.xi)
    # The bridge takes no other beginning under a token that is new to it.
    for _ in range(4):
        command = movement.send(slowly, Token(1, "t"), joints, latched=False)
    assert any(command.xi) and not movement.at_rest
    assert movement.send(slowly, None, joints, latched=False) is None
    assert movement.at_rest


def test_under_a_latched_stop_braking_is_sent_and_rest_is_not(movement):
    joints = robot().inputs().newest(m.JointState)
    assert movement.send(np.full(9, 1e-3), Token(1, "t"), joints, latched=True) is not None
    assert movement.send(np.zeros(9), Token(1, "t"), joints, latched=True) is None


def test_nobody_in_control_means_rest_whatever_the_mode(movement):
    r = robot()
    r.q[ARM_Q] = CONFIG.work.reach
    movement.update(r.inputs())
    movement.go_home()
    for _ in range(20):
        moved, inbox = movement.step("READY", held=True, now=r.now), r.inputs()
        out = movement.send(moved.xi, Token(1, "t"), inbox.newest(m.JointState), latched=False)
        r.integrate(np.array(out.xi))
        r.now += r.dt
        movement.update(r.inputs())
    assert movement.homing
    sent = np.abs(out.xi)
    assert sent.max() > 0.1
    slower = np.abs(movement.step("READY", held=False, now=r.now).xi)
    assert (slower <= 0.99 * sent).all()
    assert (np.abs(movement.step("READY", held=True, now=r.now).xi) > slower + 1e-6).any()
