"""The pictures of a recording's cuts."""

from pathlib import Path

from recorder.cut_pictures import keep_pictures
from recorder.recording import Recording
from rolling_panda import topics
from rolling_panda.cut_pictures import PictureFolder
from tests.recorder.test_player import joints, recorded
from tests.server.test_cut_pictures import at, close_up


def worked() -> Recording:
    """A recording of one cut."""
    messages = (
        recorded(topics.CONTROLLER, 0.0, at("ACCEPTED")),
        recorded(topics.CAMERA, 1.0, close_up(1)),
        recorded(topics.CONTROLLER, 2.0, at("CUTTING", "c1")),
        recorded(topics.CAMERA, 3.0, close_up(2)),
        recorded(topics.CONTROLLER, 4.0, at("DONE", "c1")),
        recorded(topics.CAMERA, 5.0, close_up(3)),
    )
    return Recording((joints(0), *messages), True)


def test_every_cut_has_its_pictures_before_it_is_played(tmp_path: Path) -> None:
    assert keep_pictures(worked(), tmp_path) == 2
    folder = PictureFolder(tmp_path, 10)
    assert folder.read("c1", "before") and folder.read("c1", "after")


def test_a_recording_without_cuts_has_none(tmp_path: Path) -> None:
    assert keep_pictures(Recording((joints(0), joints(1)), True), tmp_path / "pictures") == 0
    assert not (tmp_path / "pictures").exists()


def test_what_cannot_be_written_is_left_out(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("no folder")
    assert keep_pictures(worked(), tmp_path / "file" / "pictures") == 0
