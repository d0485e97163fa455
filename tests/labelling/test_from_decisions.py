"""Labels from a ledger and a recording: the pixels that decisions tell of, and no others."""

import dataclasses
import io
import json
import zlib
from datetime import UTC, datetime
from pathlib import Path

import msgspec
import numpy as np
import pytest
from PIL import Image

from controller.ledger.journal import TicketRow
from controller.ledger.store import Entry, Ledger
from labelling.__main__ import main
from labelling.decisions import read_decisions
from labelling.from_decisions import POINTS, write_decisions
from perception.dataset.dataset import FAR, UNLABELLED, read_dataset
from perception.segmentation.frame import CANE, decode_frame
from perception.segmentation.segmenter import LabelImageSegmenter
from recorder.recording import RecordingWriter, read_recording
from rolling_panda import messages as m
from rolling_panda import reasons, topics
from rolling_panda.errors import InputError
from rolling_panda.messages.robot import CameraFrame, Intrinsics
from rolling_panda.model.robot import RobotModel
from tests.support.points import point

WIDTH, HEIGHT, DEPTH = 192, 128, 0.8
BEGAN = 1_800_000_000.0
#: Columns of two canes in every picture.
LEFT, RIGHT = slice(50, 54), slice(120, 124)
RULE = m.PruningRule(nodes_kept=3)


def frame(sequence: int, depth: float = DEPTH, **changes) -> CameraFrame:
    """Two upright canes, labelled as a segmenter would."""
    classes = np.zeros((HEIGHT, WIDTH), np.uint8)
    classes[:, LEFT] = classes[:, RIGHT] = CANE
    color = np.random.default_rng(sequence).integers(60, 200, (HEIGHT, WIDTH, 3), dtype=np.uint8)
    jpeg = io.BytesIO()
    Image.fromarray(color).save(jpeg, "JPEG")
    usual = CameraFrame(
        header=m.Header(1.0, "camera"),
        sequence=sequence,
        intrinsics=Intrinsics(WIDTH, HEIGHT, 200.0, 200.0, 95.5, 63.5),
        base=m.PlanarPose(0.3, 0.0, 0.1),
        position=(0.0, 0.0, 0.0, -0.3, 0.0, -2.2, 1.7, 1.4, 0.0),
        color_jpeg=jpeg.getvalue(),
        depth_zlib=zlib.compress(np.full((HEIGHT, WIDTH), round(1000 * depth), "<u2").tobytes()),
        depth_unit=0.001,
        labels_zlib=zlib.compress(classes.tobytes()),
    )
    return msgspec.structs.replace(usual, **changes)


VIEW = decode_frame(frame(1), RobotModel())


def at(name: str, column: float, row: float = 60.0, **changes) -> m.PruningPoint:
    """A point that is seen at this pixel."""
    x, y, z = (float(value) for value in VIEW.points([row], [column], np.array([DEPTH]))[0])
    return point(name, (x, y, z), **changes)


def row(after_s: float, of: m.PruningPoint, state: str, why: m.Reason | None = None, user: str = "Ada") -> Entry:
    ticket = TicketRow(point=of, state=state, reason=why, user=user, accepted=of if state == "ACCEPTED" else None)
    time = datetime.fromtimestamp(BEGAN + after_s, UTC).isoformat(timespec="microseconds")
    return Entry(time, "ticket", of.point_id, msgspec.json.encode(ticket).decode())


def ledger(folder: Path, *rows: Entry) -> Path:
    folder.mkdir()
    with Ledger(folder) as open_ledger:
        open_ledger.append(rows)
    return folder


