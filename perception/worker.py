"""Frames are worked on beside the loop, so that the loop keeps its rate; a frame that hangs is noticed."""

import threading
from collections.abc import Callable
from dataclasses import dataclass
from typing import Generic, TypeVar

from rolling_panda.errors import RollingPandaError

Job = TypeVar("Job")
Result = TypeVar("Result")


@dataclass(frozen=True)
class Done(Generic[Result]):
    """A finished job: its result, or the error that it ended with."""

    result: Result | None
    error: RollingPandaError | None


class Worker(Generic[Job, Result]):
    """Runs one job at a time on a thread of its own. The caller's thread alone calls its methods."""

    def __init__(self, work: Callable[[Job], Result]) -> None:
        """Start the thread.

        Args:
            work: Does one job. A `RollingPandaError` is handed back; any other exception ends the worker and is
                raised by `poll`.
        """
        self._work = work
        self._begin = threading.Event()
        self._job: Job | None = None
        self._since: float | None = None
        self._done: Done[Result] | None = None
        self._fatal: BaseException | None = None
        threading.Thread(target=self._run, name="perception-worker", daemon=True).start()

    def submit(self, job: Job, now: float) -> bool:
        """Hand over a job; False while the worker still has one or its result was not taken."""
        if self._since is not None:
            return False
        self._job, self._since = job, now
        self._begin.set()
        return True

    def poll(self) -> Done[Result] | None:
        """What the last job came to, once."""
        if self._fatal is not None:
            raise self._fatal
        done = self._done
        if done is not None:
            self._done, self._since = None, None
        return done

    def busy_for(self, now: float) -> float:
        """Seconds that the present job has taken so far; 0 when there is none."""
        return 0.0 if self._since is None else now - self._since

    def _run(self) -> None:
        while True:
            self._begin.wait()
            self._begin.clear()
            job = self._job
            assert job is not None
            try:
                self._done = Done(self._work(job), None)
            except RollingPandaError as error:
                self._done = Done(None, error)
            except BaseException as error:
                self._fatal = error
                return
