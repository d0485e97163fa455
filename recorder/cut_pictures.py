"""The pictures of a recording's cuts, for the report: a page that jumps in a recording does not pass every close-up."""

from pathlib import Path

import msgspec

from recorder.recording import Recording
from rolling_panda import topics
from rolling_panda.cut_pictures import CloseUps, CutCloseUp, PictureFolder, box_of, cropped
from rolling_panda.messages.perception import Localisation
from rolling_panda.messages.robot import CameraFrame
from rolling_panda.messages.types import Vector3
from rolling_panda.model.robot import RobotModel

#: The largest number of pictures of a recording.
_MOST = 2000
#: In the JSON of a frame that is no close-up.
_NO_POINT = b'"point_id":""'


class _Entry(msgspec.Struct, frozen=True):
    point_id: str
    state: str
    cut_id: str = ""
    accepted_position: Vector3 | None = None


class _Queue(msgspec.Struct, frozen=True):
    """The fields of a `ControllerState` that tell of cuts: to decode all of thousands takes long."""

    queue: tuple[_Entry, ...]


def keep_pictures(recording: Recording, folder: Path) -> int:
    """Write the pictures of all cuts of a recording; returns their number. What cannot be written is left out.

    Raises:
        InputError: A message does not fit this version's type.
    """
    pictures, model, count = PictureFolder(folder, _MOST), RobotModel(), 0
    for close_up in _close_ups(recording):
        box = box_of(close_up, model)
        if box is not None:
            try:
                pictures.keep(close_up.cut_id, close_up.moment, cropped(close_up.frame.color_jpeg, box))
            except OSError:
                continue
            count += 1
    return count


def _close_ups(recording: Recording) -> list[CutCloseUp]:
    """The close-ups of cuts; of several after a cut the last."""
    found: dict[tuple[str, str], CutCloseUp] = {}
    close_ups = CloseUps()
    queue: tuple[_Entry, ...] = ()
    for each in recording.messages:
        new: list[CutCloseUp | None] = []
        if each.topic is topics.CONTROLLER:
            before, queue = queue, each.decoded(_Queue).queue
            if queue != before:
                new += close_ups.update(queue)
        elif each.topic is topics.LOCALISATION:
            told = each.message()
            if isinstance(told, Localisation):
                close_ups.where = close_ups.where.after(told)
        elif each.topic is topics.CAMERA and _NO_POINT not in each.data:
            frame = each.message()
            if isinstance(frame, CameraFrame) and frame.point_id:
                new.append(close_ups.add(frame))
        found |= {(one.cut_id, one.moment): one for one in new if one is not None}
    return list(found.values())
