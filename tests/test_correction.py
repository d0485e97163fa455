import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from controller.correction import Correction
from controller.trajectory import Progress, Rates

RATES = Rates(0.03, 1.0, 10.0)
places = st.tuples(*[st.floats(-0.01, 0.01)] * 3)


@given(places, st.floats(0.0, 5.0))
def test_it_keeps_its_bounds_and_is_all_there_at_its_end(by, begin):
    made = Correction.within(begin, np.array(by), RATES)
    size, dt = float(np.linalg.norm(by)), made.duration / 1000
    times = begin + np.arange(-10, 1011) * dt
    way = size * np.array([made.progress(time).s for time in times])
    speed = size * np.array([made.progress(time).rate for time in times])
    assert made.progress(begin) == Progress(0.0, 0.0, 0.0)
    assert made.progress(made.end + 1.0) == Progress(1.0, 0.0, 0.0)
    np.testing.assert_allclose(made.progress(made.end).s, 1.0)
    assert speed.max() <= RATES.velocity * (1 + 1e-6)
    assert np.abs(np.diff(speed) / dt).max() <= RATES.acceleration * (1 + 1e-6)
    assert np.abs(np.diff(speed, 2) / dt**2).max() <= RATES.jerk * (1 + 1e-3) + 1e-6
    np.testing.assert_allclose(np.gradient(way, dt)[20:-20], speed[20:-20], atol=1e-4)
