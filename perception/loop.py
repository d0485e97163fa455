"""Perception as a process: newest frame in, points out, one heartbeat a step. A worker thread processes the frames."""

import math
import threading
from collections import deque
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, Generic, TypeVar

from msgspec.structs import replace

from perception.config import PerceptionConfig
from perception.pipeline import Perception
from perception.segmentation.frame import CorruptFrameError
from rolling_panda import messages as m
from rolling_panda import reasons, topics
from rolling_panda.errors import RollingPandaError
from rolling_panda.messages.perception import (
    ON_THE_WAY,
    CameraState,
    CloseUpResult,
    CutSight,
    Localisation,
    Obstacles,
    RobotCalibration,
    SpurPicture,
)
from rolling_panda.messages.robot import CameraFrame
from rolling_panda.transport.inbox import Inbox, Received, Reply, Request
from rolling_panda.transport.runner import Runner, Wire

Job = TypeVar("Job")
Result = TypeVar("Result")
#: What a picture that was asked for has shown.
_Look = CloseUpResult | CutSight

#: Least time between log entries about rejected wood (s).
_REJECTED_PERIOD_S = 60.0


class Worker(Generic[Job, Result]):
    """Runs one job at a time on a daemon thread. All methods are for one calling thread."""

    def __init__(self, work: Callable[[Job], Result]) -> None:
        """Start the thread.

        Args:
            work: Executes a job. A `RollingPandaError` is a result; `poll` raises any other exception.
        """
        self._work = work
        self._submitted = threading.Event()
        self._job: Job | None = None
        self._since: float | None = None
        self._done: Result | RollingPandaError | None = None
        self._fatal: BaseException | None = None
        threading.Thread(target=self._run, name="perception-worker", daemon=True).start()

    def submit(self, job: Job, now: float) -> bool:
        """Start a job; False while there is one, or its result was not polled."""
        if self._since is not None:
            return False
        self._job, self._since = job, now
        self._submitted.set()
        return True

    def poll(self) -> Result | RollingPandaError | None:
        """The result or the error of a finished job, once; None without one."""
        if self._fatal is not None:
            raise self._fatal
        done = self._done
        if done is not None:
            self._done, self._since = None, None
        return done

    def busy_for(self, now: float) -> float:
        """Duration of the present job (s); 0 without one."""
        return 0.0 if self._since is None else now - self._since

    def _run(self) -> None:
        while True:
            self._submitted.wait()
            self._submitted.clear()
            job = self._job
            assert job is not None
            try:
                self._done = self._work(job)
            except RollingPandaError as error:
                self._done = error
            except BaseException as error:
                self._fatal = error
                return


@dataclass(frozen=True)
class _Output:
    points: m.PruningPoints
    withdrawn: tuple[m.Reason, ...]
    obstacles: Obstacles
    pictures: tuple[SpurPicture, ...]
    rejected_wood: tuple[m.Reason, ...]
    reply: Reply | None
    camera: CameraState
    localisation: Localisation
    calibration: RobotCalibration


