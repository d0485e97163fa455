"""Configuration of the real robot: section `[real]`."""

from typing import Annotated, Literal

from msgspec import Meta, Struct

from rolling_panda.bounds import at_least, at_most, within

Key = Annotated[str, Meta(max_length=200)]
#: Where the centre of what hangs on the flange may be (m), and what its inertia may be (kg·m²).
_Centre = Annotated[float, within(-0.3, 0.3)]
_Inertia = Annotated[float, Meta(ge=0.0, le=0.1)]


class BaseConfig(Struct, frozen=True, forbid_unknown_fields=True):
    """The MP-500 as its maker's ROS 2 nodes show it behind a `zenoh-bridge-ros2dds`.

    Attributes:
        connect: Where that bridge is reached; empty = the router of this program.
        namespace: Of the ROS nodes, put before every key.
        command_hz: Velocity commands a second.
        fade_s: Silence of this program, or of the wheels, after which the last command begins to fade.
        deadline_s: Silence after which zeros are the goal.
        stale_s: Wheel speeds older than this are a fault.
        unmonitored_s: An emergency-stop state older than this is a fault.
        runaway_s: Wheels that still turn this long after zeros were commanded are stopped by the relay board.
    """

    connect: Key = ""
    namespace: Key = ""
    command_hz: Annotated[float, at_least(20.0, 200.0)] = 50.0
    fade_s: Annotated[float, at_most(0.1)] = 0.07
    deadline_s: Annotated[float, at_most(0.2)] = 0.2
    stale_s: Annotated[float, at_most(0.3)] = 0.2
    unmonitored_s: Annotated[float, at_most(2.0)] = 1.0
    runaway_s: Annotated[float, at_most(1.0)] = 1.0


class ArmConfig(Struct, frozen=True, forbid_unknown_fields=True):
    """The Panda, through libfranka.

    Attributes:
        address: Of its control box; empty = no arm.
        realtime: `enforce` refuses to start without a real-time kernel.
        fade_s: Silence of this program after which the last target begins to fade.
        deadline_s: Silence after which the arm holds.
        joint_margin: Distance to a joint's limit at which motion towards it has ended (rad).
        load_mass: Of what hangs on the flange (kg).
        load_center: Its centre of mass in the flange's frame (m).
        load_inertia: Its inertia about that centre: diagonal (kg·m²).
        contact_torque: External torque of a joint that stops the arm (Nm).
        contact_force: External force at the flange that stops the arm (N).
    """

    address: Key = ""
    realtime: Literal["enforce", "ignore"] = "enforce"
    fade_s: Annotated[float, at_most(0.1)] = 0.07
    deadline_s: Annotated[float, at_most(0.2)] = 0.2
    joint_margin: Annotated[float, at_least(0.005, 0.2)] = 0.01
    load_mass: Annotated[float, Meta(ge=0.0, le=3.0)] = 1.2
    load_center: tuple[_Centre, _Centre, _Centre] = (0.0, 0.0, 0.08)
    load_inertia: tuple[_Inertia, _Inertia, _Inertia] = (0.004, 0.004, 0.002)
    contact_torque: Annotated[float, at_most(40.0)] = 20.0
    contact_force: Annotated[float, at_most(60.0)] = 30.0


class CutterConfig(Struct, frozen=True, forbid_unknown_fields=True):
    """The secateurs behind a ROS 2 service.

    Attributes:
        service: Key of the service; empty = no cutter.
        connect: Where the bridge to that service is reached; empty = the router of this program.
        timeout_s: How long the blades may take.
        retry_s: Pause between attempts to open blades that jam.
    """

    service: Key = ""
    connect: Key = ""
    timeout_s: Annotated[float, at_most(2.5)] = 2.0
    retry_s: Annotated[float, at_least(0.5, 60.0)] = 1.0


class CameraConfig(Struct, frozen=True, forbid_unknown_fields=True):
    """The RealSense on the hand.

    Attributes:
        enabled: Whether there is one.
        serial: Its serial number; empty = the only one.
        width: Image width (px); 848 is best for depth.
        height: Image height (px).
        rate_hz: Frames a second.
    """

    enabled: bool = True
    serial: Key = ""
    width: Annotated[int, Meta(ge=160, le=1920)] = 848
    height: Annotated[int, Meta(ge=120, le=1080)] = 480
    rate_hz: Annotated[int, Meta(ge=1, le=90)] = 30


class RealConfig(Struct, frozen=True, forbid_unknown_fields=True):
    """All devices of the real robot."""

    base: BaseConfig = BaseConfig()
    arm: ArmConfig = ArmConfig()
    camera: CameraConfig = CameraConfig()
    cutter: CutterConfig = CutterConfig()
