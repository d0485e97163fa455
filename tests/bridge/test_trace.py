from pathlib import Path

import numpy as np
import pytest

from bridge.sim.robot.trace import TraceWriter, read
from rolling_panda.errors import ConfigError, InputError


def write_steps(trace: TraceWriter, count: int, moving_until: int = 0) -> None:
    for i in range(count):
        row = trace.row
        row["time"] = row["clock"] = i * 1e-3
        row["velocity"] = 0.0
        row["base_velocity"] = (0.3 if i < moving_until else 0.0, 0.0, 0.0)
        row["sequence"] = i
        trace.commit()


def test_rows_and_events_come_back_in_order(tmp_path: Path) -> None:
    with TraceWriter(tmp_path / "t") as trace:
        write_steps(trace, 130)
        trace.event({"event": "cut", "cut_id": "c1"})
        write_steps(trace, 20)
    loaded = read(tmp_path / "t")
    assert len(loaded.rows) == 150
    assert loaded.rows["sequence"][129] == 129
    assert loaded.events == ({"event": "cut", "cut_id": "c1"},)


def test_a_killed_writer_loses_at_most_a_block_and_a_torn_one_is_left_out(tmp_path: Path) -> None:
    path = tmp_path / "t"
    trace = TraceWriter(path)
    write_steps(trace, 250)
    assert len(read(path).rows) == 200
    whole = path.read_bytes()
    path.write_bytes(whole[:-7])
    assert len(read(path).rows) == 100
    trace.close()


def test_stillness_is_judged_from_true_velocities(tmp_path: Path) -> None:
    with TraceWriter(tmp_path / "t") as trace:
        write_steps(trace, 400, moving_until=300)
    loaded = read(tmp_path / "t")
    assert loaded.stopping_time(0.1) == pytest.approx(0.2)
    assert loaded.stopping_time(0.35) == 0.0
    assert loaded.stopping_time(9.0) == float("inf")


def test_another_file_is_refused(tmp_path: Path) -> None:
    (tmp_path / "t").write_bytes(b"not a trace, but long enough to look at")
    with pytest.raises(InputError, match="not a trace"):
        read(tmp_path / "t")
    (tmp_path / "n").write_bytes(np.arange(3).tobytes())
    with pytest.raises(InputError):
        read(tmp_path / "n")


def test_a_place_that_cannot_be_written_is_one_clear_error(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match="cannot write the trace"):
        TraceWriter(tmp_path / "missing" / "t")
