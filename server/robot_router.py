"""Several robots behind one door: each has its whole application under a path of its own.

What a robot's application is given is what it would be given if it were alone: the path without its prefix. So the
guard, the routes and the filter of the 3-D view are the same for one robot and for several, and none of them can be
asked about another robot than its own.
"""

from collections.abc import Mapping

from starlette.types import ASGIApp, Receive, Scope, Send

from server.api.robots import path_of


class RobotRouter:
    """ASGI application that hands each request to its robot's application, or to the hall."""

    def __init__(self, robots: Mapping[str, ASGIApp], hall: ASGIApp) -> None:
        """Serve `robots` by name, and everything else by `hall`."""
        self._robots = {path_of(name): app for name, app in robots.items()}
        self._hall = hall

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Pass it on."""
        if scope["type"] in ("http", "websocket"):
            path: str = scope["path"]
            for prefix, app in self._robots.items():
                if path.startswith(prefix):
                    await app({**scope, "path": path[len(prefix) - 1 :]}, receive, send)
                    return
        await self._hall(scope, receive, send)
