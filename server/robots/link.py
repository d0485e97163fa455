"""The server's connection to one robot: newest states in, commands, stops and teleoperation out.

Zenoh's callbacks run on its own threads; they only store to slots and feeds, which the server's event loop reads.
"""

import asyncio
import hashlib
import secrets
import threading
import time
from collections import Counter, deque
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from typing import Any

import msgspec

from rolling_panda import __version__, reasons, topics
from rolling_panda import commands as intents
from rolling_panda import messages as m
from rolling_panda.commands import EvaluateRule, PlantRequest
from rolling_panda.errors import ServiceError
from rolling_panda.messages.page import ProcessPresence
from rolling_panda.messages.robot import CameraFrame
from rolling_panda.messages.supervision import Presence, StopState, TeleopTarget
from rolling_panda.model.differential_drive import Array
from rolling_panda.model.map_frame import MapFrame
from rolling_panda.model.robot import configuration
from rolling_panda.reasons import said
from rolling_panda.transport.inbox import Received
from rolling_panda.transport.zenoh import Transport
from server.auth.sessions import Session
from server.robots.event_log import RobotLog
from server.robots.pictures import PictureStore

_STOP_REPEATS = 5
_STOP_SPACING_S = 0.025
#: Camera images that are kept: a page asks for the frame of its state, and newer ones may have come since.
_MAX_IMAGES = 5


@dataclass(frozen=True)
class Posture:
    """The measured posture.

    Attributes:
        base: Pose of the base in odom.
        position: [θ_l, θ_r, q₁…q₇] (rad).
        age_s: Age of the older of both (s).
        where: Where odom is in map.
    """

    base: m.PlanarPose
    position: m.Actuated
    age_s: float
    where: MapFrame = MapFrame()

    @property
    def q(self) -> Array:
        """The configuration (12), with the base in odom."""
        return configuration(self.base, self.position)

    @property
    def q_in_map(self) -> Array:
        """The configuration (12), with the base in map."""
        return self.where.configuration_in_map(self.q)


