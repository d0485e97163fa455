"""A page may say two hundred things a second, and somewhat more after a moment's pause."""

from server.api.frame_rate import Frames


def test_a_page_at_work_is_never_refused():
    frames = Frames()
    # Heartbeat and hold at their rates, and two seconds of them at once after a browser that hung.
    assert all(frames.admits(turn / 30) for turn in range(3000))
    assert all(frames.admits(102.0) for _ in range(60))


def test_a_flood_is_refused_and_so_is_one_that_goes_on():
    frames = Frames()
    assert sum(frames.admits(0.0) for _ in range(100_000)) == 400
    assert sum(frames.admits(1.0 + number / 1000) for number in range(1000)) < 450
