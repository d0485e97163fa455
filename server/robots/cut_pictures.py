"""Keeps a picture of every cut before and after it, from the close-ups of the work."""

import asyncio
from collections import deque
from collections.abc import Callable

from rolling_panda import messages as m
from rolling_panda import reasons
from rolling_panda.cut_pictures import Box, CloseUps, CutCloseUp, Moment, PictureFolder, box_of, cropped
from rolling_panda.messages.robot import CameraFrame
from rolling_panda.model.map_frame import MapFrame
from rolling_panda.model.robot import RobotModel

#: Close-ups that wait for the next `step`.
_MOST_WAITING = 20


class CutPictures:
    """The pictures of one robot's cuts. Nothing waits for them, and their failure stops nothing: it is logged."""

    def __init__(self, folder: PictureFolder | None, model: RobotModel, note: Callable[[m.Reason], None]) -> None:
        """Keep the pictures in `folder`; None keeps none. `note` writes a line of the log."""
        self._folder, self._model, self._note = folder, model, note
        self._frames: deque[CameraFrame] = deque(maxlen=_MOST_WAITING)
        self._close_ups = CloseUps()
        self._failed = False
        self._damaged: set[tuple[str, Moment]] = set()

    def add(self, frame: CameraFrame) -> None:
        """Take in a close-up; from any thread."""
        self._frames.append(frame)

    async def step(self, queue: tuple[m.QueueEntry, ...], where: MapFrame) -> None:
        """Write the pictures of the close-ups since the last step.

        Args:
            queue: The controller's.
            where: Where odom is in map.
        """
        self._close_ups.where = where
        found: list[CutCloseUp | None] = []
        while self._frames:
            found.append(self._close_ups.add(self._frames.popleft()))
        found += self._close_ups.update(queue)
        for close_up in found:
            box = None if close_up is None else box_of(close_up, self._model)
            if close_up is not None and box is not None and self._folder is not None:
                await self._keep(self._folder, close_up, box)

    async def read(self, cut_id: str, moment: Moment) -> bytes | None:
        """The picture; None where there is none that can be shown."""
        if self._folder is None:
            return None
        try:
            return await asyncio.to_thread(self._folder.read, cut_id, moment)
        except OSError as error:
            # A report that is open asks for it again and again.
            if (cut_id, moment) not in self._damaged:
                self._damaged.add((cut_id, moment))
                self._note(reasons.cut_picture_damaged(cut_id, moment, str(error)))
            return None

    async def _keep(self, folder: PictureFolder, close_up: CutCloseUp, box: Box) -> None:
        try:
            jpeg = await asyncio.to_thread(cropped, close_up.frame.color_jpeg, box)
            await asyncio.to_thread(folder.keep, close_up.cut_id, close_up.moment, jpeg)
        except OSError as error:
            # A full disk fails every picture: it is logged once.
            if not self._failed:
                self._note(reasons.cut_picture_lost(str(error)))
            self._failed = True
        else:
            self._failed = False
