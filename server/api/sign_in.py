"""Sign-in, sign-out, invitations, and the public routes: the same for all robots of the server."""

import time
from pathlib import Path
from typing import Annotated

import msgspec
import segno
from fastapi import APIRouter, Depends, Header, Request, Response
from fastapi.responses import FileResponse, JSONResponse, RedirectResponse

from rolling_panda import reasons
from rolling_panda.cli.about import about
from rolling_panda.messages.types import Reason
from server.api import bodies as body
from server.api.dependencies import Caller, Supervisor, Visitor
from server.api.page_files import PageFiles
from server.api.responses import COMMAND, SIGN_IN, SIGN_OUT, SIGNED_IN, answer, outcome
from server.auth.sessions import Session, SignInError
from server.robots.app_state import AppState
from server.robots.link import Result


def _address(request: Request) -> str:
    return "" if request.client is None else request.client.host


Origin = Annotated[str, Header(include_in_schema=False)]
Address = Annotated[str, Depends(_address)]


def page_router(web: Path, files: PageFiles, redirect: str = "") -> APIRouter:
    """The operator's page and the sign-in page, from the folder `web`.

    A signed-in session is redirected to `redirect`, where that is given.
    """
    router = APIRouter(include_in_schema=False)

    @router.get("/")
    async def page(request: Request, visitor: Visitor) -> Response:
        if visitor is None:
            return FileResponse(web / "sign-in.html")
        return RedirectResponse(redirect) if redirect else files.cached("index.html", request.scope)

    @router.get("/sign-in")
    def sign_in_page() -> Response:
        # The page alone: a browser that prefetches links must not use up the token.
        return FileResponse(web / "sign-in.html")

    return router


def sign_in_router(app_state: AppState) -> APIRouter:
    """Sessions, health and version."""
    router = APIRouter()

    async def _session_of(request: body.SignIn, address: str) -> Session:
        if request.token is not None:
            return app_state.sessions.sign_in(request.token, time.monotonic(), address)
        if app_state.passwords is None:
            raise SignInError(reasons.sign_in_without_passwords())
        user = await app_state.passwords.check(request.user or "", request.password or "", address)
        return app_state.sessions.open(user.name, user.role, time.monotonic(), user.fingerprint)

    @router.post("/api/sign-in", tags=["sessions"], responses=SIGN_IN)
    async def sign_in(visitor: Visitor, request: body.SignIn, address: Address, origin: Origin) -> Response:
        """Sign in with name and password, or with the single-use token of a link; sets the session cookie."""
        try:
            session = await _session_of(request, address)
        except SignInError as error:
            refusal = (
                reasons.link_refused(address, error.reason)
                if request.user is None
                else reasons.sign_in_refused(request.user, address, error.reason)
            )
            app_state.note(refusal, f"sign-in {address}")
            if error.wait_s > 0:
                refused = answer(Result(429, error.reason))
                refused.headers["Retry-After"] = str(max(1, round(error.wait_s)))
                return refused
            return answer(Result(401, error.reason))
        if visitor is not None:
            app_state.sign_out(visitor)
        app_state.note(reasons.signed_in(session.user, session.role))
        signed_in = JSONResponse(outcome(True))
        signed_in.set_cookie(
            app_state.cookie,
            session.session_id,
            httponly=True,
            samesite="strict",
            # True behind a TLS proxy too; the middleware has checked that this is one of the server's own origins.
            secure=origin.startswith("https:"),
            path="/",
        )
        return signed_in

    @router.get("/api/sign-in", tags=["sessions"])
    async def sign_in_method() -> body.SignInMethod:
        """How to sign in."""
        return body.SignInMethod(password=app_state.passwords is not None)

    @router.post("/api/sign-out", tags=["sessions"], responses=SIGN_OUT)
    async def sign_out(visitor: Visitor) -> Response:
        """End this session; its pages close at once."""
        if visitor is not None:
            app_state.sign_out(visitor)
        signed_out = JSONResponse(outcome(True))
        signed_out.delete_cookie(app_state.cookie, path="/", httponly=True, samesite="strict")
        return signed_out

    @router.get("/api/health", tags=["server"])
    async def health() -> dict[str, str]:
        """The server answers."""
        return {"status": "ok"}

    running = msgspec.to_builtins(about())

    @router.get("/version", tags=["server"])
    async def version() -> dict[str, str]:
        """Version, source revision, Python, and a digest of the installed packages."""
        return dict(running)

    @router.get("/api/me", tags=["sessions"], responses=SIGNED_IN)
    async def me(session: Caller) -> body.Me:
        """The caller's user and role."""
        return body.Me(user=session.user, role=session.role)

    @router.post("/api/invite", tags=["sessions"], responses=COMMAND | {200: {"model": body.Invited}})
    async def invite(session: Supervisor, request: body.Invite, origin: Origin) -> Response:
        """A single-use sign-in link for another user or a script, and as a QR code. Supervisors only."""
        made = app_state.invite(session, request.user, request.role, origin)
        if isinstance(made, Reason):
            return answer(Result(403, made))
        rows = ["".join("1" if dark else "0" for dark in row) for row in segno.make_qr(made).matrix]
        return JSONResponse(outcome(True) | {"link": made, "qr": rows})

    return router
