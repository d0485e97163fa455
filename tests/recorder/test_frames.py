"""Pictures of a recording."""

from pathlib import Path

import msgspec
import pytest

from recorder.frames import main
from recorder.recording import RecordingWriter
from rolling_panda import messages as m
from rolling_panda import topics
from rolling_panda.messages.robot import CameraFrame, Intrinsics

BEGAN = 1_800_000_000_000_000_000
FRAME = CameraFrame(
    header=m.Header(1.0, "camera"),
    sequence=1,
    intrinsics=Intrinsics(4, 4, 1.0, 1.0, 2.0, 2.0),
    base=m.PlanarPose(),
    position=(0.0,) * 9,
    color_jpeg=b"",
    depth_zlib=b"d",
    depth_unit=0.001,
)
TOPIC = next(topic for topic in topics.TOPICS if topic.message is CameraFrame)


@pytest.fixture
def recording(tmp_path) -> Path:
    """Half a second between frames; the third is a close-up, and the camera restarts before the fifth."""
    writer = RecordingWriter(tmp_path / "r.mcap", "r1")
    for k, (sequence, point) in enumerate([(1, ""), (2, ""), (3, "p1"), (4, ""), (1, ""), (2, "")]):
        frame = msgspec.structs.replace(FRAME, sequence=sequence, point_id=point, color_jpeg=f"jpeg {k}".encode())
        writer.write(TOPIC, frame, BEGAN + k * 500_000_000)
    writer.close()
    return tmp_path / "r.mcap"


def pictures(recording, *more) -> list[bytes]:
    out = recording.parent / "out"
    assert main([str(recording), "--out", str(out), *more]) == 0
    return [path.read_bytes() for path in sorted(out.iterdir())]


def test_frames_are_written_as_they_were_sent_in_order_of_time_without_close_ups(recording, capsys):
    assert pictures(recording, "--every", "0") == [b"jpeg 0", b"jpeg 1", b"jpeg 3", b"jpeg 4", b"jpeg 5"]
    assert capsys.readouterr().out.startswith("5 pictures in ")


def test_pictures_have_some_time_between_them(recording):
    """A close-up is no picture, so that the next one is not delayed by it."""
    assert pictures(recording, "--every", "1") == [b"jpeg 0", b"jpeg 3", b"jpeg 5"]


def test_a_killed_recording_gives_what_it_holds(recording, capsys):
    recording.write_bytes(recording.read_bytes()[:-40])
    assert len(pictures(recording, "--every", "0")) == 5
    assert "incomplete" in capsys.readouterr().out


def test_mistakes_are_named_and_nothing_is_written(recording, tmp_path, capsys):
    def refused(*words) -> str:
        before = sorted(tmp_path.rglob("*"))
        assert main([*map(str, words)]) == 1
        assert sorted(tmp_path.rglob("*")) == before
        said = capsys.readouterr().err
        assert said.startswith("rolling-panda frames: ") and said.count("\n") == 1
        return said

    assert "--every -1" in refused(recording, "--out", tmp_path / "out", "--every", "-1")
    assert "exists already" in refused(recording, "--out", tmp_path)
    assert "none.mcap" in refused(tmp_path / "none.mcap", "--out", tmp_path / "out")
    (tmp_path / "vine.jpg").write_bytes(b"jpeg")
    assert "no recording" in refused(tmp_path / "vine.jpg", "--out", tmp_path / "out")
    assert "cannot write" in refused(recording, "--out", tmp_path / "vine.jpg" / "out")
    writer = RecordingWriter(tmp_path / "e.mcap", "r1")
    state = next(topic for topic in topics.TOPICS if topic.message is m.Odometry)
    odometry = m.Odometry(header=m.Header(), sequence=1, pose=m.PlanarPose(), linear=0.0, angular=0.0)
    writer.write(state, odometry, BEGAN)
    writer.close()
    assert "no camera frame" in refused(tmp_path / "e.mcap", "--out", tmp_path / "out")
