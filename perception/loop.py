"""The process's loop: newest frame in, points out, one heartbeat a turn."""

import queue
import threading
import time
from collections.abc import Callable
from concurrent.futures import Future
from concurrent.futures import TimeoutError as FutureTimeoutError
from dataclasses import dataclass

from perception.config import PerceptionConfig
from perception.pipeline import Perception
from perception.worker import Worker
from rolling_panda import messages as m
from rolling_panda import topics
from rolling_panda.messages.commands import PlantRequest
from rolling_panda.messages.perception import CloseLook, Obstacles, PointCrop
from rolling_panda.messages.robot import CameraFrame
from rolling_panda.transport.zenoh import Received, Transport


@dataclass(frozen=True)
class _Result:
    points: m.PruningPoints
    withdrawn: tuple[str, ...]
    obstacles: Obstacles
    crops: tuple[PointCrop, ...]
    left_out: str


@dataclass(frozen=True)
class _Asked:
    request: PlantRequest
    answer: Future[m.Answer]


_Job = CameraFrame | _Asked
#: How long an operator's question waits for the worker (s); less than the service's timeout.
_ANSWER_S = 1.8
#: What was left out as implausible is told this often at most (s).
_LEFT_OUT_S = 60.0


class Loop:
    """Turns at `rate_hz`. Frames are worked on beside it; a frame that hangs stops the heartbeat's count."""

    def __init__(self, transport: Transport, config: PerceptionConfig, perception: Perception) -> None:
        """Subscribe and announce.

        Args:
            transport: Open session.
            config: Section `[perception]`.
            perception: What does the work; from now on the worker's alone.
        """
        self._config = config
        self._frames = transport.slot(topics.CAMERA)
        self._points = transport.publisher(topics.POINTS)
        self._obstacles = transport.publisher(topics.OBSTACLES)
        self._crops = transport.publisher(topics.CROPS)
        self._heartbeat = transport.publisher(topics.HEARTBEAT)
        self._events = transport.publisher(topics.EVENT)
        looks = transport.publisher(topics.LOOK)
        # The controller waits for a look, so it is told before the rest of the frame is worked on.
        self._worker: Worker[_Job, _Result] = Worker(lambda job: _work(perception, job, looks.put))
        self._asked: queue.SimpleQueue[_Asked] = queue.SimpleQueue()
        transport.serve(topics.PLANT, self._ask)
        self._newest: m.PruningPoints | None = None
        self._in_the_way: Obstacles | None = None
        self._pictures: dict[tuple[str, int], PointCrop] = {}
        """In the order in which they are repeated, the next one first."""
        self._sightings = perception.sightings
        self._noted: Received[CameraFrame] | None = None
        self._sequence = 0
        self._sent = self._sent_obstacles = self._sent_crop = -1e9
        self._last_error = ""
        self._left_out, self._told_left_out = "", -1e9
        self._shown: frozenset[str] = frozenset()
        self._hanging = False

    def run(self, stopping: threading.Event) -> None:
        """Keep time until told to stop."""
        period = 1.0 / self._config.rate_hz
        due = time.monotonic()
        self._tell("info", "perception is up and waits for camera frames", due)
        while not stopping.is_set():
            self.turn(time.monotonic())
            due = max(due + period, time.monotonic())
            stopping.wait(max(0.0, due - time.monotonic()))

    def turn(self, now: float) -> None:
        """One turn at `now` (s, monotonic)."""
        done = self._worker.poll()
        if done is not None and done.result is not None:
            self._take(done.result, now)
        elif done is not None:
            self._refuse(str(done.error), now)
        frame = self._frames.peek()
        if frame is not None and frame is not self._noted:
            # Also those that are never worked on: the page shows them, and may click into them.
            self._noted = frame
            self._sightings.note(frame.message)
        if self._worker.busy_for(now) == 0.0:
            if not self._asked.empty():
                self._worker.submit(self._asked.get(), now)
            elif (frame := self._frames.take()) is not None:
                self._worker.submit(frame.message, now)
        if self._newest is not None and now - self._sent >= 1.0 / topics.POINTS.rate_hz:
            self._publish(now)
        if self._in_the_way is not None and now - self._sent_obstacles >= 1.0 / topics.OBSTACLES.rate_hz:
            self._obstacles.put(self._in_the_way)
            self._sent_obstacles = now
        if self._pictures and now - self._sent_crop >= 1.0 / topics.CROPS.rate_hz:
            self._repeat_crop(now)
        self._beat(now)

    def _ask(self, request: PlantRequest) -> m.Answer:
        """On a thread of the transport: waits until the worker has come to it."""
        asked = _Asked(request, Future())
        self._asked.put(asked)
        try:
            return asked.answer.result(_ANSWER_S)
        except FutureTimeoutError:
            asked.answer.cancel()
            return m.Answer(ok=False, reason="perception is busy with a frame; nothing was done, ask again")

    def _take(self, result: _Result, now: float) -> None:
        self._newest, self._in_the_way, self._last_error = result.points, result.obstacles, ""
        self._publish(now)
        self._show_crops(result.crops)
        shown = frozenset(point.point_id for point in result.points.points)
        if shown - self._shown:
            new = len(shown - self._shown)
            self._tell("info", f"{new} new pruning point{'' if new == 1 else 's'}, {len(shown)} in all", now)
        for text in result.withdrawn:
            # Mostly since it was cut. Where somebody had accepted it, the controller warns.
            self._tell("info", text, now)
        self._shown = shown
        if result.left_out != self._left_out and now - self._told_left_out >= _LEFT_OUT_S:
            self._left_out, self._told_left_out = result.left_out, now
            if result.left_out:
                self._tell("info", f"taken for wood where none can be, and left out: {result.left_out}", now)

    def _show_crops(self, crops: tuple[PointCrop, ...]) -> None:
        wanted = {(crop.point_id, crop.revision): crop for crop in crops}
        new = {key: crop for key, crop in wanted.items() if key not in self._pictures}
        for crop in new.values():
            self._crops.put(crop)
        self._pictures = {key: crop for key, crop in self._pictures.items() if key in wanted} | new

    def _repeat_crop(self, now: float) -> None:
        key = next(iter(self._pictures))
        crop = self._pictures.pop(key)
        self._pictures[key] = crop
        self._crops.put(crop)
        self._sent_crop = now

    def _refuse(self, reason: str, now: float) -> None:
        # The same fault frame after frame is told once.
        if reason.split(":")[-1] != self._last_error:
            self._tell("error", f"a camera frame was refused: {reason}", now)
        self._last_error = reason.split(":")[-1]

    def _publish(self, now: float) -> None:
        if self._newest is not None:
            self._points.put(self._newest)
            self._sent = now

    def _beat(self, now: float) -> None:
        hanging = self._worker.busy_for(now) > self._config.hang_s
        if hanging and not self._hanging:
            self._tell("error", f"a frame has taken more than {self._config.hang_s:g} s", now)
        self._hanging = hanging
        if not hanging:
            self._sequence += 1
        self._heartbeat.put(
            m.Heartbeat(process="perception", sequence=self._sequence, status="hangs in a frame" if hanging else "")
        )

    def _tell(self, severity: m.Severity, text: str, now: float) -> None:
        self._events.put(m.LogEvent(header=m.Header(now), process="perception", severity=severity, text=text[:500]))


def _work(perception: Perception, job: _Job, tell: Callable[[CloseLook], None]) -> _Result:
    if isinstance(job, _Asked):
        # What nobody waits for any more must not be done.
        if job.answer.set_running_or_notify_cancel():
            job.answer.set_result(perception.answer(job.request))
        points = perception.points()
    else:
        if job.point_id:
            tell(perception.look_closely(job))
        points = perception.process(job)
    obstacles = Obstacles(header=points.header, capsules=perception.obstacles)
    return _Result(points, perception.withdrawn, obstacles, perception.crops, perception.left_out)
