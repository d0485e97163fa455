"""Golden vectors: bytes put together by hand from the CDR rules, as a ROS 2 node behind a Zenoh bridge has them."""

import struct

import numpy as np
import pytest

from bridge.fakes.mp500 import battery
from bridge.real import ros_messages as ros
from rolling_panda.errors import MessageError

LITTLE_ENDIAN = bytes([0, 1, 0, 0])
# Stamp 7 s 8 ns, then a string of four letters and its end: 17 bytes.
HEADER = struct.pack("<iII", 7, 8, 5) + b"odom\0"


def vector(x: float, y: float, z: float) -> object:
    return ros.make("geometry_msgs/msg/Vector3", x=x, y=y, z=z)


def header(frame: str = "odom") -> object:
    stamp = ros.make("builtin_interfaces/msg/Time", sec=7, nanosec=8)
    return ros.make("std_msgs/msg/Header", stamp=stamp, frame_id=frame)


def odometry() -> object:
    pose = ros.make(
        "geometry_msgs/msg/Pose",
        position=ros.make("geometry_msgs/msg/Point", x=1.0, y=2.0, z=0.0),
        orientation=ros.make("geometry_msgs/msg/Quaternion", x=0.0, y=0.0, z=0.6, w=0.8),
    )
    twist = ros.make(ros.TWIST, linear=vector(0.3, 0.0, 0.0), angular=vector(0.0, 0.0, 0.1))
    return ros.make(
        ros.ODOMETRY,
        header=header(),
        child_frame_id="base_link",
        pose=ros.make("geometry_msgs/msg/PoseWithCovariance", pose=pose, covariance=np.arange(36.0)),
        twist=ros.make("geometry_msgs/msg/TwistWithCovariance", twist=twist, covariance=-np.arange(36.0)),
    )


def joint_state() -> object:
    return ros.make(
        ros.JOINT_STATE,
        header=header(),
        name=["l", "r"],
        position=np.array([1.0, 2.0]),
        velocity=np.array([3.0, -4.0]),
        effort=np.zeros(0),
    )


def emergency() -> object:
    return ros.make(
        ros.EMERGENCY_STOP,
        header=header(),
        emergency_button_stop=True,
        scanner_stop=False,
        software_stop=False,
        emergency_state=2,
    )


# The body of each message: every number stands at a multiple of its size, counted from the end of the 4-byte header.
GOLDEN = [
    (
        lambda: ros.make(ros.TWIST, linear=vector(0.3, 0.0, 0.0), angular=vector(0.0, 0.0, -0.5)),
        struct.pack("<6d", 0.3, 0, 0, 0, 0, -0.5),
    ),
    (
        odometry,
        HEADER
        + bytes(3)
        + struct.pack("<I", 10)
        + b"base_link\0"
        + bytes(6)
        + struct.pack("<7d", 1, 2, 0, 0, 0, 0.6, 0.8)
        + struct.pack("<36d", *range(36))
        + struct.pack("<6d", 0.3, 0, 0, 0, 0, 0.1)
        + struct.pack("<36d", *(-float(i) for i in range(36))),
    ),
    (
        joint_state,
        HEADER
        + bytes(3)
        + struct.pack("<II2s2xI2s2x", 2, 2, b"l\0", 2, b"r\0")
        + struct.pack("<I", 2)
        + bytes(4)
        + struct.pack("<2d", 1, 2)
        + struct.pack("<I", 2)
        + bytes(4)
        + struct.pack("<2d", 3, -4)
        + struct.pack("<I", 0),
    ),
    (emergency, HEADER + bytes([1, 0, 0]) + struct.pack("<h", 2)),
    (lambda: ros.make(ros.SUCCESS, success=True), b"\1"),
    (lambda: ros.make(ros.SET_BOOL, data=True), b"\1"),
    (
        lambda: ros.make(ros.SET_BOOL_REPLY, success=True, message="jam"),
        b"\1" + bytes(3) + struct.pack("<I", 4) + b"jam\0",
    ),
]
NAMES = ["Twist", "Odometry", "JointState", "EmergencyStopState", "success", "SetBool", "SetBool reply"]


@pytest.mark.parametrize(("message", "body"), GOLDEN, ids=NAMES)
def test_the_bytes_are_those_that_cdr_asks_for(message, body: bytes) -> None:
    data = ros.encode(message())
    # The encapsulation's last two bits may tell how many bytes of padding stand at the end.
    assert data[:3] == LITTLE_ENDIAN[:3]
    assert data[4 : 4 + len(body)] == body
    assert not any(data[4 + len(body) :])
    read = ros.decode(message().__msgtype__, LITTLE_ENDIAN + body)
    assert ros.encode(read) == data


def test_a_battery_state_has_its_numbers_where_cdr_has_them() -> None:
    data = ros.encode(battery(header("odom"), 0.75))
    at = 4 + len(HEADER) + 3
    assert struct.unpack_from("<7f", data, at)[0] == 24.5
    assert struct.unpack_from("<7f", data, at)[6] == 0.75
    assert data[at + 28 : at + 32] == bytes([2, 0, 1, 1])
    assert data.endswith(b"slot1\0" + bytes(2) + struct.pack("<I", 12) + b"neobattery1\0")


@pytest.mark.parametrize("data", [b"", b"\0\1\0\0", b"\0\1\0\0" + b"\xff" * 200, b"x" * 60])
def test_bytes_that_are_no_such_message_are_refused(data: bytes) -> None:
    with pytest.raises(MessageError, match="JointState"):
        ros.decode(ros.JOINT_STATE, data)
    whole = ros.encode(joint_state())
    for cut in (8, 20, 40, len(whole) - 1):
        with pytest.raises(MessageError):
            ros.decode(ros.JOINT_STATE, whole[:cut])
