"""Hold-to-run: one session moves the robot while it renews its hold.

`TeleopHold` decides who holds, without a clock. `Teleoperation` alone tells it the aim, and alone sends the target.
"""

import time
from collections.abc import Callable
from dataclasses import dataclass

from rolling_panda import messages as m
from rolling_panda import reasons
from rolling_panda.messages.supervision import (
    ArmAngles,
    ArmVelocities,
    BaseVelocity,
    GizmoAxes,
    TeleopTarget,
    ToolVelocity,
)
from rolling_panda.runtime.token_bucket import TokenBuckets
from server.auth.sessions import Session
from server.config import ServerConfig
from server.robots.event_log import RobotLog
from server.robots.link import RobotLink
from server.robots.page_view import PageView
from server.scene.scene import Scene
from server.scene.viser_adapter.client_messages import GizmoDragEnd, GizmoUpdate

#: Rate limit and burst of a session's motion commands; a busy browser sends several at once.
MOTION_RATE_HZ, _MOTION_BURST = 60.0, 20.0
#: A dragged gizmo's target is sent at once, but no sooner than this after the last one (s).
_MIN_TARGET_PERIOD_S = 0.02
#: The end of a hold is sent this often, since a message may be lost.
_RELEASE_REPEATS = 5


@dataclass(frozen=True)
class TeleopCommand:
    """Command of a hold, as in `TeleopTarget`."""

    target: m.Pose | None = None
    base: BaseVelocity | None = None
    joints: ArmVelocities | None = None
    along: ToolVelocity | None = None
    posture: ArmAngles | None = None


@dataclass
class _Hold:
    holder: str
    user: str
    view: str
    client: str
    renewed_at: float
    command: TeleopCommand
    speed_scale: float = 1.0


class TeleopHold:
    """One holder at a time; the first wins. No clock here: `now` is given (s).

    A hold lapses unless it is renewed within `hold_timeout_s` and its view has rendered a state that is not older than
    `view_timeout_s`. A lapsed hold continues with a renewal within `hold_resume_s`; after that its holder has to
    release first, so that a suspended page or server moves nothing when it wakes.
    """

    def __init__(self, config: ServerConfig) -> None:
        """No session holds."""
        self._config = config
        self._hold: _Hold | None = None
        self._ended: _Hold | None = None
        #: Last renewal of each lapsed hold that was not released since (s).
        self._lapsed: dict[str, float] = {}
        self._releases_left = 0
        self._sequence = 0
        self._commands: dict[str, TeleopCommand] = {}
        self._rendered_at: dict[str, float] = {}
        self._latency_s: dict[str, float] = {}

    @property
    def holder(self) -> str | None:
        """Key of the session that holds now."""
        return None if self._hold is None else self._hold.holder

    def view_rendered(self, view: str, seen_at: float, now: float) -> None:
        """A view reports at `now` that it has rendered a state that was measured at `seen_at` (s)."""
        if seen_at > self._rendered_at.get(view, float("-inf")):
            self._rendered_at[view] = seen_at
            self._latency_s[view] = max(0.0, now - seen_at)

    def forget_view(self, view: str) -> None:
        """A view has closed."""
        self._rendered_at.pop(view, None)
        self._latency_s.pop(view, None)

    def set_command(self, holder: str, command: TeleopCommand) -> None:
        """Set this holder's command; the newest wins."""
        self._commands[holder] = command
        if self._hold is not None and self._hold.holder == holder:
            self._hold.command = command

    @property
    def follows_gizmo(self) -> bool:
        """Whether the robot is held to a target: then the gizmo stays where it was dragged."""
        return self._hold is not None and self._hold.command.target is not None

    def hold(
        self, holder: str, user: str, now: float, view: str = "", client: str = "", speed_scale: float = 1.0
    ) -> m.Reason | None:
        """Start or renew a hold.

        Args:
            holder: Key of the session.
            user: Its user.
            now: Monotonic time (s).
            view: The page that holds; empty for a script, which is its own view.
            client: The session's key at the controller.
            speed_scale: Speed scale, 0…1.

        Returns:
            Why it is refused: somebody else holds, the view is stale, there is no target, or the last hold has lapsed
            and was not released since.
        """
        self.expire(now)
        if self._hold is not None and self._hold.holder != holder:
            return reasons.held_by_other(self._hold.user)
        if self.must_release(holder, now):
            return reasons.hold_overdue(self._config.hold_resume_s)
        view = view or holder
        age = now - self._rendered_at.get(view, float("-inf"))
        if age > self._config.view_timeout_s:
            return reasons.hold_view_stale(self._config.view_timeout_s)
        if holder not in self._commands:
            return reasons.hold_without_target()
        if self._hold is None:
            self._hold = _Hold(holder, user, view, client, now, self._commands[holder])
        self._hold.renewed_at, self._hold.view, self._hold.speed_scale = now, view, speed_scale
        self._lapsed.pop(holder, None)
        return None

    def must_release(self, holder: str, now: float) -> bool:
        """Whether this holder's hold lapsed so long ago that it has to be released before the next one."""
        return now - self._lapsed.get(holder, now) > self._config.hold_resume_s

    def release(self, holder: str) -> bool:
        """End this holder's hold at once; True when it was holding."""
        self._lapsed.pop(holder, None)
        if self._hold is None or self._hold.holder != holder:
            return False
        self._ended, self._hold = self._hold, None
        self._releases_left = _RELEASE_REPEATS
        self._commands.pop(holder, None)
        return True

    def clear_target(self, holder: str) -> None:
        """This holder's gizmo was removed: forget its pose."""
        self._commands.pop(holder, None)

    def forget(self, holder: str) -> bool:
        """The session has ended: release its hold and forget it; True when it was holding."""
        held = self.release(holder)
        self._commands.pop(holder, None)
        self.forget_view(holder)
        return held

    def expire(self, now: float) -> str | None:
        """End a hold that was not renewed in time or whose view is stale; returns its holder, else None."""
        hold = self._hold
        if hold is None:
            return None
        seen_at = self._rendered_at.get(hold.view, float("-inf"))
        if now - hold.renewed_at <= self._config.hold_timeout_s and now - seen_at <= self._config.view_timeout_s:
            return None
        self.release(hold.holder)
        self._lapsed[hold.holder] = hold.renewed_at
        return hold.holder

    def next_message(self, now: float) -> TeleopTarget | None:
        """The message to send now: the held command, the end of a hold, or none."""
        self.expire(now)
        if self._hold is not None:
            return self._message(True, self._hold)
        if self._releases_left > 0 and self._ended is not None:
            self._releases_left -= 1
            return self._message(False, self._ended)
        return None

    def _message(self, holds: bool, hold: _Hold) -> TeleopTarget:
        self._sequence += 1
        command = hold.command
        return TeleopTarget(
            sequence=self._sequence,
            hold=holds,
            user=hold.user,
            target=command.target,
            base=command.base,
            joints=command.joints,
            along=command.along,
            posture=command.posture,
            client=hold.client,
            speed_scale=hold.speed_scale,
            round_trip_s=min(self._latency_s.get(hold.view, 0.0), 1e3),
        )


