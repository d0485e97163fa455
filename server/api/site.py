"""Signing in and out, inviting others, and what is open to everybody: the same for every robot of the server."""

import time
from pathlib import Path
from typing import Annotated

import msgspec
from fastapi import APIRouter, Depends, Header, Request, Response
from fastapi.responses import FileResponse, JSONResponse, RedirectResponse

from rolling_panda.cli.about import about
from server.api import bodies as body
from server.api.answers import ANSWERS, SIGN_IN, SIGN_OUT, SIGNED_IN, Caller, Supervisor, answer
from server.api.page_files import PageFiles
from server.auth.sessions import Session, SignInError
from server.robots.app_state import AppState
from server.robots.context import Result


def _maybe_session(request: Request) -> Session | None:
    session: Session | None = request.state.session
    return session


def _address(request: Request) -> str:
    return "" if request.client is None else request.client.host


Visitor = Annotated[Session | None, Depends(_maybe_session)]
Origin = Annotated[str, Header(include_in_schema=False)]
Address = Annotated[str, Depends(_address)]


def page_router(web: Path, files: PageFiles, onwards: str = "") -> APIRouter:
    """The page and the way in, from the folder `web` and what of it is kept.

    Whoever is signed in is sent `onwards`, where that is given.
    """
    router = APIRouter(include_in_schema=False)

    @router.get("/")
    async def page(request: Request, visitor: Visitor) -> Response:
        if visitor is None:
            return FileResponse(web / "sign-in.html")
        return RedirectResponse(onwards) if onwards else files.kept("index.html", request.scope)

    @router.get("/sign-in")
    def sign_in_page() -> Response:
        # Only shows a page: a browser that fetches links in advance must not use the token up.
        return FileResponse(web / "sign-in.html")

    return router


def site_router(reception: AppState) -> APIRouter:
    """Who is signed in, and what is open to everybody."""
    router = APIRouter()

    async def _signed_in(request: body.SignIn, address: str) -> Session:
        if request.token is not None:
            return reception.sessions.sign_in(request.token, time.monotonic(), address)
        if reception.passwords is None:
            raise SignInError("this server has no users file: sign in with the link that it printed")
        user = await reception.passwords.enter(request.user or "", request.password or "", address)
        return reception.sessions.open(user.name, user.role, time.monotonic(), user.fingerprint)

    @router.post("/api/sign-in", tags=["sessions"], responses=SIGN_IN)
    async def sign_in(visitor: Visitor, request: body.SignIn, address: Address, origin: Origin) -> Response:
        """Sign in with name and password, or use up the token of a link; the answer sets the session cookie."""
        try:
            session = await _signed_in(request, address)
        except SignInError as error:
            whose = f" as {request.user!r}" if request.user is not None else ""
            reception.note("warning", f"sign-in{whose} from {address} refused: {error}", f"sign-in {address}")
            if error.wait_s > 0:
                refused = answer(Result(429, False, str(error)))
                refused.headers["Retry-After"] = str(max(1, round(error.wait_s)))
                return refused
            return answer(Result(401, False, str(error)))
        if visitor is not None:
            reception.sign_out(visitor)
        reception.note("info", f"{session.user} signed in ({session.role})")
        signed_in = JSONResponse({"ok": True, "reason": ""})
        signed_in.set_cookie(
            reception.cookie,
            session.session_id,
            httponly=True,
            samesite="strict",
            # Behind a proxy that speaks TLS too; the guard has checked that this is one of the server's own origins.
            secure=origin.startswith("https:"),
            path="/",
        )
        return signed_in

    @router.get("/api/sign-in", tags=["sessions"])
    async def sign_in_way() -> body.SignInWay:
        """How to sign in."""
        return body.SignInWay(password=reception.passwords is not None)

    @router.post("/api/sign-out", tags=["sessions"], responses=SIGN_OUT)
    async def sign_out(visitor: Visitor) -> Response:
        """End this session; its pages close at once."""
        if visitor is not None:
            reception.sign_out(visitor)
        signed_out = JSONResponse({"ok": True, "reason": ""})
        signed_out.delete_cookie(reception.cookie, path="/", httponly=True, samesite="strict")
        return signed_out

    @router.get("/api/health", tags=["server"])
    async def health() -> dict[str, str]:
        """The server answers."""
        return {"status": "ok"}

    running = msgspec.to_builtins(about())

    @router.get("/version", tags=["server"])
    async def version() -> dict[str, str]:
        """Which program runs here: version, revision of its source, Python, and a digest of the installed packages."""
        return dict(running)

    @router.get("/api/me", tags=["sessions"], responses=SIGNED_IN)
    async def me(session: Caller) -> body.Me:
        """Who is signed in."""
        return body.Me(user=session.user, role=session.role)

    @router.post("/api/invite", tags=["sessions"], responses=ANSWERS | {200: {"model": body.Invited}})
    async def invite(session: Supervisor, request: body.Invite) -> Response:
        """A single-use sign-in link for somebody else or for a script. Supervisors only."""
        made = reception.invite(session, request.user, request.role)
        return JSONResponse({"ok": True, "reason": "", "link": made.reason}) if made.ok else answer(made)

    return router
