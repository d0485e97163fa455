"""Queries over REST: the robot's state, points, plan, log, report, constants and camera image."""

import csv
import io
import time
from datetime import UTC, datetime
from typing import Annotated

import msgspec
from fastapi import APIRouter, Depends, Query, Response
from pydantic import BaseModel, Field

from rolling_panda import reasons
from rolling_panda.cut_pictures import Moment
from rolling_panda.messages.page import Diagnostics, PageEvents, PagePoints, PageState
from rolling_panda.messages.perception import CameraState, RobotCalibration
from rolling_panda.messages.supervision import CutReport, SessionPlan, SessionReport, Timeline
from rolling_panda.reasons import text_of
from server.api.dependencies import Caller, PointId, activity
from server.api.responses import INVALID, NOT_FOUND, SIGNED_IN, UNAVAILABLE, answer, message, query
from server.robots.context import RobotContext
from server.robots.diagnostics import diagnose
from server.robots.link import Result
from server.robots.page_view import addressed

_CUT_COLUMNS = tuple(field.name for field in msgspec.structs.fields(CutReport))


class RobotFacts(BaseModel):
    """Constants of the robot: the lower and upper limit of each joint of the arm, from its base on (rad)."""

    arm_limits: list[Annotated[list[float], Field(min_length=2, max_length=2)]]


def state_router(robot: RobotContext) -> APIRouter:
    """Everything under `/api` that a script reads."""
    router = APIRouter(prefix="/api", dependencies=[Depends(activity(robot))])

    @router.get("/state", tags=["state"], responses=query(PageState, UNAVAILABLE))
    async def state(session: Caller) -> Response:
        """The newest state of the robot: what the page gets 10 times a second."""
        if robot.pages.state is None:
            return answer(Result(503, reasons.not_reported("server")))
        robot.pages.on_state_fetched(session, time.monotonic())
        return message(addressed(robot.pages.state, session))

    @router.get("/points", tags=["state"], responses=query(PagePoints))
    async def points(session: Caller) -> Response:
        """Every pruning point in the order of work, with its life in the queue."""
        return message(robot.pages.points if robot.pages.points is not None else robot.view.points(time.monotonic()))

    @router.get("/plan", tags=["state"], responses=query(SessionPlan, UNAVAILABLE))
    async def plan(session: Caller) -> Response:
        """The plan: order and approach of each accepted point that can be cut, and why the others cannot."""
        received = robot.link.plan.peek()
        if received is None:
            return answer(Result(503, reasons.not_reported("controller")))
        return message(received.message)

    @router.get("/events", tags=["state"], responses=query(PageEvents, INVALID))
    async def events(session: Caller, after: Annotated[int, Query(ge=0)] = 0) -> Response:
        """Log lines after line number `after`, oldest first."""
        return message(PageEvents(events=robot.log.lines.after(after, robot.config.log_lines)))

    @router.get("/report", tags=["state"], responses=query(SessionReport, UNAVAILABLE))
    async def report(session: Caller) -> Response:
        """What has happened since the controller started: cuts, vines, refusals, changes of control."""
        received = robot.link.report.peek()
        if received is None:
            return _no_report()
        return message(received.message)

    @router.get("/report.csv", tags=["state"], response_class=Response, responses=query("text/csv", UNAVAILABLE))
    async def cuts(session: Caller) -> Response:
        """One row a cut; times in ISO 8601, UTC."""
        received = robot.link.report.peek()
        if received is None:
            return _no_report()
        headers = {"Content-Disposition": 'attachment; filename="cuts.csv"'}
        return Response(cuts_csv(received.message.cuts), media_type="text/csv", headers=headers)

    @router.get(
        "/cuts/{cut_id}/{moment}.jpg",
        tags=["state"],
        response_class=Response,
        responses=query("image/jpeg", {204: {"description": "No picture was kept."}}, INVALID),
    )
    async def picture(session: Caller, cut_id: PointId, moment: Moment) -> Response:
        """The picture of a cut, before or after it, the cut in the middle, as JPEG. 204 where none can be shown."""
        jpeg = await robot.pictures.read(cut_id, moment)
        if jpeg is None:
            # Not an error, which a browser's console would show.
            return Response(status_code=204)
        return Response(jpeg, media_type="image/jpeg")

    @router.get("/timeline", tags=["state"], responses=query(Timeline, UNAVAILABLE))
    async def timeline(session: Caller) -> Response:
        """Changes of mode, cuts and refusals since the controller started, or of the whole recording."""
        received = robot.link.timeline.peek()
        if received is None:
            return answer(Result(503, reasons.not_reported("controller")))
        return message(received.message)

    @router.get("/camera", tags=["state"], responses=query(CameraState, UNAVAILABLE))
    async def camera(session: Caller) -> Response:
        """The camera's calibration, the one on offer, and the monitor's estimate of its error."""
        received = robot.link.camera_state.peek()
        if received is None:
            return answer(Result(503, reasons.not_reported("perception")))
        return message(received.message)

    @router.get("/calibration", tags=["state"], responses=query(RobotCalibration, UNAVAILABLE))
    async def calibration(session: Caller) -> Response:
        """What pictures of the board tell of the base. The calibration in use is in the bridge's state."""
        received = robot.link.robot_calibration.peek()
        if received is None:
            return answer(Result(503, reasons.not_reported("perception")))
        return message(received.message)

    @router.get("/diagnostics", tags=["state"], responses=query(Diagnostics))
    async def diagnostics(session: Caller) -> Response:
        """Programs of the processes, and how often messages of each topic come to the server."""
        return message(diagnose(robot.link, time.monotonic()))

    @router.get("/robot", tags=["state"], responses=SIGNED_IN)
    async def facts(session: Caller) -> RobotFacts:
        """Constants of the robot, which a page fetches once."""
        return RobotFacts(arm_limits=[list(limits) for limits in robot.view.arm_limits])

    return router


