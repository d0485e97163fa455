"""A measurement that arrives late does not take the place of a newer one."""

import msgspec
import pytest

from rolling_panda import messages as m
from rolling_panda.transport.inbox import Inbox
from tests.support.fake_wire import bridge_state


def joints(made):
    rest = (0.0,) * 9
    return m.JointState(header=m.Header(made), sequence=round(made * 100), position=rest, velocity=rest)


def odometry(made):
    return m.Odometry(header=m.Header(made), sequence=1, pose=m.PlanarPose(0.0), linear=0.0, angular=0.0)


def bridge(made):
    return msgspec.structs.replace(bridge_state(), header=m.Header(made))


def kept(inbox, message, at):
    inbox.put(message, at)
    return inbox.newest(type(message))


def test_what_was_measured_before_does_not_take_the_place_of_what_was_measured_after():
    inbox, late = Inbox(), joints(0.10)
    assert kept(inbox, late, 0.15).message is late
    assert kept(inbox, joints(0.06), 0.16).message is late
    after = joints(0.11)
    assert kept(inbox, after, 0.17).message is after


def test_a_repetition_is_never_fresh():
    inbox = Inbox()
    for at in (1.0, 1.1, 1.5, 9.0):
        assert kept(inbox, joints(1.0), at).at == 1.0


def test_a_bridge_that_has_started_again_with_another_clock_is_believed_soon():
    inbox = Inbox()
    for made, at, stamp in ((500.0, 10.0, 500.0), (0.01, 10.1, 500.0), (0.16, 10.25, 0.16), (0.17, 10.26, 0.17)):
        assert kept(inbox, joints(made), at).message.header.stamp == stamp


@pytest.mark.parametrize("made", [joints, odometry, bridge])
def test_each_of_what_the_robot_says_is_kept_by_itself(made):
    inbox, first = Inbox(), {joints: joints(3.0), odometry: odometry(2.0), bridge: bridge(1.0)}
    for message in first.values():
        inbox.put(message, 3.0)
    inbox.put(made(0.5), 3.1)
    for message in first.values():
        assert inbox.newest(type(message)).message is message
    after = made(3.5)
    assert kept(inbox, after, 3.2).message is after
