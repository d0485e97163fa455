"""State of one robot in the server, shared by REST and the pages, and the operations on it."""

import asyncio
import time
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any, Protocol

import msgspec

from rolling_panda import commands as intents
from rolling_panda import messages as m
from rolling_panda import topics
from rolling_panda.commands import EvaluateRule, PlantRequest
from rolling_panda.errors import InputError, ServiceError
from rolling_panda.messages.page import GizmoAxes, Measured, PagePoints, PageState, PickRay
from rolling_panda.runtime.token_bucket import TokenBuckets
from server.auth.sessions import Session
from server.config import ServerConfig
from server.robots.event_log import EventLog, LogRateLimiter
from server.robots.link import RobotLink
from server.robots.page_view import PageView
from server.robots.presence import PresenceTracker
from server.robots.scene_updater import SceneUpdater
from server.robots.teleop import TeleopHold
from server.scene.scene import Scene
from server.scene.viser_adapter.client_messages import GizmoDragEnd, GizmoUpdate

_CONFIRM_POLL_S = 0.01
#: A dragged gizmo's target is sent at once, but no sooner than this after the last one (s).
_MIN_TARGET_PERIOD_S = 0.02
#: Rate limit and burst of a session's motion commands; a busy browser sends several at once.
MOTION_RATE_HZ, _MOTION_BURST = 60.0, 20.0


@dataclass(frozen=True)
class Result:
    """The result of a request: HTTP status, success, and a message."""

    status: int
    ok: bool
    reason: str
    effect: m.RuleEffect | None = None
    refused: m.Reason | None = None


class Page(Protocol):
    """An open page."""

    session: Session
    view: str
    placing: bool
    measuring: bool

    def wake(self) -> None:
        """Send what is new."""

    def send_measured(self, measured: Measured) -> None:
        """This page's session has picked the second of two points to measure."""

    def send_pick_ray(self, ray: PickRay) -> None:
        """This page's session has clicked into the 3-D view, to place a point there."""

    def send_selected(self, point_id: str) -> None:
        """A point was clicked in the 3-D view of this page's session."""

    def send_hold_ended(self, reason: str) -> None:
        """The hold of this page's session has ended."""


