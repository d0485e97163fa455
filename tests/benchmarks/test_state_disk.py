"""A child's state folder is made read-only while it works with it, and nothing else is."""

import subprocess
import sys

import pytest

from benchmarks.faults.state_disk import StateDisk
from rolling_panda.runtime.launch import child_environment

_WRITES = """
import os, sqlite3, sys
from pathlib import Path
from rolling_panda.runtime.state_folder import replace_durably
state, beside = Path(sys.argv[1]), Path(sys.argv[2])
state.mkdir()
kept = os.open(state / "kept", os.O_WRONLY | os.O_CREAT | os.O_APPEND)
database = sqlite3.connect(state / "rows.sqlite", isolation_level=None)
database.execute("PRAGMA journal_mode = WAL")
database.execute("CREATE TABLE rows (number)")
def tried(work):
    try:
        work()
        return "done"
    except (OSError, sqlite3.Error) as error:
        return type(error).__name__
for _ in sys.stdin:
    print(
        tried(lambda: os.write(kept, b"x")),
        tried(lambda: replace_durably(state / "whole", b"x")),
        tried(lambda: database.execute("INSERT INTO rows VALUES (1)")),
        tried(lambda: beside.write_bytes(b"x")),
        database.execute("SELECT count(*) FROM rows").fetchone()[0],
        flush=True,
    )
"""


@pytest.mark.processes
def test_a_read_only_folder_takes_nothing_through_open_files_either_and_is_writable_again(tmp_path):
    disk = StateDisk(tmp_path)
    child = subprocess.Popen(
        [sys.executable, "-c", _WRITES, str(disk.folder), str(tmp_path / "beside")],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
        env=child_environment() | disk.environment,
    )

    def ask():
        child.stdin.write("\n")
        child.stdin.flush()
        return child.stdout.readline().split()

    try:
        assert ask() == ["done", "done", "done", "done", "1"]
        disk.set_read_only(True)
        assert ask() == ["OSError", "OSError", "OperationalError", "done", "1"]
        disk.set_read_only(False)
        assert ask() == ["done", "done", "done", "done", "2"]
    finally:
        child.communicate()