def recording(path: Path, *frames: tuple[float, CameraFrame]) -> Path:
    """Perception tells of its rule and network in the beginning."""
    writer = RecordingWriter(path, "r1")
    of = {topic.message: topic for topic in topics.TOPICS}
    told = m.PruningPoints(header=m.Header(), segmenter="vine ab12cd34ef56", frames=1, points=(), rule=RULE)
    writer.write(of[m.PruningPoints], told, int(1e9 * (BEGAN - 1)))
    for after_s, each in frames:
        writer.write(of[CameraFrame], each, int(1e9 * (BEGAN + after_s)))
    writer.close()
    return path


def made(tmp_path, rows, frames=()):
    decisions, taken_back = read_decisions(ledger(tmp_path / "state", *rows))
    recorded = read_recording(recording(tmp_path / "r.mcap", *(frames or [(0.0, frame(1))])))
    outcome = write_decisions(decisions, recorded, tmp_path / "out", LabelImageSegmenter(), 5.0, "test")
    return outcome, taken_back, read_dataset(tmp_path / "out")


def lines(dataset) -> list[dict]:
    return [json.loads(line) for line in (dataset.folder / POINTS).read_text(encoding="utf-8").splitlines()]


def proposed(of: m.PruningPoint) -> Entry:
    return row(-2.0, of, "PROPOSED", user="")


def test_an_accepted_point_labels_its_cane_near_it_and_nothing_else(tmp_path):
    cut = at("p1", 52.0)
    _, _, dataset = made(tmp_path, [proposed(cut), row(0.2, cut, "ACCEPTED")])
    (name,) = (entry.name for entry in dataset.manifest.pictures)
    labels = dataset.load(name)[1]
    assert (labels[55:66, LEFT] == CANE).all()
    # 0.04 m are 10 px at this distance.
    rows, cols = np.nonzero(labels != UNLABELLED)
    assert cols.min() == 50 and cols.max() == 53 and rows.min() >= 49 and rows.max() <= 71
    (line,) = lines(dataset)
    assert line["picture"] == name and line["pixel"] == [52.0, 60.0] and line["decision"] == "accepted"
    assert line["model"] == "vine ab12cd34ef56" and line["rule"]["nodes_kept"] == 3 and line["labelled"] == len(rows)
    assert line["at"] == "2027-01-15T08:00:00.200+00:00" and line["picture_later_s"] == -0.2


def test_only_a_rejection_as_no_cane_labels_background(tmp_path):
    no_cane, elsewhere = at("p1", 52.0), at("p2", 122.0)
    rows = [
        row(0.0, no_cane, "REJECTED", reasons.said("Not a cane, a tendril")),
        row(0.1, elsewhere, "REJECTED", reasons.said("too near a wire")),
    ]
    outcome, _, dataset = made(tmp_path, rows)
    labels = dataset.load(dataset.manifest.pictures[0].name)[1]
    assert (labels[55:66, LEFT] == FAR).all() and (labels[:, RIGHT] == UNLABELLED).all()
    assert [each.decision for each in outcome.lines] == ["rejected", "rejected"]
    assert [line["reason"] for line in lines(dataset)] == ["Not a cane, a tendril", "too near a wire"]


def test_by_hand_moved_inspected_and_cut_are_told_apart_and_what_was_taken_back_is_left_out(tmp_path):
    hand, moved, back, seen = (
        at("p1", 52.0, kind="by hand"),
        at("p2", 122.0),
        at("p3", 52.0, 90.0),
        at("p4", 122.0, 90.0),
    )
    shifted = at("p2", 122.0, 40.0, kind="by hand", revision=2)
    rows = [
        row(0.0, hand, "PROPOSED", user=""),
        proposed(moved),
        row(0.1, shifted, "PROPOSED", user=""),
        row(0.2, shifted, "ACCEPTED"),
        row(0.3, shifted, "DONE"),
        row(0.4, back, "ACCEPTED"),
        row(0.5, back, "PROPOSED"),
        row(0.6, seen, "ACCEPTED"),
        row(0.7, seen, "UNKNOWN", reasons.said("unsure")),
        row(0.8, seen, "FAILED_NOT_CUT", reasons.inspected("Ada", "it stands")),
    ]
    outcome, taken_back, _ = made(tmp_path, rows)
    assert [(each.point_id, each.decision) for each in outcome.lines] == [
        ("p1", "placed by hand"),
        ("p2", "moved"),
        ("p2", "accepted"),
        ("p2", "cut"),
        ("p4", "accepted"),
        ("p4", "stood"),
    ]
    assert taken_back == 1


