"""Where the simulated camera renders: at once, in this thread, or beside the physics in a process of its own."""

import multiprocessing
import queue
import threading
from multiprocessing.connection import Connection
from multiprocessing.context import SpawnProcess
from typing import Protocol

from bridge.core.picture import Picture, encode_picture
from bridge.sim.camera.config import CameraConfig
from bridge.sim.camera.renderer import Camera
from bridge.sim.vineyard.row import Row
from rolling_panda.model.differential_drive import Array
from rolling_panda.runtime.priority import Role, take_priority


class Photographer(Protocol):
    """Turns an exposure into a picture."""

    def expose(self, row: Row, T_world_camera: Array) -> bool:
        """Take a picture of the row as it is now; False, and no picture, while the last one is not ready."""

    def ready(self) -> Picture | None:
        """The picture that has become ready since the last call, or None."""

    def close(self) -> None:
        """End; safe to call twice."""


class InlinePhotographer:
    """Renders inside `expose`: the same calls give the same pictures, and the simulation waits for them."""

    def __init__(self, config: CameraConfig, seed: int) -> None:
        """Prepare the camera."""
        self._camera = Camera(config, seed)
        self._frame = 0
        self._picture: Picture | None = None

    def expose(self, row: Row, T_world_camera: Array) -> bool:
        """Render and encode now."""
        image = self._camera.render(row, T_world_camera, self._frame)
        self._frame += 1
        self._picture = encode_picture(self._camera.intrinsics, image.color, image.depth, image.labels)
        return True

    def ready(self) -> Picture | None:
        """The picture just rendered, once."""
        picture, self._picture = self._picture, None
        return picture

    def close(self) -> None:
        """Nothing to end."""


class ProcessPhotographer:
    """Renders in the process `camera-renderer`, since a picture takes as long as hundreds of physics steps.

    A thread waits for that process, so that the physics never does. A renderer that dies is started again.
    """

    def __init__(self, config: CameraConfig, seed: int, role: Role = "background") -> None:
        """Start the process. It ends when this side of the pipe closes, however that happens.

        Args:
            config: Lens and errors.
            seed: Of the noise.
            role: Scheduling of the process: whoever keeps time comes first.
        """
        self._config, self._seed, self._role = config, seed, role
        self._known: Row | None = None
        self._process, self._pipe = self._start()
        self._closing = False
        self._requests: queue.SimpleQueue[tuple[Row, Array] | None] = queue.SimpleQueue()
        self._picture: Picture | None = None
        self._busy = False
        self._thread = threading.Thread(target=self._wait_for_pictures, name="camera-pipe", daemon=True)
        self._thread.start()

    def expose(self, row: Row, T_world_camera: Array) -> bool:
        """Ask for a picture; the row itself crosses only when it has changed."""
        if self._busy:
            return False
        self._busy = True
        self._requests.put((row, T_world_camera))
        return True

    def ready(self) -> Picture | None:
        """The picture asked for, when it is there."""
        picture = self._picture
        if picture is not None:
            self._picture, self._busy = None, False
        return picture

    def close(self) -> None:
        """End the process."""
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
            args=(theirs, self._config, self._seed, self._role),
            name="camera-renderer",
            daemon=True,
        )
        process.start()
        theirs.close()
        return process, ours

    def _wait_for_pictures(self) -> None:
        while (request := self._requests.get()) is not None:
            self._picture = self._render(*request)

    def _render(self, row: Row, T_world_camera: Array) -> Picture | None:
        while not self._closing:
            try:
                self._pipe.send((None if row is self._known else row, T_world_camera))
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


def _render_until_closed(pipe: Connection, config: CameraConfig, seed: int, role: Role) -> None:
    take_priority(role)
    photographer, row = InlinePhotographer(config, seed), Row(())
    try:
        while True:
            changed, T_world_camera = pipe.recv()
            row = row if changed is None else changed
            photographer.expose(row, T_world_camera)
            pipe.send(photographer.ready())
    except (EOFError, BrokenPipeError, KeyboardInterrupt):
        return
