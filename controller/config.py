"""Settings of the controller, section `[controller]` of the configuration."""

from typing import Annotated, Literal

from msgspec import Meta, Struct

from controller.whole_body.hierarchy_config import HierarchyConfig
from rolling_panda.config import Positive

NotNegative = Annotated[float, Meta(ge=0.0, le=0.2)]
Gain = Annotated[float, Meta(ge=0.0, le=100.0)]
ArmPosture = tuple[float, float, float, float, float, float, float]


class ControllerConfig(Struct, frozen=True, forbid_unknown_fields=True):
    """How the robot is moved and supervised.

    Attributes:
        home: Survey posture of the arm (rad): the camera looks at the row.
        reach: Posture the search for a cut posture starts from (rad), elbow aside, tool to the left.
        method: Whole-body method by name.
        rate_hz: Control rate, that of the arm.
        base_rate_hz: Rate of the base; `rate_hz` over it, rounded, is the number of control periods in one of the base.
            Methods other than `hierarchy` run at one rate.
        row_heading: Direction of the row in odom (rad); the base keeps parallel to it, the row on its left.
        row_distance: Distance of the row from the line y = 0 along `row_heading` where the base drives (m).
        base_speed: Limit of the base in automatic work and teleoperation (m/s).
        base_yaw_rate: Limit of the base's turning (rad/s).
        base_acceleration: Limit of the base (m/s²), kept low so that the stretched arm does not tip it.
        base_yaw_acceleration: Limit of the base's turning up (rad/s²).
        base_braking: Of the base when the robot has to stop (m/s²).
        arm_share: Share of the arm's rated velocity that is used.
        arm_acceleration_share: Share of the arm's rated acceleration that is used.
        arm_jerk_share: Share of the arm's rated jerk that is used; braking for a reason may use all of it.
        tool_speed: Limit of the tool between cuts (m/s).
        tool_turn: Limit of the tool's turning (rad/s).
        tool_acceleration: Of planned motions (m/s²).
        tool_jerk: Of planned motions (m/s³).
        cut_speed: Limit in the last `slow_zone` before the cut (m/s).
        slow_zone: Length of it (m): with the blades' reach the canes are entered inside it.
        slow_braking: How the tool slows down to that (m/s²).
        blend: Share of the shorter of two legs that overlaps with the other, where the tool rounds the corner.
        advance_speed: Limit along the approach line (m/s).
        stand_off: Distance of the stand-off from the cut (m), from where the approach is straight.
        arm_only: Distance to a cut (m) within which only the arm moves, on the way in and out.
        clearance: Distance kept from the canes between cuts (m).
        position_tolerance: The tool is in place to cut (m).
        rotation_tolerance: The same for its direction (rad).
        settle_speed: Slower than this the tool counts as at rest there (m/s).
        settle_joints: Slower than this each joint does (rad/s); at 0.1 the bridge closes no blades.
        reach_timeout_s: A motion that has not ended this long after its planned end has failed (s).
        cut_timeout_s: A cut without outcome for this long is UNKNOWN (s).
        largest_radius: Canes thicker than this are refused (m).
        survey_speed: Of the base on a survey (m/s).
        confirm: Whether each point is looked at from near before it is cut.
        verify: Whether each cut is looked at afterwards; else the cutter's word is taken for it.
        look_within: The look before a cut is taken this near to the place clear of the canes (m).
        look_speed: The tool is slower than this meanwhile (m/s).
        look_from: The look afterwards is taken when the tool is this far from the cut (m).
        look_timeout_s: A look without a picture ends after this time (s).
        moved_tolerance: A point that moved further than this after acceptance is not cut (m).
        base_lag_s: Time constant with which the wheels follow their command (s).
        arm_lag_s: By which the arm's servos follow late (s); half a period comes on top.
        gain_position: Of the tool's position error (1/s).
        gain_rotation: Of the tool's rotation error (1/s).
        gain_posture: Of the null-space posture (1/s).
        gain_heading: Of the base's heading to the row (1/s).
        gain_manipulability: k₀ of the manipulability gradient.
        gain_limits: k of the joint-limit repulsion.
        limit_zone: γ_start, distance from a limit where repulsion begins (rad).
        damping: λ of the damped pseudo-inverse, in units of the weighted Jacobian.
        joint_margin: Distance from every joint limit that is never entered (rad).
        search_steps: Iterations of the posture search in 10 ms, spread over the control periods.
        joints_max_age_s: Older joint states stop the robot (s).
        odometry_max_age_s: Older odometry stops the robot (s).
        bridge_max_age_s: Older bridge states stop the robot (s).
        server_max_age_s: Older server heartbeats stop automatic work (s).
        supervision_s: Automatic work ends after so long without anybody who may operate and sees the robot (s).
        hold_link_max_age_s: Older server heartbeats end teleoperation (s).
        perception_max_age_s: Older perception heartbeats stop automatic work (s).
        ledger_max_age_s: Work whose record is not durable after this long is a fault (s).
        obstacles_max_age_s: Automatic work stops when the picture behind what is known to stand around is older (s);
            the camera rests for two of them when nothing moves.
        hold_max_age_s: Teleoperation ends after this silence (s).
        teleop_speed: Limit of the tool in teleoperation (m/s).
        teleop_turn: The same for turning (rad/s).
        teleop_base_speed: Limit of each wheel on the ground where base or tool are led by hand (m/s): from it
            `base_braking` has the base at rest 0.1 s after it hears of letting go, which leaves the word 50 ms.
        teleop_base: What the base does in teleoperation: `free` keeps it parallel to the row, in `transit` the tool's
            sideways motion steers it.
        hierarchy: Of the method `hierarchy`.
    """

    home: ArmPosture = (-0.2784, -0.1128, -0.0354, -2.0055, 1.6759, 1.2124, -0.269)
    reach: ArmPosture = (-0.3, -1.2, 1.1, -1.7, 2.25, 2.4, 0.55)
    method: Literal["hierarchy", "nullspace", "decoupled"] = "hierarchy"
    rate_hz: Positive = 100.0
    base_rate_hz: Positive = 100.0
    row_heading: float = 0.0
    row_distance: Positive = 0.75
    base_speed: Positive = 0.3
    base_yaw_rate: Positive = 0.2
    base_acceleration: Positive = 0.8
    base_yaw_acceleration: Positive = 3.0
    base_braking: Positive = 1.5
    arm_share: Annotated[float, Meta(gt=0.0, le=1.0)] = 0.6
    arm_acceleration_share: Annotated[float, Meta(gt=0.0, le=1.0)] = 0.5
    arm_jerk_share: Annotated[float, Meta(gt=0.0, le=1.0)] = 0.5
    tool_speed: Positive = 0.7
    tool_turn: Positive = 1.5
    tool_acceleration: Positive = 3.0
    tool_jerk: Positive = 50.0
    cut_speed: Positive = 0.03
    slow_zone: Positive = 0.025
    slow_braking: Positive = 1.2
    blend: Annotated[float, Meta(ge=0.0, le=0.5)] = 0.4
    advance_speed: Positive = 0.7
    stand_off: Positive = 0.15
    arm_only: Positive = 0.05
    base_lag_s: NotNegative = 0.05
    arm_lag_s: NotNegative = 0.02
    clearance: Positive = 0.22
    position_tolerance: Positive = 0.0015
    rotation_tolerance: Positive = 0.0175
    settle_speed: Positive = 0.005
    settle_joints: Positive = 0.05
    reach_timeout_s: Positive = 6.0
    cut_timeout_s: Positive = 3.0
    largest_radius: Positive = 0.0075
    survey_speed: Positive = 0.15
    confirm: bool = True
    verify: bool = True
    look_within: Positive = 0.08
    look_speed: Positive = 0.25
    look_from: Positive = 0.15
    look_timeout_s: Positive = 8.0
    moved_tolerance: Positive = 0.005
    gain_position: Gain = 5.0
    gain_rotation: Gain = 5.0
    gain_posture: Gain = 1.0
    gain_heading: Gain = 0.8
    gain_manipulability: Gain = 0.2
    gain_limits: Gain = 2.0
    limit_zone: Positive = 0.25
    damping: Positive = 0.01
    joint_margin: Annotated[float, Meta(ge=0.0, le=0.5)] = 0.03
    search_steps: Annotated[int, Meta(ge=1, le=200)] = 10
    joints_max_age_s: Positive = 0.2
    odometry_max_age_s: Positive = 0.25
    bridge_max_age_s: Positive = 0.5
    server_max_age_s: Positive = 2.0
    supervision_s: Positive = 2.0
    hold_link_max_age_s: Positive = 0.3
    perception_max_age_s: Positive = 1.0
    ledger_max_age_s: Positive = 0.6
    obstacles_max_age_s: Positive = 6.0
    hold_max_age_s: Positive = 0.15
    teleop_speed: Positive = 0.25
    teleop_turn: Positive = 0.6
    teleop_base_speed: Positive = 0.15
    teleop_base: Literal["free", "transit"] = "free"
    hierarchy: HierarchyConfig = HierarchyConfig()

    @property
    def search_steps_each(self) -> int:
        """Iterations of the posture search in one control period."""
        return max(1, round(100.0 * self.search_steps / self.rate_hz))

    @property
    def base_every(self) -> int:
        """How many control periods one of the base has."""
        return max(1, round(self.rate_hz / self.base_rate_hz)) if self.method == "hierarchy" else 1