class RobotLink:
    """Receives the robot's messages and sends the server's."""

    def __init__(self, transport: Transport) -> None:
        """Subscribe to what the page and the 3-D view need."""
        self._transport = transport
        self.traffic = transport.traffic
        self.joints = transport.slot(topics.JOINTS)
        self.odometry = transport.slot(topics.ODOMETRY)
        self.bridge = transport.slot(topics.BRIDGE)
        self.controller = transport.slot(topics.CONTROLLER)
        self.replay = transport.slot(topics.REPLAY)
        self.camera = transport.slot(topics.CAMERA)
        self.images: dict[int, bytes] = {}
        """JPEG of the newest frames, by sequence."""
        self.on_close_up: Callable[[CameraFrame], None] = lambda frame: None
        transport.subscribe(topics.CAMERA, self._on_frame)
        self.points = transport.slot(topics.POINTS)
        self.plan = transport.slot(topics.PLAN)
        self.preview = transport.slot(topics.PREVIEW)
        self.preview_motion = transport.slot(topics.PREVIEW_MOTION)
        self.report = transport.slot(topics.REPORT)
        self.timeline = transport.slot(topics.TIMELINE)
        self.programs: dict[str, m.Program] = {}
        """The program of each process, of the server too."""
        transport.subscribe(topics.PROGRAM, self._on_program)
        self.scenery = transport.slot(topics.SCENERY)
        self.scenery_motion = transport.slot(topics.SCENERY_MOTION)
        self.obstacles = transport.slot(topics.OBSTACLES)
        self.camera_state = transport.slot(topics.CAMERA_STATE)
        self.robot_calibration = transport.slot(topics.ROBOT_CALIBRATION)
        self._localisation = transport.slot(topics.LOCALISATION)
        self._map_frame = MapFrame()
        self.pictures = PictureStore()
        transport.subscribe(topics.PICTURES, lambda picture, at: self.pictures.add(picture))
        self.control = transport.slot(topics.CONTROL)
        self.stops: dict[str, Received[StopState]] = {}
        transport.subscribe(topics.STOPS, self._on_stops)
        self.events = transport.feed(topics.EVENT, 500)
        self.programs["server"] = m.Program(process="server", version=__version__, began_at=time.time())
        self._heard: dict[str, float] = {}
        transport.subscribe(topics.HEARTBEAT, self._on_heartbeat)
        self._stop = transport.publisher(topics.STOP)
        self._teleop = transport.publisher(topics.TELEOP)
        self._beat = transport.publisher(topics.HEARTBEAT)
        self._presence = transport.publisher(topics.PRESENCE)
        self._event = transport.publisher(topics.EVENT)
        # Own threads, so that a controller that does not answer delays nothing else.
        self._callers = ThreadPoolExecutor(max_workers=4, thread_name_prefix="intent")
        self._writer = ThreadPoolExecutor(max_workers=1, thread_name_prefix="event")
        self.refused: deque[tuple[str, m.Reason]] = deque(maxlen=100)
        self.rejected: Counter[str] = Counter()
        """Messages that could not be read, by topic."""
        transport.on_reject = self._on_reject

    async def call(self, service: topics.Service[Any], request: object) -> m.Answer:
        """Call a service of another process.

        Raises:
            ServiceError: It did not answer in time.
        """
        loop = asyncio.get_running_loop()
        return await loop.run_in_executor(self._callers, self._transport.call, service, request)

    def send_stop(self, stop_id: str, user: str, reason: str) -> None:
        """Send the software stop, repeated over 100 ms. It needs no controller.

        It is sent on its own thread, since the topic blocks when the wire is congested.
        """
        request = m.StopRequest(stop_id=stop_id, source="server", user=user, reason=said(reason))

        def send() -> None:
            self._stop.put(request)
            for _ in range(_STOP_REPEATS - 1):
                time.sleep(_STOP_SPACING_S)
                self._stop.put(request)

        threading.Thread(target=send, name="stop", daemon=True).start()

    def not_latched(self, stop_id: str) -> tuple[str, ...]:
        """Those of bridge and controller that have not reported this stop as latched."""
        latched = {process: {stop.stop_id for stop in state.message.stops} for process, state in self.stops.items()}
        bridge = self.bridge.peek()
        if bridge is not None:
            latched.setdefault("bridge", set()).add(bridge.message.stop_id)
        return tuple(process for process in ("bridge", "controller") if stop_id not in latched.get(process, ()))

    def send_teleop(self, target: TeleopTarget) -> None:
        """Publish the teleoperation target."""
        self._teleop.put(target)

    def send_presence(self, presence: Presence) -> None:
        """Publish the present sessions."""
        self._presence.put(presence)

    def send_heartbeat(self, sequence: int) -> None:
        """Publish the heartbeat of the server's loop."""
        self._beat.put(m.Heartbeat(process="server", sequence=sequence))

    def send_event(self, reason: m.Reason, now: float) -> None:
        """Publish a line of the log, on its own thread, since this topic blocks too."""
        event = m.LogEvent(header=m.Header(stamp=now), process="server", reason=reason)
        self._writer.submit(self._event.put, event)

    @property
    def map_frame(self) -> MapFrame:
        """Where odom is in map, and how the base stands."""
        told, odometry = self._localisation.peek(), self.odometry.peek()
        if told is not None:
            self._map_frame = self._map_frame.after(told.message)
        if odometry is not None:
            self._map_frame = self._map_frame.standing(odometry.message)
        return self._map_frame

    def posture(self, now: float) -> Posture | None:
        """The measured posture, or None before the first joints and odometry."""
        joints, odometry = self.joints.peek(), self.odometry.peek()
        if joints is None or odometry is None:
            return None
        age_s = now - min(joints.at, odometry.at)
        return Posture(odometry.message.pose, joints.message.position, age_s, self.map_frame)

    def presence(self, now: float) -> tuple[ProcessPresence, ...]:
        """One row for each process: whether it is connected, and the age of its last message."""
        present = self._transport.present()
        ages = {
            "bridge": min(self.joints.age(now), self.bridge.age(now)),
            "controller": self.controller.age(now),
            "perception": self.points.age(now),
        }
        rows = []
        for process in m.PROCESSES:
            heard = min(ages.get(process, float("inf")), now - self._heard.get(process, float("-inf")))
            age = None if heard == float("inf") else max(heard, 0.0)
            rows.append(ProcessPresence(process, process in present, age))
        return tuple(rows)

    def close(self) -> None:
        """Abandon calls without an answer."""
        self._callers.shutdown(wait=False, cancel_futures=True)
        self._writer.shutdown(wait=False, cancel_futures=True)

    def _on_reject(self, topic: str, reason: m.Reason) -> None:
        self.rejected[topic] += 1
        self.refused.append((topic, reason))

    def _on_frame(self, message: CameraFrame, at: float) -> None:
        self.images[message.sequence] = message.color_jpeg
        if len(self.images) > _MAX_IMAGES:
            del self.images[next(iter(self.images))]
        if message.point_id:
            self.on_close_up(message)

    def _on_stops(self, message: StopState, at: float) -> None:
        self.stops[message.process] = Received(message, at)

    def _on_program(self, message: m.Program, at: float) -> None:
        self.programs[message.process] = message

    def _on_heartbeat(self, message: m.Heartbeat, at: float) -> None:
        self._heard[message.process] = at


