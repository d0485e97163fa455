"""The place in the row: drift is found by canes and posts, not by what runs along the row, and a doubt is told."""

import numpy as np
import pinocchio as pin
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from perception.localisation.estimator import RZ, RowLocaliser, X, Y
from perception.localisation.row_map import RowMap
from perception.localisation.sighting import ALONG, CANE, UPRIGHT, WIRES, Sighting, joined

#: The row stands beside the line on which the base drives (m), and the camera looks at it from ahead of the base.
ROW, AHEAD, SIDE = 0.75, 0.5, 0.8
#: Standard deviation of what is common to a body of a frame, and of its samples (m).
BODY, SAMPLE = 0.0015, 0.002
EAST = np.array([1.0, 0.0, 0.0])

Body = tuple[int, np.ndarray, np.ndarray]


def vines(seed: int, first: float = -1.5, last: float = 5.5) -> list[Body]:
    """Canes, trunks, cordon and wires of a row, as kind, points and direction."""
    rng = np.random.default_rng(seed)
    return [*canes(rng, np.sort(rng.uniform(first, last, round((last - first) * 10)))), *lines(first, last)]


def canes(rng: np.random.Generator, places: np.ndarray) -> list[Body]:
    out: list[Body] = []
    for x in places:
        direction = np.array([*(rng.standard_normal(2) * [0.12, 0.06]), 1.0])
        direction /= np.linalg.norm(direction)
        start = np.array([x, ROW + 0.01 * rng.standard_normal(), 0.95 + 0.02 * rng.standard_normal()])
        out.append((CANE, start + np.arange(0.0, 0.25, 0.01)[:, None] * direction, direction))
    return out


def lines(first: float, last: float) -> list[Body]:
    out: list[Body] = []
    x = np.arange(first, last, 0.025)
    for kind, height in ((ALONG, 0.9), (WIRES, 1.2), (WIRES, 1.5)):
        out.append((kind, np.column_stack([x, np.full_like(x, ROW), np.full_like(x, height)]), EAST))
    return out


def posts(*places: float) -> list[Body]:
    height = np.arange(0.6, 1.4, 0.03)
    return [
        (
            UPRIGHT,
            np.column_stack([np.full_like(height, x), np.full_like(height, ROW), height]),
            np.array([0.0, 0.0, 1.0]),
        )
        for x in places
    ]


def placement(pose: np.ndarray) -> pin.SE3:
    return pin.SE3(pin.exp3(np.array([0.0, 0.0, pose[2]])), np.array([pose[0], pose[1], 0.0]))


def sees(row: list[Body], true: np.ndarray, odom: np.ndarray, rng: np.random.Generator) -> tuple[Sighting, np.ndarray]:
    """What the camera sees from a true pose, in odom, and where the camera is there."""
    T = placement(odom) * placement(true).inverse()
    camera = placement(true).act(np.array([AHEAD, 0.0, 1.05]))
    parts = []
    for kind, points, direction in row:
        there = points[np.abs(points[:, 0] - camera[0]) < SIDE]
        if len(there) < 4:
            continue
        off = BODY * rng.standard_normal(3) + SAMPLE * rng.standard_normal((len(there), 3))
        weight = 2.0 if kind in (CANE, UPRIGHT) else 0.15 * len(there)
        placed = (there + off) @ T.rotation.T + T.translation
        parts.append((kind, placed, np.tile(T.rotation @ direction, (len(there), 1)), weight))
    return joined(parts), T.act(camera)


