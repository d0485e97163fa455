"""The operator's desk of one robot: what REST and the pages share, and what comes of it when somebody asks."""

import asyncio
import time
from collections import deque
from collections.abc import Awaitable, Callable
from dataclasses import dataclass, field
from typing import Protocol

import msgspec

from rolling_panda import messages as m
from rolling_panda.errors import InputError, ServiceError
from rolling_panda.messages import commands as intents
from rolling_panda.messages.commands import PlantRequest, TryRule
from rolling_panda.messages.page import GizmoAxes, Measured, PagePoints, PageState, Sightline
from server.auth.sessions import Session
from server.config import ServerConfig
from server.robots.event_log import EventLog
from server.robots.link import RobotLink
from server.robots.log_rate_limit import LogRateLimiter
from server.robots.motion_rate import MotionRate
from server.robots.page_view import PageView
from server.robots.presence import PresentPeople
from server.robots.teleop import TeleopHold
from server.robots.view_state import Looking
from server.scene.scene import Scene
from server.scene.viser_filter import GizmoDragEnd, GizmoUpdate

_CONFIRM_POLL_S = 0.01
#: A view says where its gizmo is twenty times a second at most; one that says more often waits for the loop's turn (s).
_AIM_GAP_S = 0.02


@dataclass(frozen=True)
class Result:
    """How a request ended: the HTTP status that says so, and the reason in words."""

    status: int
    ok: bool
    reason: str
    effect: m.RuleEffect | None = None


class Listener(Protocol):
    """An open page."""

    session: Session
    view: str

    def wake(self) -> None:
        """There may be something new to send."""

    placing: bool
    measuring: bool

    def measured(self, told: Measured) -> None:
        """This page's session has clicked the second of two places to measure."""

    def sighted(self, line: Sightline) -> None:
        """This page's session has clicked into the 3-D view, to place a point there."""

    def selected(self, point_id: str) -> None:
        """A point was clicked in the 3-D view of this page's session."""

    def hold_ended(self, reason: str) -> None:
        """The hold of this page's session is over, and why."""


