"""Configuration of the operator's server."""

from typing import Annotated

from msgspec import Meta, Struct

from rolling_panda.bounds import at_least, at_most


class ServerConfig(Struct, frozen=True, forbid_unknown_fields=True):
    """Rates and limits of the operator's server.

    Attributes:
        page_rate_hz: Rate of `PageState` messages to each page.
        onlooker_rate_hz: The same for pages of viewers; another mode or stop is sent at once.
        scene_rate_hz: Largest update rate of the 3-D view; nothing is sent while nothing moves.
        teleop_rate_hz: Rate of `TeleopTarget` messages while the robot is held.
        hold_timeout_s: A hold that is not renewed for this long lapses.
        hold_resume_s: A lapsed hold that is renewed within this time continues; after that the button has to be
            released first.
        view_timeout_s: Largest age of the rendered state with which a page may move the robot.
        stop_confirm_s: Time limit for bridge and controller to report a stop as latched.
        unread_s: A page or a 3-D view that does not read for this long is disconnected; it may reconnect.
        session_idle_s: A session unused for this long ends.
        invite_s: Lifetime of a sign-in link that a supervisor makes.
        log_lines: Log lines in memory.
        cut_pictures: Pictures of cuts on disk, two a cut; the oldest give way.
        head_s: Time limit for a TLS handshake, for the first byte of a request, and from it to the end of the head.
        body_s: Time limit for a request's body after its head.
        connections: Limit of open connections; a new one replaces the longest idle one.
        connections_per_address: Limit of open connections of one address; two thirds may be WebSockets, of which a page
            has two.
        socket_messages_hz: Rate limit of messages on one WebSocket, with a burst of twice as many; more closes it.
        socket_bytes_hz: Rate limit of bytes on one WebSocket; more closes it.
        session_messages_hz: Rate limit of messages on all WebSockets of a session.
        max_body_bytes: Longest request body, and longest WebSocket frame from a client.
        origins: Permitted origins of the page beside the loopback ones, as `https://HOST`.
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
    cut_pictures: Annotated[int, Meta(ge=2, le=100_000)] = 2000
    head_s: Annotated[float, at_most(10.0)] = 5.0
    body_s: Annotated[float, at_most(30.0)] = 10.0
    connections: Annotated[int, at_most(2048, 16)] = 512
    connections_per_address: Annotated[int, at_most(1024, 8)] = 384
    socket_messages_hz: Annotated[float, at_most(200.0)] = 200.0
    socket_bytes_hz: Annotated[float, at_most(1 << 20)] = 128 << 10
    session_messages_hz: Annotated[float, at_most(1000.0)] = 600.0
    max_body_bytes: Annotated[int, at_most(1 << 20, 1024)] = 64 << 10
    origins: tuple[str, ...] = ()
