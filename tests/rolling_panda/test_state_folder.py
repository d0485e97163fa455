"""What is kept lies where the user said, and a file is replaced whole or not at all."""

import os
import stat
from pathlib import Path

import pytest

from rolling_panda.errors import InputError
from rolling_panda.runtime.state_folder import alone, open_state_folder, replace_durably, usual_state_folder


def test_each_robot_has_its_own_folder_for_this_user_alone(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path))
    folder = open_state_folder(usual_state_folder("rp7"))
    assert folder == tmp_path / "rolling-panda" / "rp7"
    assert stat.S_IMODE(folder.stat().st_mode) == 0o700
    assert open_state_folder(folder) == folder


def test_a_relative_state_home_is_ignored(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setenv("XDG_STATE_HOME", "here")
    monkeypatch.setenv("HOME", str(tmp_path))
    assert usual_state_folder("rp1") == tmp_path / ".local" / "state" / "rolling-panda" / "rp1"


def test_a_folder_that_cannot_be_made_is_named(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("in the way")
    with pytest.raises(InputError, match=r"file/rp1.*--state"):
        open_state_folder(tmp_path / "file" / "rp1")


def test_an_interrupted_replacement_leaves_the_old_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "epoch"
    replace_durably(path, b"1")
    replace_durably(path, b"2")
    assert path.read_bytes() == b"2"

    def full(descriptor: int) -> None:
        raise OSError(28, "no space")

    monkeypatch.setattr(os, "fsync", full)
    with pytest.raises(OSError, match="no space"):
        replace_durably(path, b"3")
    assert path.read_bytes() == b"2" and list(tmp_path.iterdir()) == [path]


def test_a_second_bridge_does_not_start_beside_the_first_and_a_later_one_does(tmp_path: Path) -> None:
    with alone(tmp_path, "bridge"):
        with pytest.raises(InputError, match="another bridge works with"), alone(tmp_path, "bridge"):
            pass
        with alone(tmp_path, "controller"):
            pass
    with alone(tmp_path, "bridge"):
        pass
