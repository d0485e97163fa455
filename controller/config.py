"""Settings of the controller, section `[controller]` of the configuration."""

from typing import Annotated, Literal

from msgspec import Meta, Struct

from rolling_panda.bounds import always_on, at_least, at_most, usually_on, within
from rolling_panda.config import ArmPosture, Positive

NotNegative = Annotated[float, Meta(ge=0.0, le=0.2)]
Gain = Annotated[float, Meta(ge=0.0, le=100.0)]
Weight = Annotated[float, Meta(ge=0.0, le=1e4)]


class HierarchyConfig(Struct, frozen=True, forbid_unknown_fields=True):
    """Weights among the tasks of the null space (each against a velocity in shares of its limit), and damping.

    Attributes:
        base_heading: Weight of the base's heading.
        base_place: Weight of the base's place along its heading.
        arm_posture: Weight of the arm's posture.
        manipulability: Weight of the climb to more manipulability.
        joint_centre: Weight, at the limit, of the way back to the middle of a joint; 0 outside `limit_zone`.
        smoothness: Weight against changes of velocity.
        good_manipulability: ω of the arm from which on it is not raised.
        damping: λ² where the smallest singular value of the scaled Jacobian is 0.
        damping_from: Singular value below which damping begins.
        clock_rise: Largest rise of the rate of a motion's clock (1/s).
        axle_ahead: Least distance of the tool ahead of the axle in transit (m).
        axle_rate: Rate at which that distance may be used up (1/s).
        collisions: Whether distances to itself, the ground and obstacles are kept.
        collision_distance: d_s, kept between any two parts that are watched (m).
        blade_distance: The same for the blades (m), which work near wires that nothing else may come near to.
        cutter_distance: The same for the cutter's body (m), whose capsule is 9 mm larger than it.
        cane_distance: The same of the robot's other parts to canes that stay (m).
        cane_speed: ξ for canes (m/s): wider than for what does not give, and in step with the way into a cut.
        cane_braking: Deceleration that an approach to a cane reckons with (m/s²), that of the way into a cut.
        collision_influence: d_i, nearer than which they approach more slowly (m).
        collision_speed: ξ, fastest approach at d_i (m/s), and fastest parting below d_s.
        collision_braking: Deceleration that an approach reckons with (m/s²).
        tipping: Whether the wheels and the caster are kept on the ground.
    """

    base_heading: Weight = 4.0
    base_place: Weight = 4.0
    arm_posture: Weight = 1.0
    manipulability: Weight = 1.0
    joint_centre: Weight = 10.0
    smoothness: Weight = 0.2
    good_manipulability: Positive = 0.08
    damping: Weight = 0.01
    damping_from: Positive = 0.2
    clock_rise: Positive = 4.0
    axle_ahead: Annotated[float, at_least(0.15, 1.0)] = 0.25
    axle_rate: Positive = 2.0
    collisions: Annotated[bool, always_on()] = True
    collision_distance: Annotated[float, at_least(0.01, 0.1)] = 0.015
    blade_distance: Annotated[float, at_least(0.003, 0.05)] = 0.004
    cutter_distance: Annotated[float, at_least(0.005, 0.05)] = 0.008
    cane_distance: Annotated[float, at_least(0.005, 0.05)] = 0.010
    cane_speed: Annotated[float, at_most(1.0)] = 0.7
    cane_braking: Annotated[float, at_most(2.0)] = 1.2
    collision_influence: Annotated[float, at_least(0.04, 0.5)] = 0.08
    collision_speed: Annotated[float, at_most(0.4)] = 0.25
    collision_braking: Annotated[float, at_most(1.0)] = 0.5
    tipping: Annotated[bool, always_on()] = True

    def kept(self, pair: tuple[str, str]) -> float:
        """d_s of a pair of parts, by their names (m): of the tool's parts the smaller one of the two."""
        own = {"blades": self.blade_distance, "cutter": self.cutter_distance}
        usual = self.cane_distance if is_cane(pair) else self.collision_distance
        return min(own.get(part, usual) for part in pair)


