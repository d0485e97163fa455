"""Rendering of the camera: in the calling thread, or in a process beside the physics."""

import multiprocessing
import queue
import threading
from multiprocessing.connection import Connection
from multiprocessing.context import SpawnProcess
from typing import Protocol

from bridge.core.picture import Picture
from bridge.sim.camera.config import CameraConfig
from bridge.sim.vineyard.row import Row
from bridge.sim.world.config import CALM, WorldConfig
from rolling_panda.model.differential_drive import Array
from rolling_panda.runtime.scheduling import Priority, set_priority


class CameraRenderer(Protocol):
    """Renders exposures."""

    def expose(self, row: Row, T_world_camera: Array, at: float, velocity: Array) -> bool:
        """Start an exposure of the present row; False while the last one is not ready.

        Args:
            row: The row.
            T_world_camera: Pose of the camera (4×4).
            at: Simulated time (s).
            velocity: Of the camera, linear (m/s) and angular (rad/s) in the world's axes (6).
        """

    def ready(self) -> Picture | None:
        """The finished picture, once; None without one."""

    def close(self) -> None:
        """Close; idempotent."""


class RenderProcess:
    """Renders in a process: a picture takes as long as hundreds of physics steps.

    A thread waits for that process. A process that dies is started again.
    """

    def __init__(
        self, config: CameraConfig, seed: int, priority: Priority = "background", world: WorldConfig = CALM
    ) -> None:
        """Start the process. It ends when the pipe closes.

        Args:
            config: Lens and errors.
            seed: Of the noise.
            priority: Of the process.
            world: Disturbances.
        """
        self._config, self._seed, self._priority, self._world = config, seed, priority, world
        self._known: Row | None = None
        self._process, self._pipe = self._start()
        self._closing = False
        self._requests: queue.SimpleQueue[tuple[Row, Array, float, Array] | None] = queue.SimpleQueue()
        self._picture: Picture | None = None
        self._busy = False
        self._thread = threading.Thread(target=self._wait_for_pictures, name="camera-pipe", daemon=True)
        self._thread.start()

    def expose(self, row: Row, T_world_camera: Array, at: float, velocity: Array) -> bool:
        """Request a picture; the row is sent only when it has changed."""
        if self._busy:
            return False
        self._busy = True
        self._requests.put((row, T_world_camera, at, velocity))
        return True

    def ready(self) -> Picture | None:
        """The requested picture, once it is ready."""
        picture = self._picture
        if picture is not None:
            self._picture, self._busy = None, False
        return picture

    def close(self) -> None:
        """End process and thread."""
        self._closing = True
        self._requests.put(None)
        self._process.kill()
        self._thread.join(2.0)
        self._process.join(2.0)
        self._pipe.close()

    def _start(self) -> tuple[SpawnProcess, Connection]:
        context = multiprocessing.get_context("spawn")
        ours, theirs = context.Pipe()
        process = context.Process(
            target=_render_until_closed,
            args=(theirs, self._config, self._seed, self._priority, self._world),
            name="camera-renderer",
            daemon=True,
        )
        process.start()
        theirs.close()
        return process, ours

    def _wait_for_pictures(self) -> None:
        while (request := self._requests.get()) is not None:
            self._picture = self._render(*request)

    def _render(self, row: Row, T_world_camera: Array, at: float, velocity: Array) -> Picture | None:
        while not self._closing:
            try:
                self._pipe.send((None if row is self._known else row, T_world_camera, at, velocity))
                self._known = row
                picture: Picture = self._pipe.recv()
                return picture
            except (EOFError, OSError):
                if not self._closing:
                    self._pipe.close()
                    self._process.join()
                    self._known = None
                    self._process, self._pipe = self._start()
        return None


def _render_until_closed(
    pipe: Connection, config: CameraConfig, seed: int, priority: Priority, world: WorldConfig
) -> None:
    set_priority(priority)
    # Imported here, since ray casting and its filters are a lot of memory, which the bridge does without.
    from bridge.sim.camera.renderer import InlineRenderer

    renderer, row = InlineRenderer(config, seed, world), Row(())
    try:
        while True:
            changed, T_world_camera, at, velocity = pipe.recv()
            row = row if changed is None else changed
            renderer.expose(row, T_world_camera, at, velocity)
            pipe.send(renderer.ready())
    except (EOFError, BrokenPipeError, KeyboardInterrupt):
        return
