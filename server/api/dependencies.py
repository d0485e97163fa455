"""FastAPI dependencies of the routes: the caller's session with the role that the route needs, and activity.

The role is part of a route, so that it is checked before the body is validated.
"""

import time
from collections.abc import Awaitable, Callable
from typing import Annotated

from fastapi import Depends, Request

from rolling_panda import reasons
from server.api import bodies as body
from server.api.responses import RefusedError
from server.auth.sessions import Session
from server.robots.context import RobotContext

PointId = Annotated[str, body.POINT_ID]


def _session(request: Request) -> Session | None:
    session: Session | None = request.state.session
    return session


#: The caller's session; None for a visitor who is not signed in.
Visitor = Annotated[Session | None, Depends(_session)]


def _caller(session: Visitor) -> Session:
    if session is None:
        raise RefusedError(401, reasons.not_signed_in())
    return session


#: Every role.
Caller = Annotated[Session, Depends(_caller)]


def operator(session: Caller) -> Session:
    """The session of a caller who may operate."""
    if not session.may_operate:
        raise RefusedError(403, reasons.viewer_only())
    return session


#: Roles that may move the robot and decide on its work.
Operator = Annotated[Session, Depends(operator)]


def supervisor(session: Caller) -> Session:
    """The session of a supervisor."""
    if session.role != "supervisor":
        raise RefusedError(403, reasons.supervisor_needed())
    return session


#: The role that resets stops and invites others.
Supervisor = Annotated[Session, Depends(supervisor)]


def activity(robot: RobotContext) -> Callable[[Request], Awaitable[None]]:
    """A dependency that counts a request as activity of its session, by which a script shows its presence."""

    # A coroutine, so that it runs on the server's loop; FastAPI runs plain functions on a thread pool.
    async def record(request: Request) -> None:
        session = _session(request)
        if session is not None:
            robot.pages.on_activity(session, time.monotonic())

    return record
