"""How the base is turned, from a camera's inertial sensors on an arm that moves: simulated exactly, then spoilt."""

import math

import numpy as np
import pinocchio as pin
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from bridge.core.attitude import GRAVITY, BaseOrientation, Inertial
from rolling_panda.model.base_attitude import attitude_of, rotation
from rolling_panda.model.differential_drive import NXI, Array
from rolling_panda.model.robot import RobotModel
from tests.support.bridge_rig import MODEL

DT = 0.01
ARM = np.array([-0.28, -0.11, -0.04, -2.0, 1.68, 1.21, -0.27])


def about(x: float = 0.0, y: float = 0.0, z: float = 0.0) -> Array:
    out: Array = pin.exp3(np.array([x, y, z]))
    return out


class Rocking:
    """A base that turns as told, an arm that moves as told, and what the estimate makes of them."""

    def __init__(self, mount: Array | None = None, bias: Array | None = None, noise: float = 0.0) -> None:
        self.mount = np.eye(3) if mount is None else mount
        self.bias = np.zeros(3) if bias is None else bias
        self.estimate, self.random, self.noise = BaseOrientation(RobotModel()), np.random.default_rng(3), noise
        self.R, self.q, self.now = np.eye(3), np.array([0.0, 0.0, *ARM]), 0.0
        self.pushed = np.zeros(3)
        self.seen = self.camera()

    def camera(self) -> Array:
        """R_world_camera of the true camera."""
        on_base = MODEL.pose(np.array([0.0, 0.0, 0.0, *self.q]), MODEL.camera_id).rotation
        out: Array = self.R @ on_base @ self.mount
        return out

    def step(self, R: Array | None = None, arm: Array | None = None, wheels: float = 0.0, sees: bool = True) -> None:
        """One period in which the base comes to R, the arm to a posture, and the wheels turn (rad/s)."""
        before = self.q.copy()
        self.R = self.R if R is None else R
        self.q[2:] = self.q[2:] if arm is None else arm
        self.q[:2] += wheels * DT
        camera = self.camera()
        rate = pin.log3(self.seen.T @ camera) / DT + self.bias + self.noise * self.random.standard_normal(3)
        force = camera.T @ (np.array([0.0, 0.0, GRAVITY]) + self.pushed)
        self.seen, self.now = camera, self.now + DT
        sample = Inertial(self.now, rate, force) if sees else None
        self.estimate.update(sample, self.q, (self.q - before) / DT, 0.0, self.now)

    def stand(self, seconds: float) -> None:
        for _ in range(round(seconds / DT)):
            self.step()

    def reach(self, arm: Array, seconds: float = 1.0) -> None:
        start, count = self.q[2:].copy(), round(seconds / DT)
        for k in range(1, count + 1):
            self.step(arm=start + (arm - start) * 0.5 * (1.0 - math.cos(math.pi * k / count)))

    def roll(self, R: Array, seconds: float = 2.0, arm: Array | None = None) -> None:
        """Drive while the base turns to R and the arm goes to a posture."""
        R_0, start, count = self.R, self.q[2:].copy(), round(seconds / DT)
        by = pin.log3(R_0.T @ R)
        for k in range(1, count + 1):
            share = 0.5 * (1.0 - math.cos(math.pi * k / count))
            self.step(R_0 @ pin.exp3(share * by), None if arm is None else start + share * (arm - start), 2.0)

    @property
    def off(self) -> float:
        """Error of the estimate (rad)."""
        return float(np.linalg.norm(pin.log3(self.estimate.R.T @ self.R)))


