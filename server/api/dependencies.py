"""FastAPI dependencies of the routes: the caller's session with the role that the route needs, activity, and bodies.

The role is part of a route, so that it is checked before the body is validated. The bodies of requests that become a
message are made from the message, with its bounds.
"""

import inspect
import time
from collections.abc import Awaitable, Callable, Collection
from types import UnionType
from typing import Annotated, Any, Union, get_args, get_origin

import msgspec
from fastapi import Depends, Path, Request
from pydantic import BaseModel, BeforeValidator, Field, create_model

from rolling_panda import reasons
from rolling_panda.commands import Intent, PlantRequest
from rolling_panda.generate.description import describe
from server.api.bodies import JsonTuples
from server.api.responses import RefusedError
from server.auth.sessions import Session
from server.robots.context import RobotContext

_NAME: Any = Path(min_length=1, max_length=64, pattern=r"^[A-Za-z0-9_.:\-]+$")
#: Id of a point in a path, as `rolling_panda.messages.Name`.
PointId = Annotated[str, _NAME]
#: Larger integers are not exact in every JSON parser.
_MAX_INTEGER = 2**53


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


def _as_integer(value: Any) -> Any:
    # JSON has one kind of number: 2.0 is an integer too.
    return int(value) if isinstance(value, float) and value.is_integer() else value


_INTEGER = BeforeValidator(_as_integer)

#: Bounds that msgspec and pydantic call the same.
_BOUNDS = ("ge", "gt", "le", "lt", "min_length", "max_length")
#: Of the caller, never of a body.
_CALLER = frozenset({*Intent.__struct_fields__, *PlantRequest.__struct_fields__})


def fields_of(message: type[msgspec.Struct], in_path: Collection[str] = ()) -> Callable[..., dict[str, Any]]:
    """A FastAPI dependency that reads the fields of a message from the body and the path of a request.

    Args:
        message: Type of the request. Its fields about the caller are not read.
        in_path: Fields in the path; each is the id of a point.
    """
    about = describe(message)
    own = [field for field in about.fields if field.name not in _CALLER and field.name not in in_path]

    def read(**given: Any) -> dict[str, Any]:
        body: BaseModel | None = given.pop("body", None)
        return given | ({} if body is None else dict(body))

    keyword = inspect.Parameter.KEYWORD_ONLY
    parameters = [inspect.Parameter(name, keyword, annotation=PointId) for name in in_path]
    if own:
        fields: dict[str, Any] = {
            field.name: (
                _strict(field.hint),
                Field(... if field.required else field.default, description=field.about or None),
            )
            for field in own
        }
        model = create_model(message.__name__, __base__=JsonTuples, __doc__=about.about, **fields)
        parameters.append(inspect.Parameter("body", keyword, annotation=model))
    read.__signature__ = inspect.Signature(parameters)  # type: ignore[attr-defined]
    return read


def _strict(hint: Any) -> Any:
    """The pydantic form of a msgspec annotation."""
    origin, arguments = get_origin(hint), get_args(hint)
    if hint is int:
        return _strict(Annotated[int, msgspec.Meta()])
    if origin is Annotated:
        inner: Any = arguments[0] if arguments[0] is int else _strict(arguments[0])
        for meta in arguments[1:]:
            bounds = {name: getattr(meta, name) for name in _BOUNDS if getattr(meta, name) is not None}
            if arguments[0] is int:
                bounds["le"] = min(bounds.get("le", _MAX_INTEGER), _MAX_INTEGER)
            # In the regular expressions of pydantic and of JSON Schema "$" matches at the end alone.
            pattern = None if meta.pattern is None else meta.pattern.replace(r"(?!\n)", "")
            inner = Annotated[inner, Field(pattern=pattern, **bounds)]
        # The bounds come first: in the schema those outside of a validator are lost.
        return Annotated[inner, _INTEGER] if arguments[0] is int else inner
    if origin in (Union, UnionType):
        return Union[tuple(_strict(argument) for argument in arguments)]  # noqa: UP007
    if origin is tuple:
        return tuple[tuple(_strict(argument) for argument in arguments)]  # type: ignore[misc]
    return hint
