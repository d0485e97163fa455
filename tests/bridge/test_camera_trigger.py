from dataclasses import replace

import pytest

from bridge.core.camera_trigger import CameraTrigger, Posture
from bridge.core.picture import Picture
from rolling_panda import messages as m
from rolling_panda.messages.perception import CloseUpRequest
from rolling_panda.messages.robot import Intrinsics

PICTURE = Picture(Intrinsics(4, 4, 1.0, 1.0, 2.0, 2.0), b"c", b"d", b"l")
Q = (0.0,) * 9


def posture(clock: float, x: float = 0.0) -> Posture:
    return Posture(clock, m.Header(clock, "camera"), m.PlanarPose(x), Q)


def exposures(shutter: CameraTrigger, first: int, last: int, step: int = 10) -> list[int]:
    out = []
    for ticks in range(first, last, step):
        if shutter.due(ticks):
            shutter.exposed(ticks, posture(ticks * 1e-3))
            assert shutter.frame(PICTURE) is not None
            out.append(ticks)
    return out


def test_two_a_second_while_awake_then_one_in_two_seconds() -> None:
    shutter = CameraTrigger(2.0, 0.5, 1e-3)
    assert exposures(shutter, 0, 4000) == list(range(0, 4000, 500))
    assert exposures(shutter, 4000, 12000) == [5500, 7500, 9500, 11500]
    shutter.wake(12000)
    assert exposures(shutter, 12000, 13000) == [12000, 12500]


def test_never_two_exposures_at_once_and_the_posture_is_that_of_the_exposure() -> None:
    shutter = CameraTrigger(2.0, 0.5, 1e-3)
    shutter.exposed(0, posture(0.25, 1.0))
    assert not shutter.due(5000)
    frame = shutter.frame(PICTURE)
    assert frame is not None
    assert (frame.header.stamp, frame.base.x, frame.sequence) == (0.25, 1.0, 1)
    assert frame.position == Q
    assert shutter.frame(PICTURE) is None


def test_a_picture_that_is_asked_for_is_taken_at_once_and_once_and_carries_its_point() -> None:
    shutter = CameraTrigger(2.0, 0.5, 1e-3)
    assert exposures(shutter, 0, 10) == [0]
    shutter.want(CloseUpRequest(epoch=1, number=4, point_id="p7"))
    assert shutter.due(20)
    shutter.exposed(20, posture(0.02))
    shutter.want(CloseUpRequest(epoch=1, number=4, point_id="p7"))
    frame = shutter.frame(PICTURE)
    assert frame is not None and (frame.point_id, frame.number) == ("p7", 4)
    assert not shutter.due(30), "a repetition takes no second picture"
    shutter.want(CloseUpRequest(epoch=1, number=3, point_id="p6"))
    assert not shutter.due(30), "an older request comes too late"
    shutter.exposed(600, posture(0.6))
    usual = shutter.frame(PICTURE)
    assert usual is not None and (usual.point_id, usual.number) == ("", 0)
    assert usual.sequence == frame.sequence + 1


def test_a_picture_that_knows_when_it_was_taken_gets_the_posture_of_that_moment() -> None:
    shutter = CameraTrigger(2.0, 0.5, 1e-3)
    for k in range(300):
        shutter.follow(posture(k * 0.01, k * 0.003))
        if k == 100:
            shutter.exposed(1000, posture(1.0, 0.3))
    frame = shutter.frame(replace(PICTURE, taken_at=1.504))
    assert frame is not None
    assert (frame.header.stamp, frame.base.x) == (1.5, 0.45)
    shutter.exposed(3000, posture(3.0, 0.9))
    frame = shutter.frame(replace(PICTURE, taken_at=-5.0))
    assert frame is not None and frame.header.stamp == 0.99, "of two seconds the oldest"


def test_a_picture_that_does_not_know_when_it_was_taken_gets_the_posture_of_its_exposure() -> None:
    shutter = CameraTrigger(2.0, 0.5, 1e-3)
    for k in range(100):
        shutter.follow(posture(k * 0.01, k * 0.003))
    shutter.exposed(500, posture(0.5, 0.15))
    frame = shutter.frame(PICTURE)
    assert frame is not None and (frame.header.stamp, frame.base.x) == (0.5, 0.15)


def test_pictures_that_are_later_than_their_times_get_the_posture_of_that_much_later() -> None:
    for delay, taken_at, stamp in ((0.04, 1.5, 1.54), (-0.03, 1.5, 1.47), (0.04, None, 1.04), (0.5, 2.9, 2.99)):
        shutter = CameraTrigger(2.0, 0.5, 1e-3)
        for k in range(300):
            shutter.follow(posture(k * 0.01, k * 0.003))
        shutter.exposed(1000, posture(1.0, 0.3))
        frame = shutter.frame(replace(PICTURE, taken_at=taken_at), delay)
        assert frame is not None and frame.delay == delay
        assert (frame.header.stamp, frame.base.x) == (pytest.approx(stamp), pytest.approx(0.3 * stamp))


def test_a_frame_carries_all_of_its_picture() -> None:
    shutter, picture = CameraTrigger(2.0, 0.5, 1e-3), replace(PICTURE, depth_unit=0.001)
    shutter.exposed(0, posture(0.0))
    frame = shutter.frame(picture)
    assert frame is not None
    assert (frame.intrinsics, frame.depth_unit) == (picture.intrinsics, 0.001)
    assert (frame.color_jpeg, frame.depth_zlib, frame.labels_zlib) == (b"c", b"d", b"l")
