"""A played server that decides about points and places as the robot does: what has changed is refused."""

import msgspec
from starlette.responses import JSONResponse, Response

from rolling_panda import messages as m
from rolling_panda import reasons
from rolling_panda.messages.page import PagePoint
from server.api.responses import outcome
from tests.support.page_host import PlayedRequest
from tests.support.played_server import PlayedServer

_BECOMES: dict[str, m.PointState] = {"accept": "ACCEPTED", "reject": "REJECTED", "reconsider": "PROPOSED"}


class DecidingServer(PlayedServer):
    """Decides about points and places."""

    def answer(self, request: PlayedRequest) -> Response | None:
        if request.path == "/api/sites/leave" and self.online:
            return self._leave(request)
        kind, _, action = request.path.removeprefix("/api/points/").partition("/")
        if request.method != "POST" or action not in _BECOMES or not self.online:
            return super().answer(request)
        self.posted.append((request.path, request.body))
        row = next((row for row in self.points if row.point.point_id == kind), None)
        if row is None:
            return JSONResponse(outcome(False, reasons.point_unknown(kind)), 409)
        if action == "accept" and request.body["digest"] != row.point.digest:
            return JSONResponse(outcome(False, reasons.said("it has changed since")), 409)
        state = _BECOMES[action]
        said = reasons.said(request.body["reason"]) if action == "reject" and request.body["reason"] else None
        self.put(msgspec.structs.replace(row, entry=msgspec.structs.replace(row.entry, state=state, reason=said)))
        return JSONResponse(outcome(True))

    def _leave(self, request: PlayedRequest) -> Response:
        self.posted.append((request.path, request.body))
        vine, spur = request.body["vine"], request.body["spur"]
        needs: m.Need = "nothing" if request.body["left"] else "operator"
        self.undecided_sites = tuple(
            msgspec.structs.replace(each, needs=needs) if (each.vine, each.spur) == (vine, spur) else each
            for each in self.undecided_sites
        )
        self.tell(self.page_points())
        return JSONResponse(outcome(True))

    def put(self, *rows: PagePoint) -> None:
        """Replace rows, and tell."""
        new = {row.point.point_id: row for row in rows}
        self.points = tuple(new.get(row.point.point_id, row) for row in self.points)
        self.tell(self.page_points())

    def state_of(self, name: str) -> m.PointState:
        return next(row.entry.state for row in self.points if row.point.point_id == name)
