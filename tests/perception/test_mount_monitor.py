"""The monitor finds how a camera is turned from canes that it has seen from several places, and only then."""

import numpy as np
import pinocchio as pin
import pytest
from hypothesis import Phase, given, settings
from hypothesis import strategies as st

from perception.calibration.monitor import LATE_WARNS, WARNS, MountMonitor, TimeOffset

AHEAD = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]])
BASE = np.zeros(3)
UPRIGHT = pin.SE3.Identity()


def canes(rng, count=12, first=0.0, last=1.1):
    """Canes of a row 0.75 m to the left, in odom."""
    out = []
    for x in np.linspace(first, last, count):
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


class Rider:
    """A robot that looks at a row while it moves, with pictures that are exposed later than their joints."""

    def __init__(self, late, rng, noise=0.0, turn=(0.0, 0.0, 0.0), jitter=0.0):
        self.monitor, self.row, self.rng = MountMonitor(), canes(rng, 16, -0.4, 1.7), rng
        self.late, self.noise, self.turn, self.jitter = late, noise, np.array(turn), jitter
        self.stamp = 0.0

    def look(self, R, t, velocity, base=BASE, wrong=UPRIGHT):
        """A picture; `velocity` is of the camera in its own frame, `wrong` how the base stands otherwise."""
        late = self.late + self.jitter * self.rng.standard_normal()
        true = wrong * pin.SE3(R, np.array(t)) * pin.exp6(np.array(velocity) * late)
        seen = []
        for axis in self.row:
            local = (axis - true.translation) @ true.rotation @ pin.exp3(self.turn)
            if abs(local[0, 0]) > 0.5:
                continue
            off = self.noise * (self.rng.standard_normal(3) + 0.3 * self.rng.standard_normal(axis.shape))
            seen.append(local @ R.T + t + off)
        self.stamp += 0.5
        self.monitor.observe(R, np.array(t), np.array(base, float), seen, np.array(velocity, float), self.stamp)

    def move_arm(self, count=14, speed=0.2, turning=0.3):
        """The arm moves while the base stands."""
        for R, t in poses(self.rng, count):
            v, w = self.rng.normal(0.0, speed, 3), self.rng.normal(0.0, turning, 3)
            self.look(R, t, [*v, *w])
        return self

    def drive(self, stops=4, slip=0.0, tilt=0.0):
        """The base drives along the row with the arm at rest, and stops now and then."""
        x = slipped = 0.0
        for _ in range(stops):
            for way, speed in ((0.05, 0.0), (0.0, 0.0), (0.05, 0.25), (0.125, 0.25), (0.125, 0.25)):
                x, slipped = x + way, slipped + slip * way * self.rng.standard_normal()
                leans = self.rng.normal(0.0, tilt, 3) * (1.0, 1.0, 0.2)
                under = pin.SE3(np.eye(3), np.array([x - 0.5, 0.0, 0.0]))
                wrong = (
                    pin.SE3(np.eye(3), np.array([slipped, 0.0, 0.0]))
                    * under
                    * pin.SE3(pin.exp3(leans), np.zeros(3))
                    * under.inverse()
                )
                # The camera looks to the left of the way: forward is along its x.
                self.look(AHEAD, [x, 0.0, 1.05], [speed, *[0.0] * 5], (x - 0.5, 0.0, 0.0), wrong)
        return self


offsets = st.floats(-0.06, 0.06)


@pytest.mark.long
@settings(max_examples=12, deadline=None, phases=(Phase.explicit, Phase.generate))
@given(offsets, turns, st.floats(0.0, 0.0015), st.integers(0, 1000))
def test_pictures_in_motion_tell_time_and_mount_apart(late, turn, noise, seed):
    rng = np.random.default_rng(seed)
    monitor = Rider(late, rng, noise, turn, jitter=0.005).move_arm().monitor
    time, error = monitor.time, monitor.error
    assert abs(time.offset - late) < 4.0 * time.sd and time.sd < 0.01
    assert (np.abs(error.turn - turn) < 4.5 * np.sqrt(np.diag(error.covariance)[:3]) + 1e-3).all()
    if time.warning is not None:
        assert time.warning.code == ("frames_late" if late > 0.0 else "frames_early")
        assert abs(late) > LATE_WARNS - 4.0 * time.sd
    if abs(late) > LATE_WARNS + 6.6 * time.sd:
        assert time.warning is not None


