"""Planner in its own process at low priority. The control loop sends requests and never waits."""

import multiprocessing
import os
import signal
import threading
from collections import deque
from multiprocessing.connection import Connection

from controller.config import ControllerConfig
from controller.planning.preview_plan import Preview, PreviewRequest
from controller.planning.work_plan import PlanRequest, WorkPlan
from rolling_panda import reasons
from rolling_panda.config import RobotConfig
from rolling_panda.errors import RollingPandaError
from rolling_panda.messages.types import Reason
from rolling_panda.runtime.scheduling import keep_from_children, set_priority

#: Time limit for the process to end (s).
_END_S = 2.0


class PlannerProcess:
    """Processes the newest request of each kind, one at a time, previews first. Close it at the end.

    `take` has the results.
    """

    def __init__(self, config: ControllerConfig, robot_config: RobotConfig) -> None:
        """Wait for the first request, which starts the process: without work its memory is not needed.

        Args:
            config: Of the controller.
            robot_config: Of the robot.
        """
        self._configs = config, robot_config
        self._waiting = threading.Condition()
        self._plan: PlanRequest | None = None
        self._preview: PreviewRequest | None = None
        self._process: multiprocessing.process.BaseProcess | None = None
        self._closing = False
        self._made: deque[WorkPlan | Preview] = deque()
        self._thread = threading.Thread(target=self._run, name="planner", daemon=True)
        self._thread.start()

    @property
    def pid(self) -> int | None:
        """Of the planning process; None while there is none."""
        process = self._process
        return None if process is None else process.pid

    def ask(self, request: PlanRequest | PreviewRequest) -> None:
        """Do this next."""
        with self._waiting:
            if isinstance(request, PreviewRequest):
                self._preview = request
            else:
                self._plan = request
            self._waiting.notify()

    def take(self) -> list[WorkPlan | Preview]:
        """Plans and previews since the last call, in the order in which they were made."""
        made = self._made
        return [made.popleft() for _ in range(len(made))]

    def close(self) -> None:
        """End the process, in the middle of a plan too."""
        with self._waiting:
            self._closing = True
            if self._process is not None:
                self._process.terminate()
            self._waiting.notify()
        self._thread.join(_END_S)

    def _run(self) -> None:
        keep_from_children()
        connection: Connection | None = None
        while (request := self._next()) is not None:
            connection = connection or self._start()
            if connection is None:
                break
            try:
                connection.send(request)
                self._made.append(connection.recv())
            except (EOFError, OSError):
                self._made.append(_failed(request, reasons.planner_ended()))
                connection.close()
                connection = None
        if connection is not None:
            connection.close()
        if self._process is not None:
            self._process.join(_END_S)

    def _next(self) -> PlanRequest | PreviewRequest | None:
        """Waits for a request; None when closing."""
        with self._waiting:
            while self._plan is None and self._preview is None and not self._closing:
                self._waiting.wait()
            if self._closing:
                return None
            if self._preview is not None:
                preview, self._preview = self._preview, None
                return preview
            plan, self._plan = self._plan, None
            return plan

    def _start(self) -> Connection | None:
        """A new process; None when closing."""
        context = multiprocessing.get_context("spawn")
        here, there = context.Pipe()
        process = context.Process(target=_plan, args=(there, *self._configs), name="planner", daemon=True)
        with self._waiting:
            if self._closing:
                return None
            process.start()
            self._process = process
        there.close()
        return here


def _plan(connection: Connection, config: ControllerConfig, robot_config: RobotConfig) -> None:
    """The planner process: answers requests until its parent has ended."""
    set_priority("background")
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    threading.Thread(target=_end_with_parent, name="parent-watch", daemon=True).start()
    # Only this process imports the planners.
    from controller.planning.cuts import CutPlanner
    from controller.planning.rollout import Rollout

    planner, rollout = CutPlanner(config, robot_config), Rollout(config, robot_config)
    while True:
        try:
            request = connection.recv()
        except EOFError:
            return
        try:
            made = rollout.roll(request) if isinstance(request, PreviewRequest) else planner.plan(request)
        except RollingPandaError as error:
            made = _failed(request, reasons.motion_failed(str(error)))
        connection.send(made)


def _failed(request: PlanRequest | PreviewRequest, why: Reason) -> WorkPlan | Preview:
    if isinstance(request, PreviewRequest):
        return Preview(request, failure=why)
    return WorkPlan(request, failure=why)


def _end_with_parent() -> None:
    parent = multiprocessing.parent_process()
    if parent is not None:
        parent.join()
        os._exit(1)