_CONFIRM_POLL_S = 0.01
#: Number of confirmed stops that are remembered, for requests that are repeated.
_CONFIRMED = 1000


@dataclass(frozen=True)
class Result:
    """The result of a request.

    Attributes:
        status: HTTP status; below 400 it was done.
        reason: Why it was refused, or what was done; None where there is nothing to say.
        effect: Of a pruning rule.
    """

    status: int
    reason: m.Reason | None = None
    effect: m.RuleEffect | None = None

    @property
    def ok(self) -> bool:
        """Whether the request was done."""
        return self.status < 400


class RobotCommands:
    """Sends commands to the processes of one robot and waits for their answers."""

    def __init__(
        self,
        link: RobotLink,
        log: RobotLog,
        view_age_s: Callable[[Session], float],
        on_stop: Callable[[], None],
        stop_confirm_s: float,
    ) -> None:
        """Nothing was commanded.

        Args:
            link: To the processes.
            log: For stops, and for the answers of perception; the controller logs its own.
            view_age_s: Age of the newest state that a session has seen (s).
            on_stop: Called after a stop was sent.
            stop_confirm_s: Time limit for bridge and controller to report a stop as latched.
        """
        self._link, self._log = link, log
        self._view_age_s, self._on_stop, self._stop_confirm_s = view_age_s, on_stop, stop_confirm_s
        self._confirmed: deque[str] = deque(maxlen=_CONFIRMED)

    async def ask(self, session: Session, intent: intents.Intent) -> Result:
        """Send an intent to the controller, which logs its answer."""
        complete = msgspec.structs.replace(
            intent,
            role=session.role,
            client=session.client,
            # The age of the view goes with the intent, since the presence message may arrive later.
            view_age_s=self._view_age_s(session),
        )
        return await self._call(session, "controller", topics.INTENT, complete)

    async def ask_perception(self, session: Session, request: PlantRequest) -> Result:
        """Send a request to perception, and log the answer."""
        name = type(request).__name__
        result = await self._call(session, "perception", topics.PLANT, request)
        # Dragging a slider tries many rules, and changes nothing.
        if result.status in (200, 409) and not isinstance(request, EvaluateRule):
            told, by = result.reason or reasons.done(), session.user
            line = reasons.request_done(name, by, told) if result.ok else reasons.request_refused(name, by, told)
            self._log.note(line, session.client)
        return result

    async def _call(
        self, session: Session, process: str, service: topics.Service[Any], request: msgspec.Struct
    ) -> Result:
        try:
            answer = await self._link.call(service, request)
        except ServiceError as error:
            silent = reasons.service_silent(process, str(error))
            refused = reasons.request_refused(type(request).__name__, session.user, silent)
            self._log.note(refused, session.client)
            return Result(503, silent)
        return result_of(answer)

    async def stop(self, session: Session, reason: str, press: str) -> Result:
        """Send the software stop at once, and wait until bridge and controller report it latched.

        Args:
            session: Whose.
            reason: For the log.
            press: What a repeated request has in common with the first one; empty if it tells nothing. Confirmed once,
                it is not sent again: somebody may have reset it meanwhile.
        """
        sent_at = time.monotonic()
        stop_id = _stop_id(session, press)
        if stop_id in self._confirmed:
            return Result(200, reasons.stop_confirmed())
        self._link.send_stop(stop_id, session.user, reason)
        self._on_stop()
        self._log.note(reasons.software_stop(session.user, reasons.said(reason)), f"stop {session.client}")
        while (missing := self._link.not_latched(stop_id)) and time.monotonic() - sent_at < self._stop_confirm_s:
            await asyncio.sleep(_CONFIRM_POLL_S)
        if "bridge" in missing:
            return Result(503, reasons.stop_unconfirmed())
        self._confirmed.append(stop_id)
        return Result(200, reasons.stop_half_confirmed() if missing else reasons.stop_confirmed())


def _stop_id(session: Session, press: str) -> str:
    """The same for the same press of the same browser, another one for any other."""
    token = hashlib.sha256(f"{session.client} {press}".encode()).hexdigest()[:16] if press else secrets.token_hex(8)
    return f"s-{token}"


def result_of(answer: m.Answer) -> Result:
    """The result of a request that a process has answered."""
    return Result(200 if answer.ok else 409, answer.reason, answer.effect)
