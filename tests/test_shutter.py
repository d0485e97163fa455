from bridge.picture import Picture
from bridge.shutter import Shutter
from rolling_panda import messages as m

PICTURE = Picture(m.Intrinsics(4, 4, 1.0, 1.0, 2.0, 2.0), b"c", b"d", b"l")
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
