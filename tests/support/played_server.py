"""A server that a test plays: the page's files, its socket and its requests."""

import mimetypes
import time
from dataclasses import dataclass, field
from functools import cache
from io import BytesIO
from typing import Any

import msgspec
from PIL import Image, ImageDraw
from playwright.sync_api import Page
from starlette.responses import JSONResponse, Response

from controller.supervision.permission import HOLD, OF_SUPERVISOR, of_holder
from rolling_panda import messages as m
from rolling_panda import reasons
from rolling_panda.commands import COMMANDS
from rolling_panda.messages import page as page_messages
from rolling_panda.messages import types as types_messages
from rolling_panda.messages.perception import CameraState, RobotCalibration, SpurDrawing
from rolling_panda.messages.supervision import ControlState, ReplayState, SessionReport, StopState, Timeline
from rolling_panda.reasons import said
from rolling_panda.resources import resource
from rolling_panda.topics import TOPICS
from tests.support.drawings import SIZE, drawing
from tests.support.fake_wire import bridge_state
from tests.support.page_host import ORIGIN, PlayedRequest, PlayedSocket, page_host

__all__ = ["ORIGIN"]
POLICY = (
    "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self'; connect-src 'self' ws://panda.test; "
    "frame-src 'self'; manifest-src 'self'; base-uri 'none'; form-action 'self'; frame-ancestors 'none'"
)
VIEW = (
    "<!doctype html><html data-view=drawn><title>view</title><script type=module src=/js/scene/frame.js></script>"
    "<div id=root>3-D view</div><button>in the view</button>"
)
STILL = (
    "<!doctype html><html data-view=drawn><title>view</title>"
    "<style>body{margin:0}img{width:100vw;height:100vh;object-fit:cover}</style>"
    "<img id=root src=/viser/still.jpg>"
)
COMMAND_NAMES = tuple(command.name for command in COMMANDS if command.process == "controller" or command.modes)
ALLOWED = {
    "IDLE": ("Arm", "UseCamera", "UseBase", "UseArm", "UseTiming"),
    "READY": (
        "Start",
        "Continue",
        "Home",
        "Teleoperation",
        "UseCamera",
        "CheckCamera",
        "CalibrateCamera",
        "UseBase",
        "CalibrateBase",
        "UseArm",
        "CalibrateArm",
        "UseTiming",
    ),
    "AUTO": ("Pause",),
    "TELEOP": ("Pause", "Teleoperation"),
    "PAUSED": ("Resume", "Continue", "UseCamera", "UseBase", "UseArm", "UseTiming"),
    "ESTOP_LATCHED": ("Reset",),
}


def _refused(mode: m.Mode) -> dict[str, m.Reason]:
    return {name: reasons.wrong_mode(name, "PAUSED", mode) for name in (*COMMAND_NAMES, HOLD)}


ARMED = reasons.command_by("Arm", "Ada")


def controller(mode: m.Mode = "READY", reason: str | m.Reason = ARMED, **changes: Any) -> m.ControllerState:
    points = ("AcceptPoint", "RejectPoint", "ReconsiderPoint", "ResolvePoint", "JudgeCut", "AcceptAll")
    state = m.ControllerState(
        header=m.Header(),
        mode=mode,
        phase="",
        reason=said(reason) if isinstance(reason, str) else reason,
        allowed=_refused(mode) | dict.fromkeys((*ALLOWED.get(mode, ()), *points)),
        of_holder=of_holder(mode),
        of_supervisor=OF_SUPERVISOR[mode],
        active_point_id="",
        method="nullspace",
        T_odom_tool=None,
        T_odom_tool_desired=None,
        position_error=0.0021,
        rotation_error=0.012,
        manipulability=0.083,
        joint_margin=0.41,
        tick_s=0.000142,
        ticks=1000,
        late_ticks=3,
        queue=(),
    )
    return msgspec.structs.replace(state, **changes)


def bridge(**changes: Any) -> m.BridgeState:
    return msgspec.structs.replace(bridge_state(), **{"real_time_factor": 0.99, **changes})


