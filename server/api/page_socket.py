"""The page's WebSocket `/ws`: it sends states, newest wins, and receives pings, holds and commands of the 3-D view."""

import asyncio
import secrets
import time

import msgspec
from fastapi import APIRouter
from starlette.websockets import WebSocket, WebSocketDisconnect

from rolling_panda import reasons
from rolling_panda.messages.page import (
    FromPage,
    Hold,
    HoldEnded,
    Measure,
    Measured,
    PageEvents,
    PageMessage,
    PagePoints,
    PagePreview,
    PageState,
    PickRay,
    Ping,
    PlaceByHand,
    PlaceCamera,
    Pong,
    Select,
    Selected,
    ShowGizmo,
    ShowLayers,
    ShowPosture,
    ShowPreview,
)
from rolling_panda.messages.supervision import PreviewState
from rolling_panda.messages.types import Reason
from server.auth.sessions import Session
from server.connections.websocket_protocol import why_ended
from server.robots.context import RobotContext
from server.robots.page_view import addressed
from server.robots.teleop import TeleopCommand

_ENCODER = msgspec.json.Encoder()
_DECODER: msgspec.json.Decoder[FromPage] = msgspec.json.Decoder(FromPage, strict=True)
_MAX_EVENTS = 200
_POLICY_VIOLATION = 1008


