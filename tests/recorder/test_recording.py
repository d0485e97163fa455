"""What a recording holds, as the `mcap` library's own reader and Foxglove's rules see it."""

import base64
import json
import math
from pathlib import Path
from typing import Any

import msgspec
import numpy as np
import pinocchio as pin
import pytest
from mcap.reader import make_reader
from mcap.writer import Writer

from recorder.foxglove import CHANNELS
from recorder.recording import RecordingWriter, read_recording, schema_of
from rolling_panda import messages as m
from rolling_panda import topics
from rolling_panda.errors import InputError
from rolling_panda.messages.robot import CameraFrame, Intrinsics
from tests.support.fake_wire import located

BEGAN = 1_800_000_000_000_000_000
FRAME = CameraFrame(
    header=m.Header(1.0, "camera"),
    sequence=1,
    intrinsics=Intrinsics(4, 4, 1.0, 1.0, 2.0, 2.0),
    base=m.PlanarPose(),
    position=(0.0,) * 9,
    color_jpeg=b"\xff\xd8 a picture",
    depth_zlib=b"d",
    depth_unit=0.001,
)


def odometry(k: int) -> m.Odometry:
    pose = m.PlanarPose(0.1 * k, 0.0, math.pi / 2)
    return m.Odometry(header=m.Header(k * 0.02, "odom"), sequence=k, pose=pose, linear=0.3, angular=0.0)


def fill(writer: RecordingWriter, seconds: int) -> None:
    for k in range(50 * seconds):
        writer.write(topics.ODOMETRY, odometry(k), BEGAN + k * 20_000_000)
        if k % 25 == 0:
            writer.write(topics.CAMERA, FRAME, BEGAN + k * 20_000_000)
            writer.flush()


def test_the_librarys_reader_finds_every_message_with_its_schema(tmp_path: Path) -> None:
    writer = RecordingWriter(tmp_path / "a.mcap", "rp1")
    fill(writer, 4)
    writer.close()
    with (tmp_path / "a.mcap").open("rb") as file:
        reader = make_reader(file)
        summary = reader.get_summary()
        assert summary is not None and summary.statistics is not None
        counts = {summary.channels[i].topic: n for i, n in summary.statistics.channel_message_counts.items()}
        rows = list(reader.iter_messages())
    assert counts == {"/state/odometry": 200, "/camera/frame": 8, "/foxglove/tf": 200, "/foxglove/camera": 8}
    assert {topic.name for topic in topics.TOPICS} == {
        channel.topic[1:] for channel in summary.channels.values() if not channel.topic.startswith("/foxglove")
    }
    names = {channel.topic: schema.name for schema, channel, _ in rows if schema is not None}
    assert names["/foxglove/tf"] == "foxglove.FrameTransform"
    assert names["/foxglove/camera"] == "foxglove.CompressedImage"
    shown = {channel.topic: json.loads(message.data) for _, channel, message in rows}
    assert base64.b64decode(shown["/foxglove/camera"]["data"]) == FRAME.color_jpeg
    transform = shown["/foxglove/tf"]
    assert transform["translation"]["x"] == pytest.approx(19.9)
    assert transform["rotation"]["z"] == pytest.approx(math.sqrt(0.5))
    assert transform["timestamp"] == {"sec": 1_800_000_003, "nsec": 980_000_000}


def kinds(schema: dict[str, Any]) -> set[str]:
    inner = [*schema.get("properties", {}).values(), *([schema["items"]] if "items" in schema else [])]
    return {schema["type"]}.union(*(kinds(one) for one in inner))


@pytest.mark.parametrize(
    "kind", dict.fromkeys(topic.message for topic in topics.TOPICS), ids=lambda kind: str(kind.__name__)
)
def test_every_schema_is_one_that_a_viewer_reads(kind: type[m.Message]) -> None:
    """Foxglove takes an object of plain fields, arrays of one type, and no references."""
    schema = schema_of(kind)
    assert schema["type"] == "object"
    assert "$ref" not in json.dumps(schema) and "anyOf" not in json.dumps(schema)
    assert kinds(schema) <= {"object", "array", "string", "number", "integer", "boolean"}
    assert set(schema["properties"]) == {"type", *kind.__struct_fields__}


def test_what_views_show_is_what_their_schema_says() -> None:
    drift = located(pin.SE3(np.eye(3), np.array([0.1, 0.0, 0.0])))
    for message in (odometry(3), drift, FRAME):
        channel = CHANNELS[type(message)]
        shown = channel.convert(message, BEGAN)
        assert shown is not None and set(shown) == set(channel.schema["properties"])


def test_a_recording_is_read_back_as_it_was(tmp_path: Path) -> None:
    writer = RecordingWriter(tmp_path / "a.mcap", "rp1")
    fill(writer, 2)
    writer.close()
    recording = read_recording(tmp_path / "a.mcap")
    assert recording.complete
    assert recording.duration_s == pytest.approx(1.98)
    got = [each.message() for each in recording.messages if each.topic is topics.ODOMETRY]
    assert got == [odometry(k) for k in range(100)]
    assert [each.message() for each in recording.messages if each.topic is topics.CAMERA][0] == FRAME


def test_of_a_file_that_was_cut_off_all_that_was_flushed_is_read(tmp_path: Path) -> None:
    writer = RecordingWriter(tmp_path / "a.mcap", "rp1")
    fill(writer, 4)
    torn = tmp_path / "torn.mcap"
    torn.write_bytes((tmp_path / "a.mcap").read_bytes()[:-7])
    writer.close()
    recording = read_recording(torn)
    assert not recording.complete
    # Everything but the last half second, which was never flushed, and what the cut has taken.
    assert recording.duration_s >= 2.9


def test_a_file_that_exists_stays_and_what_is_no_recording_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "notes.mcap"
    path.write_text("not to be lost")
    with pytest.raises(InputError, match="exists already"):
        RecordingWriter(path, "rp1")
    assert path.read_text() == "not to be lost"
    with pytest.raises(InputError, match="no recording"):
        read_recording(path)
    with pytest.raises(InputError, match="cannot read"):
        read_recording(tmp_path / "nowhere.mcap")


def test_a_recording_of_another_version_of_the_wire_is_refused_in_words(tmp_path: Path) -> None:
    writer = RecordingWriter(tmp_path / "a.mcap", "rp1")
    writer.write(topics.ODOMETRY, odometry(1), BEGAN)
    writer.close()
    assert read_recording(tmp_path / "a.mcap").messages[0].message() == odometry(1)
    old = tmp_path / "old.mcap"
    with old.open("wb") as file:
        version_1 = Writer(file)
        version_1.start()
        schema = version_1.register_schema("rolling_panda.Odometry", "jsonschema", b"{}")
        channel = version_1.register_channel("/state/odometry", "json", schema, {"robot_id": "rp1", "about": "base"})
        version_1.add_message(channel, BEGAN, msgspec.json.encode(odometry(1)), BEGAN)
        version_1.finish()
    with pytest.raises(InputError, match="version 1 of the wire.*replays version 3 only.*Replay it with the version"):
        read_recording(old)
