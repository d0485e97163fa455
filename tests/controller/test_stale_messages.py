import msgspec
import pytest

from controller.inputs import Sample
from controller.interface import StepInputs
from controller.supervision.stale_messages import StaleMessageFilter
from rolling_panda import messages as m
from tests.support.fake_wire import bridge_state


def joints(made, at):
    rest = (0.0,) * 9
    return Sample(m.JointState(header=m.Header(made), sequence=round(made * 100), position=rest, velocity=rest), at)


def taken(newest, sample):
    return newest.of(StepInputs(joints=sample)).joints


def test_what_was_measured_before_does_not_take_the_place_of_what_was_measured_after():
    newest = StaleMessageFilter()
    late, early = joints(0.10, 0.15), joints(0.06, 0.16)
    assert taken(newest, late) is late
    assert taken(newest, early) is late
    after = joints(0.11, 0.17)
    assert taken(newest, after) is after


def test_a_repetition_is_never_fresh():
    newest, first = StaleMessageFilter(), joints(1.0, 1.0)
    for at in (1.0, 1.1, 1.5, 9.0):
        assert taken(newest, first if at == 1.0 else joints(1.0, at)).at == 1.0


def test_a_bridge_that_has_started_again_with_another_clock_is_believed_soon():
    newest = StaleMessageFilter()
    taken(newest, joints(500.0, 10.0))
    assert taken(newest, joints(0.01, 10.1)).message.header.stamp == 500.0
    assert taken(newest, joints(0.16, 10.25)).message.header.stamp == 0.16
    assert taken(newest, joints(0.17, 10.26)).message.header.stamp == 0.17


def odometry(made, at):
    pose = m.PlanarPose(0.0)
    return Sample(m.Odometry(header=m.Header(made), sequence=1, pose=pose, linear=0.0, angular=0.0), at)


def bridge(made, at):
    return Sample(msgspec.structs.replace(bridge_state(), header=m.Header(made)), at)


@pytest.mark.parametrize(("name", "made"), [("joints", joints), ("odometry", odometry), ("bridge", bridge)])
def test_each_of_what_the_robot_says_is_kept_by_itself(name, made):
    newest = StaleMessageFilter()
    first = {"joints": joints(3.0, 3.0), "odometry": odometry(2.0, 3.0), "bridge": bridge(1.0, 3.0)}
    given = StepInputs(**first)
    assert newest.of(given) is given
    late = {**first, name: made(0.5, 3.1)}
    found = newest.of(StepInputs(**late))
    assert {each: getattr(found, each) for each in first} == first
    after = {**first, name: made(3.5, 3.2)}
    found = newest.of(StepInputs(**after))
    assert getattr(found, name) is after[name]
