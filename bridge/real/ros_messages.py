"""ROS 2 messages of base and cutter, as CDR bytes with their 4-byte header.

ROS itself is not needed: `rosbags` has the standard messages, and the makers' own are defined here. A bridge between
DDS and Zenoh (`zenoh-bridge-ros2dds`) forwards exactly these bytes under the topic's name.
"""

from functools import cache
from typing import Any

from rolling_panda.errors import MessageError

TWIST = "geometry_msgs/msg/Twist"
ODOMETRY = "nav_msgs/msg/Odometry"
JOINT_STATE = "sensor_msgs/msg/JointState"
BATTERY_STATE = "sensor_msgs/msg/BatteryState"
EMERGENCY_STOP = "neo_msgs2/msg/EmergencyStopState"
#: Reply of the relay board's services.
SUCCESS = "rolling_panda/msg/Success"
#: std_srvs/srv/SetBool: request and reply.
SET_BOOL = "std_msgs/msg/Bool"
SET_BOOL_REPLY = "rolling_panda/msg/SetBoolReply"

# Field for field as in the packages' .msg and .srv files.
_DEFINITIONS = {
    EMERGENCY_STOP: (
        "std_msgs/Header header\nint16 EMFREE=0\nint16 EMSTOP=1\nint16 EMCONFIRMED=2\n"
        "bool emergency_button_stop\nbool scanner_stop\nbool software_stop\nint16 emergency_state"
    ),
    SUCCESS: "bool success",
    SET_BOOL_REPLY: "bool success\nstring message",
}
_INSTALL = "the driver for ROS 2 messages is not installed; run: pip install 'rolling-panda[real]'"


@cache
def _store() -> Any:
    try:
        from rosbags.typesys import Stores, get_types_from_msg, get_typestore
    except ImportError as error:
        raise MessageError(_INSTALL) from error
    store = get_typestore(Stores.ROS2_HUMBLE)
    for name, text in _DEFINITIONS.items():
        store.register(get_types_from_msg(text, name))
    return store


def make(kind: str, **fields: Any) -> Any:
    """A message of a ROS type; every field has to be given.

    Raises:
        MessageError: The driver for ROS messages is not installed.
    """
    return _store().types[kind](**fields)


def encode(message: Any) -> bytes:
    """CDR, little-endian."""
    return bytes(_store().serialize_cdr(message, message.__msgtype__))


def decode(kind: str, data: bytes) -> Any:
    """A message from CDR of either byte order.

    Raises:
        MessageError: The bytes are no such message, or hold more than one.
    """
    store = _store()
    from rosbags.serde import SerdeError

    try:
        return store.deserialize_cdr(data, kind)
    except SerdeError as error:
        raise MessageError(f"{len(data)} bytes are no {kind}: {error}") from error
