"""Saved postures: their names, and that they outlive the controller."""

import pytest

from controller.config import ControllerConfig
from controller.core import Controller
from controller.ledger.journal import PostureRow
from controller.work.postures import LONGEST, MOST
from rolling_panda import commands as intents
from rolling_panda.config import RobotConfig
from tests.support.worlds.kinematic_robot import KinematicRobot

CONFIG = ControllerConfig()


@pytest.fixture
def robot():
    made = KinematicRobot(Controller(CONFIG, RobotConfig()), CONFIG.work.home)
    made.run(0.2)
    return made


def save(robot, name):
    answer = robot.ask(intents.SavePosture(user="ada", posture=name))
    robot.run(0.1)
    return None if answer.ok else answer.reason.code


def names(robot):
    return [each.name for each in robot.state.postures]


def test_the_present_posture_is_saved_under_its_name_and_can_be_deleted(robot):
    assert save(robot, " Over the wire ") is None
    assert names(robot) == ["survey", "folded", "Over the wire"]
    assert robot.state.postures[-1].angles == pytest.approx(robot.q[5:], abs=1e-4)
    assert robot.state.postures[-1].user == "ada"
    assert robot.ask(intents.DeletePosture(user="bob", posture="Over the wire")).ok
    robot.run(0.1)
    assert names(robot) == ["survey", "folded"]


@pytest.mark.parametrize(
    ("name", "code"),
    [
        ("", "posture_name_empty"),
        ("   ", "posture_name_empty"),
        ("x" * (LONGEST + 1), "posture_name_long"),
        ("Survey", "posture_name_taken"),
    ],
)
def test_a_name_that_does_not_do_is_refused_with_the_reason(robot, name, code):
    assert save(robot, name) == code
    assert names(robot) == ["survey", "folded"]


def test_a_second_posture_of_the_same_name_is_refused_whatever_its_capitals(robot):
    assert save(robot, "low") is None
    before = robot.state.postures
    assert save(robot, "LOW") == "posture_name_taken"
    assert robot.state.postures == before


def test_there_is_room_for_so_many_and_no_more(robot):
    for number in range(MOST):
        assert save(robot, f"p{number}") is None
    assert save(robot, "one more") == "postures_full"


@pytest.mark.parametrize("name", ["survey", "folded", "never saved"])
def test_the_programs_own_postures_and_unknown_ones_cannot_be_deleted(robot, name):
    answer = robot.ask(intents.DeletePosture(user="ada", posture=name))
    assert not answer.ok and answer.reason.code == "posture_not_saved"
    assert names(robot) == ["survey", "folded"]


def test_they_are_there_again_after_a_restart():
    controller = Controller(CONFIG, RobotConfig())
    kept, gone = PostureRow(angles=CONFIG.work.reach, user="ada"), PostureRow(angles=None, user="ada")
    controller.restore((), postures=(("low", kept), ("gone", gone)))
    robot = KinematicRobot(controller, CONFIG.work.home)
    robot.run(0.2)
    assert names(robot) == ["survey", "folded", "low"]