def point(number: int, state: m.PointState, vine: int = 1, spur: int = 1, **changes: Any) -> page_messages.PagePoint:
    name = f"p{number}"
    found = m.PruningPoint(
        point_id=name,
        revision=4,
        position=(0.2 * number, 0.8, 0.9),
        tangent=(0.0, 0.0, 1.0),
        radius=0.004,
        confidence=0.87,
        nodes_seen=9,
        nodes_kept=2,
        vine=vine,
        spur=spur,
        reason=reasons.spur_cut_lowest(3, 8.0, reasons.past_node(20.0, 2)),
        position_covariance=(4e-6, 0.0, 0.0, 9e-6, 0.0, 4e-6),
        tangent_covariance=(1e-3, 0.0, 0.0, 1e-3, 0.0, 0.0),
        offset=0.02,
        force=469.0,
        wire_distance=0.141,
        cordon_distance=0.062,
        node_distance=0.0206,
        digest=f"{number:08x}" * 4,
    )
    entry = m.QueueEntry(point_id=name, state=state, **changes)
    return page_messages.PagePoint(point=found, entry=entry, pixel=(60.0 + 45.0 * number, 90.0 + 11.0 * number))


@dataclass
class PlayedServer:
    """Answers the page: a state for each ping, canned REST answers; keeps what the page sent."""

    controller: m.ControllerState | None = field(default_factory=controller)
    bridge: m.BridgeState | None = field(default_factory=bridge)
    #: Of the base; None lets it drive along the row.
    pose: m.PlanarPose | None = None
    points: tuple[page_messages.PagePoint, ...] = ()
    undecided_sites: tuple[m.UndecidedSite, ...] = ()
    gone: dict[str, float] = field(default_factory=dict)
    role: types_messages.Role = "supervisor"
    #: Path of its page, where there are several.
    base: str = ""
    control: ControlState | None = None
    viewers: int = 1
    stopped: tuple[StopState, ...] = ()
    replay: ReplayState | None = None
    plain_wire: bool = False
    relaxed_limits: tuple[m.Reason, ...] = ()
    camera: CameraState = field(default_factory=lambda: CameraState(header=m.Header()))
    calibration: RobotCalibration = field(default_factory=lambda: RobotCalibration(header=m.Header()))
    online: bool = True
    silent: bool = False
    #: How long ago it heard each process, where none is gone (s).
    heard_s: float = 0.03
    answers: dict[str, tuple[int, Any]] = field(default_factory=dict)
    posted: list[tuple[str, Any]] = field(default_factory=list)
    said: list[page_messages.FromPage] = field(default_factory=list)
    sockets: list[PlayedSocket] = field(default_factory=list)
    pictures_fetched: list[str] = field(default_factory=list)
    #: Points whose drawing shows this revision instead of the newest.
    drawn_revisions: dict[str, int] = field(default_factory=dict)
    frames_fetched: list[int] = field(default_factory=list)
    report: SessionReport = field(default_factory=lambda: SessionReport(began_at=0.0, written_at=0.0))
    timeline: Timeline = field(default_factory=lambda: Timeline(began_at=0.0, ended_at=0.0))
    diagnostics: page_messages.Diagnostics = field(default_factory=lambda: diagnostics())
    #: Pictures of cuts, by cut and moment.
    cut_pictures: dict[tuple[str, str], bytes] = field(default_factory=dict)
    cut_pictures_fetched: list[tuple[str, str]] = field(default_factory=list)
    rule: m.PruningRule | None = field(default_factory=m.PruningRule)
    crop: bytes = field(default_factory=lambda: camera_image(SIZE))
    view: bytes = b""
    #: The page of the 3-D view, where `view` is no picture of it.
    frame: str = VIEW
    number: int = 0
    heres: int = 0
    started: float = field(default_factory=time.time)
    image: bytes = field(default_factory=lambda: camera_image())

    def attach(self, page: Page) -> None:
        page_host().show(page, self)

    def answer(self, request: PlayedRequest) -> Response | None:
        path = request.path.removeprefix(self.base)
        if not self.online:
            return None
        if path == "/api/control/here":
            self.heres += 1
            return JSONResponse({"ok": True, "reason": ""})
        if request.method == "POST":
            self.posted.append((path, request.body))
            status, body = self.answers.get(path, (200, {"ok": True, "reason": ""}))
            return JSONResponse(body, status)
        if path == "/api/me":
            status, body = self.answers.get(path, (200, {"user": "Ada", "role": self.role}))
            return JSONResponse(body, status)
        if path == "/api/robot":
            return JSONResponse({"arm_limits": [(-2.9, 2.9)] * 7})
        if path == "/api/sign-in":
            return JSONResponse({"password": False})
        for name in ("report", "timeline", "diagnostics", "camera", "calibration"):
            if path == f"/api/{name}":
                return Response(msgspec.json.encode(getattr(self, name)), media_type="application/json")
        if path.startswith("/api/cuts/"):
            _, _, _, cut_id, moment = path.removesuffix(".jpg").split("/")
            picture = self.cut_pictures.get((cut_id, moment))
            self.cut_pictures_fetched.append((cut_id, moment))
            return Response(picture, media_type="image/jpeg") if picture else Response(status_code=204)
        if path == "/viser/":
            return Response(STILL if self.view else self.frame, media_type="text/html")
        if path == "/viser/still.jpg":
            return Response(self.view, media_type="image/jpeg")
        if path.startswith(("/api/points/", "/api/spurs/")) and path.endswith(("/drawing", "/picture")):
            self.pictures_fetched.append(request.target)
            drawn = self.drawing_of(path) if self.crop else None
            if drawn is None:
                return Response(status_code=204)
            if path.endswith("/picture"):
                return Response(self.crop, media_type="image/jpeg")
            return Response(msgspec.json.encode(drawn), media_type="application/json")
        if path == "/camera/color.jpg":
            self.frames_fetched.append(int(request.target.split("n=")[1]))
            return Response(self.image, media_type="image/jpeg")
        return page_file({"/": "index.html", "/sign-in": "sign-in.html"}.get(path, path))

    def drawing_of(self, path: str) -> SpurDrawing | None:
        """What is drawn on the picture of a point or a spur; None where there is no such point."""
        _, _, kind, *place, _ = path.split("/")
        if kind == "spurs":
            vine, spur = map(int, place)
            return drawing(
                vine, spur, *(row for row in self.points if (row.point.vine, row.point.spur) == (vine, spur))
            )
        for row in self.points:
            if row.point.point_id == place[0]:
                revision = self.drawn_revisions.get(place[0], row.point.revision)
                drawn = msgspec.structs.replace(row.point, revision=revision)
                return drawing(drawn.vine, drawn.spur, msgspec.structs.replace(row, point=drawn))
        return None

    def accept(self, socket: PlayedSocket) -> bool:
        if self.online:
            self.sockets.append(socket)
            self.greet(socket)
        return self.online

    def greet(self, socket: PlayedSocket) -> None:
        self.send(socket, self.state())
        self.send(socket, self.page_points())
        self.send(socket, page_messages.PageEvents(events=(self.event(1, "info", "signed in"),)))

    def hear(self, socket: PlayedSocket, text: str) -> None:
        message = msgspec.json.decode(text, type=page_messages.FromPage)
        self.said.append(message)
        if isinstance(message, page_messages.Ping) and self.online and not self.silent:
            self.send(socket, page_messages.Pong(number=message.number))
            self.send(socket, self.state())

    def send(self, socket: PlayedSocket, message: page_messages.FromServer) -> None:
        socket.send(msgspec.json.encode(message).decode())

    def tell(self, message: page_messages.FromServer) -> None:
        self.send(self.sockets[-1], message)

    def state(self) -> page_messages.PageState:
        self.number += 1
        ages = {name: self.gone.get(name, self.heard_s) for name in m.PROCESSES}
        rows = tuple(page_messages.ProcessPresence(name, name not in self.gone, ages[name]) for name in m.PROCESSES)
        return page_messages.PageState(
            number=self.number,
            user="Ada",
            role=self.role,
            viewers=self.viewers,
            processes=rows,
            controller=self.controller,
            controller_age_s=None if self.controller is None else ages["controller"],
            bridge=self.bridge,
            bridge_age_s=None if self.bridge is None else ages["bridge"],
            joints=m.JointState(
                header=m.Header(stamp=0.1 * self.number), sequence=self.number, position=(0.0,) * 9, velocity=(0.0,) * 9
            ),
            base=self.pose or m.PlanarPose(x=0.021 * self.number),
            camera_frame=1 + self.number // 5,
            client="me",
            control=self.control,
            stops=self.stopped,
            speed_ratios=(0.2, 0.1, 0.0, 0.5, 0.0, 0.0, 0.0, 0.0, 0.0),
            replay=self.replay,
            plain_wire=self.plain_wire,
            relaxed_limits=self.relaxed_limits,
            camera_warning=self.camera.warning,
        )

    def page_points(self) -> page_messages.PagePoints:
        return page_messages.PagePoints(
            points=self.points,
            undecided_sites=self.undecided_sites,
            segmenter="simulator labels",
            frames=12,
            image_size=(480, 360),
            rule=self.rule,
        )

    def event(self, number: int, severity: m.Severity, told: str | m.Reason) -> page_messages.PageEvent:
        reason = reasons.said(told) if isinstance(told, str) else told
        at, text = self.started + 0.001 * number, reasons.text_of(reason)
        return page_messages.PageEvent(number, at, "server", severity, text, reason)

    def holds(self) -> list[bool]:
        return [message.hold for message in self.said if isinstance(message, page_messages.Hold)]

    def stops(self) -> list[Any]:
        return [body for path, body in self.posted if path == "/api/stop"]


