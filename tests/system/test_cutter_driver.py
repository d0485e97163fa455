"""The cutter's driver against a ROS 2 service over a real router."""

import threading
import time
from collections.abc import Iterator

import pytest

from bridge.real import ros_messages as ros
from bridge.real.config import CutterConfig
from bridge.real.cutter import Cutter
from rolling_panda import reasons
from rolling_panda.config import TransportConfig
from rolling_panda.transport.zenoh import ForeignWire
from tests.support.waiting import until

pytestmark = pytest.mark.paced


class Secateurs:
    """Blades that take their time, jam or fall silent as told."""

    def __init__(self, wire: ForeignWire) -> None:
        self.wire = wire
        self.asked: list[bool] = []
        self.jam, self.close_s = "", 0.05
        self.opened = threading.Event()
        wire.serve("cutter/close", self.answer)

    def answer(self, request: bytes) -> bytes:
        shut = bool(ros.decode(ros.SET_BOOL, request).data)
        self.asked.append(shut)
        if not shut:
            self.opened.set()
            return self.say("")
        self.opened.clear()
        # The wire's threads wait for this answer, as those of a ROS node with one executor would.
        time.sleep(self.close_s)
        return self.say(self.jam)

    def say(self, fault: str) -> bytes:
        return ros.encode(ros.make(ros.SET_BOOL_REPLY, success=not fault, message=fault))


@pytest.fixture
def device(endpoint: str) -> Iterator[Secateurs]:
    wire = ForeignWire(TransportConfig(connect=(endpoint,), plain_wire=True))
    yield Secateurs(wire)
    wire.close()


@pytest.fixture
def cutter(endpoint: str, device: Secateurs) -> Iterator[Cutter]:
    config = CutterConfig(service="cutter/close", timeout_s=0.4, retry_s=0.1)
    cutter = Cutter(ForeignWire(TransportConfig(connect=(endpoint,), plain_wire=True)), config)
    until(lambda: cutter.read().state == "open")
    cutter.enable(True)
    yield cutter
    cutter.close()


def test_it_closes_opens_again_and_says_that_the_blades_met(cutter: Cutter, device: Secateurs) -> None:
    assert device.asked == [False], "at the start the blades open"
    cutter.cut("c1")
    assert cutter.read().state == "closing"
    until(lambda: cutter.read().state == "open")
    status = cutter.read()
    assert (status.cut_id, status.outcome) == ("c1", "DONE")
    assert device.asked == [False, True, False]


def test_a_jam_is_told_with_the_devices_words(cutter: Cutter, device: Secateurs) -> None:
    device.jam = "motor current over 9 A"
    cutter.cut("c1")
    until(lambda: cutter.read().outcome != "")
    assert cutter.read().outcome == "FAILED_NOT_CUT"
    assert cutter.read().detail == reasons.cutter_jam_reported("motor current over 9 A")
    until(lambda: cutter.read().state == "open")


def test_silence_is_unknown_and_no_second_cut(cutter: Cutter, device: Secateurs) -> None:
    device.close_s = 0.8
    cutter.cut("c1")
    until(lambda: cutter.read().outcome != "")
    assert cutter.read().outcome == "UNKNOWN"
    assert cutter.read().detail == reasons.cutter_silent(0.4)
    until(lambda: cutter.read().state == "open")
    assert device.asked.count(True) == 1


def test_blades_that_close_open_at_once_when_the_cutter_is_inhibited(cutter: Cutter, device: Secateurs) -> None:
    device.close_s = 0.3
    cutter.cut("c1")
    until(lambda: True in device.asked)
    cutter.enable(False)
    until(lambda: cutter.read().outcome != "")
    assert cutter.read().outcome == "UNKNOWN"
    assert cutter.read().detail == reasons.inhibited_while_closing()
    until(lambda: cutter.read().state == "open")
    assert device.opened.is_set()


def test_without_permission_the_device_hears_nothing(cutter: Cutter, device: Secateurs) -> None:
    cutter.enable(False)
    cutter.cut("c1")
    until(lambda: cutter.read().outcome != "")
    assert cutter.read().outcome == "FAILED_NOT_CUT"
    assert True not in device.asked
