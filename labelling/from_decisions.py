"""A dataset from decisions about points: the frame in which each point lies, and what the decision labels in it."""

import json
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, field
from datetime import UTC, datetime
from functools import lru_cache
from pathlib import Path

import msgspec
import numpy as np
from PIL import Image
from scipy.ndimage import label

from labelling.decisions import Decision
from perception.arrays import Array, Labels
from perception.dataset.dataset import (
    FAR,
    MASKS,
    PICTURES,
    UNLABELLED,
    Entry,
    Manifest,
    new_folder,
    write_manifest,
)
from perception.segmentation.frame import CANE, NODE, SPUR, CorruptFrameError, UnusablePictureError, View, decode_frame
from perception.segmentation.segmenter import Segmenter
from recorder.recording import RecordedMessage, Recording
from rolling_panda import reasons
from rolling_panda.errors import InputError
from rolling_panda.messages.perception import PruningPoints
from rolling_panda.messages.robot import CameraFrame
from rolling_panda.model.robot import RobotModel

#: In the dataset: a line of JSON for each decision with a picture.
POINTS = "points.jsonl"
#: The words of a rejection that say that there is no cane, in lower case.
NOT_A_CANE = "not a cane"
#: Wood of a cane that ends in a point, and how far from the point a decision tells of it (m).
_WOOD, _REACH = (CANE, NODE, SPUR), 0.04
#: The point lies on wood that is at most so far from its pixel (px).
_NEAR = 6.0
#: A point is not in a picture's outermost pixels, and its depth differs by at most so much from that of the pixels (m).
_MARGIN, _DEPTH = 8, 0.08
_TELLS_WOOD = ("accepted", "moved", "placed by hand", "cut", "stood", "was cut")
_HELD_OUT = 0.2
#: Decoded frames in memory.
_DECODED = 32


class PointLine(msgspec.Struct, frozen=True):
    """A line of `points.jsonl`.

    Attributes:
        picture: Name of the picture.
        pixel: Column and row of the point (px).
        decision: As in `Decision.kind`.
        reason: Of the decision, in English; empty without one.
        point_id: The point.
        cut: Kind of the cut.
        confidence: That perception told (0…1).
        rule: In force at the decision; None if the recording does not tell.
        model: Segmenter that proposed the point, with the beginning of its hash; empty if neither ledger nor recording
            tells.
        at: Time of the decision (ISO 8601, UTC).
        picture_later_s: Time from the decision to the picture (s); negative if the picture is older.
        labelled: Pixels that the decision has labelled.
    """

    picture: str
    pixel: tuple[float, float]
    decision: str
    reason: str
    point_id: str
    cut: str
    confidence: float
    rule: object
    model: str
    at: str
    picture_later_s: float
    labelled: int


@dataclass
class Outcome:
    """What became of the decisions.

    Attributes:
        lines: Decisions with a picture, in order of time.
        unmatched: Decisions without one, by cause.
    """

    lines: list[PointLine] = field(default_factory=list)
    unmatched: Counter[str] = field(default_factory=Counter)


def write_decisions(
    decisions: Sequence[Decision], recording: Recording, out: Path, segmenter: Segmenter, within_s: float, source: str
) -> Outcome:
    """Write a dataset with `points.jsonl`.

    Args:
        decisions: In order of time.
        recording: Of the same robot at the same time.
        out: New folder; it is written whole or not at all.
        segmenter: Tells which pixels around a point are wood.
        within_s: Greatest time between a decision and its picture (s).
        source: Of the dataset.

    Raises:
        InputError: No decision has a picture, or the folder cannot be written.
    """
    frames = _Frames(recording)
    outcome = Outcome()
    masks: dict[int, Labels] = {}
    wood: dict[int, Labels | None] = {}
    for decision in decisions:
        found = frames.showing(decision, within_s)
        if isinstance(found, str):
            outcome.unmatched[found] += 1
            continue
        index, pixel, depth = found
        view = frames.view(index)
        assert view is not None
        if index not in masks:
            masks[index] = np.full((view.intrinsics.height, view.intrinsics.width), UNLABELLED, np.uint8)
            wood[index] = _wood(segmenter, view)
        proposed = wood[index]
        told = 0
        if proposed is not None:
            near = connected(proposed, pixel, max(_REACH * view.intrinsics.fx / depth, _NEAR))
            told = _tell(masks[index], proposed, near, decision)
        outcome.lines.append(_line(decision, frames, index, pixel, told))
    if not outcome.lines:
        causes = "; ".join(f"{count} {cause}" for cause, count in outcome.unmatched.most_common())
        raise InputError(f"no decision has a picture ({causes or 'the ledger holds no decision'}); nothing is written")
    order = sorted(masks)
    first_held_out = len(order) - max(round(_HELD_OUT * len(order)), int(len(order) > 1))
    with new_folder(out) as folder:
        for each in (PICTURES, MASKS):
            (folder / each).mkdir()
        entries = []
        for number, index in enumerate(order):
            name = frames.name(index)
            (folder / PICTURES / name).write_bytes(frames.jpeg(index))
            Image.fromarray(masks[index]).save(folder / MASKS / f"{Path(name).stem}.png")
            entries.append(Entry(name, "train" if number < first_held_out else "held-out"))
        lines = "".join(f"{json.dumps(msgspec.to_builtins(each), ensure_ascii=False)}\n" for each in outcome.lines)
        (folder / POINTS).write_text(lines, encoding="utf-8")
        write_manifest(folder, Manifest(source, "own", tuple(entries)))
    return outcome


