from controller.inputs import Sample
from controller.interface import StepInputs
from controller.supervision.stale_messages import StaleMessageFilter
from rolling_panda import messages as m


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


def test_each_of_what_the_robot_says_is_kept_by_itself():
    newest = StaleMessageFilter()
    odometry = Sample(
        m.Odometry(header=m.Header(2.0), sequence=1, pose=m.PlanarPose(0.0), linear=0.0, angular=0.0), 2.0
    )
    assert newest.of(StepInputs(joints=joints(3.0, 3.0), odometry=odometry)).odometry is odometry
    given = StepInputs(joints=joints(3.1, 3.1), odometry=odometry)
    assert newest.of(given) is given