@given(
    st.floats(-0.1, 0.1),
    st.floats(-0.1, 0.1),
    st.floats(-1.0, 1.0),
    st.lists(st.floats(-0.6, 0.6), min_size=7, max_size=7),
)
@settings(max_examples=20, deadline=None)
def test_whatever_the_arm_does_meanwhile_the_base_is_told_to_turn_as_it_does(
    roll: float, pitch: float, heading: float, arm: list[float]
) -> None:
    robot = Rocking(bias=np.array([0.01, -0.02, 0.005]))
    robot.stand(1.0)
    robot.roll(about(z=heading) @ about(y=pitch) @ about(x=roll), arm=ARM + np.array(arm))
    assert robot.off < 0.002
    assert np.allclose(robot.estimate.R @ robot.estimate.R.T, np.eye(3), atol=1e-9)


def test_noise_and_bias_do_not_make_it_drift_where_the_base_stands() -> None:
    robot = Rocking(bias=np.array([0.01, -0.02, 0.015]), noise=0.0024)
    robot.stand(20.0)
    robot.reach(ARM + 0.4)
    robot.stand(20.0)
    assert robot.off < 0.003
    assert attitude_of(robot.estimate.R, 0.0)[1] == pytest.approx(0.0, abs=1e-4)


def test_roll_and_pitch_return_to_what_gravity_says_and_the_heading_stays() -> None:
    robot = Rocking()
    robot.stand(1.0)
    robot.roll(about(x=0.05, y=-0.03, z=0.4))
    robot.estimate.R = robot.estimate.R @ about(x=0.02)
    heading = attitude_of(robot.estimate.R, 0.0)[1]
    robot.stand(12.0)
    assert robot.off < 0.002
    assert attitude_of(robot.estimate.R, 0.0)[1] == pytest.approx(heading, abs=0.002)


def test_a_base_that_speeds_up_is_not_taken_to_tilt() -> None:
    robot = Rocking()
    robot.stand(1.0)
    for push in (0.6, -0.6):
        robot.pushed = np.array([push, 0.0, 0.0])
        robot.roll(robot.R, 0.5)
        assert robot.off < 0.002
    robot.pushed = np.zeros(3)


def test_a_camera_that_is_turned_on_its_hand_is_noticed_by_motions_of_the_arm() -> None:
    robot = Rocking(mount=about(0.006, -0.008, 0.004), noise=0.0024)
    other = ARM + np.array([0.5, 0.3, 0.2, 0.4, -0.3, 0.3, 0.6])
    robot.stand(1.0)
    robot.roll(robot.R, arm=other)
    unaware = robot.off
    robot.roll(robot.R, arm=ARM)
    robot.stand(1.0)
    for arm in (other, ARM, ARM - 0.3, ARM, ARM + np.array([-0.4, 0.2, 0.3, 0.3, 0.5, -0.2, 0.8]), ARM):
        robot.reach(arm)
        robot.stand(0.5)
    before = robot.off
    robot.roll(robot.R, arm=other)
    assert unaware > 0.004
    assert abs(robot.off - before) < 0.4 * unaware


def test_a_robot_that_drives_at_once_goes_by_its_wheels_until_it_has_stood() -> None:
    """One sample is no bias: its noise would turn the base by degrees in a row."""
    robot = Rocking(bias=np.array([0.0, 0.0, 0.02]), noise=0.0024)
    robot.stand(0.1)
    robot.roll(robot.R, 10.0)
    assert not robot.estimate.measured and robot.off == 0.0
    robot.stand(1.0)
    robot.roll(about(z=0.3))
    assert robot.estimate.measured and robot.off < 0.003


def test_a_sample_that_is_told_twice_counts_once_and_a_missing_one_is_made_up_for_by_the_next() -> None:
    robot = Rocking()
    robot.stand(1.0)
    start = robot.now
    for k in range(1, 101):
        robot.step(about(z=0.003 * k), wheels=2.0)
        camera = robot.camera()
        again = Inertial(robot.now, np.zeros(3), camera.T @ [0.0, 0.0, GRAVITY])
        robot.estimate.update(again, robot.q, np.full(NXI, 1.0), 0.0, robot.now)
    assert robot.now > start and robot.off < 0.002