class PerceptionProcess:
    """Steps at `rate_hz`. A frame that takes too long stops the count of the heartbeat."""

    def __init__(
        self, config: PerceptionConfig, perception: Perception, worker: Callable[..., Worker[Any, Any]] = Worker
    ) -> None:
        """Start the worker.

        Args:
            config: Section `[perception]`.
            perception: The pipeline; used by the worker only from now on.
            worker: What makes the worker from its work.
        """
        self._config = config
        #: Called when the worker has something to send; it ends the wait for the next step.
        self.wake: Callable[[], None] = lambda: None
        # The controller waits for a close-up check: it is sent before the rest of the frame is processed.
        self._checks: deque[_Look] = deque()
        self._worker: Worker[CameraFrame | Request, _Output] = worker(lambda job: _work(perception, job, self._checked))
        self._newest: _Output | None = None
        self._picture_cycle: dict[tuple[int, int], SpurPicture] = {}
        """Pictures by vine and spur in the order of their repetition, the next one first."""
        self._camera_rays = perception.camera_rays
        self._familiarity_unknown = perception.familiarity_unknown
        self._frame: Received[CameraFrame] | None = None
        self._submitted: Received[CameraFrame] | None = None
        self._sequence = 0
        self._camera = perception.camera.state
        self._camera_told: CameraState | None = None
        self._localisation_sent = -1e9
        self._localisation_told: Localisation | None = None
        self._calibration = perception.robot_calibration
        self._calibration_told: RobotCalibration | None = None
        self._obstacles_sent = self._picture_sent = self._rejected_logged = -1e9
        self._started = False
        self._last_error = ""
        self._rejected_wood: tuple[m.Reason, ...] = ()
        self._point_ids: frozenset[str] = frozenset()
        self._timed_out = False
        self._out: list[object] = []

    def step(self, inbox: Inbox, now: float) -> list[object]:
        """One cycle at `now` (s, monotonic)."""
        self._out = []
        if not self._started:
            self._started = True
            self._log(reasons.perception_started(), now)
            if self._familiarity_unknown:
                self._log(reasons.familiarity_unknown(), now)
        while self._checks:
            self._out.append(self._checks.popleft())
        done = self._worker.poll()
        if isinstance(done, RollingPandaError):
            self._log_refused(
                done.reason if isinstance(done, CorruptFrameError) else reasons.frame_failed(str(done)), now
            )
        elif done is not None:
            self._accept(done, now)
        frame = inbox.newest(CameraFrame)
        if frame is not None and frame is not self._frame:
            # The page shows frames that are never processed too, and they can be clicked.
            self._frame = frame
            self._camera_rays.add(frame.message)
        if self._worker.busy_for(now) == 0.0:
            if (request := inbox.next_request()) is not None:
                self._worker.submit(request, now)
            elif frame is not None and frame is not self._submitted:
                self._submitted = frame
                self._worker.submit(frame.message, now)
        if self._newest is not None and now - self._obstacles_sent >= 1.0 / topics.OBSTACLES.rate_hz:
            self._out.append(self._newest.obstacles)
            self._obstacles_sent = now
        if self._picture_cycle and now - self._picture_sent >= 1.0 / topics.PICTURES.rate_hz:
            key = next(iter(self._picture_cycle))
            self._picture_cycle[key] = self._picture_cycle.pop(key)
            self._out.append(self._picture_cycle[key])
            self._picture_sent = now
        self._tell_camera(now)
        self._tell_localisation(now)
        if self._calibration != self._calibration_told:
            self._calibration_told = self._calibration
            self._out.append(self._calibration)
        self._beat(now)
        return self._out

    def end(self) -> Sequence[object]:
        """Nothing."""
        return ()

    def _checked(self, check: _Look) -> None:
        """Runs on the worker's thread."""
        self._checks.append(check)
        self.wake()

    def _accept(self, output: _Output, now: float) -> None:
        self._newest, self._last_error, self._camera = output, "", output.camera
        self._calibration = output.calibration
        self._out.append(output.points)
        # The controller counts the age of what it has: a repetition a second later is too late on a busy machine.
        self._obstacles_sent = -math.inf
        if output.reply is not None:
            self._out.append(output.reply)
        self._add_new_pictures(output.pictures)
        ids = frozenset(point.point_id for point in output.points.points)
        if new := len(ids - self._point_ids):
            self._log(reasons.new_point(len(ids)) if new == 1 else reasons.new_points(new, len(ids)), now)
        for reason in output.withdrawn:
            # The controller warns where the point was accepted.
            self._log(reason, now)
        self._point_ids = ids
        if output.rejected_wood != self._rejected_wood and now - self._rejected_logged >= _REJECTED_PERIOD_S:
            self._rejected_wood, self._rejected_logged = output.rejected_wood, now
            for reason in output.rejected_wood:
                self._log(reason, now)

    def _add_new_pictures(self, pictures: tuple[SpurPicture, ...]) -> None:
        wanted = {(picture.drawing.vine, picture.drawing.spur): picture for picture in pictures}
        new = {key: picture for key, picture in wanted.items() if self._picture_cycle.get(key) is not picture}
        self._out += new.values()
        kept = {key: picture for key, picture in self._picture_cycle.items() if key in wanted and key not in new}
        self._picture_cycle = kept | new

    def _tell_camera(self, now: float) -> None:
        """State of the camera where it has changed; a warning of another kind is logged too."""
        told, camera = self._camera_told, self._camera
        if told is not None and replace(camera, header=told.header) == told:
            return
        before = None if told is None or told.warning is None else told.warning.code
        if camera.warning is not None and camera.warning.code != before:
            self._log(camera.warning, now)
        self._camera_told = camera
        self._out.append(camera)

    def _tell_localisation(self, now: float) -> None:
        if self._newest is None:
            return
        localisation, told = self._newest.localisation, self._localisation_told
        changed = told is None or (told.state, told.T_map_odom) != (localisation.state, localisation.T_map_odom)
        if not changed and now - self._localisation_sent < 1.0 / topics.LOCALISATION.rate_hz:
            return
        if localisation.reason is not None and (told is None or told.state != "lost"):
            self._log(localisation.reason, now)
        self._localisation_sent, self._localisation_told = now, localisation
        self._out.append(localisation)

    def _log_refused(self, cause: m.Reason, now: float) -> None:
        # An error that repeats frame after frame is logged once.
        if cause.code != self._last_error:
            self._log(reasons.frame_refused(cause), now)
        self._last_error = cause.code

    def _beat(self, now: float) -> None:
        timed_out = self._worker.busy_for(now) > self._config.frame_timeout_s
        if timed_out and not self._timed_out:
            self._log(reasons.frame_overdue(self._config.frame_timeout_s), now)
        self._timed_out = timed_out
        if not timed_out:
            self._sequence += 1
        self._out.append(m.Heartbeat(process="perception", sequence=self._sequence))

    def _log(self, reason: m.Reason, now: float) -> None:
        self._out.append(m.LogEvent(header=m.Header(now), process="perception", reason=reason))


def perception_runner(wire: Wire, config: PerceptionConfig, perception: Perception) -> Runner:
    """Perception on a wire; arguments as of `PerceptionProcess`."""
    process = PerceptionProcess(config, perception)
    runner = Runner(process, wire, 1.0 / config.rate_hz)
    process.wake = runner.wake
    return runner


def _work(
    perception: Perception, job: CameraFrame | Request, send: Callable[[CloseUpResult | CutSight], None]
) -> _Output:
    reply = None
    if isinstance(job, Request):
        reply = Reply(job, perception.answer(job.message))
        points = perception.points()
    else:
        if job.point_id.startswith(ON_THE_WAY):
            send(perception.see_cut(job))
        elif job.point_id:
            send(perception.check_close_up(job))
        points = perception.process(job)
    obstacles = Obstacles(header=points.header, capsules=perception.obstacles)
    return _Output(
        points,
        perception.withdrawn,
        obstacles,
        perception.pictures,
        perception.rejected_wood,
        reply,
        perception.camera.state,
        perception.localisation,
        perception.robot_calibration,
    )
