"""Hold-to-run: one session moves the robot while it renews its hold. No clock here: `now` is given (s)."""

from dataclasses import dataclass

from rolling_panda import messages as m
from rolling_panda.errors import InputError
from rolling_panda.messages.supervision import ArmVelocities, BaseVelocity, TeleopTarget
from server.config import ServerConfig

#: The end of a hold is sent this often, since a message may be lost.
_RELEASE_REPEATS = 5


@dataclass(frozen=True)
class TeleopCommand:
    """Command of a hold, as in `TeleopTarget`."""

    target: m.Pose | None = None
    base: BaseVelocity | None = None
    joints: ArmVelocities | None = None


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
    """One holder at a time; the first wins.

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

    def set_target(self, holder: str, target: m.Pose) -> None:
        """Set the pose of this holder's gizmo; without effect while they hold base or joints."""
        if self.holder != holder or self.follows_gizmo:
            self.set_command(holder, TeleopCommand(target))

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
    ) -> None:
        """Start or renew a hold.

        Args:
            holder: Key of the session.
            user: Its user.
            now: Monotonic time (s).
            view: The page that holds; empty for a script, which is its own view.
            client: The session's key at the controller.
            speed_scale: Speed scale, 0…1.

        Raises:
            InputError: Somebody else holds, the view is stale, there is no target, or the last hold has lapsed and was
                not released since.
        """
        self.expire(now)
        if self._hold is not None and self._hold.holder != holder:
            raise InputError(f"{self._hold.user} is holding the robot; wait until they let go")
        if self.must_release(holder, now):
            raise InputError(
                f"your hold ended, as nothing was heard of it in time, and more than {self._config.hold_resume_s} s "
                "have passed: let go, then hold again"
            )
        view = view or holder
        age = now - self._rendered_at.get(view, float("-inf"))
        if age > self._config.view_timeout_s:
            raise InputError("the view of the robot is not current; teleoperation needs one younger than 0.5 s")
        if holder not in self._commands:
            raise InputError("there is no target yet; show the gizmo first")
        if self._hold is None:
            self._hold = _Hold(holder, user, view, client, now, self._commands[holder])
        self._hold.renewed_at, self._hold.view, self._hold.speed_scale = now, view, speed_scale
        self._lapsed.pop(holder, None)

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
            client=hold.client,
            speed_scale=hold.speed_scale,
            round_trip_s=min(self._latency_s.get(hold.view, 0.0), 1e3),
        )
