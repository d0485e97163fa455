"""The message of the controller state."""

from controller.config import ControllerConfig
from controller.motion.follower import Measured, Tracking
from controller.supervision.modes import State
from controller.supervision.permission import OF_SUPERVISOR, of_holder
from controller.whole_body.collision import Clearance
from controller.whole_body.joint_limits import margin
from controller.whole_body.manipulability import arm_omega
from rolling_panda import messages as m
from rolling_panda import reasons
from rolling_panda.messages.supervision import SavedPosture
from rolling_panda.model.robot import RobotModel, pose_message
from rolling_panda.transport.inbox import Inbox


def controller_state(
    *,
    config: ControllerConfig,
    robot: RobotModel,
    state: State,
    waits: m.Reason | None,
    phase: m.Phase,
    active: str,
    measured: Measured | None,
    tracking: Tracking | None,
    allowed: dict[str, m.Reason | None],
    inbox: Inbox,
    queue: tuple[m.QueueEntry, ...],
    nearest: Clearance | None,
    order: m.QueueOrder,
    interrupted: m.Interrupted,
    relaxed_limits: tuple[m.Reason, ...],
    postures: tuple[SavedPosture, ...],
    tool_force: float | None,
    now: float,
) -> m.ControllerState:
    """The message of the controller's state.

    Args:
        config: Section `[controller]`.
        robot: Robot model.
        state: State of the supervision state machine.
        waits: Why the robot stands in the midst of its work; None where it does not.
        phase: Phase of the cut sequence.
        active: Current point of the work.
        measured: Measured state of the robot; None before the first joint state.
        tracking: Tracking of the current motion.
        allowed: Reason why each command would be refused; None if it would be taken.
        inbox: What has arrived, with the pace of the loop.
        queue: Points in the order of work.
        nearest: Smallest distance in the last step.
        order: Origin of that order.
        interrupted: Activity that a pause or a protective stop interrupted.
        relaxed_limits: Safety limits that the configuration sets less strictly than usual.
        postures: Postures that the arm can be led to.
        tool_force: Force at the tool (N); None if the arm estimates none.
        now: Monotonic time (s).
    """
    omega = 0.0
    if tracking is not None:
        omega = tracking.manipulability
    elif measured is not None:
        omega = arm_omega(measured.kinematics.J)
    desired = tracking.desired if tracking is not None else None
    # In work the sequence reports why it gave up; motion by hand has to be reported at once.
    held = tracking.reason if tracking is not None and state.mode == "TELEOP" else ""
    return m.ControllerState(
        header=m.Header(now, "odom"),
        mode=state.mode,
        phase=phase if state.mode == "AUTO" else "",
        reason=reasons.held_back(held) if held else waits or state.reason,
        allowed=allowed,
        of_holder=of_holder(state.mode),
        of_supervisor=OF_SUPERVISOR[state.mode],
        active_point_id=active if state.mode == "AUTO" else "",
        method=config.whole_body.method,
        T_odom_tool=None if measured is None else pose_message(measured.kinematics.T_odom_tool),
        T_odom_tool_desired=None if desired is None else pose_message(desired),
        position_error=0.0 if tracking is None else tracking.position_error,
        rotation_error=0.0 if tracking is None else tracking.rotation_error,
        manipulability=omega,
        joint_margin=0.0 if measured is None else margin(measured.q, robot.limits),
        tick_s=inbox.tick_s,
        ticks=inbox.ticks,
        late_ticks=inbox.late_ticks,
        queue=queue,
        limited_by="" if tracking is None else tracking.reason[:500],
        proximity=None if tracking is None or nearest is None else _proximity(nearest),
        order=order,
        interrupted=interrupted,
        relaxed_limits=relaxed_limits,
        postures=postures,
        tool_force=tool_force,
        kept_margin=config.whole_body.joint_margin,
    )


def _proximity(nearest: Clearance) -> m.Proximity:
    return m.Proximity(nearest.distance, " – ".join(nearest.pair)[:500])
