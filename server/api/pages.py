"""The page's WebSocket `/ws`: states out, newest wins; heartbeats, holds and gestures in, strict."""

import asyncio
import secrets
import time

import msgspec
from fastapi import APIRouter
from starlette.websockets import WebSocket, WebSocketDisconnect

from rolling_panda.errors import InputError
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
    Ping,
    PlaceByHand,
    PlaceCamera,
    Pong,
    Select,
    Selected,
    ShowGizmo,
    ShowLayers,
    ShowPreview,
    Sightline,
)
from rolling_panda.messages.supervision import PreviewState
from rolling_panda.messages.types import Pose
from server.api.page_pace import PagePace
from server.auth.sessions import Session
from server.connections.websocket_protocol import why_ended
from server.robots.context import RobotContext
from server.robots.page_view import addressed
from server.robots.teleop import Aim

_ENCODER = msgspec.json.Encoder()
_DECODER: msgspec.json.Decoder[FromPage] = msgspec.json.Decoder(FromPage, strict=True)
_EVENTS_AT_ONCE = 200
_POLICY = 1008


class OpenPage:
    """One open page. A page that reads slowly skips states; nothing queues up for it."""

    def __init__(self, desk: RobotContext, websocket: WebSocket, session: Session) -> None:
        """Nothing has been sent yet."""
        self._desk = desk
        self._websocket = websocket
        self.session = session
        self._wake = asyncio.Event()
        self._pong: Pong | None = None
        self._selected: str | None = None
        self._hold_ended: HoldEnded | None = None
        self._sightline: Sightline | None = None
        self._measured: Measured | None = None
        self.placing = False
        self.measuring = False
        self._pace = PagePace(desk.config.page_rate_hz, desk.config.onlooker_rate_hz)
        self._points: PagePoints | None = None
        self._preview: PreviewState | None = None
        self._event_number = 0
        self._hold_sequence = -1
        self._holding = False
        #: The button is still pressed, but its hold is over: only a new press starts another.
        self._spent = False
        #: Tells this page from others of the same session.
        self.view = f"page {secrets.token_hex(8)}"

    async def run(self) -> None:
        """Serve the page until it goes, breaks the rules, or the session ends."""
        desk = self._desk
        desk.pages.add(self)
        self.wake()
        legs = [
            asyncio.create_task(self._write()),
            asyncio.create_task(self._read()),
            asyncio.create_task(self.session.ended.wait()),
        ]
        try:
            await asyncio.wait(legs, return_when=asyncio.FIRST_COMPLETED)
        finally:
            desk.page_closed(self, self._holding)
            if not any(other.session is self.session for other in desk.pages):
                desk.scene.show_ghost(self.session.session_id, None)
            for leg in legs:
                leg.cancel()
            await asyncio.gather(*legs, return_exceptions=True)
        if self.session.ended.is_set():
            await self._close("signed out")
        elif reason := why_ended(self._websocket.scope):
            self._closed_for(reason)

    def selected(self, point_id: str) -> None:
        """A point was clicked in the 3-D view of this session."""
        self._selected = point_id
        self.wake()

    def sighted(self, line: Sightline) -> None:
        """This session has clicked into the 3-D view, to place a point there."""
        self._sightline = line
        self.wake()

    def measured(self, told: Measured) -> None:
        """The second of two places was clicked."""
        self._measured = told
        self.wake()

    def hold_ended(self, reason: str) -> None:
        """This session's hold is over; the page that held must let go and press again."""
        if self._holding:
            self._spend(reason)

    def wake(self) -> None:
        """There may be something new to send."""
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
        """The most urgent message that this page has not been sent."""
        desk = self._desk
        if self._pong is not None:
            pong, self._pong = self._pong, None
            return pong
        if self._hold_ended is not None:
            ended, self._hold_ended = self._hold_ended, None
            return ended
        if desk.state is not None and self._pace.due(desk.state, self.session.may_operate):
            return addressed(desk.state, self.session)
        if self._sightline is not None:
            line, self._sightline = self._sightline, None
            return line
        if self._measured is not None:
            told, self._measured = self._measured, None
            return told
        if self._selected is not None:
            point_id, self._selected = self._selected, None
            return Selected(point_id=point_id)
        if desk.points is not None and desk.points is not self._points:
            self._points = desk.points
            return desk.points
        preview = desk.link.preview.peek()
        if preview is not None and preview.message is not self._preview:
            self._preview = preview.message
            return PagePreview(preview=preview.message)
        if desk.log.number > self._event_number:
            events = desk.log.after(self._event_number, _EVENTS_AT_ONCE)
            self._event_number = desk.log.number
            return PageEvents(events=events)
        return None

    async def _read(self) -> None:
        try:
            while True:
                text = await self._websocket.receive_text()
                try:
                    message = _DECODER.decode(text)
                except (msgspec.MsgspecError, UnicodeEncodeError, RecursionError) as error:
                    self._closed_for(str(error)[:200])
                    await self._close("this message is not one that a page may send")
                    return
                self._take(message)
        except (WebSocketDisconnect, KeyError, RuntimeError):
            # KeyError: a binary frame, which no page sends.
            return

    def _closed_for(self, reason: str) -> None:
        self._desk.note("warning", f"a page of {self.session.user} was closed: {reason}", self.session.client)

    def _take(self, message: FromPage) -> None:
        match message:
            case Ping(number=number, rendered=rendered):
                self._desk.drew(self.session, self.view, rendered, time.monotonic())
                self._pong = Pong(number=number)
                self.wake()
            case Hold(sequence=sequence, hold=hold):
                if sequence <= self._hold_sequence:
                    return
                self._hold_sequence = sequence
                if hold:
                    self._renew(message, time.monotonic())
                else:
                    self._holding = self._spent = False
                    self._desk.let_go(self.session)
            case ShowGizmo(visible=visible, axes=axes):
                self._desk.show_gizmo(self.session, visible, axes)
            case PlaceByHand(active=active):
                self._desk.place_by_hand(self, active)
            case ShowPreview(time=moment):
                self._desk.scene.show_ghost(self.session.session_id, moment)
            case PlaceCamera(preset=preset):
                self._desk.looking.place_camera(self.session, preset)
            case ShowLayers(layers=layers):
                self._desk.looking.show_layers(self.session, layers)
            case Measure(active=active):
                self._desk.measure(self, active)
            case Select(point_id=point_id, follow=follow):
                self._desk.scene.select(self.session.session_id, point_id)
                self._desk.scene.bring(self.session.session_id, point_id, follow)

    def _renew(self, held: Hold, now: float) -> None:
        try:
            self._desk.motion.count(self.session.session_id, now)
        except InputError:
            # A renewal too many renews nothing; one in time follows, or the hold ends.
            return
        self._hold(held, now)

    def _hold(self, message: Hold, now: float) -> None:
        if self._spent:
            return
        # A moment's pause of a slow browser goes on by itself; after a longer one it takes a new press.
        self._desk.end_lapsed_hold(now)
        if self._holding and self._desk.teleop.must_let_go(self.session.session_id, now):
            self._spend("The hold ended: the page or its link was too slow. Press again to go on.")
            return
        aim = aim_of(message, self._desk.scene.gizmos.pose(self.session.session_id))
        if aim is not None:
            self._desk.teleop.want(self.session.session_id, aim)
        held = self._desk.hold(self.session, now, self.view, message.share)
        if held.ok:
            self._holding = True
        elif not self._holding:
            self._spend(held.reason)

    def _spend(self, reason: str) -> None:
        self._holding, self._spent = False, True
        self._hold_ended = HoldEnded(reason=reason)
        self.wake()

    async def _close(self, reason: str) -> None:
        try:
            await self._websocket.close(_POLICY, reason)
        except RuntimeError:
            return


def aim_of(held: Hold, gizmo: Pose | None) -> Aim | None:
    """What a page that holds wants of the robot; None where it wants nothing, as without a gizmo."""
    if held.base is not None or held.joints is not None:
        return Aim(None, held.base, held.joints)
    return None if gizmo is None else Aim(gizmo)


def pages_router(desk: RobotContext) -> APIRouter:
    """The WebSocket `/ws`."""
    router = APIRouter(include_in_schema=False)

    @router.websocket("/ws")
    async def page(websocket: WebSocket) -> None:
        await websocket.accept()
        await OpenPage(desk, websocket, websocket.state.session).run()

    return router
