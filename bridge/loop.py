"""Loop of the bridge: it reads the newest commands, steps in real time and publishes the due messages."""

import threading
import time

from bridge.core.bridge import TICK_S, BridgeCore, BridgeOutputs
from bridge.core.robot_time import RealTime, RobotTime, SteppedTime
from rolling_panda import messages as m
from rolling_panda import topics
from rolling_panda.transport.zenoh import Slot, Transport

# Waking twice as often as joint states go out costs a fifth of waking every millisecond. A command wakes it at once.
_WAKES = 2


class BridgeLoop:
    """Connects a core to the wire. One lock guards the core, because services answer on the transport's threads."""

    def __init__(self, core: BridgeCore, transport: Transport) -> None:
        """Subscribe and announce."""
        self._core = core
        self._lock = threading.Lock()
        self._wake_s = max(TICK_S, core.joints_s / _WAKES)
        clock = time.monotonic()
        self._time: RobotTime = RealTime(clock, TICK_S) if core.kind != "sim" else SteppedTime(clock, TICK_S)
        transport.on_reject = core.refusals.log
        self._motion: Slot[m.MotionCommand] = Slot()
        self._commanded = threading.Event()
        transport.subscribe(topics.MOTION, self._command)
        self._cuts, self._tokens = transport.feed(topics.CUT, 32), transport.feed(topics.TOKEN, 32)
        self._pictures = transport.feed(topics.CLOSE_UP_REQUEST, 8)
        transport.subscribe(topics.STOP, self._stop)
        transport.serve(topics.RELEASE, self._release)
        self._joints = transport.publisher(topics.JOINTS)
        self._odometry = transport.publisher(topics.ODOMETRY)
        self._state = transport.publisher(topics.BRIDGE)
        self._camera = transport.publisher(topics.CAMERA)
        self._scenery = transport.publisher(topics.SCENERY)
        self._event = transport.publisher(topics.EVENT)
        self._stops = transport.publisher(topics.STOPS)

    def run(self, stopping: threading.Event) -> None:
        """Step in real time until `stopping` is set."""
        while not stopping.is_set():
            self._commanded.wait(self._wake_s)
            self._commanded.clear()
            for outputs in self._advance(time.monotonic()):
                self._publish(outputs)

    def _advance(self, clock: float) -> list[BridgeOutputs]:
        outputs, wall_time = [], time.time()
        with self._lock:
            due = self._time.due(clock)
            for request in self._tokens.drain():
                self._core.on_token(request.message, self._time.now)
            motion = self._motion.take()
            if motion is not None:
                self._core.on_motion(motion.message, self._time.now, motion.at)
            for cut in self._cuts.drain():
                self._core.on_cut(cut.message, self._time.now)
            for picture in self._pictures.drain():
                self._core.on_picture(picture.message)
            for _ in range(due):
                outputs.append(self._core.step(self._time.tick(), clock, wall_time))
        return outputs

    def _publish(self, outputs: BridgeOutputs) -> None:
        if outputs.joints is not None:
            self._joints.put(outputs.joints)
        if outputs.odometry is not None:
            self._odometry.put(outputs.odometry)
        if outputs.state is not None:
            self._state.put(outputs.state)
        if outputs.frame is not None:
            self._camera.put(outputs.frame)
        if outputs.stops is not None:
            self._stops.put(outputs.stops)
        if outputs.scenery is not None:
            self._scenery.put(outputs.scenery)
        for event in outputs.events:
            self._event.put(event)

    def _command(self, command: m.MotionCommand, at: float) -> None:
        self._motion.store(command, at)
        self._commanded.set()

    def _stop(self, request: m.StopRequest, at: float) -> None:
        with self._lock:
            self._core.on_stop(request, self._time.now, time.time())

    def _release(self, request: m.ReleaseStop) -> m.Answer:
        with self._lock:
            return self._core.on_release(request, self._time.now)