class Drive:
    """A base that drives along a row; wheels that slip by some share, and turn it by so much a metre."""

    #: Whether inertial sensors have corrected the odometry.
    inertial = False

    def __init__(self, row: list[Body], seed: int, slip: float = 0.0, turns: float = 0.0, known: bool = False) -> None:
        self.row, self.slip, self.turns = row, slip, turns
        self.rng = np.random.default_rng([seed, 7])
        self.true, self.odom, self.now = np.zeros(3), np.zeros(3), 0.0
        row_map = RowMap()
        if known:
            row_map.add(*sees(row, self.true, self.odom, self.rng))
        self.localiser = RowLocaliser(row_map)
        self.look()

    def go(self, metres: float, step: float = 0.2, looks: bool = True) -> None:
        for _ in range(round(abs(metres) / step)):
            way = np.copysign(step, metres)
            self.true = self.true + [way, 0.0, 0.0]
            turned = self.turns * abs(way)
            rolled = (1.0 + self.slip) * way
            self.odom = self.odom + [rolled * np.cos(self.odom[2]), rolled * np.sin(self.odom[2]), turned]
            self.now += step / 0.15
            self.look() if looks else self.localiser.predict(self.odom, self.now, self.inertial)

    def look(self) -> None:
        self.localiser.predict(self.odom, self.now, self.inertial)
        self.localiser.update(*sees(self.row, self.true, self.odom, self.rng))

    @property
    def error(self) -> np.ndarray:
        """Of x, y and the heading in standard deviations."""
        estimate = self.localiser.estimate
        off = placement(self.true).inverse() * estimate.T_map_base
        away = np.array([*off.translation[:2], pin.log3(off.rotation)[2]])
        return away / np.sqrt(np.diag(estimate.covariance)[[X, Y, RZ]])


def spread_along(drive: Drive) -> float:
    return float(np.sqrt(drive.localiser.estimate.covariance[X, X]))


@pytest.mark.long
@given(st.integers(0, 10**6))
@settings(max_examples=4)
def test_without_drift_it_stays_at_zero_within_its_deviation(seed):
    drive = Drive(vines(seed), seed)
    drive.go(1.0)
    drive.go(-1.0)
    assert drive.localiser.estimate.state == "located"
    assert np.abs(drive.error).max() < 3.5
    assert np.linalg.norm(drive.localiser.estimate.T_map_odom.translation) < 0.006


@pytest.mark.long
@given(st.integers(0, 10**6), st.floats(-0.05, 0.05), st.floats(-0.06, 0.06))
@settings(max_examples=5)
def test_drift_is_found_within_its_interval(seed, slip, turns):
    drive = Drive(vines(seed), seed, slip, turns)
    drive.go(2.0)
    drive.go(-2.0)
    assert drive.localiser.estimate.state == "located"
    assert np.abs(drive.error).max() < 3.5
    assert np.abs(drive.localiser.estimate.T_map_base.translation[:2] - drive.true[:2]).max() < 0.012


@given(st.integers(0, 10**6), st.floats(-0.05, 0.05))
@settings(max_examples=4)
def test_wires_and_cordon_alone_tell_nothing_of_the_place_along_the_row(seed, slip):
    """The trap: what runs along the row fits wherever along it the robot is."""
    drive = Drive(lines(-1.5, 5.5), seed, slip, known=True)
    blind = Drive([], seed, slip)
    drive.go(0.8)
    blind.go(0.8)
    assert spread_along(drive) > 0.8 * spread_along(blind) > 0.01
    assert np.sqrt(drive.localiser.estimate.covariance[Y, Y]) < 0.008
    assert np.abs(drive.error).max() < 3.5


@given(st.integers(0, 10**6), st.floats(-0.05, 0.05))
@settings(max_examples=3)
def test_canes_as_even_as_a_fence_are_no_fix_once_the_place_is_doubtful(seed, slip):
    fence = [*canes(np.random.default_rng(seed), np.zeros(0)), *lines(-1.5, 5.5)]
    for x in np.arange(-1.5, 5.5, 0.045):
        points = np.array([x, ROW, 0.95]) + np.arange(0.0, 0.25, 0.01)[:, None] * [0.0, 0.0, 1.0]
        fence.append((CANE, points, np.array([0.0, 0.0, 1.0])))
    drive = Drive(fence, seed, slip)
    drive.go(0.8, looks=False)
    before = spread_along(drive)
    drive.look()
    assert before > 0.015 and spread_along(drive) > 0.8 * before
    assert abs(drive.error[0]) < 3.5


