"""Commands of sessions to one robot: to the controller, to perception, and the software stop."""

import asyncio
import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import msgspec

from rolling_panda import commands as intents
from rolling_panda import messages as m
from rolling_panda import reasons, topics
from rolling_panda.commands import EvaluateRule, PlantRequest
from rolling_panda.errors import ServiceError
from server.auth.sessions import Session
from server.robots.event_log import RobotLog
from server.robots.link import RobotLink

_CONFIRM_POLL_S = 0.01


@dataclass(frozen=True)
class Result:
    """The result of a request.

    Attributes:
        status: HTTP status; below 400 it was done.
        reason: Why it was refused, or what was done; None where there is nothing to say.
        effect: Of a pruning rule.
    """

    status: int
    reason: m.Reason | None = None
    effect: m.RuleEffect | None = None

    @property
    def ok(self) -> bool:
        """Whether the request was done."""
        return self.status < 400


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
        return await self._call(session, "controller", topics.INTENT, complete)

    async def ask_perception(self, session: Session, request: PlantRequest) -> Result:
        """Send a request to perception, and log the answer."""
        name = type(request).__name__
        result = await self._call(session, "perception", topics.PLANT, request)
        # Dragging a slider tries many rules, and changes nothing.
        if result.status in (200, 409) and not isinstance(request, EvaluateRule):
            told, by = result.reason or reasons.done(), session.user
            line = reasons.request_done(name, by, told) if result.ok else reasons.request_refused(name, by, told)
            self._log.note(line, session.client)
        return result

    async def _call(
        self, session: Session, process: str, service: topics.Service[Any], request: msgspec.Struct
    ) -> Result:
        try:
            answer = await self._link.call(service, request)
        except ServiceError as error:
            silent = reasons.service_silent(process, str(error))
            refused = reasons.request_refused(type(request).__name__, session.user, silent)
            self._log.note(refused, session.client)
            return Result(503, silent)
        return result_of(answer)

    async def stop(self, session: Session, reason: str) -> Result:
        """Send the software stop at once, and wait until bridge and controller report it latched."""
        sent_at = time.monotonic()
        stop_id = self._link.send_stop(session.user, reason)
        self._on_stop()
        self._log.note(reasons.software_stop(session.user, reasons.said(reason)), f"stop {session.client}")
        while (missing := self._link.not_latched(stop_id)) and time.monotonic() - sent_at < self._stop_confirm_s:
            await asyncio.sleep(_CONFIRM_POLL_S)
        if "bridge" in missing:
            return Result(503, reasons.stop_unconfirmed())
        return Result(200, reasons.stop_half_confirmed() if missing else reasons.stop_confirmed())


def result_of(answer: m.Answer) -> Result:
    """The result of a request that a process has answered."""
    return Result(200 if answer.ok else 409, answer.reason, answer.effect)
