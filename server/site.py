"""The page's files, signing in and out, and what is open to everybody."""

import time
from pathlib import Path
from typing import Annotated

import msgspec
from fastapi import APIRouter, Depends, Header, Query, Request, Response
from fastapi.responses import FileResponse, JSONResponse

from rolling_panda.about import about
from server import requests as body
from server.desk import Desk, Result
from server.operator_api import answer
from server.sessions import Session, SignInError


def _maybe_session(request: Request) -> Session | None:
    session: Session | None = request.state.session
    return session


def _address(request: Request) -> str:
    return "" if request.client is None else request.client.host


Visitor = Annotated[Session | None, Depends(_maybe_session)]
Origin = Annotated[str, Header(include_in_schema=False)]
Address = Annotated[str, Depends(_address)]


def site_router(desk: Desk, web: Path) -> APIRouter:
    """Routes outside the session; `web` is the folder of the page."""
    router = APIRouter()

    async def _signed_in(request: body.SignIn, address: str) -> Session:
        if request.token is not None:
            return desk.sessions.sign_in(request.token, time.monotonic(), address)
        if desk.passwords is None:
            raise SignInError("this server has no users file: sign in with the link that it printed")
        user = await desk.passwords.enter(request.user or "", request.password or "", address)
        return desk.sessions.open(user.name, user.role, time.monotonic(), user.fingerprint)

    @router.get("/", include_in_schema=False)
    def page(visitor: Visitor) -> Response:
        return FileResponse(web / ("sign-in.html" if visitor is None else "index.html"))

    @router.get("/sign-in", include_in_schema=False)
    def sign_in_page() -> Response:
        # Only shows a page: a browser that fetches links in advance must not use the token up.
        return FileResponse(web / "sign-in.html")

    @router.post("/api/sign-in", tags=["sessions"], responses={401: {"model": body.Outcome}})
    async def sign_in(visitor: Visitor, request: body.SignIn, address: Address, origin: Origin) -> Response:
        """Sign in with name and password, or use up the token of a link; the answer sets the session cookie."""
        try:
            session = await _signed_in(request, address)
        except SignInError as error:
            whose = f" as {request.user!r}" if request.user is not None else ""
            desk.note("warning", f"sign-in{whose} from {address} refused: {error}", f"sign-in {address}")
            if error.wait_s > 0:
                refused = answer(Result(429, False, str(error)))
                refused.headers["Retry-After"] = str(max(1, round(error.wait_s)))
                return refused
            return answer(Result(401, False, str(error)))
        if visitor is not None:
            desk.sign_out(visitor)
        desk.note("info", f"{session.user} signed in ({session.role})")
        signed_in = JSONResponse({"ok": True, "reason": ""})
        signed_in.set_cookie(
            desk.cookie,
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
        return body.SignInWay(password=desk.passwords is not None)

    @router.post("/api/sign-out", tags=["sessions"], responses={401: {"model": body.Outcome}})
    async def sign_out(visitor: Visitor) -> Response:
        """End this session; its pages close at once."""
        if visitor is not None:
            desk.sign_out(visitor)
        signed_out = JSONResponse({"ok": True, "reason": ""})
        signed_out.delete_cookie(desk.cookie, path="/", httponly=True, samesite="strict")
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

    @router.get("/camera/color.jpg", tags=["state"], response_class=Response)
    async def camera(n: Annotated[int, Query(ge=0)] | None = None) -> Response:
        """The newest image of the eye-in-hand camera, JPEG; with `n` that of frame `n`, one of the newest few."""
        frame = desk.link.camera.peek()
        if frame is None:
            return answer(Result(404, False, "no camera image has come yet"))
        image = frame.message.color_jpeg if n is None else desk.link.images.get(n)
        if image is None:
            return answer(Result(404, False, f"frame {n} is not among the newest ones; {frame.message.sequence} is"))
        return Response(image, media_type="image/jpeg")

    return router