def test_a_post_tells_the_place_along_the_row_where_wires_do_not():
    drive = Drive([*posts(0.2, 0.6, 0.9), *lines(-1.5, 5.5)], 3, slip=0.04, known=True)
    drive.go(0.3)
    assert spread_along(drive) < 0.006 and np.abs(drive.error).max() < 3.5


@pytest.mark.parametrize(("odom", "stamp"), [((0.0, 0.0, 0.0), 0.2), ((0.0, 0.0, 0.0), -100.0), ((9.0, 3.0, 1.0), 0.2)])
def test_odometry_or_a_clock_that_begins_anew_leaves_the_base_where_it_was_until_wood_is_recognised(odom, stamp):
    drive = Drive(vines(4), 4)
    drive.go(1.0)
    before = drive.localiser.estimate
    drive.odom, drive.now = np.array(odom), drive.now + stamp
    after = drive.localiser.predict(drive.odom, drive.now)
    assert after.state == "lost" and after.cause in ("time ran back", "odometry jumped")
    assert after.T_map_base.isApprox(before.T_map_base, 1e-9)
    assert after.covariance[X, X] > 20 * before.covariance[X, X]
    drive.look()
    drive.look()
    assert drive.localiser.estimate.state == "located" and np.abs(drive.error).max() < 3.5


def test_a_frame_that_comes_late_changes_nothing():
    drive = Drive(vines(5), 5)
    drive.go(0.5)
    before = drive.localiser.estimate
    drive.localiser.predict(drive.odom - [0.1, 0.0, 0.0], drive.now - 0.3)
    drive.localiser.update(*sees(drive.row, drive.true - [0.1, 0.0, 0.0], drive.odom, drive.rng))
    after = drive.localiser.estimate
    assert after.T_map_base.isApprox(before.T_map_base, 1e-12) and np.array_equal(after.covariance, before.covariance)


@pytest.mark.long
@given(st.integers(0, 10**6))
@settings(max_examples=4)
def test_wood_of_another_row_is_refused_and_the_estimate_stays(seed):
    drive = Drive(vines(seed), seed)
    drive.go(0.6)
    before = drive.localiser.estimate.T_map_odom
    drive.row = vines(seed + 1)
    for _ in range(6):
        drive.go(0.02, step=0.02)
    after = drive.localiser.estimate
    assert after.state == "lost" and after.cause == "other wood"
    wood = np.array([0.6, ROW, 0.95])
    assert np.linalg.norm(after.T_map_odom.act(wood) - before.act(wood)) < 0.01
    assert after.covariance[X, X] > 0.05**2


def test_close_ups_of_other_wood_do_not_lose_the_robot_and_the_next_sight_of_the_row_does():
    """In the wind no cane of a close-up may be where it was."""
    drive = Drive(vines(3), 3)
    drive.go(0.6)
    drive.row, before = vines(4), drive.localiser.estimate.T_map_odom
    for _ in range(8):
        drive.now, drive.odom = drive.now + 0.5, drive.odom + [0.01, 0.0, 0.0]
        drive.localiser.predict(drive.odom, drive.now)
        drive.localiser.update(*sees(drive.row, drive.true, drive.odom, drive.rng), near=True)
    assert drive.localiser.estimate.state == "located"
    assert np.linalg.norm(drive.localiser.estimate.T_map_odom.act(EAST) - before.act(EAST)) < 0.02
    for _ in range(4):
        drive.go(0.02, step=0.02)
    assert drive.localiser.estimate.cause == "other wood"


def test_the_deviation_grows_with_the_way_and_beyond_a_bound_the_robot_is_lost():
    drive = Drive(vines(6), 6)
    spreads = []
    for _ in range(6):
        drive.go(1.0, looks=False)
        spreads.append(drive.localiser.spread)
    assert all(after > before for before, after in zip(spreads, spreads[1:], strict=False))
    assert drive.localiser.estimate.state == "lost" and drive.localiser.estimate.cause == "too far without wood"


