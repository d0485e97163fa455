"""The whole robot on one simulated clock, without sockets: what an operator asks for is what the actuators do."""

import hashlib
import math
from pathlib import Path

import pytest
from msgspec.structs import replace

from benchmarks.control.row import sim_config
from bridge.sim.robot import trace
from bridge.sim.world.config import CALM
from rolling_panda import commands as intents
from rolling_panda import messages as m
from tests.support.worlds.closed_loop import ClosedLoop


def surveyed(seed: int, path: Path) -> ClosedLoop:
    """A loop that has looked at the row long enough, armed."""
    loop = ClosedLoop(seed, path)
    assert loop.run_until(lambda: len(list(loop.queue("PROPOSED"))) >= 3, 15.0), "too few points were detected"
    assert loop.command(intents.Arm(user="test")).ok
    return loop


def accept(loop: ClosedLoop, count: int) -> list[m.QueueEntry]:
    """Accept the first `count` points; their entries."""
    shown = loop.inbox.newest(m.PruningPoints)
    proposed = () if shown is None else shown.message.points
    for point in proposed[:count]:
        assert loop.command(intents.AcceptPoint(user="test", point_id=point.point_id, revision=point.revision)).ok
    loop.run(0.1)
    return list(loop.queue("ACCEPTED"))


def test_nothing_moves_before_start_and_then_the_cane_is_severed_where_it_was_accepted(tmp_path: Path) -> None:
    loop = surveyed(3, tmp_path / "trace")
    (entry,) = accept(loop, 1)
    planned = loop.run_until(lambda: loop.session_plan is not None and loop.session_plan.state == "valid", 4.0)
    assert planned, "nobody planned the accepted cut"
    started = loop.now
    assert loop.command(intents.Start(user="test")).ok
    assert loop.run_until(lambda: any(loop.queue("DONE", "FAILED_NOT_CUT", "UNKNOWN")), 40.0)
    assert [done.point_id for done in loop.queue("DONE")] == [entry.point_id]
    loop.close()
    record = trace.read(tmp_path / "trace")
    before = record.rows[record.rows["clock"] <= started]
    assert len(before) > 100 and abs(before["setpoint"]).max() == 0.0
    (cut,) = record.events
    assert cut["point_id"] == entry.point_id
    assert entry.accepted_position is not None
    assert min(math.dist(piece["point"], entry.accepted_position) for piece in cut["severed"]) < 0.010


@pytest.mark.long
def test_the_stop_halts_a_moving_robot_and_only_a_reset_with_a_start_moves_it_again(tmp_path: Path) -> None:
    loop = surveyed(2, tmp_path / "trace")
    accept(loop, 2)
    loop.command(intents.Start(user="test"))

    def driving() -> bool:
        odometry = loop.inbox.newest(m.Odometry)
        return odometry is not None and abs(odometry.message.linear) > 0.05

    assert loop.run_until(driving, 15.0), "the base never moved"
    pressed = loop.now
    loop.stop("test")
    loop.run(2.0)
    assert loop.state is not None and loop.state.mode == "ESTOP_LATCHED"
    refused = loop.command(intents.Start(user="test"))
    assert not refused.ok and refused.reason.code == "impossible_in_estop"
    assert loop.command(intents.Reset(user="test", role="supervisor", reason="the test goes on")).ok
    loop.run(2.0)
    assert loop.state.mode == "IDLE"
    loop.close()
    record = trace.read(tmp_path / "trace")
    assert record.stopping_time(pressed) < 0.5


@pytest.mark.long
@pytest.mark.parametrize("seed", [5])
def test_the_same_seed_gives_the_same_trace(tmp_path: Path, seed: int) -> None:
    digests = []
    for name in ("first", "second"):
        loop = surveyed(seed, tmp_path / name)
        accept(loop, 1)
        loop.command(intents.Start(user="test"))
        loop.run(2.0)
        loop.close()
        digests.append(hashlib.sha256((tmp_path / name).read_bytes()).hexdigest())
    assert digests[0] == digests[1]


@pytest.mark.long
def test_late_pictures_are_corrected_by_what_a_check_of_the_camera_tells(tmp_path: Path) -> None:
    late = replace(CALM, frame_delay=0.04)
    with ClosedLoop(5300, tmp_path / "trace", sim_config(tmp_path / "row.toml", 2.0, late), segmenter="labels") as loop:

        def check() -> float:
            """Check the camera; the delay that is left (s)."""
            assert loop.command(intents.CheckCamera(user="test")).ok
            assert loop.run_until(lambda: loop.controller.mode != "AUTO", 60.0)
            assert loop.perception.camera.state.time_offset is not None
            return loop.perception.camera.state.time_offset

        loop.run(1.0)
        assert loop.command(intents.Arm(user="test")).ok
        assert check() > 0.025
        loop.run(1.0)
        offer = loop.perception.robot_calibration.timing
        assert offer is not None
        assert not loop.command(intents.UseTiming(user="test", made_at=offer.made_at - 1.0)).ok, (
            "another one than was seen"
        )
        assert loop.command(intents.UseTiming(user="test", made_at=offer.made_at)).ok
        loop.run(1.0)
        told = loop.inbox.newest(m.BridgeState)
        assert told is not None and told.message.timing == offer
        assert abs(check()) < 0.012 and loop.perception.robot_calibration.timing is None
        assert list(loop.queue("PROPOSED"))
