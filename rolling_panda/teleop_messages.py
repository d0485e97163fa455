"""What an operator's hand asks of the robot while it holds: where the tool should be, or how base and joints move."""

from typing import Annotated

from msgspec import Meta, Struct

from rolling_panda.messages import Count, Message, NonNegative, Pose, Text

JointVelocity = Annotated[float, Meta(ge=-10.0, le=10.0)]
#: Share of the robot's usual speed by hand.
SpeedShare = Annotated[float, Meta(ge=0.05, le=1.0)]
ArmVelocities = tuple[
    JointVelocity, JointVelocity, JointVelocity, JointVelocity, JointVelocity, JointVelocity, JointVelocity
]


class BaseVelocity(Struct, frozen=True, forbid_unknown_fields=True):
    """Forward velocity (m/s) and yaw rate (rad/s) of the base."""

    linear: Annotated[float, Meta(ge=-2.0, le=2.0)]
    angular: Annotated[float, Meta(ge=-4.0, le=4.0)]


class TeleopTarget(Message, frozen=True, kw_only=True):
    """Server → controller while the operator holds: what the robot should do.

    A `target` alone is followed by the tool, with base and arm together. With `base` beside it, the tool keeps to the
    target while the base moves under it, as far as the arm allows. `base` alone drives with the arm still, `joints`
    alone turns joints with the base still.

    Attributes:
        sequence: Strictly increasing; one that is not above the last is refused until the hold has ended by silence.
        hold: False ends the hold at once; silence ends it too.
        user: Who holds.
        target: Desired T_odom_tool in odom.
        base: Velocity of the base.
        joints: Velocities of the arm's joints (7, rad/s).
        client: Tells apart who has the same name, as in an intent.
        share: Of the usual speed, for all of the above.
        round_trip_s: From the holder's page to the server and back, as the server measured it (s).
    """

    sequence: Count
    hold: bool
    user: Text
    target: Pose | None = None
    base: BaseVelocity | None = None
    joints: ArmVelocities | None = None
    client: Annotated[str, Meta(max_length=64)] = ""
    share: SpeedShare = 1.0
    round_trip_s: NonNegative = 0.0
