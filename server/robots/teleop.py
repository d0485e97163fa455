"""Hold-to-run: whose gizmo the tool follows, and when the hold has ended. Pure: `now` is an argument."""

from dataclasses import dataclass

from rolling_panda import messages as m
from rolling_panda.errors import InputError
from rolling_panda.messages.supervision import ArmVelocities, BaseVelocity, TeleopTarget
from server.config import ServerConfig

#: The end of a hold is said this often, since a single message may be lost.
_RELEASES = 5


@dataclass(frozen=True)
class Aim:
    """What a holder wants of the robot, as in `TeleopTarget`."""

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
    aim: Aim
    share: float = 1.0


class TeleopHold:
    """One holder at a time; the first wins.

    A hold lives while it is renewed within `hold_timeout_s` and the holder has lately drawn a state of the robot that
    is not older than `view_timeout_s`. One that has lapsed goes on with the next word within `hold_resume_s`; later its
    holder lets go first: who slept, or was not heard while this process did, moves nothing on waking.
    """

    def __init__(self, config: ServerConfig) -> None:
        """Nobody holds."""
        self._config = config
        self._hold: _Hold | None = None
        self._ended: _Hold | None = None
        #: When each holder whose hold has lapsed, and who has not let go since, renewed it last.
        self._lapsed: dict[str, float] = {}
        self._releases = 0
        self._sequence = 0
        self._aims: dict[str, Aim] = {}
        self._drawn_at: dict[str, float] = {}
        self._lag: dict[str, float] = {}

    @property
    def holder(self) -> str | None:
        """Key of who holds now."""
        return None if self._hold is None else self._hold.holder

    def drew(self, view: str, seen_at: float, now: float) -> None:
        """A view says at `now` that it has drawn the robot in the posture that was measured at `seen_at` (s)."""
        if seen_at > self._drawn_at.get(view, float("-inf")):
            self._drawn_at[view] = seen_at
            self._lag[view] = max(0.0, now - seen_at)

    def unseen(self, view: str) -> None:
        """A view has gone."""
        self._drawn_at.pop(view, None)
        self._lag.pop(view, None)

    def aim(self, holder: str, target: m.Pose) -> None:
        """Set where this holder's gizmo is; the newest wins. While base or joints are held it leads nothing."""
        if not self._holds_otherwise(holder):
            self.want(holder, Aim(target))

    def want(self, holder: str, aim: Aim) -> None:
        """Set what this holder wants; the newest wins."""
        self._aims[holder] = aim
        if self._hold is not None and self._hold.holder == holder:
            self._hold.aim = aim

    @property
    def leads_gizmo(self) -> bool:
        """Whether the hold that there is follows a target: then the gizmo stays where it was dragged."""
        return self._hold is not None and self._hold.aim.target is not None

    def _holds_otherwise(self, holder: str) -> bool:
        return self.holder == holder and not self.leads_gizmo

    def hold(self, holder: str, user: str, now: float, view: str = "", client: str = "", share: float = 1.0) -> None:
        """Start or renew a hold, by what `view` shows: the page that holds, not another one of the same person.

        Args:
            holder: Key of who holds.
            user: Their name.
            now: Monotonic time (s).
            view: What shows them the robot; empty for their own key.
            client: Who, as the controller knows them.
            share: Of the usual speed, 0…1.

        Raises:
            InputError: Somebody else holds, the holder's view is old, there is no target, or their last hold lapsed
                long ago and they have not let go since.
        """
        self.expire(now)
        if self._hold is not None and self._hold.holder != holder:
            raise InputError(f"{self._hold.user} is holding the robot; wait until they let go")
        if self.must_let_go(holder, now):
            raise InputError(
                f"your hold ended, as nothing was heard of it in time, and more than {self._config.hold_resume_s} s "
                "have passed: let go, then hold again"
            )
        view = view or holder
        age = now - self._drawn_at.get(view, float("-inf"))
        if age > self._config.view_timeout_s:
            raise InputError("the view of the robot is not current; teleoperation needs one younger than 0.5 s")
        if holder not in self._aims:
            raise InputError("there is no target yet; show the gizmo first")
        if self._hold is None:
            self._hold = _Hold(holder, user, view, client, now, self._aims[holder])
        self._hold.renewed_at, self._hold.view, self._hold.share = now, view, share
        self._lapsed.pop(holder, None)

    def must_let_go(self, holder: str, now: float) -> bool:
        """Whether this holder's hold lapsed so long ago that the next one begins only after they have let go."""
        return now - self._lapsed.get(holder, now) > self._config.hold_resume_s

    def release(self, holder: str) -> bool:
        """End this holder's hold at once; True when they were holding."""
        self._lapsed.pop(holder, None)
        if self._hold is None or self._hold.holder != holder:
            return False
        self._ended, self._hold = self._hold, None
        self._releases = _RELEASES
        self._aims.pop(holder, None)
        return True

    def aim_nowhere(self, holder: str) -> None:
        """This holder's gizmo is gone, and where it was means nothing any more."""
        self._aims.pop(holder, None)

    def forget(self, holder: str) -> bool:
        """The holder has gone: end the hold and drop what is known of it; True when they were holding."""
        held = self.release(holder)
        self._aims.pop(holder, None)
        self.unseen(holder)
        return held

    def expire(self, now: float) -> str | None:
        """End a hold that was not renewed or whose holder no longer sees the robot; who that was, else None."""
        hold = self._hold
        if hold is None:
            return None
        seen_at = self._drawn_at.get(hold.view, float("-inf"))
        if now - hold.renewed_at <= self._config.hold_timeout_s and now - seen_at <= self._config.view_timeout_s:
            return None
        self.release(hold.holder)
        self._lapsed[hold.holder] = hold.renewed_at
        return hold.holder

    def due(self, now: float) -> TeleopTarget | None:
        """What to publish at this tick: the held target, an end of hold, or nothing."""
        self.expire(now)
        if self._hold is not None:
            return self._message(True, self._hold)
        if self._releases > 0 and self._ended is not None:
            self._releases -= 1
            return self._message(False, self._ended)
        return None

    def _message(self, holds: bool, hold: _Hold) -> TeleopTarget:
        self._sequence += 1
        aim = hold.aim
        return TeleopTarget(
            sequence=self._sequence,
            hold=holds,
            user=hold.user,
            target=aim.target,
            base=aim.base,
            joints=aim.joints,
            client=hold.client,
            share=hold.share,
            round_trip_s=min(self._lag.get(hold.view, 0.0), 1e3),
        )