def is_cane(pair: tuple[str, str]) -> bool:
    """Whether the second of a pair, by its name, is a cane."""
    return pair[1].startswith("cane ")


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
        pre_cut_check: Whether a close-up checks each point before it is cut.
        post_cut_check: Whether a close-up checks each cut; else the cutter's report counts.
        close_up_within: Largest distance from the place clear of the canes at the close-up before a cut (m).
        close_up_speed: Largest speed of the tool at the close-up before a cut (m/s).
        close_up_from: Distance of the tool from the cut at the close-up afterwards (m).
        close_up_timeout_s: Time limit of a close-up (s).
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
    rate_hz: Annotated[float, at_least(50.0, 1000.0)] = 100.0
    base_rate_hz: Annotated[float, at_least(50.0, 1000.0)] = 100.0
    row_heading: float = 0.0
    row_distance: Annotated[float, within(0.5, 3.0)] = 0.75
    base_speed: Annotated[float, at_most(0.3)] = 0.3
    base_yaw_rate: Annotated[float, at_most(0.5)] = 0.2
    base_acceleration: Annotated[float, at_most(1.5)] = 0.8
    base_yaw_acceleration: Annotated[float, at_most(6.0)] = 3.0
    base_braking: Annotated[float, within(1.5, 1.8)] = 1.5
    arm_share: Annotated[float, at_most(1.0)] = 0.6
    arm_acceleration_share: Annotated[float, at_most(1.0, 0.2)] = 0.5
    arm_jerk_share: Annotated[float, at_most(1.0, 0.05)] = 0.5
    tool_speed: Annotated[float, at_most(1.0)] = 0.7
    tool_turn: Annotated[float, at_most(2.5)] = 1.5
    tool_acceleration: Annotated[float, at_most(10.0)] = 3.0
    tool_jerk: Annotated[float, at_most(500.0)] = 50.0
    cut_speed: Annotated[float, at_most(0.1)] = 0.03
    slow_zone: Annotated[float, at_least(0.01, 0.2)] = 0.025
    slow_braking: Annotated[float, at_most(3.0)] = 1.2
    blend: Annotated[float, Meta(ge=0.0, le=0.5)] = 0.4
    advance_speed: Annotated[float, at_most(1.0)] = 0.7
    stand_off: Annotated[float, at_least(0.08, 0.4)] = 0.15
    arm_only: Annotated[float, at_least(0.03, 0.3)] = 0.05
    base_lag_s: NotNegative = 0.05
    arm_lag_s: NotNegative = 0.02
    clearance: Annotated[float, at_least(0.1, 0.5)] = 0.22
    position_tolerance: Annotated[float, at_most(0.005)] = 0.0015
    rotation_tolerance: Annotated[float, at_most(0.09)] = 0.0175
    settle_speed: Annotated[float, at_most(0.02)] = 0.005
    settle_joints: Annotated[float, at_most(0.1)] = 0.05
    reach_timeout_s: Annotated[float, at_most(15.0)] = 6.0
    cut_timeout_s: Annotated[float, at_most(5.0)] = 3.0
    largest_radius: Annotated[float, at_most(0.0125)] = 0.0075
    survey_speed: Annotated[float, at_most(0.3)] = 0.15
    pre_cut_check: Annotated[bool, usually_on()] = True
    post_cut_check: Annotated[bool, usually_on()] = True
    close_up_within: Annotated[float, at_most(0.2)] = 0.08
    close_up_speed: Annotated[float, at_most(0.5)] = 0.25
    close_up_from: Annotated[float, at_most(0.5)] = 0.15
    close_up_timeout_s: Annotated[float, at_most(20.0)] = 8.0
    moved_tolerance: Annotated[float, at_most(0.005)] = 0.005
    gain_position: Gain = 5.0
    gain_rotation: Gain = 5.0
    gain_posture: Gain = 1.0
    gain_heading: Gain = 0.8
    gain_manipulability: Gain = 0.2
    gain_limits: Gain = 2.0
    limit_zone: Annotated[float, at_least(0.1, 1.0)] = 0.25
    damping: Positive = 0.01
    joint_margin: Annotated[float, at_least(0.01, 0.5)] = 0.03
    search_steps: Annotated[int, Meta(ge=1, le=200)] = 10
    joints_max_age_s: Annotated[float, at_most(0.25)] = 0.2
    odometry_max_age_s: Annotated[float, at_most(0.3)] = 0.25
    bridge_max_age_s: Annotated[float, at_most(0.5)] = 0.5
    server_max_age_s: Annotated[float, at_most(2.0)] = 2.0
    supervision_s: Annotated[float, at_most(2.0)] = 2.0
    hold_link_max_age_s: Annotated[float, at_most(0.3)] = 0.3
    perception_max_age_s: Annotated[float, at_most(2.0)] = 1.0
    ledger_max_age_s: Annotated[float, at_most(0.8)] = 0.6
    obstacles_max_age_s: Annotated[float, at_most(10.0)] = 6.0
    hold_max_age_s: Annotated[float, at_most(0.15)] = 0.15
    teleop_speed: Annotated[float, at_most(0.25)] = 0.25
    teleop_turn: Annotated[float, at_most(1.0)] = 0.6
    teleop_base_speed: Annotated[float, at_most(0.15)] = 0.15
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