def test_uneven_ground_is_followed_and_forgotten():
    drive = Drive(vines(7), 7)
    lean = pin.SE3(pin.exp3(np.array([0.01, -0.012, 0.0])), np.array([0.0, 0.0, 0.006]))
    drive.true, drive.odom, drive.now = np.array([0.1, 0.0, 0.0]), np.array([0.1, 0.0, 0.0]), 1.0
    seen, camera = sees(drive.row, drive.true, drive.odom, drive.rng)
    at = placement(drive.odom)
    leaning = at * lean.inverse() * at.inverse()
    drive.localiser.predict(drive.odom, drive.now)
    drive.localiser.update(seen.moved(leaning.rotation, leaning.translation), leaning.act(camera))
    tilt = pin.log3(drive.localiser.estimate.T_map_base.rotation)
    assert tilt[:2] == pytest.approx([0.01, -0.012], abs=0.004)
    drive.go(2.0, looks=False)
    after = drive.localiser.estimate.T_map_base
    assert abs(after.translation[2]) < 1e-3 and np.abs(pin.log3(after.rotation)[:2]).max() < 1e-3


def test_what_inertial_sensors_leave_of_height_and_tilt_adds_up_and_what_the_ground_makes_comes_back() -> None:
    spread = {}
    for inertial in (False, True):
        localiser, variances = RowLocaliser(), []
        for k in range(41):
            estimate = localiser.predict(np.array([0.2 * k, 0.0, 0.0]), 2.0 * k, inertial)
            variances.append(np.diag(estimate.covariance)[2:5])
        spread[inertial] = np.array(variances)
    ground, sensors = (each[40] / each[10] for each in (spread[False], spread[True]))
    assert np.all(ground < 1.1) and np.all(sensors > 2.0)


def test_a_base_that_creeps_is_located_again():
    """Between two frames it moves less than the noise of the odometry at rest."""
    drive = Drive(vines(3), 3, slip=0.1)
    for _ in range(5):
        drive.look()
    drive.go(0.3, step=0.002)
    off = placement(drive.true).inverse() * drive.localiser.estimate.T_map_base
    assert drive.odom[0] - drive.true[0] > 0.025
    wood = np.array([AHEAD, ROW, 1.0])
    assert np.linalg.norm(off.act(wood) - wood) < 0.010


def with_laterals(row: list[Body], seed: int) -> list[Body]:
    """A row with a shoot beside each cane."""
    rng = np.random.default_rng([seed, 3])
    beside = [
        (kind, points + [*(rng.choice([-1, 1], 2) * rng.uniform(0.018, 0.03, 2)), 0.0], direction)
        for kind, points, direction in row
        if kind == CANE
    ]
    return [*row, *beside]


@pytest.mark.parametrize("near", [True, False])
def test_a_picture_from_near_tells_the_place_though_it_shows_shoots_that_the_survey_did_not(near):
    """A survey that shows so much else is of another row."""
    for seed in range(4):
        drive = Drive(vines(seed), seed, slip=0.04)
        drive.go(0.6, looks=False)
        drive.row = with_laterals(drive.row, seed)
        drive.localiser.predict(drive.odom, drive.now)
        drive.localiser.update(*sees(drive.row, drive.true, drive.odom, drive.rng), near=near)
        off = abs(drive.localiser.estimate.T_map_base.translation[0] - drive.true[0])
        assert off < 0.006 if near else off > 0.015, (seed, off)


def test_what_is_seen_from_near_alone_is_not_added_to_the_map():
    row_map = RowMap()
    drive = Drive(vines(6), 6)
    localiser = RowLocaliser(row_map)
    for x, near, kept in ((0.0, False, 1), (0.3, True, 1), (0.3, False, 2)):
        pose = np.array([x, 0.0, 0.0])
        localiser.predict(pose, 10.0 * x)
        localiser.update(*sees(drive.row, pose, pose, drive.rng), near=near)
        assert len(row_map.cameras) == kept
