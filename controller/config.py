"""Settings of the controller, section `[controller]` of the configuration."""

from typing import Annotated, Literal

from msgspec import Meta, Struct

from rolling_panda.bounds import always_on, at_least, at_most, usually_on, within
from rolling_panda.config import ArmPosture, Positive

NotNegative = Annotated[float, Meta(ge=0.0, le=0.2)]
Gain = Annotated[float, Meta(ge=0.0, le=100.0)]
Weight = Annotated[float, Meta(ge=0.0, le=1e4)]


class HierarchyConfig(Struct, frozen=True, forbid_unknown_fields=True):
    """Parameters of the method `hierarchy`. The weights are for velocities that are scaled by their limits.

    Attributes:
        base_heading: Weight of the base's heading.
        base_place: Weight of the base's position along its heading.
        arm_posture: Weight of the arm's posture.
        manipulability: Weight of the task that increases the manipulability.
        joint_centre: Weight of the task that moves a joint to its middle, at the joint's limit; 0 outside `limit_zone`.
        smoothness: Weight against changes of velocity.
        good_manipulability: ω of the arm above which the manipulability task is off.
        damping: λ² where the smallest singular value of the scaled Jacobian is 0.
        damping_from: Singular value below which damping begins.
        clock_rise: Largest rise of the rate of a motion's clock (1/s).
        axle_ahead: Smallest distance of the tool ahead of the axle in transit (m).
        axle_rate: Rate at which that distance may decrease to `axle_ahead` (1/s).
        collisions: Whether the collision guard is on: distances to itself, the ground and obstacles.
        collision_distance: d_s, smallest distance of each monitored pair (m).
        blade_distance: d_s of the blades (m), which work near wires.
        cutter_distance: d_s of the cutter's body (m), whose capsule is 9 mm larger than the body.
        cane_distance: d_s of the robot's other parts to retained canes (m).
        cane_speed: v_i for canes (m/s), larger than for stiff obstacles and matched to the approach to a cut.
        cane_braking: Deceleration a_i for canes (m/s²), that of the approach to a cut.
        collision_influence: d_i, distance below which a pair slows its approach (m).
        collision_speed: v_i, largest approach speed at d_i and largest separation speed below d_s (m/s).
        collision_braking: Deceleration a_i in the approach limit (m/s²).
        tipping: Whether the tipping guard is on, which keeps wheels and caster on the ground.
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


class WholeBodyConfig(Struct, frozen=True, forbid_unknown_fields=True):
    """Parameters of the whole-body control: the limits of base and arm, and the gains of the null space.

    Attributes:
        method: Name of the whole-body method.
        base_speed: Speed limit of the base in automatic work and teleoperation (m/s).
        base_yaw_rate: Limit of the base's yaw rate (rad/s).
        base_acceleration: Acceleration limit of the base (m/s²), low so that the stretched arm does not tip it.
        base_yaw_acceleration: Limit of the base's yaw acceleration (rad/s²).
        base_braking: Deceleration of the base when the robot has to stop (m/s²).
        arm_velocity_scale: Fraction of the arm's rated velocity that is used.
        arm_acceleration_scale: Fraction of the arm's rated acceleration that is used.
        arm_jerk_scale: Fraction of the arm's rated jerk that is used; braking for a reason may use all of it.
        gain_posture: Gain of the null-space posture (1/s).
        gain_heading: Gain of the base's heading error (1/s).
        gain_manipulability: k₀ of the manipulability gradient.
        gain_limits: k of the joint-limit repulsion.
        limit_zone: γ_start, distance from a limit where repulsion begins (rad).
        damping: λ of the damped pseudo-inverse, in units of the weighted Jacobian.
        joint_margin: Distance from every joint limit that is never entered (rad).
        hierarchy: Parameters of the method `hierarchy`.
    """

    method: Literal["hierarchy", "nullspace", "decoupled"] = "hierarchy"
    base_speed: Annotated[float, at_most(0.3)] = 0.3
    base_yaw_rate: Annotated[float, at_most(0.5)] = 0.2
    base_acceleration: Annotated[float, at_most(1.5)] = 0.8
    base_yaw_acceleration: Annotated[float, at_most(6.0)] = 3.0
    base_braking: Annotated[float, within(1.5, 1.8)] = 1.5
    arm_velocity_scale: Annotated[float, at_most(1.0)] = 0.6
    arm_acceleration_scale: Annotated[float, at_most(1.0, 0.2)] = 0.5
    arm_jerk_scale: Annotated[float, at_most(1.0, 0.05)] = 0.5
    gain_posture: Gain = 1.0
    gain_heading: Gain = 0.8
    gain_manipulability: Gain = 0.2
    gain_limits: Gain = 2.0
    limit_zone: Annotated[float, at_least(0.1, 1.0)] = 0.25
    damping: Positive = 0.01
    joint_margin: Annotated[float, at_least(0.01, 0.5)] = 0.03
    hierarchy: HierarchyConfig = HierarchyConfig()


class MotionConfig(Struct, frozen=True, forbid_unknown_fields=True):
    """Parameters of the motions that the robot follows.

    Attributes:
        tool_turn: Limit of the tool's angular speed (rad/s).
        tool_acceleration: Acceleration limit of planned tool motions (m/s²).
        tool_jerk: Jerk limit of planned tool motions (m/s³).
        cut_speed: Speed limit in the last `slow_zone` before the cut (m/s); usual is the slowest of the contact trials.
        slow_zone: Length of the slow last stretch (m). The blades enter the canes inside it.
        slow_braking: Deceleration of the tool to `cut_speed` (m/s²).
        blend: Fraction of the shorter of two segments that overlaps with the other, where the tool rounds the corner.
        base_lag_s: Time constant of the wheels' response (s).
        arm_lag_s: Time constant of the arm's servos (s), without half a period of sampling.
        gain_position: Gain of the tool's position error (1/s).
        gain_rotation: Gain of the tool's rotation error (1/s).
    """

    tool_turn: Annotated[float, at_most(2.5)] = 1.5
    tool_acceleration: Annotated[float, at_most(10.0)] = 2.0
    tool_jerk: Annotated[float, at_most(500.0)] = 20.0
    cut_speed: Annotated[float, at_most(0.1)] = 0.05
    slow_zone: Annotated[float, at_least(0.01, 0.2)] = 0.025
    slow_braking: Annotated[float, at_most(3.0)] = 1.2
    blend: Annotated[float, Meta(ge=0.0, le=0.5)] = 0.4
    base_lag_s: NotNegative = 0.05
    arm_lag_s: NotNegative = 0.02
    gain_position: Gain = 5.0
    gain_rotation: Gain = 5.0


class WorkConfig(Struct, frozen=True, forbid_unknown_fields=True):
    """Parameters of the automatic work: the row, the cuts and their checks.

    Attributes:
        home: Survey posture of the arm (rad), with the camera facing the row.
        survey_far: Posture of the arm (rad) on a survey's way out over Guyot vines, with the camera 0.3 m farther from
            the row than at home and 0.05 m lower: from 0.55 m beside the row a picture shows a vine from its head to
            its last cut.
        survey_low: Posture of the arm (rad) on the way back over them, with the camera 0.2 m farther from the row and
            0.2 m lower.
        folded: Posture of the arm folded over the base (rad), to drive far.
        reach: Initial posture of the search for a cut posture (rad), elbow aside, tool to the left.
        row_heading: Direction of the row in odom (rad); the base keeps parallel to it, the row on its left.
        row_distance: Distance of the row from the line y = 0 along `row_heading` where the base drives (m).
        tool_speed: Speed limit of the tool between cuts (m/s).
        advance_speed: Speed limit along the approach line (m/s).
        stand_off: Distance of the stand-off from the cut (m); from there the approach is straight.
        arm_only: Distance to a cut (m) within which only the arm moves, in and out.
        clearance: Distance from the canes between cuts (m).
        position_tolerance: Largest position error of the tool at a cut (m).
        rotation_tolerance: Largest rotation error of the tool at a cut (rad).
        settle_speed: Speed below which the tool counts as at rest at a cut (m/s).
        settle_joints: Speed below which each joint counts as at rest (rad/s); at 0.1 the bridge closes no blades.
        reach_timeout_s: A motion fails this long after its planned end (s).
        cut_timeout_s: A cut without an outcome for this long is UNKNOWN (s).
        largest_radius: Canes with a larger radius are refused (m).
        largest_stub_radius: Two-year wood, stubs and last year's cane, with a larger radius is refused (m).
        survey_speed: Speed of the base on a survey (m/s). At two pictures a second there is one every 0.125 m.
        pre_cut_check: Whether a close-up checks each point before its cut.
        post_cut_check: Whether a close-up checks each cut; otherwise the cutter's report counts.
        close_up_within: Largest distance from the pose clear of the canes at the close-up before a cut (m).
        close_up_speed: Largest speed of the tool at the close-up before a cut (m/s).
        close_up_from: Distance of the tool from the cut at the close-up after it (m).
        close_up_timeout_s: Time limit of a close-up (s).
        servo: Whether pictures on the last way in correct the motion to the cut; needs `pre_cut_check`.
        servo_rate_hz: Largest rate of these pictures.
        servo_until: Distance of the tool from the cut where the last one is asked for (m): nearer, the camera measures
            no depth.
        servo_max_age_s: Age limit of such a picture when its result comes (s).
        servo_jump: A cane that is seen farther than this from where it is expected is another one (m).
        servo_reach: Largest correction (m). Wood is kept so far from the closing blades before the motion begins.
        search_steps: Iterations of the posture search in 10 ms, distributed over the control periods.
    """

    home: ArmPosture = (-0.2784, -0.1128, -0.0354, -2.0055, 1.6759, 1.2124, -0.269)
    survey_far: ArmPosture = (-0.6406, 0.4434, -0.2267, -1.4197, 1.6581, 0.6788, -0.1891)
    survey_low: ArmPosture = (-0.5114, 0.3681, -0.1862, -1.8314, 1.3691, 0.8589, -0.6466)
    folded: ArmPosture = (0.0, -1.2, 0.0, -2.6, 0.0, 1.9, 0.785)
    reach: ArmPosture = (-0.3, -1.2, 1.1, -1.7, 2.25, 2.4, 0.55)
    row_heading: float = 0.0
    row_distance: Annotated[float, within(0.5, 3.0)] = 0.75
    tool_speed: Annotated[float, at_most(1.0)] = 0.7
    advance_speed: Annotated[float, at_most(1.0)] = 0.7
    stand_off: Annotated[float, at_least(0.08, 0.4)] = 0.15
    arm_only: Annotated[float, at_least(0.03, 0.3)] = 0.05
    clearance: Annotated[float, at_least(0.1, 0.5)] = 0.22
    position_tolerance: Annotated[float, at_most(0.005)] = 0.0015
    rotation_tolerance: Annotated[float, at_most(0.09)] = 0.0175
    settle_speed: Annotated[float, at_most(0.02)] = 0.005
    settle_joints: Annotated[float, at_most(0.1)] = 0.05
    reach_timeout_s: Annotated[float, at_most(15.0)] = 6.0
    cut_timeout_s: Annotated[float, at_most(5.0)] = 3.0
    largest_radius: Annotated[float, at_most(0.0125)] = 0.0075
    largest_stub_radius: Annotated[float, at_most(0.0125)] = 0.010
    survey_speed: Annotated[float, at_most(0.3)] = 0.25
    pre_cut_check: Annotated[bool, usually_on()] = True
    post_cut_check: Annotated[bool, usually_on()] = True
    close_up_within: Annotated[float, at_most(0.2)] = 0.08
    close_up_speed: Annotated[float, at_most(0.5)] = 0.25
    close_up_from: Annotated[float, at_most(0.5)] = 0.15
    close_up_timeout_s: Annotated[float, at_most(20.0)] = 8.0
    servo: bool = False
    servo_rate_hz: Annotated[float, within(4.0, 30.0)] = 10.0
    servo_until: Annotated[float, within(0.035, 0.2)] = 0.04
    servo_max_age_s: Annotated[float, at_most(0.5)] = 0.3
    servo_jump: Annotated[float, at_most(0.02)] = 0.015
    servo_reach: Annotated[float, at_most(0.005)] = 0.005
    search_steps: Annotated[int, Meta(ge=1, le=200)] = 10


class SupervisionConfig(Struct, frozen=True, forbid_unknown_fields=True):
    """Age limits of what the work relies on.

    Attributes:
        joints_max_age_s: Age limit of joint states; a protective stop follows (s).
        odometry_max_age_s: Age limit of odometry; a protective stop follows (s).
        bridge_max_age_s: Age limit of bridge states; a protective stop follows (s).
        server_max_age_s: Age limit of server heartbeats in automatic work (s).
        supervision_s: Automatic work pauses when no operator has seen the robot for this long (s).
        hold_link_max_age_s: Age limit of server heartbeats in teleoperation (s).
        perception_max_age_s: Age limit of perception heartbeats in automatic work (s).
        ledger_max_age_s: Work whose record is not durable after this long is a fault (s).
        obstacles_max_age_s: Age limit of the camera frame behind the obstacles in automatic work (s); beyond it the
            robot stands. While nothing moves, the camera sends a frame every 2 s.
        picture_wait_s: So long the robot stands for a newer frame before the work pauses (s).
    """

    joints_max_age_s: Annotated[float, at_most(0.25)] = 0.2
    odometry_max_age_s: Annotated[float, at_most(0.3)] = 0.25
    bridge_max_age_s: Annotated[float, at_most(0.5)] = 0.5
    server_max_age_s: Annotated[float, at_most(2.0)] = 2.0
    supervision_s: Annotated[float, at_most(2.0)] = 2.0
    hold_link_max_age_s: Annotated[float, at_most(0.3)] = 0.3
    perception_max_age_s: Annotated[float, at_most(2.0)] = 1.0
    ledger_max_age_s: Annotated[float, at_most(0.8)] = 0.6
    obstacles_max_age_s: Annotated[float, at_most(10.0)] = 6.0
    picture_wait_s: Annotated[float, at_most(30.0)] = 15.0


class ContactConfig(Struct, frozen=True, forbid_unknown_fields=True):
    """Limits of what the arm feels, and the reaction. docs/safety.md has the sources.

    Attributes:
        light_force: Force at the tool from which a push is told (N). Canes may be pushed.
        stop_force: Force at the tool that stops the robot (N).
        stop_torque: External torque of one of the joints 1 to 4 that stops the robot (N·m).
        stop_torque_wrist: The same of the joints 5 to 7.
        cane_force: Force at the tool up to which a known cane is no contact in automatic work (N).
        cane_torque: The same for the joints 1 to 4 (N·m).
        cane_torque_wrist: The same for the joints 5 to 7 (N·m).
        back_off: Distance that the tool goes back on its way after a contact (m).
    """

    light_force: Annotated[float, at_most(20.0)] = 8.0
    stop_force: Annotated[float, at_most(30.0)] = 20.0
    stop_torque: Annotated[float, at_most(20.0)] = 10.0
    stop_torque_wrist: Annotated[float, at_most(10.0)] = 5.0
    cane_force: Annotated[float, at_most(40.0)] = 28.0
    cane_torque: Annotated[float, at_most(30.0)] = 18.0
    cane_torque_wrist: Annotated[float, at_most(15.0)] = 9.0
    back_off: Annotated[float, within(0.0, 0.2, or_zero=True)] = 0.05


class TeleoperationConfig(Struct, frozen=True, forbid_unknown_fields=True):
    """Parameters of teleoperation.

    Attributes:
        hold_max_age_s: Teleoperation ends when the hold is not renewed for this long (s).
        speed: Speed limit of the tool in teleoperation (m/s).
        turn: Limit of the tool's angular speed in teleoperation (rad/s).
        joint_speed: Speed limit of the fastest joint on the way to a posture (rad/s).
        base_speed: Speed limit of each wheel on the ground in teleoperation (m/s). From it, `base_braking` stops
            the base within 0.1 s, which leaves 50 ms for the message of the release.
        base: Base in teleoperation: `free` keeps it parallel to the row; in `transit` the tool's sideways motion
            steers it.
    """

    hold_max_age_s: Annotated[float, at_most(0.15)] = 0.15
    speed: Annotated[float, at_most(0.25)] = 0.25
    turn: Annotated[float, at_most(1.0)] = 0.6
    joint_speed: Annotated[float, at_most(0.5)] = 0.35
    base_speed: Annotated[float, at_most(0.15)] = 0.15
    base: Literal["free", "transit"] = "free"


class ControllerConfig(Struct, frozen=True, forbid_unknown_fields=True):
    """Settings of motion and supervision.

    Attributes:
        rate_hz: Control rate, that of the arm.
        base_rate_hz: Rate of the base. A period of the base has `rate_hz` / `base_rate_hz` control periods, rounded.
            Methods other than `hierarchy` run at one rate.
        whole_body: Parameters of the whole-body control.
        motion: Parameters of the motions that the robot follows.
        work: Parameters of the automatic work.
        supervision: Age limits.
        contact: Limits of what the arm feels.
        teleoperation: Parameters of teleoperation.
    """

    rate_hz: Annotated[float, at_least(50.0, 1000.0)] = 100.0
    base_rate_hz: Annotated[float, at_least(50.0, 1000.0)] = 100.0
    whole_body: WholeBodyConfig = WholeBodyConfig()
    motion: MotionConfig = MotionConfig()
    work: WorkConfig = WorkConfig()
    supervision: SupervisionConfig = SupervisionConfig()
    contact: ContactConfig = ContactConfig()
    teleoperation: TeleoperationConfig = TeleoperationConfig()

    @property
    def search_steps_each(self) -> int:
        """Iterations of the posture search in one control period."""
        return max(1, round(100.0 * self.work.search_steps / self.rate_hz))

    @property
    def base_every(self) -> int:
        """How many control periods one of the base has."""
        return max(1, round(self.rate_hz / self.base_rate_hz)) if self.whole_body.method == "hierarchy" else 1
