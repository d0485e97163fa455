"""Assembles the server and runs it until the process has to stop."""

import argparse
import asyncio
import contextlib
import re
import resource
import secrets
import threading
from collections.abc import Callable, Generator, Mapping
from pathlib import Path

import uvicorn
from starlette.types import ASGIApp

from rolling_panda import reasons
from rolling_panda.bounds import wider
from rolling_panda.config import load_section
from rolling_panda.cut_pictures import PictureFolder
from rolling_panda.errors import InputError
from rolling_panda.model.robot import RobotModel
from rolling_panda.runtime.process import ProcessContext, wire_config
from rolling_panda.runtime.scheduling import freeze_heap
from rolling_panda.runtime.state_folder import usual_state_folder
from rolling_panda.transport.zenoh import Transport
from server.app import create_app
from server.auth.access import Access, Tls, access
from server.auth.passwords import Passwords
from server.auth.sessions import Sessions
from server.config import ServerConfig
from server.connections.http_protocol import SiteConfig
from server.connections.listener import Connections, Listener, listen
from server.connections.websocket_protocol import LimitedSocket
from server.loop import Loop, watch_accounts
from server.robots.app_state import AppState
from server.robots.context import RobotContext
from server.robots.link import RobotLink
from server.robots.page_view import PageView
from server.scene.scene import Scene
from server.scene.solids import Solids, build_solids

_POLL_S = 0.05
#: File descriptors of a connection; a 3-D view has three.
_FILES_PER_CONNECTION = 4


def check(arguments: argparse.Namespace) -> Access:
    """The checked access options of the command line.

    Raises:
        InputError: Options or files do not fit.
        ConfigError: The configuration is wrong.
    """
    load_section(arguments.config, "server", ServerConfig)
    robots = [arguments.robot_id, *arguments.also_robot_id]
    _check_names(robots)
    if arguments.also_robot_id and (certificates := wire_config(arguments).certificates):
        _check_certificates(Path(certificates), robots)
    return access(arguments)


def run(context: ProcessContext) -> None:
    """Serve until `context.stopping` is set.

    Raises:
        InputError: The port is taken, or a file cannot be used.
    """
    config = load_section(context.config_path, "server", ServerConfig)
    _raise_file_limit(_FILES_PER_CONNECTION * config.connections)
    arguments = context.arguments
    access_options = check(arguments)
    with listen(arguments.host, arguments.port) as listener:
        port = int(listener.getsockname()[1])
        sessions = Sessions(config.session_idle_s)
        address = f"{access_options.scheme}://127.0.0.1:{port}"
        if access_options.users is None:
            token = _first_token(arguments.sign_in_token_file)
            sessions.admit(token, "supervisor", "supervisor")
            if arguments.sign_in_token_file is None:
                print(f"Sign in once with this link: {address}/sign-in?token={token}", flush=True)
        else:
            print(f"Sign in with name and password: {address}", flush=True)
        with contextlib.ExitStack() as others:
            wires = {arguments.robot_id: context.transport}
            for name in arguments.also_robot_id:
                wires[name] = others.enter_context(Transport(context.wire, "server", name))
            asyncio.run(
                serve(
                    config,
                    wires,
                    sessions,
                    listener,
                    context.stopping,
                    access_options,
                    freeze_heap,
                    arguments.state or usual_state_folder(arguments.robot_id),
                )  # fmt: skip
            )


async def serve(
    config: ServerConfig,
    wires: Mapping[str, Transport],
    sessions: Sessions,
    listener: Listener,
    stopping: threading.Event,
    access_options: Access | None = None,
    on_ready: Callable[[], None] = lambda: None,
    state: Path | None = None,
) -> None:
    """Serve the page on `listener` until `stopping` is set.

    Args:
        config: Rates and limits.
        wires: The wire of each robot, by name.
        sessions: Sign-in tokens and sessions.
        listener: Listening socket.
        stopping: Ends the server.
        access_options: Users and TLS.
        on_ready: Called before the first request is served.
        state: Folder of what survives a restart, the pictures of cuts; it is made with the first. None keeps nothing.
    """
    access_options = access_options or Access()
    port = int(listener.getsockname()[1])
    app_state = AppState(
        sessions,
        # Cookies ignore ports: two servers on one machine need different names.
        f"rolling_panda_{port}",
        config.invite_s,
        config.max_body_bytes,
        None if access_options.users is None else Passwords(access_options.users),
    )
    solids = build_solids()
    for name, wire in wires.items():
        app_state.robots[name] = _robot_context(
            config, wire, RobotModel(), solids, app_state, None if state is None else state / "pictures" / name
        )
    own = {f"{access_options.scheme}://{name}:{port}" for name in ("127.0.0.1", "localhost")}
    origins = frozenset({*own, *config.origins})
    app = create_app(app_state, origins)
    on_ready()
    work = [watch_accounts(app_state), *(job for robot in app_state.robots.values() for job in Loop(robot).jobs())]
    jobs = [asyncio.create_task(job) for job in work]
    connections = Connections(config, lambda reason, by: app_state.note(reason, f"connections of {by}"))
    listener.count(connections, access_options.tls is not None)
    site = asyncio.create_task(_site(app, connections, listener, stopping, access_options.tls))
    try:
        # A failed job ends the server: an incomplete page would mislead.
        await asyncio.wait([*jobs, site], return_when=asyncio.FIRST_COMPLETED)
        for job in jobs:
            if job.done():
                job.result()
    finally:
        for session in sessions.active():
            session.ended.set()
        for job in jobs:
            job.cancel()
        stopping.set()
        await asyncio.gather(*jobs, site, return_exceptions=True)
        for robot in app_state.robots.values():
            robot.scene.close()
            robot.link.close()


