"""The message of the controller state."""

from controller.config import ControllerConfig
from controller.inputs import Inputs
from controller.motion.follower import Measured, Tracking
from controller.supervision.modes import State
from controller.whole_body.collision import Clearance
from controller.whole_body.joint_limits import margin
from controller.whole_body.manipulability import arm_omega
from rolling_panda import messages as m
from rolling_panda.model.robot import RobotModel, pose_message


def controller_state(
    *,
    config: ControllerConfig,
    robot: RobotModel,
    state: State,
    phase: m.Phase,
    active: str,
    measured: Measured | None,
    tracking: Tracking | None,
    allowed: tuple[str, ...],
    inputs: Inputs,
    queue: tuple[m.QueueEntry, ...],
    nearest: Clearance | None,
    order: m.QueueOrder,
    interrupted: m.Interrupted,
    relaxed_limits: tuple[str, ...],
    now: float,
) -> m.ControllerState:
    """The message of what the controller does and sees now.

    Args:
        config: Of the controller.
        robot: Its model.
        state: Of the supervision machine.
        phase: Of the cut sequence.
        active: Point being worked on.
        measured: Robot as measured, None before the first joint state.
        tracking: Of the motion under way.
        allowed: Intents that would be taken.
        inputs: Newest of everything.
        queue: Points in the order of work.
        nearest: What the last step's method found nearest to the robot.
        order: Whose order that is.
        interrupted: What a pause or a protective stop has ended.
        relaxed_limits: What the configuration sets less strictly than usual.
        now: Monotonic time (s).
    """
    omega = 0.0
    if tracking is not None:
        omega = tracking.manipulability
    elif measured is not None:
        omega = arm_omega(measured.kinematics.J)
    desired = tracking.desired if tracking is not None else None
    # In work the sequence itself says why something was given up; a hand has to be told at once.
    held = tracking.reason if tracking is not None and state.mode == "TELEOP" else ""
    return m.ControllerState(
        header=m.Header(now, "odom"),
        mode=state.mode,
        phase=phase if state.mode == "AUTO" else "",
        reason=(held or state.reason)[:500],
        allowed=allowed,
        active_point_id=active if state.mode == "AUTO" else "",
        method=config.method,
        T_odom_tool=None if measured is None else pose_message(measured.kinematics.T_odom_tool),
        T_odom_tool_desired=None if desired is None else pose_message(desired),
        position_error=0.0 if tracking is None else tracking.position_error,
        rotation_error=0.0 if tracking is None else tracking.rotation_error,
        manipulability=omega,
        joint_margin=0.0 if measured is None else margin(measured.q, robot.limits),
        tick_s=inputs.tick_s,
        ticks=inputs.ticks,
        late_ticks=inputs.late_ticks,
        queue=queue,
        limited_by="" if tracking is None else tracking.reason[:500],
        proximity=None if tracking is None or nearest is None else _proximity(nearest),
        order=order,
        interrupted=interrupted,
        relaxed_limits=relaxed_limits,
    )


def _proximity(nearest: Clearance) -> m.Proximity:
    return m.Proximity(nearest.distance, " and ".join(nearest.pair)[:500])
