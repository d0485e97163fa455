from bridge.picture import Picture
from bridge.shutter import Shutter
from rolling_panda import messages as m
from rolling_panda.camera_messages import Intrinsics
from rolling_panda.look_messages import PictureRequest

PICTURE = Picture(Intrinsics(4, 4, 1.0, 1.0, 2.0, 2.0), b"c", b"d", b"l")
Q = (0.0,) * 9


def exposures(shutter: Shutter, first: int, last: int, step: int = 10) -> list[int]:
    out = []
    for ticks in range(first, last, step):
        if shutter.due(ticks):
            shutter.exposed(ticks, m.Header(ticks * 1e-3), m.PlanarPose(), Q)
            assert shutter.frame(PICTURE) is not None
            out.append(ticks)
    return out


def test_two_a_second_while_awake_then_one_in_two_seconds() -> None:
    shutter = Shutter(2.0, 0.5, 1e-3)
    assert exposures(shutter, 0, 4000) == list(range(0, 4000, 500))
    assert exposures(shutter, 4000, 12000) == [5500, 7500, 9500, 11500]
    shutter.wake(12000)
    assert exposures(shutter, 12000, 13000) == [12000, 12500]


def test_never_two_exposures_at_once_and_the_posture_is_that_of_the_exposure() -> None:
    shutter = Shutter(2.0, 0.5, 1e-3)
    shutter.exposed(0, m.Header(0.25, "camera"), m.PlanarPose(1.0, 2.0, 3.0), Q)
    assert not shutter.due(5000)
    frame = shutter.frame(PICTURE)
    assert frame is not None
    assert (frame.header.stamp, frame.base.x, frame.sequence) == (0.25, 1.0, 1)
    assert shutter.frame(PICTURE) is None


def test_a_picture_that_is_asked_for_is_taken_at_once_and_once_and_carries_its_point() -> None:
    shutter = Shutter(2.0, 0.5, 1e-3)
    assert exposures(shutter, 0, 10) == [0]
    shutter.want(PictureRequest(epoch=1, number=4, point_id="p7"))
    assert shutter.due(20)
    shutter.exposed(20, m.Header(0.02), m.PlanarPose(), Q)
    shutter.want(PictureRequest(epoch=1, number=4, point_id="p7"))
    frame = shutter.frame(PICTURE)
    assert frame is not None and (frame.point_id, frame.number) == ("p7", 4)
    assert not shutter.due(30), "a repetition takes no second picture"
    shutter.want(PictureRequest(epoch=1, number=3, point_id="p6"))
    assert not shutter.due(30), "an older request comes too late"
    shutter.exposed(600, m.Header(0.6), m.PlanarPose(), Q)
    usual = shutter.frame(PICTURE)
    assert usual is not None and usual.point_id == ""