def _robot_context(
    config: ServerConfig,
    wire: Transport,
    model: RobotModel,
    solids: Solids,
    app_state: AppState,
    pictures: Path | None,
) -> RobotContext:
    """The context of the robot on this wire, with its own 3-D view."""
    loop = asyncio.get_running_loop()

    def call_soon(function: Callable[..., object], *arguments: object) -> None:
        # The loop may be closed before viser's thread ends.
        with contextlib.suppress(RuntimeError):
            loop.call_soon_threadsafe(function, *arguments)

    scene = Scene(
        model.model,
        solids,
        call_soon,
        # Called only once a page is served, when `robot` is bound.
        on_select=lambda owner, point_id: robot.pages.on_point_clicked(owner, point_id),
        on_ray=lambda owner, origin, direction: robot.pages.on_click(owner, origin, direction),
        on_refusal=lambda: robot.log.note(reasons.view_from_outside()),
    )
    link, widened = RobotLink(wire), wider("server", config)
    robot = RobotContext(
        config,
        link,
        scene,
        PageView(link, model, widened, wire.plain),
        held_elsewhere=lambda session: app_state.held_elsewhere(session, robot),
        picture_folder=None if pictures is None else PictureFolder(pictures, config.cut_pictures),
    )
    for relaxed in widened:
        robot.log.note(reasons.limits_relaxed(relaxed))
    if wire.plain:
        robot.log.note(reasons.plain_wire())
    return robot


class _Site(uvicorn.Server):
    """Uvicorn without its own signal handlers: the process has its own."""

    @contextlib.contextmanager
    def capture_signals(self) -> Generator[None, None, None]:
        yield


async def _site(
    app: ASGIApp, connections: Connections, listener: Listener, stopping: threading.Event, tls: Tls | None
) -> None:
    config = connections.limits
    site = _Site(
        SiteConfig(
            app,
            connections,
            log_level="error",
            access_log=False,
            lifespan="off",
            server_header=False,
            # Headers do not change the client's address.
            proxy_headers=False,
            ws_max_size=config.max_body_bytes,
            ws_per_message_deflate=False,
            ws=LimitedSocket,
            ws_ping_interval=config.unread_s / 2,
            ws_ping_timeout=config.unread_s,
            timeout_graceful_shutdown=1,
            ssl_certfile=None if tls is None else str(tls.certificate),
            ssl_keyfile=None if tls is None else str(tls.key),
        )
    )
    serving = asyncio.create_task(site.serve(sockets=[listener]))
    while not stopping.is_set() and not serving.done():
        await asyncio.sleep(_POLL_S)
    site.should_exit = True
    await serving


def _raise_file_limit(files: int) -> None:
    """Raise the limit of open files to this number, as far as the user may."""
    soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    if soft != resource.RLIM_INFINITY and soft < files:
        limit = files if hard == resource.RLIM_INFINITY else min(files, hard)
        resource.setrlimit(resource.RLIMIT_NOFILE, (limit, hard))


def _check_certificates(folder: Path, robots: list[str]) -> None:
    """With the certificate of one robot the router would silently drop messages to another."""
    for name in robots:
        if not (folder / name).is_dir():
            every = " ".join(f"--robot {each}" for each in robots)
            raise InputError(
                f"there is no folder {folder / name}: of several robots each has certificates of its own; make them "
                f"with `rolling-panda certificates --out DIR {every}`"
            )


def _check_names(robots: list[str]) -> None:
    for name in robots:
        if re.fullmatch(r"[A-Za-z0-9][A-Za-z0-9_-]{0,31}", name) is None:
            raise InputError(
                f"a robot cannot be called {name!r}: give up to 32 letters, digits, - and _, since it is part of a path"
            )
        if robots.count(name) > 1:
            raise InputError(f"robot {name} is given twice; give each of --robot-id and --also-robot-id once")


def _first_token(file: Path | None) -> str:
    if file is None:
        return secrets.token_urlsafe(32)
    try:
        token = file.read_text(encoding="ascii").strip()
        file.unlink()
    except (OSError, UnicodeDecodeError) as error:
        raise InputError(f"cannot use the sign-in token file {file}: {error}") from error
    return token
