"""The server's periodic work for each robot: heartbeat, states for the pages, 3-D view, teleoperation, log.

All of it runs on one asyncio loop, which sends the heartbeat too. When the loop hangs, the heartbeat stops, and the
controller of each robot stops its robot.
"""

import asyncio
import time
from collections.abc import Awaitable, Callable, Coroutine
from typing import Any

from rolling_panda import messages as m
from rolling_panda import reasons
from rolling_panda.topics import HEARTBEAT, PRESENCE
from server.robots.app_state import AppState
from server.robots.context import RobotContext

_POINTS_RATE_HZ = 5.0
_LOG_RATE_HZ = 10.0
#: Faster than two close-ups of a point follow each other.
_PICTURES_RATE_HZ = 5.0
#: Sessions of removed accounts end within this time (s).
_ACCOUNTS_PERIOD_S = 0.5
#: Distinct rejected messages that are logged.
_MAX_WARNINGS = 1000


class Loop:
    """The periodic work for one robot."""

    def __init__(self, robot: RobotContext) -> None:
        """Nothing runs yet."""
        self._robot = robot
        self._heartbeats = 0
        self._states = 0
        self._warned: set[tuple[str, m.Reason]] = set()

    def jobs(self) -> list[Coroutine[Any, Any, None]]:
        """Endless coroutines; cancel them to end."""
        robot = self._robot
        return [
            _every(1 / HEARTBEAT.rate_hz, self._send_heartbeat),
            _every(1 / PRESENCE.rate_hz, self._send_presence),
            _every(1 / robot.config.page_rate_hz, self._publish_state),
            _every(1 / robot.config.scene_rate_hz, robot.scene_updater.step),
            _every(1 / robot.config.teleop_rate_hz, self._send_teleop),
            _every(1 / _POINTS_RATE_HZ, self._update_points),
            _every(1 / _LOG_RATE_HZ, self._update_log),
            _every(1 / _PICTURES_RATE_HZ, self._keep_pictures),
        ]

    async def _send_heartbeat(self, now: float) -> None:
        self._heartbeats += 1
        self._robot.link.send_heartbeat(self._heartbeats)

    async def _send_presence(self, now: float) -> None:
        self._robot.pages.send_presence(now)

    async def _publish_state(self, now: float) -> None:
        self._states += 1
        robot = self._robot
        robot.pages.show_state(robot.view.state(self._states, len(robot.pages.open), now), now)

    async def _send_teleop(self, now: float) -> None:
        self._robot.teleop.step(now)

    async def _update_points(self, now: float) -> None:
        robot = self._robot
        points = robot.view.points(now)
        robot.pages.show_points(points)
        robot.teleop.follow_tool(now)
        await robot.scene_updater.update(points, now)

    async def _keep_pictures(self, now: float) -> None:
        robot, controller = self._robot, self._robot.link.controller.peek()
        # A replay has the pictures of its recording.
        if controller is not None and robot.link.replay.peek() is None:
            await robot.pictures.step(controller.message.queue, robot.link.map_frame)

    async def _update_log(self, now: float) -> None:
        robot = self._robot
        before = robot.log.lines.number
        for received in robot.link.events.drain():
            event = received.message
            if event.process != "server":
                robot.log.lines.add(event.process, event.reason, time.time() - (now - received.at))
        while robot.link.refused:
            topic, reason = robot.link.refused.popleft()
            if (topic, reason) not in self._warned and len(self._warned) < _MAX_WARNINGS:
                self._warned.add((topic, reason))
                robot.log.note(reasons.message_rejected(topic, reason))
        if robot.log.lines.number != before:
            robot.pages.wake()


def watch_accounts(app_state: AppState) -> Coroutine[Any, Any, None]:
    """Endless: ends the sessions of removed and changed accounts."""

    async def check(now: float) -> None:
        app_state.end_void_sessions()

    return _every(_ACCOUNTS_PERIOD_S, check)


async def _every(period_s: float, job: Callable[[float], Awaitable[None]]) -> None:
    """Run `job(now)` each period; missed periods are skipped."""
    due = time.monotonic()
    while True:
        now = time.monotonic()
        await job(now)
        due = max(due + period_s, now)
        await asyncio.sleep(max(due - time.monotonic(), 0.0))
