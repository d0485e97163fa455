"""What can be set about the operator's server."""

from typing import Annotated

from msgspec import Meta, Struct

from rolling_panda.bounds import at_least, at_most


class ServerConfig(Struct, frozen=True, forbid_unknown_fields=True):
    """Rates and limits of the operator's server.

    Attributes:
        page_rate_hz: `PageState` messages a second to each page.
        onlooker_rate_hz: The same to a page of somebody who may only look on; another mode or stop is told at once.
        scene_rate_hz: Most updates a second of the 3-D view; nothing is sent while nothing moves.
        teleop_rate_hz: `TeleopTarget` messages a second while the operator holds.
        hold_timeout_s: A hold that is not renewed for this long moves nothing any more.
        hold_resume_s: A page that paused for no longer than this, with the button still pressed, holds on, and so does
            a script; after that only a new press starts a hold.
        view_timeout_s: A page that has not drawn a state younger than this may not move the robot.
        stop_confirm_s: How long a stop waits for bridge and controller to say that they have latched it.
        unread_s: A page or a 3-D view that does not read what it is sent for this long is dropped; it may come again.
        session_idle_s: A session unused for this long has ended.
        invite_s: Life of a sign-in link that a supervisor makes for somebody else.
        log_lines: Log lines kept in memory.
        head_s: A TLS handshake may take so long, the first byte of a request may be awaited so long, and so long may
            pass from it to the end of the request's head.
        body_s: A request's body has to come within this long of its head.
        connections: Open connections in all; the longest idle one makes room for a new one.
        connections_per_address: Open connections of one address; two thirds of them may be WebSockets, of which a page
            has two.
        socket_messages_hz: Messages a second through one WebSocket, twice as many at once; more closes it.
        socket_bytes_hz: Bytes a second through one WebSocket; more closes it.
        session_messages_hz: Messages a second of one session through all of its WebSockets.
        max_body_bytes: Longest request body, and longest WebSocket frame from a client.
        origins: Further origins that the page may be served under, as `https://HOST`, beside the loopback ones.
    """

    page_rate_hz: Annotated[float, at_least(2.0, 100.0)] = 10.0
    onlooker_rate_hz: Annotated[float, at_least(1.0, 100.0)] = 5.0
    scene_rate_hz: Annotated[float, Meta(ge=1.0, le=100.0)] = 30.0
    teleop_rate_hz: Annotated[float, at_least(10.0, 200.0)] = 30.0
    hold_timeout_s: Annotated[float, at_most(0.15)] = 0.15
    hold_resume_s: Annotated[float, at_most(1.0)] = 1.0
    view_timeout_s: Annotated[float, at_most(0.5)] = 0.5
    stop_confirm_s: Annotated[float, at_most(2.0)] = 0.5
    unread_s: Annotated[float, at_most(60.0)] = 10.0
    session_idle_s: Annotated[float, at_most(86400.0)] = 12 * 3600.0
    invite_s: Annotated[float, at_most(3600.0)] = 600.0
    log_lines: Annotated[int, Meta(ge=200, le=100_000)] = 1000
    head_s: Annotated[float, at_most(10.0)] = 5.0
    body_s: Annotated[float, at_most(30.0)] = 10.0
    connections: Annotated[int, at_most(2048, 16)] = 512
    connections_per_address: Annotated[int, at_most(1024, 8)] = 384
    socket_messages_hz: Annotated[float, at_most(200.0)] = 200.0
    socket_bytes_hz: Annotated[float, at_most(1 << 20)] = 128 << 10
    session_messages_hz: Annotated[float, at_most(1000.0)] = 600.0
    max_body_bytes: Annotated[int, at_most(1 << 20, 1024)] = 64 << 10
    origins: tuple[str, ...] = ()
