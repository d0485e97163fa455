from rolling_panda.keeper import Keeper


def test_the_newest_is_on_disk_after_closing(tmp_path):
    keeper = Keeper(tmp_path / "it")
    for number in range(200):
        keeper.keep(str(number).encode())
    keeper.close()
    keeper.close()
    assert (tmp_path / "it").read_bytes() == b"199"
    assert keeper.failure == ""


def test_a_disk_that_refuses_is_told_in_words(tmp_path):
    keeper = Keeper(tmp_path / "gone" / "it")
    keeper.keep(b"x")
    keeper.close()
    assert "cannot be written" in keeper.failure
