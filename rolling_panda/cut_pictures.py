"""Pictures of cuts: which close-ups show a cut before and after it, their crops, and the folder that keeps them."""

import io
import shutil
from collections import OrderedDict
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Final, Literal, Protocol

import numpy as np
from PIL import Image

from rolling_panda.messages.robot import CameraFrame
from rolling_panda.messages.types import Vector3
from rolling_panda.model.map_frame import MapFrame
from rolling_panda.model.robot import RobotModel

Moment = Literal["before", "after"]
#: States of a point from the order to cut on.
_CUT: Final = ("CUTTING", "DONE", "FAILED_NOT_CUT", "UNKNOWN")
#: Points whose newest close-up is in memory.
_MOST_POINTS = 50
#: A place nearer than this to the camera is not shown (m).
_NEAREST: Final = 0.05
#: Width of a picture at the cut (m), its least and largest width in the camera image (px), and height over width.
_WIDTH, _LEAST, _LARGEST, _RATIO = 0.24, 160, 480, 0.75
_QUALITY = 85
#: The ledger needs the last of the disk's space more than pictures do (bytes).
_SPARE: Final = 256 << 20


class Entry(Protocol):
    """The fields of a `QueueEntry` that tell of cuts."""

    @property
    def point_id(self) -> str:
        """The point."""

    @property
    def state(self) -> str:
        """State of the point."""

    @property
    def cut_id(self) -> str:
        """Its last cut; empty before the first."""

    @property
    def accepted_position(self) -> Vector3 | None:
        """Position at acceptance, in map (m)."""


@dataclass(frozen=True)
class CutCloseUp:
    """A close-up of a cut, where in map the cut is (m), and where odom was in map."""

    cut_id: str
    moment: Moment
    frame: CameraFrame
    position: Vector3
    where: MapFrame = MapFrame()


class CloseUps:
    """Assigns close-ups to cuts: the last one before the order to cut, and those after it. No clock, no files."""

    def __init__(self) -> None:
        """Nothing was seen."""
        #: Where odom is in map when a close-up is added.
        self.where = MapFrame()
        self._newest: OrderedDict[str, tuple[CameraFrame, MapFrame]] = OrderedDict()
        self._cut_ids: dict[str, str] = {}
        self._cut: dict[str, Entry] = {}

    def add(self, frame: CameraFrame) -> CutCloseUp | None:
        """Take in a close-up. Returns it if it shows a cut after the order to cut; a newer one takes its place."""
        entry = self._cut.get(frame.point_id)
        if entry is not None and entry.accepted_position is not None:
            return CutCloseUp(entry.cut_id, "after", frame, entry.accepted_position, self.where)
        self._newest[frame.point_id] = frame, self.where
        self._newest.move_to_end(frame.point_id)
        if len(self._newest) > _MOST_POINTS:
            self._newest.popitem(last=False)
        return None

    def update(self, queue: Iterable[Entry]) -> list[CutCloseUp]:
        """Take in the queue, after the close-ups up to then. Returns the close-ups before cuts that have begun."""
        begun = []
        self._cut = {entry.point_id: entry for entry in queue if entry.cut_id and entry.state in _CUT}
        for point_id, entry in self._cut.items():
            if self._cut_ids.get(point_id) != entry.cut_id:
                self._cut_ids[point_id] = entry.cut_id
                newest = self._newest.pop(point_id, None)
                if newest is not None and entry.accepted_position is not None:
                    frame, where = newest
                    begun.append(CutCloseUp(entry.cut_id, "before", frame, entry.accepted_position, where))
        return begun


Box = tuple[int, int, int, int]


def box_of(close_up: CutCloseUp, model: RobotModel) -> Box | None:
    """Left, top, right and bottom of a cut's picture in the frame (px); None where the frame does not show the place.

    The cut is in the middle, so that a part of the picture may lie outside the frame.
    """
    frame, k = close_up.frame, model.lens(close_up.frame.intrinsics)
    camera = close_up.where.camera(frame, model)
    x, y, z = (np.array(close_up.position) - camera.translation) @ camera.rotation
    if z < _NEAREST:
        return None
    u, v = k.fx * x / z + k.cx, k.fy * y / z + k.cy
    if not (0 <= u < k.width and 0 <= v < k.height):
        return None
    width = round(min(max(k.fx * _WIDTH / z, _LEAST), _LARGEST))
    height = round(_RATIO * width)
    left, top = round(u - width / 2), round(v - height / 2)
    return left, top, left + width, top + height


def cropped(jpeg: bytes, box: Box) -> bytes:
    """A part of an image, as JPEG; black outside the image.

    Raises:
        OSError: The image is corrupt.
    """
    out = io.BytesIO()
    with Image.open(io.BytesIO(jpeg)) as image:
        image.convert("RGB").crop(box).save(out, "JPEG", quality=_QUALITY)
    return out.getvalue()


class PictureFolder:
    """Pictures of cuts on disk, a file each; the oldest give way to new ones."""

    def __init__(self, folder: Path, most: int) -> None:
        """Keep up to `most` pictures in `folder`, which is made with the first."""
        self.folder, self._most = folder, most

    def keep(self, cut_id: str, moment: Moment, jpeg: bytes) -> None:
        """Write a picture; an interruption leaves the old one or the new.

        Raises:
            OSError: It is not kept: the disk is full, or the folder cannot be written.
        """
        self.folder.mkdir(mode=0o700, parents=True, exist_ok=True)
        free = shutil.disk_usage(self.folder).free
        if free < _SPARE:
            raise OSError(f"{free >> 20} MB are free on the disk of {self.folder}, and {_SPARE >> 20} MB stay so")
        # Not flushed to the disk: the ledger's flushes must not wait for it.
        beside = self.folder / f".{cut_id}.{moment}.new"
        try:
            beside.write_bytes(jpeg)
            beside.replace(self._path(cut_id, moment))
        except OSError:
            beside.unlink(missing_ok=True)
            raise
        kept = sorted(self.folder.glob("*.jpg"), key=lambda each: each.stat().st_mtime)
        for oldest in kept[: -self._most]:
            oldest.unlink(missing_ok=True)

    def read(self, cut_id: str, moment: Moment) -> bytes | None:
        """The picture; None where none was kept.

        Raises:
            OSError: The file is damaged, or cannot be read.
        """
        path = self._path(cut_id, moment)
        try:
            jpeg = path.read_bytes()
        except FileNotFoundError:
            return None
        with Image.open(io.BytesIO(jpeg)) as image:
            # Decodes all of it: a file may be cut short.
            image.load()
        return jpeg

    def _path(self, cut_id: str, moment: Moment) -> Path:
        return self.folder / f"{cut_id}.{moment}.jpg"
