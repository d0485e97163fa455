"""Configuration of the bridge: section `[bridge]`."""

from typing import Annotated

from msgspec import Meta, Struct

from rolling_panda.bounds import at_least, at_most
from rolling_panda.config import ArmPosture, Positive
from rolling_panda.messages.robot import Delay
from rolling_panda.topics import JOINTS

NotNegative = Annotated[float, Meta(ge=0.0, le=1.0)]


class OdometryConfig(Struct, frozen=True, forbid_unknown_fields=True):
    """Delay and white noise of the simulated odometry.

    Attributes:
        delay_s: Delay from the wheels to the wire (s).
        position_noise: Standard deviation of x and y (m).
        heading_noise: Standard deviation of the heading (rad).
        linear_noise: Standard deviation of the forward velocity (m/s).
        angular_noise: Standard deviation of the yaw rate (rad/s).
    """

    delay_s: NotNegative = 0.0
    position_noise: NotNegative = 0.0
    heading_noise: NotNegative = 0.0
    linear_noise: NotNegative = 0.0
    angular_noise: NotNegative = 0.0


class BridgeConfig(Struct, frozen=True, forbid_unknown_fields=True):
    """Limits of the bridge, and parameters of the simulated robot. Units: s, m, rad, N.

    Attributes:
        start_arm: Posture of the simulated arm at the start (rad).
        max_age_s: A command computed from an older joint state is refused.
        fade_s: Time without a command after which the last setpoint begins to fade.
        deadline_s: Time without a command after which the setpoint is zero, the arm holds and the cutter is inhibited:
            10 ms less than the required 0.2 s, because a step can be late.
        wheel_acceleration: Limit of the setpoint of each wheel (rad/s²): 1.8 m/s². With the arm stretched forward,
            braking tips the base before the vendor's 2.4 m/s² are reached.
        joint_margin: Distance to an arm joint's limit (rad) at which motion towards it stops.
        arm_lag_s: Time constant of the simulated arm's velocity servos.
        wheel_lag_s: Time constant of the simulated wheels' velocity servos.
        close_s: Time to close the blades, and to open them again.
        opening: Gap between the open blades, along the tool's x.
        blade_half_length: Reach of the blades to either side of the tool's origin, along its z.
        blade_half_thickness: Half the thickness of the blades, along its y.
        largest_diameter: Largest diameter of wood that does not jam the blades.
        joints_hz: Rate of the joint states (Hz); the topic table has the nominal rate.
        camera_moving_hz: Frame rate while the robot moves or just after the row has changed (Hz).
        camera_resting_hz: Frame rate otherwise (Hz).
        frame_time_offset: By how much pictures are exposed later than their times tell (s). A frame gets the posture of
            that much later.
        inertial: Whether the camera's gyroscope and accelerometer correct the odometry: heading, height, roll, pitch.
        odometry: Delay and noise of the simulated base's odometry.
    """

    start_arm: ArmPosture = (-0.2784, -0.1128, -0.0354, -2.0055, 1.6759, 1.2124, -0.269)
    max_age_s: Annotated[float, at_most(0.2)] = 0.2
    fade_s: Annotated[float, at_most(0.1)] = 0.07
    # The required 0.2 s: a larger value leaves no time for a late step.
    deadline_s: Annotated[float, at_most(0.2)] = 0.19
    # From the vendor's limit down to the deceleration that stops from 0.3 m/s before the deadline.
    wheel_acceleration: Annotated[float, at_most(17.9, 12.5)] = 13.5
    joint_margin: Annotated[float, at_least(0.005, 0.2)] = 0.01
    arm_lag_s: Positive = 0.02
    wheel_lag_s: Positive = 0.05
    close_s: Positive = 0.3
    opening: Positive = 0.030
    blade_half_length: Positive = 0.018
    blade_half_thickness: Positive = 0.0025
    largest_diameter: Positive = 0.025
    joints_hz: Annotated[float, at_least(50.0, 1000.0)] = JOINTS.rate_hz
    camera_moving_hz: Positive = 2.0
    camera_resting_hz: Positive = 0.5
    frame_time_offset: Delay = 0.0
    inertial: bool = False
    odometry: OdometryConfig = OdometryConfig()
