"""The blades close at most once for a cut, whenever the bridge is killed and whatever the disk does."""

import os
import random
import signal
import subprocess
import sys
import threading
import time
from collections import Counter
from pathlib import Path

import pytest

from bridge.core import cut_orders
from bridge.core.cut_orders import FILE, FORGETFUL, CutFile, CutOrders
from rolling_panda import reasons
from rolling_panda.errors import InputError
from rolling_panda.messages import Reason
from rolling_panda.messages.robot import CutCommand
from rolling_panda.runtime.launch import child_environment


def order(cut_id: str) -> CutCommand:
    return CutCommand(epoch=3, cut_id=cut_id, point_id="p1")


def judged(orders: CutOrders, cut_id: str, inhibited: Reason | None = None) -> tuple[str, Reason | None]:
    """What comes of an order that is repeated until something does."""
    end = time.monotonic() + 20.0
    while True:
        verdict, reason = orders.judge(order(cut_id), None, True, inhibited)
        if verdict != "wait":
            return verdict, reason
        assert time.monotonic() < end
        time.sleep(0.001)


def test_a_cut_waits_until_it_cannot_be_forgotten_and_is_known_after_a_restart(tmp_path: Path) -> None:
    memory = CutFile(tmp_path)
    assert judged(CutOrders(memory), "run-1") == ("cut", None)
    assert b"run-1\n" in (tmp_path / FILE).read_bytes()
    memory.close()
    again = CutFile(tmp_path)
    orders = CutOrders(again)
    assert judged(orders, "run-1") == ("known", None)
    assert judged(orders, "run-2") == ("cut", None)
    again.close()


def test_an_order_that_was_spent_stays_so_after_a_restart(tmp_path: Path) -> None:
    memory = CutFile(tmp_path)
    assert judged(CutOrders(memory), "run-1", "stopped") == ("refuse", "stopped")
    memory.close()
    again = CutFile(tmp_path)
    assert judged(CutOrders(again), "run-1") == ("known", None)
    again.close()


def test_a_stop_between_two_repetitions_spends_the_order(tmp_path: Path) -> None:
    memory = CutFile(tmp_path)
    orders = CutOrders(memory)
    assert orders.judge(order("a"), None, True, None)[0] in ("wait", "cut")
    orders.judge(order("b"), None, True, reasons.stop_latched())
    assert judged(orders, "b") == ("known", None)
    memory.close()


