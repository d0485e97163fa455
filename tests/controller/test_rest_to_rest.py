"""Rest-to-rest profiles keep their rates and are as quick as these allow."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from controller.motion.rest_to_rest import Progress, Rates, durations, quickest, together

rate = st.floats(0.05, 20.0)


@given(st.floats(-8.0, 8.0), rate, rate, st.floats(0.1, 500.0))
def test_goes_the_distance_from_rest_to_rest_within_every_rate(distance, v, a, j):
    profile = quickest(distance, Rates(v, a, j))
    n = 2000
    t = np.linspace(0.0, profile.duration, n)
    s = profile.at(t)
    assert s[0] == pytest.approx(0.0, abs=1e-12) and s[-1] == pytest.approx(distance, abs=1e-12)
    if abs(distance) < 1e-6:
        return  # Finite differences are all rounding here.
    dt = t[1]
    speed = np.diff(s) / dt
    assert np.abs(speed).max() <= v * (1 + 1e-6)
    acceleration = np.diff(speed) / dt
    assert np.abs(acceleration).max() <= a * (1 + 1e-5)
    padded = np.concatenate([np.zeros(2), acceleration, np.zeros(2)])
    assert np.abs(np.diff(padded[1:-1])).max() / dt <= j * 1.01 + 1e-6 * a / dt
    assert (speed * np.sign(distance) >= -1e-9).all()


def test_is_as_quick_as_the_rates_allow():
    # Cruise: d / v + v / a + a / j.
    assert quickest(10.0, Rates(1.0, 2.0, 8.0)).duration == pytest.approx(10.0 + 0.5 + 0.25)
    # Short: all jerk, four stretches of ∛(d / 2j).
    assert quickest(0.001, Rates(10.0, 10.0, 2.0)).duration == pytest.approx(4 * np.cbrt(0.001 / 4.0))
    # No cruise: the velocity is reached in which d = v (v / a + a / j).
    profile = quickest(1.0, Rates(100.0, 2.0, 1000.0))
    assert profile.t_cruise == pytest.approx(0.0, abs=1e-9)
    assert profile.duration == pytest.approx(2 * np.sqrt(1.0 / 2.0), rel=1e-2)


@given(st.floats(-8.0, 8.0).filter(lambda d: abs(d) > 1e-3), rate, rate, st.floats(0.1, 500.0), st.floats(0.0, 1.0))
def test_progress_is_the_share_of_the_distance_with_its_derivatives(distance, v, a, j, share):
    profile = quickest(distance, Rates(v, a, j))
    time, step = share * profile.duration, 1e-4 * profile.duration
    at, before, after = (profile.progress(time + by) for by in (0.0, -step, step))
    assert at.s * distance == pytest.approx(float(profile.at(np.array(time))), abs=1e-9)
    # Rate and acceleration are those of s but for what they change by within a step.
    assert (after.s - before.s) / (2 * step) == pytest.approx(at.rate, abs=a / abs(distance) * step + 1e-7)
    assert (after.rate - before.rate) / (2 * step) == pytest.approx(
        at.acceleration, abs=j / abs(distance) * step + 1e-6
    )


def test_holds_before_and_after():
    profile = quickest(-2.0, Rates(1.0, 2.0, 8.0))
    assert profile.at(np.array([-1.0, 99.0])) == pytest.approx([0.0, -2.0])
    assert profile.progress(-1.0) == Progress(0.0, 0.0, 0.0) and profile.progress(99.0) == Progress(1.0, 0.0, 0.0)
    assert quickest(0.0, Rates(1.0, 2.0, 8.0)).duration == 0.0


@given(st.lists(st.floats(-8.0, 8.0), min_size=1), rate, rate, st.floats(0.1, 500.0))
def test_durations_are_those_of_the_profiles(distances, v, a, j):
    rates = Rates(v, a, j)
    expected = [quickest(distance, rates).duration for distance in distances]
    assert durations(np.array(distances), rates) == pytest.approx(expected, rel=1e-6, abs=1e-3)


@given(st.floats(0.01, 8.0), rate, rate, st.floats(0.1, 500.0), st.floats(0.2, 5.0), st.floats(0.01, 0.99))
def test_in_more_time_it_covers_the_same_more_slowly(distance, v, a, j, longer, share):
    profile = quickest(distance, Rates(v, a, j))
    time, duration = share * profile.duration, longer * profile.duration
    own, other = profile.progress(time), profile.over(longer * time, duration)
    assert (other.s, other.rate * longer, other.acceleration * longer**2) == pytest.approx(
        (own.s, own.rate, own.acceleration), rel=1e-6, abs=1e-9
    )
    assert profile.when(own.s) == pytest.approx(share, abs=1e-3)


@given(st.lists(st.tuples(st.floats(-3.0, 3.0), rate, rate, st.floats(0.1, 500.0)), min_size=1, max_size=4))
def test_together_every_distance_keeps_its_rates_and_one_uses_them(ways):
    limits = [(distance, Rates(v, a, j)) for distance, v, a, j in ways]
    common = together(*limits)
    for kind in ("velocity", "acceleration", "jerk"):
        shares = [abs(distance) * getattr(common, kind) / getattr(rates, kind) for distance, rates in limits]
        assert max(shares) <= 1.0 + 1e-9
        if any(abs(distance) > 1e-6 for distance, _ in limits):
            assert max(shares) == pytest.approx(1.0)
