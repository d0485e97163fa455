"""Configuration of the real robot: section `[real]`."""

from typing import Annotated, Literal

from msgspec import Meta, Struct

from rolling_panda.bounds import at_least, at_most, within

Key = Annotated[str, Meta(max_length=200)]
#: Bounds of the load's centre of mass (m) and of its inertia (kg·m²).
_Centre = Annotated[float, within(-0.3, 0.3)]
_Inertia = Annotated[float, Meta(ge=0.0, le=0.1)]


class BaseConfig(Struct, frozen=True, forbid_unknown_fields=True):
    """The MP-500: its maker's ROS 2 nodes behind a `zenoh-bridge-ros2dds`.

    Attributes:
        connect: Endpoint of that bridge; empty = the router of this program.
        namespace: Namespace of the ROS nodes, the prefix of every key.
        command_hz: Rate of the velocity commands (Hz).
        fade_s: Time without a target, or without wheel speeds, after which the last command begins to fade.
        deadline_s: Time without a target after which zero is commanded.
        stale_s: Wheel speeds older than this are a fault.
        unmonitored_s: An emergency-stop state older than this is a fault.
        runaway_s: If the wheels still turn this long after zero was commanded, the relay board stops them.
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
        address: Address of its control box; empty = no arm.
        realtime: `enforce` refuses to start without a real-time kernel.
        fade_s: Time without a target after which the last target begins to fade.
        deadline_s: Time without a target after which the arm holds.
        joint_margin: Distance to a joint's limit at which motion towards it stops (rad).
        load_mass: Mass of the load on the flange (kg).
        load_center: Centre of mass of the load in the flange's frame (m).
        load_inertia: Inertia of the load about that centre: diagonal (kg·m²).
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
        connect: Endpoint of the bridge to that service; empty = the router of this program.
        timeout_s: Time limit of the blades.
        retry_s: Pause between attempts to open jammed blades.
    """

    service: Key = ""
    connect: Key = ""
    timeout_s: Annotated[float, at_most(2.5)] = 2.0
    retry_s: Annotated[float, at_least(0.5, 60.0)] = 1.0


class CameraConfig(Struct, frozen=True, forbid_unknown_fields=True):
    """The RealSense on the hand.

    Attributes:
        enabled: Whether the camera is present.
        serial: Its serial number; empty = the only one.
        width: Image width (px); 848 is best for depth.
        height: Image height (px).
        rate_hz: Frame rate (Hz).
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
