"""The base's driver against a base in its own process, over a real router."""

import time
from collections.abc import Iterator

import numpy as np
import pytest

from bridge.real import mp500
from bridge.real.config import BaseConfig
from bridge.real.mp500 import Mp500
from rolling_panda import reasons
from rolling_panda.config import TransportConfig
from rolling_panda.model.robot import RobotModel
from rolling_panda.transport.zenoh import ForeignWire
from tests.support.processes.device_process import DeviceProcess
from tests.support.waiting import until

pytestmark = pytest.mark.paced

DRIVE = RobotModel().drive
REST = np.zeros(2)
FORWARD = np.array(DRIVE.wheels(0.3, 0.0))
LEFT = np.array(DRIVE.wheels(0.2, 0.4))


@pytest.fixture(scope="module")
def device(endpoint: str) -> Iterator[tuple[str, DeviceProcess]]:
    device = DeviceProcess("base", "--plain-wire", "--connect", endpoint)
    yield endpoint, device
    device.close()


@pytest.fixture
def base(device: tuple[str, DeviceProcess]) -> Iterator[Mp500]:
    endpoint, fake = device
    fake.tell("free")
    base = Mp500(ForeignWire(TransportConfig(connect=(endpoint,), plain_wire=True)), DRIVE, 13.5, BaseConfig())
    base.release()
    until(lambda: base.read().fault is None)
    fake.tell("clear")
    yield base
    base.close()


@pytest.fixture
def fake(device: tuple[str, DeviceProcess]) -> DeviceProcess:
    return device[1]


def drive(base: Mp500, wheels: np.ndarray, seconds: float) -> None:
    end = time.monotonic() + seconds
    while time.monotonic() < end:
        base.write(wheels)
        time.sleep(0.005)


def test_it_drives_and_knows_how_far_each_wheel_has_turned(base: Mp500, fake: DeviceProcess) -> None:
    before, travelled = base.read().position, np.array(fake.tell()["travel"])
    drive(base, LEFT, 1.5)
    state, report = base.read(), fake.tell()
    np.testing.assert_allclose(state.velocity, LEFT, atol=0.05)
    np.testing.assert_allclose(report["command"], [0.2, 0.4], atol=1e-6)
    drive(base, REST, 0.8)
    turned = base.read().position - before
    np.testing.assert_allclose(turned, np.array(fake.tell()["travel"]) - travelled, atol=0.1)
    assert turned[1] > turned[0] > 0.5, "left is right"
    assert fake.tell()["breaches"] == []
    assert base.read().battery == pytest.approx(0.8)


def test_a_target_that_is_not_renewed_ends_in_zeros_within_the_deadline(base: Mp500, fake: DeviceProcess) -> None:
    drive(base, FORWARD, 0.8)
    silent = time.monotonic()
    until(lambda: fake.tell()["command"] == [0.0, 0.0], 1.0)
    assert time.monotonic() - silent < 0.3
    until(lambda: fake.tell()["still_s"] > 0.0)
    assert time.monotonic() - silent < 0.7
    assert fake.tell()["breaches"] == []


def test_after_an_emergency_stop_it_begins_at_zero_by_a_ramp(base: Mp500, fake: DeviceProcess) -> None:
    drive(base, FORWARD, 0.5)
    fake.tell("press")
    until(lambda: base.read().fault == reasons.base_stopped("button"))
    assert base.read().severe
    drive(base, FORWARD, 0.3)
    assert fake.tell()["command"] == [0.0, 0.0]
    fake.tell("confirm")
    until(lambda: base.read().fault == reasons.base_stop_unconfirmed())
    fake.tell("free")
    drive(base, FORWARD, 0.5)
    report = fake.tell()
    assert report["command"][0] == pytest.approx(0.3)
    assert report["breaches"] == []


def test_without_wheel_speeds_it_stops_and_says_which_topic_is_silent(base: Mp500, fake: DeviceProcess) -> None:
    drive(base, FORWARD, 0.5)
    fake.tell(f"mute {mp500.WHEELS}")
    drive(base, FORWARD, 0.15)
    assert fake.tell()["command"][0] < 0.28, "it slows down before it calls the silence a fault"
    drive(base, FORWARD, 0.1)
    assert base.read().fault == reasons.base_silent(mp500.WHEELS), "within 0.25 s"
    drive(base, FORWARD, 1.5)
    state = base.read()
    assert state.fault == reasons.base_silent(mp500.WHEELS) and not state.severe, (
        "the last speed heard of is no runaway"
    )
    assert fake.tell()["command"] == [0.0, 0.0] and not fake.tell()["soft"]
    fake.tell("free")
    until(lambda: base.read().fault is None)


def test_without_an_emergency_stop_state_it_does_not_move(base: Mp500, fake: DeviceProcess) -> None:
    fake.tell(f"mute {mp500.EMERGENCY}")
    until(lambda: base.read().fault == reasons.base_unmonitored(mp500.EMERGENCY))
    drive(base, FORWARD, 0.3)
    assert fake.tell()["command"] == [0.0, 0.0]


def test_wheels_that_turn_against_the_command_are_stopped_by_the_relay_board(base: Mp500, fake: DeviceProcess) -> None:
    drive(base, REST, 0.1)
    fake.tell("stuck")
    until(lambda: bool(fake.tell()["soft"]), 3.0)
    until(lambda: base.read().severe)
    assert base.read().fault == reasons.base_runaway()
    until(lambda: fake.tell()["still_s"] > 0.0)
    fake.tell("free")
    assert base.read().severe, "only a person's word releases it"
    base.release()
    until(lambda: base.read().fault is None)


def test_a_base_that_only_listens_sends_nothing(device: tuple[str, DeviceProcess]) -> None:
    endpoint, fake = device
    commands = fake.tell("free")["commands"]
    base = Mp500(
        ForeignWire(TransportConfig(connect=(endpoint,), plain_wire=True)), DRIVE, 13.5, BaseConfig(), moving=False
    )
    until(lambda: base.read().fault is None)
    drive(base, FORWARD, 0.3)
    base.close()
    assert fake.tell()["commands"] == commands