def diagnostics() -> page_messages.Diagnostics:
    """Every topic at its rate, and every process of one version."""
    traffic = (
        page_messages.TopicTraffic(
            name=topic.name,
            sender=topic.sender,
            nominal_hz=topic.rate_hz,
            received=topic.read_by("server"),
            count=1200,
            rate_hz=topic.rate_hz or None,
            age_s=0.5 / topic.rate_hz if topic.rate_hz else None,
        )
        if topic.read_by("server")
        else page_messages.TopicTraffic(name=topic.name, sender=topic.sender, nominal_hz=topic.rate_hz, received=False)
        for topic in TOPICS
    )
    programs = (m.Program(process=name, version="0.1.0", began_at=1.8e9) for name in m.PROCESSES)
    return page_messages.Diagnostics(wall_time=1.8e9 + 5000.0, programs=tuple(programs), topics=tuple(traffic))


def cut_picture(cut: bool) -> bytes:
    """A cane before or after its cut, in the middle of the picture."""
    image = Image.new("RGB", (320, 240), (150, 170, 160))
    draw = ImageDraw.Draw(image)
    draw.rectangle((0, 120, 320, 240), fill=(92, 108, 74))
    draw.line((40, 0, 70, 240), fill=(120, 88, 60), width=14)
    draw.line((160, 120 if cut else 0, 156, 240), fill=(168, 118, 66), width=11)
    draw.line((0, 150, 320, 138), fill=(170, 175, 180), width=3)
    out = BytesIO()
    image.save(out, "JPEG")
    return out.getvalue()


@cache
def page_file(name: str) -> Response:
    """A file of the page, which browsers may cache."""
    file = resource(f"web/{name.lstrip('/')}")
    headers = {"content-security-policy": POLICY, "cache-control": "max-age=3600"}
    return Response(file.read_bytes(), media_type=mimetypes.guess_type(name)[0] or "text/plain", headers=headers)


def camera_image(size: tuple[int, int] = (480, 360)) -> bytes:
    image = Image.new("RGB", (480, 360), (46, 58, 44))
    draw = ImageDraw.Draw(image)
    draw.rectangle((0, 250, 480, 275), fill=(92, 70, 50))
    for x in range(60, 460, 55):
        draw.line((x, 250, x + 18, 20), fill=(120, 88, 60), width=7)
    out = BytesIO()
    image.resize(size).save(out, "JPEG")
    return out.getvalue()