def test_a_cut_that_was_called_wrong_is_told_with_its_network_and_not_after_it_was_called_right(tmp_path):
    of = at("p1", 52.0)
    before = row(1.0, of, "DONE")

    def judged(after_s, by):
        ticket = TicketRow(point=of, state="DONE", user="Ada", proposer="network a.onnx 1111", wrong_by=by)
        return dataclasses.replace(row(after_s, of, "DONE"), body=msgspec.json.encode(ticket).decode())

    decisions, _ = read_decisions(ledger(tmp_path / "a", before, judged(2.0, "Bo")))
    assert [(each.kind, each.proposer) for each in decisions] == [("cut", ""), ("wrong", "network a.onnx 1111")]
    decisions, taken_back = read_decisions(ledger(tmp_path / "b", before, judged(2.0, "Bo"), judged(3.0, "")))
    assert [each.kind for each in decisions] == ["cut"] and taken_back == 1


def test_the_picture_is_the_nearest_in_time_that_shows_the_point(tmp_path):
    """Something is in front in the next one, a close-up is none, and the last one is too late."""
    frames = [(1.0, frame(1)), (1.9, frame(2, depth=0.4)), (2.0, frame(3, point_id="p1")), (9.0, frame(4))]
    rows = [
        row(2.0, at("p1", 52.0), "ACCEPTED"),
        row(2.1, at("p2", 500.0), "ACCEPTED"),
        row(30.0, at("p3", 52.0), "ACCEPTED"),
        row(8.5, at("p4", 20.0), "ACCEPTED"),
    ]
    outcome, _, dataset = made(tmp_path, rows, frames)
    assert [(each.point_id, each.picture[-5]) for each in outcome.lines] == [("p1", "1"), ("p4", "4")]
    # No cane is near the last point: its line says that it labels nothing.
    assert [each.labelled > 0 for each in outcome.lines] == [True, False]
    assert dict(outcome.unmatched) == {"out of the camera's sight": 1, "at a time without a camera frame": 1}
    assert len(dataset.manifest.pictures) == 2


def test_without_any_picture_or_with_a_changed_ledger_nothing_is_written(tmp_path, capsys):
    state = ledger(tmp_path / "state", row(0.0, at("p1", 52.0), "ACCEPTED"))
    late = recording(tmp_path / "r.mcap", (60.0, frame(1)))
    assert main(["from-decisions", str(state), str(late), str(tmp_path / "out")]) == 1
    assert "1 at a time without a camera frame" in capsys.readouterr().err
    (state / "ledger.head").write_text(f"{7:020} {'0' * 64}\n", encoding="ascii")
    with pytest.raises(InputError, match="not as it was written"):
        read_decisions(state)
    assert not (tmp_path / "out").exists()


def test_the_command_tells_what_it_has_matched_and_what_not(tmp_path, capsys):
    rows = [row(0.0, at("p1", 52.0), "ACCEPTED"), row(0.1, at("p2", 500.0), "ACCEPTED")]
    state, file = ledger(tmp_path / "state", *rows), recording(tmp_path / "r.mcap", (0.0, frame(1)))
    assert main(["from-decisions", str(state / "ledger.sqlite"), str(file), str(tmp_path / "out")]) == 0
    said = capsys.readouterr().out
    assert (
        "2 decisions, and 0 that were taken back" in said and "1 without a picture: out of the camera's sight" in said
    )
    assert f"1 picture and {POINTS}" in said and (tmp_path / "out" / POINTS).exists()