@settings(max_examples=12, deadline=None, phases=(Phase.explicit, Phase.generate))
@given(offsets, st.floats(0.0, 0.0015), st.floats(0.0, 0.04), st.integers(0, 1000))
def test_a_survey_that_starts_and_stops_tells_the_offset_though_its_wheels_slip(late, noise, slip, seed):
    rider = Rider(late, np.random.default_rng(seed), noise, jitter=0.003).drive(slip=slip)
    time = rider.monitor.time
    assert abs(time.offset - late) < 4.0 * time.sd and time.sd < 0.02
    assert rider.monitor.error is None, "the mount is told while the base stands"


@pytest.mark.long
@pytest.mark.parametrize(
    ("how", "ground", "jitter"), [("move_arm", {}, 0.01), ("drive", {"slip": 0.08, "tilt": 0.007}, 0.005)]
)
def test_the_standard_deviation_is_that_of_the_errors(how, ground, jitter):
    riders = [Rider(0.02, np.random.default_rng(seed), 0.001, jitter=jitter) for seed in range(16)]
    told = [getattr(rider, how)(**ground).monitor.time for rider in riders]
    scaled = [(each.offset - 0.02) / each.sd for each in told]
    assert 0.4 < np.std(scaled) < 1.4 and abs(np.mean(scaled)) < 0.8


@pytest.mark.parametrize(
    ("offset", "sd", "code"),
    [
        (0.020, 0.005, "frames_late"),
        (-0.020, 0.005, "frames_early"),
        (0.020, 0.009, None),
        (0.008, 0.001, None),
        (-0.008, 0.001, None),
    ],
)
def test_an_offset_is_complained_about_that_is_certain_and_matters(offset, sd, code):
    warning = TimeOffset(offset, sd, 9).warning
    assert (None if warning is None else warning.code) == code
    if warning is not None:
        assert dict(warning.values) == pytest.approx({"offset": 20.0, "interval": 13.0})


@pytest.mark.long
def test_a_camera_whose_times_are_right_is_not_complained_about():
    riders = [Rider(0.0, np.random.default_rng(seed), 0.001, jitter=0.01) for seed in range(6)]
    assert not any(rider.move_arm().drive().monitor.time.warning for rider in riders)


def test_at_rest_at_one_speed_or_with_few_moving_pictures_nothing_is_told_of_time():
    rng = np.random.default_rng(5)
    still = Rider(0.04, rng, 0.001).move_arm(speed=0.0, turning=0.0)
    assert still.monitor.error is not None and still.monitor.time is None
    steady = Rider(0.04, rng, 0.001)
    for k in range(20):
        steady.look(AHEAD, [0.1 * k, 0.0, 1.05], [0.2, *[0.0] * 5], (0.1 * k - 0.5, 0.0, 0.0))
    assert steady.monitor.time is None
    few = Rider(0.04, rng, 0.001).move_arm(8, 0.0, 0.0).move_arm(2)
    assert few.monitor.time is None
    unknown = Rider(0.04, rng, 0.001)
    for R, t in poses(rng, 12):
        unknown.look(R, t, [np.nan] * 6)
    assert unknown.monitor.time is None and unknown.monitor.error is None


def test_a_clock_that_jumps_tells_nothing_wrong():
    rider = Rider(0.04, np.random.default_rng(6), 0.001).move_arm().drive()
    assert rider.monitor.time.warning.code == "frames_late"
    rider.late, rider.stamp = 0.0, 1.0
    rider.look(AHEAD, [0.5, 0.0, 1.05], [0.0] * 6)
    assert rider.monitor.time is None, "what was seen by the old clock is no more"
    time = rider.move_arm().monitor.time
    assert abs(time.offset) < 4.0 * time.sd < 0.03 and time.warning is None
    # For some pictures the postures are those of another moment.
    jumping = Rider(0.0, np.random.default_rng(7), 0.001).move_arm(12)
    jumping.late = 0.5
    jumping.move_arm(3)
    jumping.late = 0.0
    assert jumping.move_arm(6).monitor.time.warning is None
