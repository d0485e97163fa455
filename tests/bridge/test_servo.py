import numpy as np

from bridge.sim.robot.servo import VelocityServos


def test_speed_follows_a_step_with_the_configured_lag() -> None:
    lag, inertia, dt = 0.05, np.diag([0.8]), 0.001
    servos = VelocityServos(np.array([lag]), np.array([60.0]), dt)
    speed, trail = np.zeros(1), []
    for _ in range(500):
        speed = speed + np.linalg.solve(inertia, servos.step(np.ones(1), speed, inertia)) * dt
        trail.append(float(speed[0]))
    # The area above the curve is the lag of any chain of first-order lags.
    assert abs(sum(1.0 - value for value in trail) * dt - lag) < 0.003
    assert abs(trail[-1] - 1.0) < 1e-3


def test_torque_stays_in_its_bound() -> None:
    servos = VelocityServos(np.array([0.02, 0.02]), np.array([12.0, 5.0]), 0.001)
    for _ in range(100):
        assert np.all(np.abs(servos.step(np.array([1e3, -1e3]), np.zeros(2), np.eye(2))) <= [12.0, 5.0])
