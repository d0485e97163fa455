"""Commands of sessions to one robot: to the controller, to perception, and the software stop."""

import asyncio
import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import msgspec

from rolling_panda import commands as intents
from rolling_panda import messages as m
from rolling_panda import topics
from rolling_panda.commands import EvaluateRule, PlantRequest
from rolling_panda.errors import ServiceError
from server.auth.sessions import Session
from server.robots.event_log import RobotLog
from server.robots.link import RobotLink

_CONFIRM_POLL_S = 0.01


@dataclass(frozen=True)
class Result:
    """The result of a request: HTTP status, success, and a message."""

    status: int
    ok: bool
    reason: str
    effect: m.RuleEffect | None = None
    refused: m.Reason | None = None


class RobotCommands:
    """Sends commands to the processes of one robot and waits for their answers."""

    def __init__(
        self,
        link: RobotLink,
        log: RobotLog,
        view_age_s: Callable[[Session], float],
        on_stop: Callable[[], None],
        stop_confirm_s: float,
    ) -> None:
        """Nothing was commanded.

        Args:
            link: To the processes.
            log: For stops, and for the answers of perception; the controller logs its own.
            view_age_s: Age of the newest state that a session has seen (s).
            on_stop: Called after a stop was sent.
            stop_confirm_s: Time limit for bridge and controller to report a stop as latched.
        """
        self._link, self._log = link, log
        self._view_age_s, self._on_stop, self._stop_confirm_s = view_age_s, on_stop, stop_confirm_s

    async def ask(self, session: Session, intent: intents.Intent) -> Result:
        """Send an intent to the controller, which logs its answer."""
        complete = msgspec.structs.replace(
            intent,
            role=session.role,
            client=session.client,
            # The age of the view goes with the intent, since the presence message may arrive later.
            view_age_s=self._view_age_s(session),
        )
        return await self._call(session, "the controller", topics.INTENT, complete)

    async def ask_perception(self, session: Session, request: PlantRequest) -> Result:
        """Send a request to perception, and log the answer."""
        name = type(request).__name__
        result = await self._call(session, "perception", topics.PLANT, request)
        # Dragging a slider tries many rules, and changes nothing.
        if result.status in (200, 409) and not isinstance(request, EvaluateRule):
            self._log.note(
                "info",
                f"{name} by {session.user}: {result.reason if result.ok else 'refused, ' + result.reason}",
                session.client,
            )
        return result

    async def _call(
        self, session: Session, process: str, service: topics.Service[Any], request: msgspec.Struct
    ) -> Result:
        try:
            answer = await self._link.call(service, request)
        except ServiceError as error:
            name = type(request).__name__
            self._log.note("error", f"{name} by {session.user}: no answer from {process}", session.client)
            return Result(503, False, f"{process[0].upper()}{process[1:]} does not answer: {error}")
        return Result(200 if answer.ok else 409, answer.ok, answer.reason, answer.effect, answer.refused)

    async def stop(self, session: Session, reason: str) -> Result:
        """Send the software stop at once, and wait until bridge and controller report it latched."""
        sent_at = time.monotonic()
        stop_id = self._link.send_stop(session.user, reason)
        self._on_stop()
        self._log.note("warning", f"software stop by {session.user}: {reason}", f"stop {session.client}")
        while (missing := self._link.not_latched(stop_id)) and time.monotonic() - sent_at < self._stop_confirm_s:
            await asyncio.sleep(_CONFIRM_POLL_S)
        if "bridge" in missing:
            reason = "The stop was sent, but the bridge has not confirmed it: use the robot's emergency stop."
            return Result(503, False, reason)
        if missing:
            return Result(200, True, "stopped: the bridge has latched the stop; the controller has not confirmed it")
        return Result(200, True, "stopped: bridge and controller have latched the stop")