def test_a_hand_that_shakes_faster_than_it_is_followed_does_not_turn_the_base() -> None:
    """Blades that rub on wood: joint 6 swings by 4 mrad, 200 times a second, while the wheels roll."""
    robot = Rocking()
    robot.stand(1.0)
    speed = np.full(NXI, 2.0)
    for tick in range(1, 1001):
        robot.q[7] = ARM[5] + 0.004 * math.sin(2.0 * math.pi * 0.2 * tick)
        before, robot.now = robot.seen, robot.now + 0.001
        robot.seen = robot.camera()
        force = robot.seen.T @ [0.0, 0.0, GRAVITY]
        sample = Inertial(robot.now, pin.log3(before.T @ robot.seen) / 0.001, force)
        robot.estimate.feel(sample)
        if tick % 10 == 0:
            robot.estimate.update(sample, robot.q, speed, 0.0, robot.now)
    assert robot.off < 0.001


def test_a_push_on_a_parked_base_is_not_taken_for_a_turn_of_the_camera() -> None:
    robot = Rocking()
    robot.stand(1.0)
    arm = ARM + 0.4
    start, pushed = robot.q[2:].copy(), about(x=0.15)
    for k in range(1, 101):
        robot.step(pin.exp3(k / 100 * pin.log3(pushed)), start + k / 100 * (arm - start))
    robot.stand(0.5)
    for k in range(1, 101):
        robot.step(pin.exp3((1.0 - k / 100) * pin.log3(pushed)), arm + k / 100 * (start - arm))
    robot.stand(3.0)
    robot.roll(robot.R, arm=arm)
    assert robot.off < 0.01


@pytest.mark.parametrize("stands_first", [True, False])
def test_without_samples_or_a_bias_the_base_turns_as_its_wheels_say(stands_first: bool) -> None:
    estimate, up = BaseOrientation(RobotModel()), np.array([0.0, -GRAVITY, 0.0])
    xi, speed, now = np.array([0.0, 0.0, *ARM]), np.zeros(NXI), 0.0
    for _ in range(100 if stands_first else 0):
        now += DT
        estimate.update(Inertial(now, np.zeros(3), up), xi, speed, 0.0, now)
    speed[:2] = -1.0, 1.0
    for _ in range(100):
        now += DT
        estimate.update(None if stands_first else Inertial(now, np.zeros(3), up), xi, speed, 0.003, now)
    assert attitude_of(estimate.R, 0.0)[1] == pytest.approx(0.3)
    assert not estimate.measured


@pytest.mark.parametrize("number", [math.nan, math.inf])
def test_a_sample_that_is_no_number_spoils_nothing(number: float) -> None:
    robot = Rocking()
    robot.stand(1.0)
    robot.roll(about(x=0.04))
    for rate, position in ((np.full(3, number), robot.q), (np.zeros(3), np.full(NXI, number))):
        robot.now += DT
        robot.estimate.update(Inertial(robot.now, rate, np.zeros(3)), position, np.zeros(NXI), number, robot.now)
    robot.roll(about(x=-0.04))
    assert robot.off < 0.002


@given(st.floats(-0.4, 0.4), st.floats(-0.4, 0.4), st.floats(-3.0, 3.0), st.floats(-1.0, 1.0))
def test_an_attitude_and_a_heading_are_the_orientation_they_were_taken_from(
    roll: float, pitch: float, heading: float, height: float
) -> None:
    R = about(z=heading) @ about(y=pitch) @ about(x=roll)
    attitude, told = attitude_of(R, height)
    assert np.allclose(about(z=told) @ rotation(attitude), R, atol=1e-9) and attitude.height == height


@pytest.mark.parametrize("R", [about(x=1.5), about(y=-1.5), about(y=1.5) @ about(x=2.0)])
def test_no_base_is_told_to_stand_more_steeply_than_a_message_can_tell(R: Array) -> None:
    attitude, _ = attitude_of(R, 0.0)
    assert abs(attitude.roll) <= 0.5 and abs(attitude.pitch) <= 0.5
