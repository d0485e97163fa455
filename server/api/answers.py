"""What requests have in common: who may ask, how each is answered, and how that is described.

Who may ask is part of a route, so that a role is refused before anything else is looked at.
"""

import time
from collections.abc import Awaitable, Callable
from typing import Annotated, Any

import msgspec
from fastapi import Depends, HTTPException, Request, Response
from fastapi.responses import JSONResponse

from server.api import bodies as body
from server.auth.sessions import Session
from server.robots.context import Result, RobotContext

PointId = Annotated[str, body.POINT_ID]


def _session(request: Request) -> Session:
    session: Session | None = request.state.session
    if session is None:
        raise HTTPException(401, "sign in first")
    return session


#: Whoever is signed in.
Caller = Annotated[Session, Depends(_session)]


def _operator(session: Caller) -> Session:
    if not session.may_operate:
        raise HTTPException(403, f"a {session.role} may look and stop, not operate")
    return session


#: Who may move the robot and decide about its work.
Operator = Annotated[Session, Depends(_operator)]


def _supervisor(session: Caller) -> Session:
    if session.role != "supervisor":
        raise HTTPException(403, f"only a supervisor may do this, not a {session.role}")
    return session


#: Who answers for the robot: releases stops, and says who else comes in.
Supervisor = Annotated[Session, Depends(_supervisor)]

Answers = dict[int | str, dict[str, Any]]


def _outcome(status: int, description: str) -> Answers:
    return {status: {"model": body.Outcome, "description": description}}


_DONE = _outcome(200, "Done.")
_FOREIGN = _outcome(403, "The Origin header is missing or foreign.") | _outcome(413, "The body is too long.")
SIGNED_IN = _outcome(401, "Not signed in.")
WRONG = _outcome(422, "The request is wrong; `reason` names the field.")
ABSENT = _outcome(404, "There is no such thing; `reason` says which there is.")
TOO_OFTEN = _outcome(429, "Asked too often; `reason` says how often one may.")
NOT_YET = _outcome(503, "What this tells has not come yet: ask again.")
SIGN_IN = _DONE | _outcome(401, "This lets nobody in; `reason` says why.") | _FOREIGN | WRONG | TOO_OFTEN
SIGN_OUT = _DONE | SIGNED_IN | _FOREIGN
#: How a question is answered that changes something.
ANSWERS = (
    SIGN_OUT
    | _outcome(403, "The role may not, or the Origin header is missing or foreign.")
    | _outcome(409, "Refused as things are; `reason` says why.")
    | WRONG
    | _outcome(503, "Who has to decide does not answer.")
)


def gives(content: type[msgspec.Struct] | str, *others: Answers) -> Answers:
    """How a question is answered that changes nothing: by a message of the page's, or by content of a media type."""
    if isinstance(content, str):
        told: dict[str, Any] = {content: {"schema": {"type": "string"} if content == "text/csv" else {}}}
    else:
        told = {"application/json": {"schema": {"$ref": f"#/components/schemas/{content.__name__}"}}}
    answers: Answers = SIGNED_IN | {200: {"description": "Now.", "content": told}}
    for other in others:
        answers |= other
    return answers


def heard(desk: RobotContext) -> Callable[[Request], Awaitable[None]]:
    """What notes that somebody asks, which is how a script shows that it is there."""

    # Not a plain function, which would run on a thread of its own: who is there is for the server's loop alone.
    async def note(request: Request) -> None:
        session: Session | None = request.state.session
        if session is not None:
            desk.heard(session, time.monotonic())

    return note


def answer(result: Result) -> JSONResponse:
    """A result as every request is answered: `{ok, reason}`."""
    return JSONResponse({"ok": result.ok, "reason": result.reason}, result.status)


def message(told: msgspec.Struct) -> Response:
    """A message of the page's as an answer."""
    return Response(msgspec.json.encode(told), media_type="application/json")


#: A body that is read whatever it holds.
STOP_BODY: dict[str, Any] = {
    "requestBody": {
        "description": "`reason` is for the log. What cannot be read is left out, and what is too long is cut.",
        "content": {"application/json": {"schema": {"examples": [{"reason": "a dog in the row"}]}}},
    }
}