def test_a_disk_that_hangs_keeps_nobody_waiting_but_the_blades(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    go, real = threading.Event(), os.fsync
    memory = CutFile(tmp_path)
    monkeypatch.setattr(os, "fsync", lambda descriptor: (go.wait(20.0), real(descriptor)))
    orders = CutOrders(memory)
    began = time.monotonic()
    verdicts = {orders.judge(order("a"), None, True, None)[0] for _ in range(1000)}
    assert verdicts == {"wait"} and time.monotonic() - began < 1.0
    go.set()
    assert judged(orders, "a") == ("cut", None)
    memory.close()


def test_a_disk_that_hangs_does_not_keep_the_bridge_from_ending(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    go, memory = threading.Event(), CutFile(tmp_path)
    monkeypatch.setattr(os, "fsync", lambda descriptor: go.wait(20.0))
    assert CutOrders(memory).judge(order("a"), None, True, None)[0] == "wait"
    began = time.monotonic()
    memory.close()
    assert time.monotonic() - began < 10.0
    go.set()


def test_a_full_disk_means_no_cut_now_or_later(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    memory = CutFile(tmp_path)
    orders = CutOrders(memory)

    def full(descriptor: int) -> None:
        raise OSError(28, "no space left on device")

    with monkeypatch.context() as patch:
        patch.setattr(os, "fsync", full)
        assert judged(orders, "a") == ("refuse", FORGETFUL)
    assert judged(orders, "a") == ("known", None)
    assert judged(orders, "b") == ("cut", None)
    memory.close()


def test_a_disk_that_takes_half_a_line_means_no_cut(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    real, memory = os.write, CutFile(tmp_path)
    orders = CutOrders(memory)
    with monkeypatch.context() as patch:
        patch.setattr(os, "write", lambda descriptor, line: real(descriptor, line[: len(line) // 2]))
        assert judged(orders, "run-1") == ("refuse", FORGETFUL)
    assert judged(orders, "run-2") == ("cut", None)
    memory.close()
    again = CutFile(tmp_path)
    assert "run-2" in again.known and "run-1" not in again.known
    again.close()


def test_a_half_written_line_spoils_no_other(tmp_path: Path) -> None:
    (tmp_path / FILE).write_bytes(b"\nrun-1\n\nrun-")
    memory = CutFile(tmp_path)
    assert judged(CutOrders(memory), "run-2") == ("cut", None)
    memory.close()
    again = CutFile(tmp_path)
    assert {"run-1", "run-2"} <= again.known
    again.close()


def test_bytes_that_are_no_text_spoil_no_other_line(tmp_path: Path) -> None:
    (tmp_path / FILE).write_bytes(b"\nrun-1\n\n\xff\xfe\n")
    memory = CutFile(tmp_path)
    assert "run-1" in memory.known
    memory.close()


def test_only_its_owner_reads_and_writes_the_memory_of_cuts(tmp_path: Path) -> None:
    before = threading.active_count()
    CutFile(tmp_path).close()
    assert (tmp_path / FILE).stat().st_mode & 0o777 == 0o600
    assert threading.active_count() == before


def test_the_memory_of_cuts_survives_a_power_failure_and_keeps_no_file_open(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    synced: list[Path] = []
    monkeypatch.setattr(cut_orders, "sync_folder", synced.append)
    memory = CutFile(tmp_path)
    assert synced == [tmp_path], "the name of a new file is in its folder, which has to be on the disk too"
    before = len(os.listdir("/proc/self/fd"))
    for number in range(20):
        assert judged(CutOrders(memory), f"run-{number}") == ("cut", None)
    assert len(os.listdir("/proc/self/fd")) <= before
    memory.close()


def test_the_disk_waits_for_the_control_loop_and_keeps_no_process_alive(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    given: list[tuple[str, str]] = []
    monkeypatch.setattr(
        cut_orders, "set_priority", lambda priority: given.append((priority, threading.current_thread().name))
    )
    before = set(threading.enumerate())
    memory = CutFile(tmp_path)
    (writer,) = set(threading.enumerate()) - before
    assert judged(CutOrders(memory), "a") == ("cut", None)
    assert writer.daemon and given == [("interface", writer.name)]
    memory.close()


def test_what_is_pending_at_the_end_is_written_and_the_writer_ends(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    real, before = os.fsync, threading.active_count()
    monkeypatch.setattr(os, "fsync", lambda descriptor: (time.sleep(0.1), real(descriptor)))
    memory = CutFile(tmp_path)
    for cut_id in ("a", "b", "c"):
        memory.keep(cut_id)
    memory.close()
    assert threading.active_count() == before
    assert {"a", "b", "c"} <= set((tmp_path / FILE).read_text().split())


def test_a_folder_that_cannot_be_used_is_named(tmp_path: Path) -> None:
    (tmp_path / FILE).mkdir()
    with pytest.raises(InputError, match="cannot remember cuts in .*--state"):
        CutFile(tmp_path)


#: Orders and memory are the product's; the blades are a file that is written at once.
BRIDGE = """
import os, sys, time
from pathlib import Path
from bridge.core.cut_orders import CutFile
from bridge.core.cut_orders import CutOrders
from rolling_panda.messages import CutCommand

orders = CutOrders(CutFile(Path(sys.argv[1])))
blades = os.open(sys.argv[2], os.O_WRONLY | os.O_APPEND | os.O_CREAT)
first = int(sys.argv[3])
print("up", flush=True)
# The controller repeats the orders that it has had no word of, and then gives new ones.
for number in range(max(0, first - 3), 10**9):
    while True:
        verdict, _ = orders.judge(CutCommand(epoch=3, cut_id=f"run-{number}", point_id="p"), None, True, None)
        if verdict == "cut":
            os.write(blades, f"{number}\\n".encode())
        if verdict != "wait":
            break
        time.sleep(0.0005)
    print(number, flush=True)
"""


@pytest.mark.parametrize("kills", [20, pytest.param(1000, marks=pytest.mark.slow)])
def test_no_cut_is_made_twice_when_the_bridge_is_killed(tmp_path: Path, kills: int) -> None:
    blades, reached, chance = tmp_path / "blades", 0, random.Random(11)
    for _ in range(kills):
        child = subprocess.Popen(
            [sys.executable, "-c", BRIDGE, str(tmp_path), str(blades), str(reached)],
            stdout=subprocess.PIPE,
            env=child_environment(),
        )
        assert child.stdout is not None and child.stdout.readline() == b"up\n"
        time.sleep(chance.uniform(0.0, 0.1))
        os.kill(child.pid, signal.SIGKILL)
        said = [int(line) for line in child.stdout.read().splitlines(keepends=True) if line.endswith(b"\n")]
        child.stdout.close()
        child.wait()
        reached = max([reached, *said])
    made = Counter(blades.read_text().split())
    assert len(made) >= kills // 2 and set(made.values()) == {1}
