"""REST for the session's report: what was cut, how long it took, what was refused, who held control."""

import csv
import io
from datetime import UTC, datetime

import msgspec
from fastapi import APIRouter, Depends, Response

from rolling_panda.messages.supervision import CutReport, SessionReport
from server.api.answers import NOT_YET, Caller, answer, gives, heard, message
from server.robots.context import Result, RobotContext

_COLUMNS = tuple(field.name for field in msgspec.structs.fields(CutReport))


def report_router(desk: RobotContext) -> APIRouter:
    """The report of the controller's ledger, as JSON and its cuts as CSV."""
    router = APIRouter(prefix="/api", tags=["state"], dependencies=[Depends(heard(desk))])

    @router.get("/report", responses=gives(SessionReport, NOT_YET))
    async def report(session: Caller) -> Response:
        """What has happened since the controller started: cuts, vines, refusals, changes of control."""
        received = desk.link.report.peek()
        if received is None:
            return _not_yet()
        return message(received.message)

    @router.get("/report.csv", response_class=Response, responses=gives("text/csv", NOT_YET))
    async def cuts(session: Caller) -> Response:
        """One row a cut; times in ISO 8601, UTC."""
        received = desk.link.report.peek()
        if received is None:
            return _not_yet()
        headers = {"Content-Disposition": 'attachment; filename="cuts.csv"'}
        return Response(table(received.message.cuts), media_type="text/csv", headers=headers)

    return router


def table(cuts: tuple[CutReport, ...]) -> str:
    """Cuts as CSV with a heading."""
    out = io.StringIO()
    writer = csv.writer(out)
    writer.writerow(_COLUMNS)
    for cut in cuts:
        row = msgspec.to_builtins(cut)
        row["ended_at"] = (
            datetime.fromtimestamp(cut.ended_at, UTC).isoformat(timespec="seconds") if cut.ended_at else ""
        )
        # A spreadsheet would take a name that begins so for a formula.
        writer.writerow([_plain(row[name]) for name in _COLUMNS])
    return out.getvalue()


def _plain(value: object) -> object:
    return f"'{value}" if isinstance(value, str) and value[:1] in ("=", "+", "-", "@", "\t", "\r") else value


def _not_yet() -> Response:
    return answer(Result(503, False, "The controller has not reported yet; ask again."))