def connected(labels: Labels, pixel: tuple[float, float], reach: float) -> Array | None:
    """Wood that is connected to a pixel, no further from it than `reach` (px); None if it lies on no wood.

    Returns:
        Rows and columns (2×N).
    """
    rows, cols = np.ogrid[: labels.shape[0], : labels.shape[1]]
    away = np.hypot(cols - pixel[0], rows - pixel[1])
    parts, _ = label(np.isin(labels, _WOOD) & (away <= reach), np.ones((3, 3)))
    nearest = np.where(parts > 0, away, np.inf)
    at = np.unravel_index(int(np.argmin(nearest)), nearest.shape)
    if nearest[at] > _NEAR:
        return None
    found: Array = np.array(np.nonzero(parts == parts[at]))
    return found


def _tell(mask: Labels, proposed: Labels, near: Array | None, decision: Decision) -> int:
    """Label in the mask what a decision tells; returns the number of pixels. Later decisions count more."""
    if near is None:
        return 0
    rows, cols = near
    if decision.kind in _TELLS_WOOD:
        mask[rows, cols] = proposed[rows, cols]
    elif decision.reason is not None and NOT_A_CANE in reasons.text_of(decision.reason).lower():
        mask[rows, cols] = FAR
    else:
        return 0
    return len(rows)


def _wood(segmenter: Segmenter, view: View) -> Labels | None:
    try:
        return segmenter.segment(view)
    except (UnusablePictureError, CorruptFrameError):
        return None


def _line(decision: Decision, frames: "_Frames", index: int, pixel: tuple[float, float], told: int) -> PointLine:
    perceived = frames.perceived(decision.at)
    return PointLine(
        picture=frames.name(index),
        pixel=(round(pixel[0], 1), round(pixel[1], 1)),
        decision=decision.kind,
        reason="" if decision.reason is None else reasons.text_of(decision.reason),
        point_id=decision.point.point_id,
        cut=decision.point.kind,
        confidence=decision.point.confidence,
        rule=None if perceived is None or perceived.rule is None else msgspec.to_builtins(perceived.rule),
        model=decision.proposer or ("" if perceived is None else perceived.segmenter),
        at=datetime.fromtimestamp(decision.at, UTC).isoformat(timespec="milliseconds"),
        picture_later_s=round(frames.at(index) - decision.at, 3),
        labelled=told,
    )


class _Frames:
    """Camera frames of a recording; close-ups are left out, as in `rolling-panda frames`."""

    def __init__(self, recording: Recording) -> None:
        self._begins_at = recording.begins_at
        frames = (each for each in recording.messages if each.topic.message is CameraFrame)
        self._frames = [each for each in frames if not _frame(each).point_id]
        self._times = np.array([each.at for each in self._frames])
        self._perceived = [each for each in recording.messages if each.topic.message is PruningPoints]
        self._model = RobotModel()
        self.view = lru_cache(_DECODED)(self._view)

    def showing(self, decision: Decision, within_s: float) -> tuple[int, tuple[float, float], float] | str:
        """The nearest frame in time that shows the point, its pixel there and its depth (m); or why there is none."""
        apart = np.abs(self._times - decision.at)
        near = [int(index) for index in np.argsort(apart, kind="stable") if apart[index] <= within_s]
        if not near:
            return "at a time without a camera frame"
        position = np.array(decision.point.position)
        cause = "out of the camera's sight"
        for index in near:
            view = self.view(index)
            if view is None:
                continue
            column, row, depth = (float(value) for value in view.pixels(position)[0])
            k = view.intrinsics
            if depth <= 0.05 or not (_MARGIN <= column < k.width - _MARGIN and _MARGIN <= row < k.height - _MARGIN):
                continue
            if _depth_agrees(view, column, row, depth):
                return index, (column, row), depth
            cause = "hidden, or of another depth than the picture there"
        return cause

    def name(self, index: int) -> str:
        """Of the picture's file, as `rolling-panda frames` names it."""
        frame = self._frames[index]
        return f"frame_{frame.at - self._begins_at:09.2f}s_{_frame(frame).sequence:06}.jpg"

    def jpeg(self, index: int) -> bytes:
        """The picture."""
        return _frame(self._frames[index]).color_jpeg

    def at(self, index: int) -> float:
        """Unix time (s)."""
        return self._frames[index].at

    def perceived(self, at: float) -> PruningPoints | None:
        """What perception told last before a time; None if it told nothing."""
        before = [each for each in self._perceived if each.at <= at]
        if not before:
            return None
        message = before[-1].message()
        assert isinstance(message, PruningPoints)
        return message

    def _view(self, index: int) -> View | None:
        try:
            view = decode_frame(_frame(self._frames[index]), self._model)
            view.color()
        except CorruptFrameError:
            return None
        return view


def _frame(recorded: RecordedMessage) -> CameraFrame:
    frame = recorded.message()
    assert isinstance(frame, CameraFrame)
    return frame


def _depth_agrees(view: View, column: float, row: float, depth: float) -> bool:
    """Whether a pixel around the point is as far away as the point; true where none has a depth."""
    rows, cols = round(row), round(column)
    around = view.depth[max(0, rows - 3) : rows + 4, max(0, cols - 3) : cols + 4]
    known = around[around > 0.0]
    return not known.size or bool(np.abs(known - depth).min() <= _DEPTH)