class Teleoperation:
    """The stream of one robot's teleoperation: the only writer of the aim, and the only sender of `TeleopTarget`.

    The aim of a session is the pose of its gizmo, the velocities that its page holds, or the command of its script.
    """

    def __init__(
        self,
        config: ServerConfig,
        link: RobotLink,
        scene: Scene,
        view: PageView,
        log: RobotLog,
        held_elsewhere: Callable[[Session], str],
        on_end: Callable[[str, m.Reason], None],
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        """No session holds.

        Args:
            config: Time limits of a hold.
            link: Takes the targets.
            scene: Shows the gizmos.
            view: Knows the tool's pose.
            log: For holds, releases and refusals.
            held_elsewhere: Name of another robot that a session holds now; empty where it holds none.
            on_end: Called with a session's id and the reason when its hold was ended from elsewhere.
            clock: Monotonic time (s).
        """
        self._link, self._scene, self._view, self._log = link, scene, view, log
        self._held_elsewhere, self._on_end, self._clock = held_elsewhere, on_end, clock
        self._hold = TeleopHold(config)
        self._limiter = TokenBuckets(MOTION_RATE_HZ, _MOTION_BURST)
        self._refused: dict[str, m.Reason] = {}
        self._sent_at = float("-inf")

    @property
    def holder(self) -> str | None:
        """Key of the session that holds now."""
        return self._hold.holder

    def may_move(self, session: Session) -> bool:
        """Whether this session may move the robot: its role may, and nobody else holds control."""
        control = self._link.control.peek()
        holder = "" if control is None else control.message.holder
        return session.may_operate and holder in ("", session.client)

    def view_rendered(self, view: str, seen_at: float, now: float) -> None:
        """A view reports at `now` that it has rendered a state that was measured at `seen_at` (s)."""
        self._hold.view_rendered(view, seen_at, now)

    def forget_view(self, view: str) -> None:
        """A view has closed."""
        self._hold.forget_view(view)

    def within_rate(self, session: Session, now: float) -> bool:
        """Count a motion command of this session; False above the rate limit."""
        return self._limiter.take(session.session_id, now)

    def must_release(self, session: Session, now: float) -> bool:
        """Whether this session has to release before its next hold, as its last one has lapsed long ago."""
        self._expire(now)
        return self._hold.must_release(session.session_id, now)

    def hold(
        self,
        session: Session,
        now: float,
        command: TeleopCommand | None = None,
        view: str = "",
        speed_scale: float = 1.0,
    ) -> m.Reason | None:
        """Start or renew this session's hold on the robot.

        Args:
            session: Of the holder.
            now: Monotonic time (s).
            command: Where to move. None is the pose of the gizmo; where none is shown, and for a script that holds, it
                is the last command.
            view: The page that holds; empty for a script.
            speed_scale: Fraction of the usual speed.

        Returns:
            Why it is refused; None where it holds.
        """
        key = session.session_id
        if command is None and (view or self._hold.holder != key):
            pose = self._scene.gizmos.pose(key)
            command = None if pose is None else TeleopCommand(self._view.in_odom(pose))
        if command is not None:
            self._hold.set_command(key, command)
        refused = self._refusal(session)
        if refused is None:
            self._expire(now)
            was_holding = self._hold.holder == key
            refused = self._hold.hold(key, session.user, now, view or key, session.client, speed_scale)
        if refused is not None:
            # Held buttons repeat at 20 Hz; each new reason is logged once.
            if self._refused.get(key) != refused:
                self._refused[key] = refused
                self._log.note(reasons.hold_refused(session.user, refused), session.client)
            return refused
        self._refused.pop(key, None)
        if not was_holding:
            self._log.note(reasons.hold_began(session.user), session.client)
        return None

    def _refusal(self, session: Session) -> m.Reason | None:
        if not session.may_operate:
            return reasons.viewer_only()
        control = self._link.control.peek()
        if control is not None and not self.may_move(session):
            # Otherwise the hold would block the session that has control.
            return reasons.control_held(control.message.user)
        other = self._held_elsewhere(session)
        # One key or gamepad must not move two robots in two windows.
        return reasons.other_robot_held(other) if other else None

    def drag(self, session: Session, gizmo: GizmoUpdate | GizmoDragEnd) -> None:
        """A gizmo was dragged or released. While its owner holds, the target is sent at once.

        At the end of a drag the 3-D client sends its last pose after the page has ended the hold. The gizmo is reset
        then, so that the next hold does not move there.
        """
        owner = session.session_id
        if isinstance(gizmo, GizmoDragEnd):
            if self._hold.holder != owner:
                self._reset_gizmo(owner)
            return
        target = self._scene.gizmos.drag(owner, gizmo.position, gizmo.wxyz)
        if target is None:
            return
        now = self._clock()
        self._expire(now)
        if self._hold.holder != owner or not self._hold.follows_gizmo:
            return
        self._hold.set_command(owner, TeleopCommand(self._view.in_odom(target)))
        if now - self._sent_at >= _MIN_TARGET_PERIOD_S:
            self._sent_at = now
            self._send(now)

    def show_gizmo(self, session: Session, axes: GizmoAxes = "tool") -> None:
        """Show this session's gizmo at the tool, along these axes; its hold ends."""
        tool = self._view.tool(self._clock())
        if not session.may_operate or tool is None:
            refused = reasons.tool_unknown() if session.may_operate else reasons.viewer_only()
            self._log.note(reasons.gizmo_refused(session.user, refused), session.client)
            return
        self.release(session)
        self._scene.show_gizmo(session.session_id, tool, axes)

    def hide_gizmo(self, session: Session) -> None:
        """Hide this session's gizmo, and end its hold."""
        self.release(session)
        self._hold.clear_target(session.session_id)
        self._scene.gizmos.hide(session.session_id)

    def follow_tool(self, now: float) -> None:
        """Move each gizmo that is not dragged to the tool."""
        tool = self._view.tool(now)
        if tool is not None:
            self._scene.gizmos.follow(tool, self._hold.holder if self._hold.follows_gizmo else None)

    def step(self, now: float) -> None:
        """End a hold that has lapsed, and send what is due: the target, or the end of a hold."""
        self._expire(now)
        self._send(now)

    def release(self, session: Session) -> None:
        """End this session's hold at once; its gizmo returns to the tool."""
        self._refused.pop(session.session_id, None)
        if self._hold.release(session.session_id):
            self._send(self._clock())
            self._reset_gizmo(session.session_id, reasons.hold_ended_elsewhere())
            self._log.note(reasons.hold_released(session.user), session.client)

    def stopped(self) -> None:
        """The robot is being stopped: end the hold."""
        holder = self._hold.holder
        if holder is not None:
            self._hold.release(holder)
            self._reset_gizmo(holder, reasons.hold_stopped())

    def forget(self, session: Session) -> None:
        """The session has ended: release its hold and forget it."""
        self.release(session)
        self._hold.forget(session.session_id)

    def _send(self, now: float) -> None:
        message = self._hold.next_message(now)
        if message is not None:
            self._link.send_teleop(message)

    def _expire(self, now: float) -> None:
        """End a hold that was not renewed in time, or whose page has no current view."""
        ended = self._hold.expire(now)
        if ended is not None:
            self._log.note(reasons.hold_lapsed())
            self._reset_gizmo(ended)

    def _reset_gizmo(self, owner: str, reason: m.Reason | None = None) -> None:
        """After a hold: the gizmo returns to the tool; pages that hold are sent a reason."""
        if reason is not None:
            self._on_end(owner, reason)
        self._scene.gizmos.reset(owner, self._view.tool(self._clock()))