class PageSocket:
    """One open page. A page that reads slowly skips states; they are not queued."""

    def __init__(self, robot: RobotContext, websocket: WebSocket, session: Session) -> None:
        """Nothing has been sent yet."""
        self._robot = robot
        self._websocket = websocket
        self.session = session
        self._wake = asyncio.Event()
        self._pong: Pong | None = None
        self._selected: str | None = None
        self._hold_ended: HoldEnded | None = None
        self._pick_ray: PickRay | None = None
        self._measured: Measured | None = None
        self.placing = False
        self.measuring = False
        self._throttle = StateThrottle(robot.config.page_rate_hz, robot.config.onlooker_rate_hz)
        self._points: PagePoints | None = None
        self._preview: PreviewState | None = None
        self._event_number = 0
        self._hold_sequence = -1
        self._holding = False
        #: The hold has ended while the button is still pressed: only a new press starts another.
        self._needs_release = False
        #: Distinguishes the pages of a session.
        self.view = f"page {secrets.token_hex(8)}"

    async def run(self) -> None:
        """Serve the page until it closes, sends an invalid message, or the session ends."""
        robot = self._robot
        robot.pages.open.add(self)
        self.wake()
        tasks = [
            asyncio.create_task(self._write()),
            asyncio.create_task(self._read()),
            asyncio.create_task(self.session.ended.wait()),
        ]
        try:
            await asyncio.wait(tasks, return_when=asyncio.FIRST_COMPLETED)
        finally:
            robot.pages.close(self, self._holding)
            for task in tasks:
                task.cancel()
            await asyncio.gather(*tasks, return_exceptions=True)
        if self.session.ended.is_set():
            await self._close("signed out")
        elif reason := why_ended(self._websocket.scope):
            self._robot.log.note(reasons.page_closed(self.session.user, reason), self.session.client)

    def send_selected(self, point_id: str) -> None:
        """A point was clicked in the 3-D view of this session."""
        self._selected = point_id
        self.wake()

    def send_pick_ray(self, ray: PickRay) -> None:
        """This session has clicked into the 3-D view, to place a point there."""
        self._pick_ray = ray
        self.wake()

    def send_measured(self, measured: Measured) -> None:
        """The second of two points was picked."""
        self._measured = measured
        self.wake()

    def send_hold_ended(self, reason: Reason) -> None:
        """This session's hold has ended; the page that held needs a new press of the button."""
        if self._holding:
            self._end_hold(reason)

    def wake(self) -> None:
        """Send what is new."""
        self._wake.set()

    async def _write(self) -> None:
        try:
            while True:
                await self._wake.wait()
                self._wake.clear()
                while (message := self._next()) is not None:
                    await self._websocket.send_text(_ENCODER.encode(message).decode())
        except (WebSocketDisconnect, RuntimeError):
            return

    def _next(self) -> PageMessage | None:
        """The most urgent unsent message."""
        robot = self._robot
        if self._pong is not None:
            pong, self._pong = self._pong, None
            return pong
        if self._hold_ended is not None:
            ended, self._hold_ended = self._hold_ended, None
            return ended
        state, points, log = robot.pages.state, robot.pages.points, robot.log.lines
        if state is not None and self._throttle.is_due(state, self.session.may_operate):
            return addressed(state, self.session)
        if self._pick_ray is not None:
            ray, self._pick_ray = self._pick_ray, None
            return ray
        if self._measured is not None:
            measured, self._measured = self._measured, None
            return measured
        if self._selected is not None:
            point_id, self._selected = self._selected, None
            return Selected(point_id=point_id)
        if points is not None and points is not self._points:
            self._points = points
            return points
        preview = robot.link.preview.peek()
        if preview is not None and preview.message is not self._preview:
            self._preview = preview.message
            return PagePreview(preview=preview.message)
        if log.number > self._event_number:
            events = log.after(self._event_number, _MAX_EVENTS)
            self._event_number = log.number
            return PageEvents(events=events)
        return None

    async def _read(self) -> None:
        try:
            while True:
                text = await self._websocket.receive_text()
                try:
                    message = _DECODER.decode(text)
                except (msgspec.MsgspecError, UnicodeEncodeError, RecursionError) as error:
                    invalid = reasons.page_message_invalid(self.session.user, str(error)[:200])
                    self._robot.log.note(invalid, self.session.client)
                    await self._close("this message is not one that a page may send")
                    return
                self._handle(message)
        except (WebSocketDisconnect, KeyError, RuntimeError):
            # KeyError: a binary frame, which no page sends.
            return

    def _handle(self, message: FromPage) -> None:
        match message:
            case Ping(number=number, rendered=rendered):
                self._robot.pages.on_rendered(self.session, self.view, rendered, time.monotonic())
                self._pong = Pong(number=number)
                self.wake()
            case Hold(sequence=sequence, hold=hold):
                if sequence <= self._hold_sequence:
                    return
                self._hold_sequence = sequence
                if hold:
                    self._renew(message, time.monotonic())
                else:
                    self._holding = self._needs_release = False
                    self._robot.teleop.release(self.session)
            case ShowGizmo(visible=visible, axes=axes):
                if visible:
                    self._robot.teleop.show_gizmo(self.session, axes)
                else:
                    self._robot.teleop.hide_gizmo(self.session)
            case PlaceByHand(active=active):
                self._robot.pages.place_by_hand(self, active)
            case ShowPreview(time=moment):
                self._robot.scene.show_ghost(self.session.session_id, moment)
            case ShowPosture(angles=angles):
                self._robot.scene_updater.show_posture(self.session, angles)
            case PlaceCamera(preset=preset):
                self._robot.scene_updater.place_camera(self.session, preset)
            case ShowLayers(layers=layers):
                self._robot.scene_updater.show_layers(self.session, layers)
            case Measure(active=active):
                self._robot.pages.measure(self, active)
            case Select(point_id=point_id, follow=follow):
                self._robot.scene.select(self.session.session_id, point_id)
                self._robot.scene.fly_to(self.session.session_id, point_id, follow)

    def _renew(self, message: Hold, now: float) -> None:
        teleop = self._robot.teleop
        # A renewal over the rate limit is ignored: a later one follows, or the hold ends.
        if not teleop.within_rate(self.session, now) or self._needs_release:
            return
        # A short pause of a slow browser is resumed; a longer one needs a new press.
        if teleop.must_release(self.session, now) and self._holding:
            self._end_hold(reasons.hold_interrupted())
            return
        led = TeleopCommand(None, message.base, message.joints, message.along, message.posture)
        command = None if led == TeleopCommand() else led
        refused = teleop.hold(self.session, now, command, self.view, message.speed_scale)
        if refused is None:
            self._holding = True
        elif not self._holding:
            self._end_hold(refused)

    def _end_hold(self, reason: Reason) -> None:
        self._holding, self._needs_release = False, True
        self._hold_ended = HoldEnded(reason=reason)
        self.wake()

    async def _close(self, reason: str) -> None:
        try:
            await self._websocket.close(_POLICY_VIOLATION, reason)
        except RuntimeError:
            return


class StateThrottle:
    """Selects the states that a page is sent: all for operators, fewer for viewers."""

    def __init__(self, page_rate_hz: float, viewer_rate_hz: float) -> None:
        """States come at the first rate; viewers are sent them at the second."""
        self._divisor = max(1, round(page_rate_hz / viewer_rate_hz))
        self._sent: PageState | None = None

    def is_due(self, state: PageState, may_operate: bool) -> bool:
        """Whether to send this state, which then counts as sent; another mode, stop or lost process is due at once."""
        sent = self._sent
        if state is sent:
            return False
        if sent is not None and not may_operate and state.number % self._divisor and _urgent(sent) == _urgent(state):
            return False
        self._sent = state
        return True


def _urgent(state: PageState) -> tuple[object, ...]:
    mode = None if state.controller is None else state.controller.mode
    return mode, state.stops, [row.present for row in state.processes]


def page_socket_router(robot: RobotContext) -> APIRouter:
    """The WebSocket `/ws`."""
    router = APIRouter(include_in_schema=False)

    @router.websocket("/ws")
    async def page(websocket: WebSocket) -> None:
        await websocket.accept()
        await PageSocket(robot, websocket, websocket.state.session).run()

    return router
