from rolling_panda import reasons
from rolling_panda.runtime.latest_file import LatestFileWriter
from tests.support.waiting import until


def test_the_newest_is_on_disk_after_closing(tmp_path):
    keeper = LatestFileWriter(tmp_path / "it")
    for number in range(200):
        keeper.keep(str(number).encode())
    keeper.close()
    keeper.close()
    assert (tmp_path / "it").read_bytes() == b"199"
    assert keeper.failure is None


def test_a_disk_that_refuses_is_told_in_words(tmp_path):
    keeper = LatestFileWriter(tmp_path / "gone" / "it")
    keeper.keep(b"x")
    keeper.close()
    assert keeper.failure == reasons.file_unwritable(str(tmp_path / "gone" / "it"), "No such file or directory")


def test_what_the_disk_refuses_is_written_once_it_takes_it(tmp_path):
    keeper = LatestFileWriter(tmp_path / "gone" / "it")
    keeper.keep(b"stopped")
    until(lambda: keeper.failure)
    (tmp_path / "gone").mkdir()
    until((tmp_path / "gone" / "it").exists)
    assert (tmp_path / "gone" / "it").read_bytes() == b"stopped"
    until(lambda: keeper.kept and keeper.failure is None)
    keeper.close()