@dataclass(eq=False)
class RobotContext:
    """Shared state of the server about one robot; its event loop alone touches it.

    `held_elsewhere` names another robot that a session holds now; empty where it holds none.
    """

    config: ServerConfig
    link: RobotLink
    scene: Scene
    view: PageView
    log: EventLog
    teleop: TeleopHold
    people: PresentPeople
    held_elsewhere: Callable[[Session], str] = lambda session: ""
    motion: MotionRate = field(default_factory=MotionRate)
    quiet: LogRateLimiter = field(default_factory=LogRateLimiter)
    pages: set["Listener"] = field(default_factory=set)
    state: PageState | None = None
    points: PagePoints | None = None
    _seen_at: deque[tuple[int, float]] = field(default_factory=lambda: deque(maxlen=100))
    _aimed_at: float = float("-inf")
    _refused_holds: dict[str, str] = field(default_factory=dict)
    looking: Looking = field(init=False)

    def __post_init__(self) -> None:
        """Begin to draw what the link says."""
        self.looking = Looking(self.link, self.view, self.scene)

    def note(self, severity: m.Severity, text: str, by: str = "") -> None:
        """Write a line of the server's own into the log, here and on the wire; `by` whom, who must not fill it."""
        text = self.quiet.line(by, text, time.monotonic()) if by else text
        if not text:
            return
        self.log.add("server", severity, text[:500], time.time())
        self.link.event(severity, text, time.monotonic())

    def made_state(self, state: PageState, now: float) -> None:
        """A new state goes out to the pages; who draws it sees the robot as it was when its posture was measured."""
        self.state = state
        posture = self.link.posture(now)
        self._seen_at.append((state.number, float("-inf") if posture is None else now - posture.age_s))

    def drew(self, session: Session, view: str, number: int, now: float) -> None:
        """A page of this session, its `view`, has drawn state `number`."""
        self.heard(session, now)
        for known, seen_at in reversed(self._seen_at):
            if known == number:
                self.teleop.drew(view, seen_at, now)
                self._saw(session, seen_at, now)
                return

    def heard(self, session: Session, now: float) -> None:
        """A page or a script of this session has said something."""
        if self.people.heard(session, now):
            self.link.presence_of(self.people.message(now))

    def fetched(self, session: Session, now: float) -> None:
        """A script has fetched the state that was made last."""
        if self._seen_at:
            seen_at = self._seen_at[-1][1]
            self.teleop.drew(session.session_id, seen_at, now)
            self._saw(session, seen_at, now)

    def _saw(self, session: Session, seen_at: float, now: float) -> None:
        if self.people.saw(session, seen_at):
            # Who looks and then asks at once must be known to have looked.
            self.link.presence_of(self.people.message(now))

    async def ask(self, session: Session, intent: intents.Intent) -> Result:
        """Ask the controller, which logs what it does or why it refuses."""
        # What they have seen goes with what they ask: what else tells the controller may come later on the wire.
        view_age_s = self.people.view_age_s(session, time.monotonic())
        theirs = msgspec.structs.replace(intent, role=session.role, client=session.client, view_age_s=view_age_s)
        return await self._asked(session, type(intent).__name__, "the controller", lambda: self.link.ask(theirs))

    async def ask_perception(self, session: Session, request: PlantRequest) -> Result:
        """Ask perception for another rule or a point, and log what came of it."""
        name = type(request).__name__
        result = await self._asked(session, name, "perception", lambda: self.link.ask_perception(request))
        # Who drags a slider asks often what would be, and changes nothing.
        if result.status in (200, 409) and not isinstance(request, TryRule):
            self.note(
                "info",
                f"{name} by {session.user}: {result.reason if result.ok else 'refused, ' + result.reason}",
                session.client,
            )
        return result

    async def _asked(self, session: Session, name: str, whom: str, ask: Callable[[], Awaitable[m.Answer]]) -> Result:
        """Put a question; what comes of it, also when nobody answers."""
        try:
            answer = await ask()
        except ServiceError as error:
            self.note("error", f"{name} by {session.user}: no answer from {whom}", session.client)
            return Result(503, False, f"{whom[0].upper()}{whom[1:]} does not answer: {error}")
        return Result(200 if answer.ok else 409, answer.ok, answer.reason, answer.effect)

    async def stop(self, session: Session, reason: str) -> Result:
        """Send the software stop at once and wait for bridge and controller to say that they have latched it."""
        sent_at = time.monotonic()
        stop_id = self.link.stop(session.user, reason)
        holder = self.teleop.holder
        if holder is not None:
            self.teleop.release(holder)
            self._held_out(holder, "The robot was stopped.")
        self.note("warning", f"software stop by {session.user}: {reason}", f"stop {session.client}")
        while (missing := self.link.not_latched(stop_id)) and time.monotonic() - sent_at < self.config.stop_confirm_s:
            await asyncio.sleep(_CONFIRM_POLL_S)
        if "bridge" in missing:
            said = "The stop was sent, but the bridge has not confirmed it: use the robot's emergency stop."
            return Result(503, False, said)
        if missing:
            return Result(200, True, "stopped: the bridge has latched the stop; the controller has not confirmed it")
        return Result(200, True, "stopped: bridge and controller have latched the stop")

    def may_move(self, session: Session) -> bool:
        """May this session lead the tool: by its role, and unless somebody else holds control."""
        control = self.link.control.peek()
        holder = "" if control is None else control.message.holder
        return session.may_operate and holder in ("", session.client)

    def hold(self, session: Session, now: float, view: str = "", share: float = 1.0) -> Result:
        """Start or renew this session's hold on the tool, by what its `view` shows; a script is its own view."""
        key = session.session_id
        if not session.may_operate:
            return self._refuse_hold(session, f"a {session.role} may look and stop, not operate", 403)
        if not self.may_move(session):
            # Whoever may not move the robot must not keep the tool from who may.
            return self._refuse_hold(session, "somebody else holds control of the robot; ask for it, or take it", 409)
        other = self.held_elsewhere(session)
        if other:
            # With two windows side by side, one key or one gamepad must not lead both.
            return self._refuse_hold(session, f"you hold {other}: let go of it first", 409)
        self.end_lapsed_hold(now)
        was_holding = self.teleop.holder == key
        try:
            self.teleop.hold(key, session.user, now, view or key, session.client, share)
        except InputError as error:
            return self._refuse_hold(session, str(error), 409)
        self._refused_holds.pop(key, None)
        if not was_holding:
            self.note("info", f"{session.user} holds the robot", session.client)
        return Result(200, True, "holding")

    def dragged(self, session: Session, gizmo: GizmoUpdate | GizmoDragEnd) -> None:
        """A gizmo was dragged, or let go of. While its owner holds, the robot hears at once, not with the loop's turn.

        The 3-D client tells the last place of a drag when it ends, after the page has said that the hold has: the next
        hold may not lead there.
        """
        owner = session.session_id
        if isinstance(gizmo, GizmoDragEnd):
            if self.teleop.holder != owner:
                self._held_out(owner)
            return
        target = self.scene.gizmos.drag(owner, gizmo.position, gizmo.wxyz)
        if target is None:
            return
        self.teleop.aim(owner, target)
        now = time.monotonic()
        self.end_lapsed_hold(now)
        if self.teleop.holder == owner and self.teleop.leads_gizmo and now - self._aimed_at >= _AIM_GAP_S:
            held = self.teleop.due(now)
            if held is not None:
                self._aimed_at = now
                self.link.teleop(held)

    def let_go(self, session: Session) -> None:
        """End this session's hold at once; its gizmo goes back to the tool."""
        self._refused_holds.pop(session.session_id, None)
        if self.teleop.release(session.session_id):
            self._say_release()
            self._held_out(session.session_id, "The hold was ended from elsewhere. Press again to go on.")
            self.note("info", f"{session.user} let go of the robot", session.client)

    def _say_release(self) -> None:
        """At once: the robot brakes from when it hears of it, and the next turn of the loop repeats it."""
        ended = self.teleop.due(time.monotonic())
        if ended is not None:
            self.link.teleop(ended)

    def end_lapsed_hold(self, now: float) -> None:
        """End the hold of whoever no longer renews it or no longer sees the robot."""
        ended = self.teleop.expire(now)
        if ended is not None:
            self.note("info", "the hold ended: it was not renewed, or the page no longer sees the robot")
            self._held_out(ended)

    def _held_out(self, owner: str, reason: str = "") -> None:
        """A hold has ended: the gizmo goes back to the tool, and aims there; pages that hold are told a reason."""
        for page in self.pages:
            if reason and page.session.session_id == owner:
                page.hold_ended(reason)
        tool = self.view.tool(time.monotonic())
        self.scene.gizmos.reset(owner, tool)
        if tool is not None and self.scene.gizmos.shown(owner):
            self.teleop.aim(owner, tool)

    def show_gizmo(self, session: Session, visible: bool, axes: GizmoAxes = "tool") -> None:
        """Show this session's gizmo at the tool, along these axes, or hide it and end its hold."""
        if not visible:
            self.let_go(session)
            self.teleop.aim_nowhere(session.session_id)
            self.scene.gizmos.hide(session.session_id)
            return
        tool = self.view.tool(time.monotonic())
        if not session.may_operate or tool is None:
            why = "the tool's place is not known, or the role is viewer"
            self.note("warning", f"no gizmo for {session.user}: {why}", session.client)
            return
        self.let_go(session)
        self.scene.show_gizmo(session.session_id, tool, axes)
        self.teleop.aim(session.session_id, tool)

    def leave(self, session: Session) -> None:
        """A session ends: nothing of it stays with this robot."""
        self.let_go(session)
        self.teleop.forget(session.session_id)
        self.motion.forget(session.session_id)
        self.people.forget(session)
        self.scene.forget(session.session_id)

    def wake_pages(self) -> None:
        """There is something new for the pages: whoever may operate hears it before all that look on."""
        for page in sorted(self.pages, key=lambda page: not page.session.may_operate):
            page.wake()

    def clicked(self, owner: str, point_id: str) -> None:
        """`owner` clicked a point in their 3-D view."""
        self.scene.select(owner, point_id)
        theirs = [page for page in self.pages if page.session.session_id == owner]
        # Who clicks for a measure or a new point wants to click on in the same view.
        if not any(page.placing or page.measuring for page in theirs):
            self.scene.bring(owner, point_id)
        for page in theirs:
            page.selected(point_id)

    def place_by_hand(self, page: Listener, placing: bool) -> None:
        """A page takes its session's next clicks into the 3-D view for points to place, or no more."""
        page.placing = placing and page.session.may_operate
        self._take_clicks(page.session)

    def measure(self, page: Listener, measuring: bool) -> None:
        """A page takes its session's next clicks into the 3-D view for a measure, or no more."""
        page.measuring = measuring and page.session.may_operate
        self.scene.begin_measure(page.session.session_id, page.measuring)
        self._take_clicks(page.session)

    def _take_clicks(self, session: Session) -> None:
        taken = any(page.placing or page.measuring for page in self.pages if page.session is session)
        self.scene.take_clicks(session.session_id, taken)

    def sighted(self, owner: str, origin: m.Vector3, direction: m.Vector3) -> None:
        """`owner` clicked into their 3-D view; of their pages the one that places asks for the point."""
        for page in self.pages:
            if page.placing and page.session.session_id == owner:
                page.sighted(Sightline(origin=origin, direction=direction))
                return
        told = self.looking.measured(owner, origin, direction)
        for page in self.pages:
            if told is not None and page.measuring and page.session.session_id == owner:
                page.measured(told)

    def page_closed(self, page: Listener, holding: bool) -> None:
        """A page has gone; with the last one of its session goes the gizmo, and with a holding one the hold."""
        self.pages.discard(page)
        self.teleop.unseen(page.view)
        if holding:
            self.let_go(page.session)
        if page.measuring:
            self.measure(page, False)
        if page.placing:
            self._take_clicks(page.session)
        if not any(other.session is page.session for other in self.pages):
            self.show_gizmo(page.session, False)
            self.people.forget(page.session)

    def _refuse_hold(self, session: Session, reason: str, status: int) -> Result:
        # Held buttons repeat at 20 Hz; one line for each new reason is enough.
        if self._refused_holds.get(session.session_id) != reason:
            self._refused_holds[session.session_id] = reason
            self.note("warning", f"hold by {session.user} refused: {reason}", session.client)
        return Result(status, False, reason)
