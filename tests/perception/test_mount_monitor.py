"""The monitor finds how a camera is turned from canes that it has seen from several places, and only then."""

import numpy as np
import pinocchio as pin
import pytest
from hypothesis import Phase, given, settings
from hypothesis import strategies as st

from perception.calibration.monitor import WARNS, MountMonitor

AHEAD = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]])
BASE = np.zeros(3)


def canes(rng, count=12):
    """Canes of a row 0.75 m to the left, in odom."""
    out = []
    for x in np.linspace(0.0, 1.1, count):
        lean = np.array([rng.normal(0.0, 0.2), rng.normal(0.0, 0.1), 1.0])
        out.append(np.array([x, 0.75, 0.95]) + np.linspace(0.0, 0.5, 40)[:, None] * lean)
    return out


def poses(rng, count=6):
    for _ in range(count):
        lean = pin.exp3(rng.normal(0.0, 0.15, 3))
        yield AHEAD @ lean, np.array([0.5, 0.0, 1.05]) + rng.normal(0.0, 0.08, 3)


def watched(turn, shift, rng, noise=0.0, count=6, moving=0.0):
    """A monitor whose camera is turned (rad) and shifted (m) against its calibration."""
    monitor, row = MountMonitor(), canes(rng)
    for k, (R, t) in enumerate(poses(rng, count)):
        seen = []
        for axis in row:
            # What the true camera sees, where the calibration has it.
            local = (axis - t) @ R
            true = (local - shift) @ pin.exp3(np.array(turn))
            seen.append(true @ R.T + t + noise * rng.standard_normal(3) + 0.3 * noise * rng.standard_normal(axis.shape))
        monitor.observe(R, t, BASE + [k * moving, 0.0, 0.0], seen)
    return monitor


turns = st.tuples(*[st.floats(-0.03, 0.03)] * 3)


@settings(max_examples=25, deadline=None, phases=(Phase.explicit, Phase.generate))
@given(turns, st.floats(0.0, 0.002), st.integers(0, 1000))
def test_a_turned_camera_is_found_within_the_interval_that_is_told(turn, noise, seed):
    rng = np.random.default_rng(seed)
    error = watched(turn, rng.normal(0.0, 0.002, 3), rng, noise).error
    sd = np.sqrt(np.diag(error.covariance)[:3])
    assert (np.abs(error.turn - turn) < 4.5 * sd + 1e-4).all() and sd[:2].max() < 0.012
    true = np.hypot(turn[0], turn[1])
    if error.warning is not None:
        assert true > WARNS - 2.0 * error.interval
    if true > WARNS + 2.0 * error.interval:
        assert error.warning is not None


@pytest.mark.parametrize(
    ("turn", "code"),
    [
        ((0.0, 0.01, 0.0), "camera_looks_right"),
        ((0.0, -0.01, 0.0), "camera_looks_left"),
        ((0.01, 0.0, 0.0), "camera_looks_up"),
        ((-0.01, 0.0, 0.0), "camera_looks_down"),
    ],
)
def test_it_tells_the_side_and_the_angle(turn, code):
    warning = watched(turn, np.zeros(3), np.random.default_rng(1), 0.0005).error.warning
    assert warning.code == code and dict(warning.values)["angle"] == pytest.approx(0.573, abs=0.2)


def test_a_camera_that_is_where_it_was_calibrated_is_not_complained_about():
    straight = [watched((0.0, 0.0, 0.0), np.zeros(3), np.random.default_rng(seed), 0.001) for seed in range(20)]
    assert sum(each.error.warning is not None for each in straight) <= 1


def test_pictures_from_one_place_or_with_a_base_that_moves_say_nothing():
    rng = np.random.default_rng(2)
    monitor, row = MountMonitor(), canes(rng)
    for _ in range(9):
        monitor.observe(AHEAD, np.array([0.5, 0.0, 1.05]), BASE, row)
    assert monitor.error is None
    assert watched((0.0, 0.01, 0.0), np.zeros(3), rng, moving=0.05).error is None
    few = watched((0.0, 0.01, 0.0), np.zeros(3), rng, count=2)
    assert few.error is None


def test_another_calibration_begins_anew():
    monitor = watched((0.0, 0.01, 0.0), np.zeros(3), np.random.default_rng(3))
    assert monitor.error is not None
    monitor.forget()
    assert monitor.error is None
