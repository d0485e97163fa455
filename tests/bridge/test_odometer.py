import numpy as np
import pytest

from bridge.config import OdometryConfig
from bridge.core.interface import NO_CUT, Measurement
from bridge.core.odometer import Odometer
from rolling_panda import messages as m
from rolling_panda.model.differential_drive import Array
from rolling_panda.model.robot import RobotModel

DRIVE = RobotModel().drive
TICK = 0.001


def measured(wheels: Array) -> Measurement:
    return Measurement(np.array([*wheels, *np.zeros(7)]), np.zeros(9), "open", "", "", NO_CUT)


def drive(config: OdometryConfig, seed: int = 0, v: float = 0.3, omega: float = 0.2) -> list[tuple[int, m.Odometry]]:
    """Two seconds at constant speed; each message with the tick at which it came out."""
    odometer, wheels, speeds = Odometer(DRIVE, config, TICK, seed), np.zeros(2), np.array(DRIVE.wheels(v, omega))
    odometer.follow(measured(wheels), 0.0)
    out = []
    for tick in range(1, 2001):
        wheels = wheels + speeds * TICK
        odometer.follow(measured(wheels), tick * TICK)
        if tick % 20 == 0:
            odometer.measure(tick, tick * TICK, speeds)
        message = odometer.due(tick)
        if message is not None:
            out.append((tick, message))
    return out


def test_it_follows_the_wheels_on_their_arc() -> None:
    told = [message for _, message in drive(OdometryConfig())]
    assert [message.sequence for message in told] == list(range(1, 101))
    assert {message.header.frame_id for message in told} == {"odom"}
    tick, last = drive(OdometryConfig())[-1]
    turned = 0.2 * tick * TICK
    assert last.pose.phi == pytest.approx(turned, abs=1e-9)
    assert last.pose.x == pytest.approx(0.3 / 0.2 * np.sin(turned), abs=1e-9)
    assert last.pose.y == pytest.approx(0.3 / 0.2 * (1 - np.cos(turned)), abs=1e-9)
    assert (last.linear, last.angular) == pytest.approx((0.3, 0.2))


def test_a_delayed_measurement_comes_late_and_says_when_it_was_true() -> None:
    for tick, message in drive(OdometryConfig(delay_s=0.03)):
        assert tick * TICK - message.header.stamp == pytest.approx(0.03)
        assert message.pose.phi == pytest.approx(0.2 * message.header.stamp, abs=1e-9)


def test_noise_is_white_and_its_seeds_repeat() -> None:
    config = OdometryConfig(position_noise=0.001, heading_noise=0.002, linear_noise=0.01, angular_noise=0.02)
    clean, noisy = drive(OdometryConfig()), drive(config, 3)
    assert noisy == drive(config, 3) != drive(config, 4)
    x = np.array([b.pose.x - a.pose.x for (_, a), (_, b) in zip(clean, noisy, strict=True)])
    speed = np.array([message.linear for _, message in noisy])
    turn = np.array([message.angular for _, message in noisy])
    assert 0.014 < turn.std() < 0.026 and abs(np.corrcoef(speed, turn)[0, 1]) < 0.5
    assert 0.0007 < x.std() < 0.0013 and abs(x.mean()) < 0.0004
    assert 0.007 < speed.std() < 0.013 and abs(speed.mean() - 0.3) < 0.004
