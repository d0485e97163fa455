"""What the server does all the time for each robot: heartbeat, states to the pages, 3-D view, teleoperation, log.

One asyncio loop does all of it, and the heartbeat is sent from that same loop: when it hangs, the heartbeat stops and
the controller stops the robot; with several robots, each of them.
"""

import asyncio
import time
from collections.abc import Awaitable, Callable, Coroutine
from typing import Any

from rolling_panda.model.robot import configuration
from rolling_panda.topics import HEARTBEAT, PRESENCE
from server.robots.app_state import AppState
from server.robots.context import RobotContext

#: Posture older than this (s) is drawn grey: it is only the last known one.
_STALE_S = 1.0
_POINTS_RATE_HZ = 5.0
_LOG_RATE_HZ = 10.0
#: Whose account has been removed is out after this long (s).
_ACCOUNTS_S = 0.5


class Loop:
    """The server's periodic work for one robot."""

    def __init__(self, desk: RobotContext) -> None:
        """Nothing runs yet."""
        self._desk = desk
        self._turns = 0
        self._number = 0
        self._scenery_at = 0.0
        self._warned: set[tuple[str, str]] = set()

    def jobs(self) -> list[Coroutine[Any, Any, None]]:
        """Endless coroutines; cancel them to end."""
        config, looking = self._desk.config, self._desk.looking
        return [
            _every(1 / HEARTBEAT.rate_hz, self._beat),
            _every(1 / PRESENCE.rate_hz, self._presence),
            _every(1 / config.page_rate_hz, self._state),
            _every(1 / config.scene_rate_hz, self._scene),
            _every(1 / config.teleop_rate_hz, self._teleop),
            _every(1 / _POINTS_RATE_HZ, self._points),
            _every(1 / _POINTS_RATE_HZ, looking.draw),
            _every(1 / _LOG_RATE_HZ, self._log),
        ]

    async def _beat(self, now: float) -> None:
        self._turns += 1
        self._desk.link.beat(self._turns)

    async def _presence(self, now: float) -> None:
        self._desk.link.presence_of(self._desk.people.message(now))

    async def _state(self, now: float) -> None:
        self._number += 1
        desk = self._desk
        desk.made_state(desk.view.state(self._number, len(desk.pages), now), now)
        desk.wake_pages()

    async def _scene(self, now: float) -> None:
        desk = self._desk
        desk.scene.fly(now)
        posture = desk.link.posture(now)
        if posture is not None:
            desk.scene.move(configuration(posture.base, posture.position))
            desk.scene.robot.set_grey(posture.age_s > _STALE_S)
        desk.scene.fall.step(now)

    async def _teleop(self, now: float) -> None:
        desk = self._desk
        desk.end_lapsed_hold(now)
        target = desk.teleop.due(now)
        if target is not None:
            desk.link.teleop(target)

    async def _points(self, now: float) -> None:
        desk = self._desk
        points = desk.view.points(now)
        if points is not desk.points:
            desk.points = points
            desk.scene.show_points(points.points)
            desk.wake_pages()
        bridge = desk.link.bridge.peek()
        desk.scene.show_cuts(points.points, bridge.message if bridge is not None else None, now)
        received = desk.link.points.peek()
        if received is not None:
            desk.scene.show_canes(received.message.canes)
        preview = desk.link.preview_motion.peek()
        if preview is not None:
            desk.scene.ghost.take(preview.message)
        scenery = desk.link.scenery.peek()
        if scenery is not None and scenery.at != self._scenery_at:
            self._scenery_at = scenery.at
            desk.scene.show_row(scenery.message, now)
        tool = desk.view.tool(now)
        if tool is not None:
            led = desk.teleop.holder if desk.teleop.leads_gizmo else None
            for owner in desk.scene.gizmos.follow(tool, led):
                desk.teleop.aim(owner, tool)

    async def _log(self, now: float) -> None:
        desk = self._desk
        before = desk.log.number
        for received in desk.link.events.drain():
            event = received.message
            if event.process != "server":
                desk.log.add(event.process, event.severity, event.text, time.time() - (now - received.at))
        while desk.link.refused:
            topic, reason = desk.link.refused.popleft()
            if (topic, reason) not in self._warned and len(self._warned) < 1000:
                self._warned.add((topic, reason))
                desk.note("warning", f"refused a message on {topic}: {reason}")
        if desk.log.number != before:
            desk.wake_pages()


def watch_accounts(reception: AppState) -> Coroutine[Any, Any, None]:
    """Endless: whoever's account has been removed is out soon."""

    async def look(now: float) -> None:
        reception.end_void_sessions()

    return _every(_ACCOUNTS_S, look)


async def _every(period_s: float, job: Callable[[float], Awaitable[None]]) -> None:
    """Run `job(now)` each period; turns that were missed are left out, not caught up."""
    due = time.monotonic()
    while True:
        now = time.monotonic()
        await job(now)
        due = max(due + period_s, now)
        await asyncio.sleep(max(due - time.monotonic(), 0.0))