@dataclass(eq=False)
class RobotContext:
    """State and operations of one robot; it belongs to the server's event loop.

    `held_elsewhere` names another robot that a session holds now; empty where it holds none.
    """

    config: ServerConfig
    link: RobotLink
    scene: Scene
    view: PageView
    log: EventLog
    teleop: TeleopHold
    presence: PresenceTracker
    held_elsewhere: Callable[[Session], str] = lambda session: ""
    motion_limiter: TokenBuckets = field(default_factory=lambda: TokenBuckets(MOTION_RATE_HZ, _MOTION_BURST))
    log_limiter: LogRateLimiter = field(default_factory=LogRateLimiter)
    pages: set[Page] = field(default_factory=set)
    state: PageState | None = None
    points: PagePoints | None = None
    _seen_at: deque[tuple[int, float]] = field(default_factory=lambda: deque(maxlen=100))
    _target_sent_at: float = float("-inf")
    _refused_holds: dict[str, str] = field(default_factory=dict)
    scene_updater: SceneUpdater = field(init=False)

    def __post_init__(self) -> None:
        """Connect link and scene."""
        self.scene_updater = SceneUpdater(self.link, self.view, self.scene)

    def note(self, severity: m.Severity, text: str, by: str = "") -> None:
        """Write a line into the log, here and on the wire; `by` is the source whose rate is limited, empty for none."""
        text = self.log_limiter.line(by, text, time.monotonic()) if by else text
        if not text:
            return
        self.log.add("server", severity, text[:500], time.time())
        self.link.send_event(severity, text, time.monotonic())

    def publish_state(self, state: PageState, now: float) -> None:
        """Give the pages a new state, and remember when its posture was measured."""
        self.state = state
        posture = self.link.posture(now)
        self._seen_at.append((state.number, float("-inf") if posture is None else now - posture.age_s))

    def on_rendered(self, session: Session, view: str, number: int, now: float) -> None:
        """The page `view` of this session has rendered state `number`."""
        self.on_activity(session, now)
        for known, seen_at in reversed(self._seen_at):
            if known == number:
                self.teleop.view_rendered(view, seen_at, now)
                self._on_seen(session, seen_at, now)
                return

    def on_activity(self, session: Session, now: float) -> None:
        """A page or a script of this session has sent something."""
        if self.presence.on_activity(session, now):
            self.link.send_presence(self.presence.message(now))

    def on_state_fetched(self, session: Session, now: float) -> None:
        """A script has fetched the newest state."""
        if self._seen_at:
            seen_at = self._seen_at[-1][1]
            self.teleop.view_rendered(session.session_id, seen_at, now)
            self._on_seen(session, seen_at, now)

    def _on_seen(self, session: Session, seen_at: float, now: float) -> None:
        if self.presence.on_seen(session, seen_at):
            # A request may follow at once, and the controller has to know the age of the view by then.
            self.link.send_presence(self.presence.message(now))

    async def ask(self, session: Session, intent: intents.Intent) -> Result:
        """Send an intent to the controller, which logs its answer."""
        # The age of the view goes with the intent, since the presence message may arrive later.
        view_age_s = self.presence.view_age_s(session, time.monotonic())
        complete = msgspec.structs.replace(intent, role=session.role, client=session.client, view_age_s=view_age_s)
        return await self._call(session, "the controller", topics.INTENT, complete)

    async def ask_perception(self, session: Session, request: PlantRequest) -> Result:
        """Send a request to perception, and log the answer."""
        name = type(request).__name__
        result = await self._call(session, "perception", topics.PLANT, request)
        # Dragging a slider tries many rules, and changes nothing.
        if result.status in (200, 409) and not isinstance(request, EvaluateRule):
            self.note(
                "info",
                f"{name} by {session.user}: {result.reason if result.ok else 'refused, ' + result.reason}",
                session.client,
            )
        return result

    async def _call(
        self, session: Session, process: str, service: topics.Service[Any], request: msgspec.Struct
    ) -> Result:
        try:
            answer = await self.link.call(service, request)
        except ServiceError as error:
            self.note("error", f"{type(request).__name__} by {session.user}: no answer from {process}", session.client)
            return Result(503, False, f"{process[0].upper()}{process[1:]} does not answer: {error}")
        return Result(200 if answer.ok else 409, answer.ok, answer.reason, answer.effect, answer.refused)

    async def stop(self, session: Session, reason: str) -> Result:
        """Send the software stop at once, and wait until bridge and controller report it latched."""
        sent_at = time.monotonic()
        stop_id = self.link.send_stop(session.user, reason)
        holder = self.teleop.holder
        if holder is not None:
            self.teleop.release(holder)
            self._reset_gizmo(holder, "The robot was stopped.")
        self.note("warning", f"software stop by {session.user}: {reason}", f"stop {session.client}")
        while (missing := self.link.not_latched(stop_id)) and time.monotonic() - sent_at < self.config.stop_confirm_s:
            await asyncio.sleep(_CONFIRM_POLL_S)
        if "bridge" in missing:
            reason = "The stop was sent, but the bridge has not confirmed it: use the robot's emergency stop."
            return Result(503, False, reason)
        if missing:
            return Result(200, True, "stopped: the bridge has latched the stop; the controller has not confirmed it")
        return Result(200, True, "stopped: bridge and controller have latched the stop")

    def may_move(self, session: Session) -> bool:
        """Whether this session may move the robot: its role may, and nobody else holds control."""
        control = self.link.control.peek()
        holder = "" if control is None else control.message.holder
        return session.may_operate and holder in ("", session.client)

    def hold(self, session: Session, now: float, view: str = "", speed_scale: float = 1.0) -> Result:
        """Start or renew this session's hold on the robot; `view` is the page that holds, empty for a script."""
        key = session.session_id
        if not session.may_operate:
            return self._refuse_hold(session, f"a {session.role} may look and stop, not operate", 403)
        if not self.may_move(session):
            # Otherwise the hold would block the session that has control.
            return self._refuse_hold(session, "somebody else holds control of the robot; ask for it, or take it", 409)
        other = self.held_elsewhere(session)
        if other:
            # One key or gamepad must not move two robots in two windows.
            return self._refuse_hold(session, f"you hold {other}: let go of it first", 409)
        self.end_lapsed_hold(now)
        was_holding = self.teleop.holder == key
        try:
            self.teleop.hold(key, session.user, now, view or key, session.client, speed_scale)
        except InputError as error:
            return self._refuse_hold(session, str(error), 409)
        self._refused_holds.pop(key, None)
        if not was_holding:
            self.note("info", f"{session.user} holds the robot", session.client)
        return Result(200, True, "holding")

    def on_gizmo(self, session: Session, gizmo: GizmoUpdate | GizmoDragEnd) -> None:
        """A gizmo was dragged or released. While its owner holds, the target is sent at once.

        At the end of a drag the 3-D client sends its last pose after the page has ended the hold. The gizmo is reset
        then, so that the next hold does not move there.
        """
        owner = session.session_id
        if isinstance(gizmo, GizmoDragEnd):
            if self.teleop.holder != owner:
                self._reset_gizmo(owner)
            return
        target = self.scene.gizmos.drag(owner, gizmo.position, gizmo.wxyz)
        if target is None:
            return
        self.teleop.set_target(owner, target)
        now = time.monotonic()
        self.end_lapsed_hold(now)
        if (
            self.teleop.holder == owner
            and self.teleop.follows_gizmo
            and now - self._target_sent_at >= _MIN_TARGET_PERIOD_S
        ):
            message = self.teleop.next_message(now)
            if message is not None:
                self._target_sent_at = now
                self.link.send_teleop(message)

    def release(self, session: Session) -> None:
        """End this session's hold at once; its gizmo returns to the tool."""
        self._refused_holds.pop(session.session_id, None)
        if self.teleop.release(session.session_id):
            self._send_release()
            self._reset_gizmo(session.session_id, "The hold was ended from elsewhere. Press again to go on.")
            self.note("info", f"{session.user} let go of the robot", session.client)

    def _send_release(self) -> None:
        """Send the end of the hold at once; the loop repeats it."""
        ended = self.teleop.next_message(time.monotonic())
        if ended is not None:
            self.link.send_teleop(ended)

    def end_lapsed_hold(self, now: float) -> None:
        """End a hold that was not renewed in time, or whose page has no current view."""
        ended = self.teleop.expire(now)
        if ended is not None:
            self.note("info", "the hold ended: it was not renewed, or the page no longer sees the robot")
            self._reset_gizmo(ended)

    def _reset_gizmo(self, owner: str, reason: str = "") -> None:
        """After a hold: the gizmo and its target return to the tool; pages that hold are sent a reason."""
        for page in self.pages:
            if reason and page.session.session_id == owner:
                page.send_hold_ended(reason)
        tool = self.view.tool(time.monotonic())
        self.scene.gizmos.reset(owner, tool)
        if tool is not None and self.scene.gizmos.shown(owner):
            self.teleop.set_target(owner, tool)

    def show_gizmo(self, session: Session, visible: bool, axes: GizmoAxes = "tool") -> None:
        """Show this session's gizmo at the tool, along these axes, or hide it and end its hold."""
        if not visible:
            self.release(session)
            self.teleop.clear_target(session.session_id)
            self.scene.gizmos.hide(session.session_id)
            return
        tool = self.view.tool(time.monotonic())
        if not session.may_operate or tool is None:
            why = "the tool's place is not known, or the role is viewer"
            self.note("warning", f"no gizmo for {session.user}: {why}", session.client)
            return
        self.release(session)
        self.scene.show_gizmo(session.session_id, tool, axes)
        self.teleop.set_target(session.session_id, tool)

    def end_session(self, session: Session) -> None:
        """A session ends: remove everything of it."""
        self.release(session)
        self.teleop.forget(session.session_id)
        self.presence.forget(session)
        self.scene.forget(session.session_id)

    def wake_pages(self) -> None:
        """Wake the pages, those of operators before those of viewers."""
        for page in sorted(self.pages, key=lambda page: not page.session.may_operate):
            page.wake()

    def on_point_clicked(self, owner: str, point_id: str) -> None:
        """`owner` clicked a point in the 3-D view."""
        self.scene.select(owner, point_id)
        pages = [page for page in self.pages if page.session.session_id == owner]
        # While measuring or placing a point, the next click needs the same view.
        if not any(page.placing or page.measuring for page in pages):
            self.scene.fly_to(owner, point_id)
        for page in pages:
            page.send_selected(point_id)

    def place_by_hand(self, page: Page, placing: bool) -> None:
        """Use the clicks of the page's session to place points, or no more."""
        page.placing = placing and page.session.may_operate
        self._update_click_listener(page.session)

    def measure(self, page: Page, measuring: bool) -> None:
        """Use the clicks of the page's session to measure distances, or no more."""
        page.measuring = measuring and page.session.may_operate
        self.scene.set_measuring(page.session.session_id, page.measuring)
        self._update_click_listener(page.session)

    def _update_click_listener(self, session: Session) -> None:
        listening = any(page.placing or page.measuring for page in self.pages if page.session is session)
        self.scene.listen_to_clicks(session.session_id, listening)

    def on_click(self, owner: str, origin: m.Vector3, direction: m.Vector3) -> None:
        """`owner` clicked into the 3-D view: the ray goes to the page that places a point, or else measures."""
        for page in self.pages:
            if page.placing and page.session.session_id == owner:
                page.send_pick_ray(PickRay(origin=origin, direction=direction))
                return
        measured = self.scene_updater.measure(owner, origin, direction)
        for page in self.pages:
            if measured is not None and page.measuring and page.session.session_id == owner:
                page.send_measured(measured)

    def page_closed(self, page: Page, holding: bool) -> None:
        """A page has closed: end its hold, and with the last page of a session remove the gizmo."""
        self.pages.discard(page)
        self.teleop.forget_view(page.view)
        if holding:
            self.release(page.session)
        if page.measuring:
            self.measure(page, False)
        if page.placing:
            self._update_click_listener(page.session)
        if not any(other.session is page.session for other in self.pages):
            self.show_gizmo(page.session, False)
            self.presence.forget(page.session)

    def _refuse_hold(self, session: Session, reason: str, status: int) -> Result:
        # Held buttons repeat at 20 Hz; each new reason is logged once.
        if self._refused_holds.get(session.session_id) != reason:
            self._refused_holds[session.session_id] = reason
            self.note("warning", f"hold by {session.user} refused: {reason}", session.client)
        return Result(status, False, reason)
