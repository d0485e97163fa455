"""Responses of the routes: how they are sent, and how the OpenAPI document describes them."""

from typing import Any

import msgspec
from fastapi import HTTPException, Response
from fastapi.responses import JSONResponse

from rolling_panda.messages.types import Reason
from rolling_panda.reasons import text_of
from server.api import bodies as body
from server.robots.link import Result

Responses = dict[int | str, dict[str, Any]]


def _outcome(status: int, description: str) -> Responses:
    return {status: {"model": body.Outcome, "description": description}}


_DONE = _outcome(200, "Done.")
_FOREIGN = _outcome(403, "The Origin header is missing or foreign.") | _outcome(413, "The body is too long.")
SIGNED_IN = _outcome(401, "Not signed in.")
INVALID = _outcome(422, "The request is wrong; `reason` names the field.")
NOT_FOUND = _outcome(404, "Not found; `reason` lists what exists.")
TOO_MANY = _outcome(429, "Too many requests; `reason` names the limit.")
UNAVAILABLE = _outcome(503, "The data has not arrived yet: ask again.")
SIGN_IN = _DONE | _outcome(401, "Sign-in failed; `reason` says why.") | _FOREIGN | INVALID | TOO_MANY
SIGN_OUT = _DONE | SIGNED_IN | _FOREIGN
#: Responses of a command.
COMMAND = (
    SIGN_OUT
    | _outcome(403, "The role may not, or the Origin header is missing or foreign.")
    | _outcome(409, "Refused in the present state; `reason` says why.")
    | INVALID
    | _outcome(503, "The responsible process does not answer.")
)


def query(content: type[msgspec.Struct] | str, *others: Responses) -> Responses:
    """Responses of a query: a message as JSON, or content of a media type."""
    if isinstance(content, str):
        schema: dict[str, Any] = {content: {"schema": {"type": "string"} if content == "text/csv" else {}}}
    else:
        schema = {"application/json": {"schema": {"$ref": f"#/components/schemas/{content.__name__}"}}}
    responses: Responses = SIGNED_IN | {200: {"description": "Now.", "content": schema}}
    for other in others:
        responses |= other
    return responses


def answer(result: Result) -> JSONResponse:
    """A result as `{ok, reason}`, with `code` and `values` of the reason."""
    return JSONResponse(outcome(result.ok, result.reason), result.status)


def outcome(ok: bool, reason: Reason | None = None) -> dict[str, Any]:
    """The body of an answer: `reason` as English text, and as code and values."""
    if reason is None:
        return {"ok": ok, "reason": ""}
    return {"ok": ok, "reason": text_of(reason)} | _as_data(reason)


class RefusedError(HTTPException):
    """A refusal outside of a route's own answer."""

    def __init__(self, status: int, reason: Reason) -> None:
        """Answer with this HTTP status and reason."""
        super().__init__(status, text_of(reason))
        self.reason = reason


def _as_data(reason: Reason) -> dict[str, Any]:
    values = {name: _as_data(value) if isinstance(value, Reason) else value for name, value in reason.values}
    return {"code": reason.code, "values": values}


def message(content: msgspec.Struct) -> Response:
    """A message as JSON."""
    return Response(msgspec.json.encode(content), media_type="application/json")


#: The body of a stop, which is read leniently.
STOP_BODY: dict[str, Any] = {
    "requestBody": {
        "description": "`reason` is for the log. A request with the `press` of an earlier one is the same stop, "
        "and does not stop again after the reset. An unreadable body is ignored, and a reason that is too long is cut.",
        "content": {
            "application/json": {"schema": {"examples": [{"reason": "dog in the row", "press": "5f0c2d9a71e3b846"}]}}
        },
    }
}
