"""`rolling-panda record` as a process: what a killed one has on disk."""

import functools
import signal
import subprocess
import threading
import time
from pathlib import Path

import pytest

from recorder.record import record
from recorder.recording import read_recording
from rolling_panda import messages as m
from rolling_panda import topics
from rolling_panda.config import TransportConfig
from rolling_panda.reasons import said, text_of
from rolling_panda.runtime.launch import child_environment, python_command
from rolling_panda.transport.zenoh import Transport


class SetBackClock:
    """A wire of numbered events, 10 ms apart, while the clock of the machine is set back by an hour."""

    robot_id = "rp1"

    def __init__(self, monkeypatch: pytest.MonkeyPatch, stopping: threading.Event) -> None:
        self._monkeypatch, self._stopping = monkeypatch, stopping

    def subscribe(self, topic, store):
        if topic is not topics.EVENT:
            return
        for k in range(6):
            if k == 3:
                self._monkeypatch.setattr(time, "time_ns", functools.partial(int, time.time_ns() - 3_600_000_000_000))
            store(m.LogEvent(header=m.Header(k * 0.01), process="bridge", reason=said(str(k))), 100.0 + k * 0.01)
        self._stopping.set()


def test_a_clock_that_is_set_changes_neither_order_nor_distances_of_messages(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    stopping = threading.Event()
    record(SetBackClock(monkeypatch, stopping), tmp_path / "a.mcap", stopping)  # type: ignore[arg-type]
    messages = read_recording(tmp_path / "a.mcap").messages
    assert [text_of(each.message().reason) for each in messages] == list("012345")  # type: ignore[attr-defined]
    assert messages[-1].at - messages[0].at == pytest.approx(0.05, abs=1e-6)


def publish(transport: Transport, seconds: float, recorder: subprocess.Popen[str] | None = None) -> float:
    """Numbered events a hundred times a second, which no congested link drops.

    Returns:
        When the last was sent before the recorder was killed (s since 1970).
    """
    publisher, sent = transport.publisher(topics.EVENT), 0.0
    for k in range(round(100 * seconds)):
        publisher.put(m.LogEvent(header=m.Header(k * 0.01), process="bridge", reason=said(str(k))))
        sent = time.time()
        time.sleep(0.01)
    if recorder is not None:
        recorder.send_signal(signal.SIGKILL)
    return sent


@pytest.mark.processes
@pytest.mark.long
@pytest.mark.parametrize("killed", [True, False])
def test_a_killed_recorder_loses_less_than_a_second_and_one_that_is_ended_nothing(
    endpoint: str, tmp_path: Path, killed: bool
) -> None:
    path = tmp_path / "a.mcap"
    options = ["--out", str(path), "--plain-wire", "--connect", endpoint]
    recorder = subprocess.Popen(
        python_command("recorder.record", options), stdout=subprocess.PIPE, text=True, env=child_environment()
    )
    assert recorder.stdout is not None and "recording" in recorder.stdout.readline()
    with Transport(TransportConfig(connect=(endpoint,), plain_wire=True), "bridge", "rp1") as transport:
        time.sleep(0.5)
        last = publish(transport, 2.7, recorder if killed else None)
        time.sleep(0.2)
    recorder.send_signal(signal.SIGINT)
    code = recorder.wait(20)
    recorder.stdout.close()
    recording = read_recording(path)
    numbers = [int(text_of(each.message().reason)) for each in recording.messages if each.topic is topics.EVENT]  # type: ignore[attr-defined]
    assert numbers == list(range(numbers[0], numbers[0] + len(numbers))), "none is missing in between"
    if killed:
        assert code == -signal.SIGKILL and not recording.complete
        assert last - recording.messages[-1].at < 1.0
    else:
        assert code == 0 and recording.complete
        assert numbers == list(range(270))
