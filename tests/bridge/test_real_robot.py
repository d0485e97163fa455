"""What only a real robot does by itself: it goes on moving, stops by itself, and has buttons."""

import time
from collections.abc import Iterator

import numpy as np
import pytest

from bridge.core.bridge import TICK_S
from bridge.core.robot_time import RealTime
from bridge.real import mp500
from rolling_panda import messages as m
from rolling_panda import reasons
from rolling_panda.reasons import text_of
from tests.support.bridge_rig import FORWARD, REST, Parts, Rig
from tests.support.extras import need
from tests.support.real_rig import RealPlant

need("real")

pytestmark = pytest.mark.paced

SILENT = reasons.base_silent(mp500.WHEELS)


@pytest.fixture(scope="module")
def plant() -> Iterator[RealPlant]:
    plant = RealPlant()
    yield plant
    plant.close()


@pytest.fixture
def rig(plant: RealPlant) -> Iterator[Rig]:
    plant.base.tell("free")
    plant.base.tell("clear")
    plant.arm.tell("clear")
    rig = Rig(Parts(plant.start, plant, lambda: RealTime(time.monotonic(), TICK_S), real=True, close=lambda: None))
    yield rig
    rig.close()


def log(rig: Rig) -> list[m.Reason]:
    return [event.reason for out in rig.outputs for event in out.events]


def release(rig: Rig) -> m.Answer:
    return rig.core.on_release(m.ReleaseStop(stop_id=rig.state.stop_id, user="ada", reason="looked at it"), rig.now)


def goes_on(rig: Rig) -> bool:
    rig.run(0.3, REST)
    return rig.until(lambda: float(np.abs(rig.plant.velocity()).max()) > 0.5, FORWARD)


def test_the_charge_of_the_base_and_the_arms_commands_in_time_are_told(rig: Rig) -> None:
    rig.run(0.3, REST)
    assert rig.state.battery == pytest.approx(0.8)
    assert rig.until(lambda: (rig.state.arm_success or 0.0) > 0.9, REST), "of the last 100"


def test_a_bridge_that_hangs_leaves_a_robot_that_comes_to_rest_by_itself(rig: Rig) -> None:
    rig.drive_on()
    time.sleep(0.6)
    assert rig.at_rest()
    rig.run(0.3, FORWARD)
    assert rig.at_rest(), "what was under way before woke moving"
    assert goes_on(rig)
    assert rig.plant.breaches() == []


def test_an_emergency_stop_is_latched_and_its_release_waits_for_the_button(rig: Rig, plant: RealPlant) -> None:
    rig.drive_on()
    plant.base.tell("press")
    assert rig.until(lambda: rig.state.stop_id != "", FORWARD)
    rig.run(0.5, FORWARD)
    assert rig.comes_to_rest(FORWARD)
    assert reasons.emergency_stop(reasons.button_pressed()) in log(rig)
    assert not release(rig).ok
    plant.base.tell("free")
    rig.run(0.3, FORWARD)
    assert rig.at_rest()
    assert release(rig).ok
    rig.run(0.5, FORWARD)
    assert rig.at_rest(), "the release moved it"
    assert goes_on(rig)


def test_a_reflex_is_told_in_the_arms_words_and_recovered_from_by_a_persons_word(rig: Rig, plant: RealPlant) -> None:
    rig.drive_on()
    recoveries = plant.arm.tell("collide")["recoveries"]
    assert rig.until(lambda: rig.state.stop_id != "", FORWARD)
    rig.run(0.6, FORWARD)
    assert rig.comes_to_rest(FORWARD), "the base went on without the arm"
    assert "joint_reflex" in text_of(rig.state.stopped_by)
    assert plant.arm.tell()["recoveries"] == recoveries
    assert release(rig).ok
    rig.run(0.5, REST)
    assert plant.arm.tell()["recoveries"] == recoveries + 1
    assert goes_on(rig)


def test_a_base_that_tells_nothing_stops_everything_without_a_latch(rig: Rig, plant: RealPlant) -> None:
    rig.drive_on()
    plant.base.tell(f"mute {mp500.WHEELS}")
    rig.run(0.9, FORWARD)
    assert rig.comes_to_rest(FORWARD)
    assert rig.state.watchdog
    assert reasons.robot_faulty(SILENT) in log(rig)
    plant.base.tell("free")
    rig.run(0.5, FORWARD)
    assert rig.at_rest(), "it went on without a setpoint at rest"
    assert rig.state.stop_id == ""
    assert goes_on(rig)
    assert rig.plant.breaches() == []


def test_the_faults_of_two_devices_are_both_told(rig: Rig, plant: RealPlant) -> None:
    rig.drive_on()
    plant.base.tell(f"mute {mp500.WHEELS}")
    plant.arm.tell("press")
    both = reasons.both(SILENT, reasons.arm_user_stopped())
    assert rig.until(lambda: reasons.robot_faulty(both) in log(rig), FORWARD)
    plant.base.tell("free")
    plant.arm.tell("free")
