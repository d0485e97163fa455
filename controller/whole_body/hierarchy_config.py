"""Settings of the method `hierarchy`, section `[controller.hierarchy]`."""

from typing import Annotated

from msgspec import Meta, Struct

from rolling_panda.config import Positive

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
    axle_ahead: Positive = 0.25
    axle_rate: Positive = 2.0
    collisions: bool = True
    collision_distance: Positive = 0.015
    blade_distance: Positive = 0.004
    cutter_distance: Positive = 0.008
    cane_distance: Positive = 0.010
    cane_speed: Positive = 0.7
    cane_braking: Positive = 1.2
    collision_influence: Positive = 0.08
    collision_speed: Positive = 0.25
    collision_braking: Positive = 0.5
    tipping: bool = True

    def kept(self, pair: tuple[str, str]) -> float:
        """d_s of a pair of parts, by their names (m): of the tool's parts the smaller one of the two."""
        own = {"blades": self.blade_distance, "cutter": self.cutter_distance}
        usual = self.cane_distance if is_cane(pair) else self.collision_distance
        return min(own.get(part, usual) for part in pair)


def is_cane(pair: tuple[str, str]) -> bool:
    """Whether the second of a pair, by its name, is a cane."""
    return pair[1].startswith("cane ")