def camera_router(robot: RobotContext) -> APIRouter:
    """`/camera/color.jpg`."""
    router = APIRouter()

    @router.get(
        "/camera/color.jpg",
        tags=["state"],
        response_class=Response,
        responses=query("image/jpeg", NOT_FOUND, INVALID),
    )
    async def camera(n: Annotated[int, Query(ge=0)] | None = None) -> Response:
        """The newest image of the eye-in-hand camera, JPEG; with `n` that of frame `n`, one of the newest few."""
        frame = robot.link.camera.peek()
        if frame is None:
            return answer(Result(404, reasons.no_camera_image()))
        # `images` is filled on another thread, and may lack the newest frame for a moment.
        images = {**robot.link.images, frame.message.sequence: frame.message.color_jpeg}
        image = images.get(frame.message.sequence if n is None else n)
        if image is None:
            return answer(Result(404, reasons.camera_frame_gone(float(n or 0), float(frame.message.sequence))))
        return Response(image, media_type="image/jpeg")

    return router


def cuts_csv(cuts: tuple[CutReport, ...]) -> str:
    """Cuts as CSV with a heading."""
    out = io.StringIO()
    writer = csv.writer(out)
    writer.writerow(_CUT_COLUMNS)
    for cut in cuts:
        row = msgspec.to_builtins(cut)
        row["reason"] = "" if cut.reason is None else text_of(cut.reason)
        row["ended_at"] = (
            datetime.fromtimestamp(cut.ended_at, UTC).isoformat(timespec="seconds") if cut.ended_at else ""
        )
        row["seconds"] = round(cut.seconds, 2)
        # A spreadsheet would evaluate a text with such a first character as a formula.
        writer.writerow([_escape_formula(row[name]) for name in _CUT_COLUMNS])
    return out.getvalue()


def _escape_formula(value: object) -> object:
    return f"'{value}" if isinstance(value, str) and value[:1] in ("=", "+", "-", "@", "\t", "\r") else value


def _no_report() -> Response:
    return answer(Result(503, reasons.not_reported("controller")))
