"""The arm's driver: its own process with the unmodified libfranka, against a control box in another process."""

import os
import random
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from multiprocessing import active_children
from pathlib import Path
from typing import Self

import numpy as np
import pytest

from bridge.real.config import ArmConfig
from bridge.real.panda import Panda
from rolling_panda import reasons
from rolling_panda.model.robot import RobotModel
from rolling_panda.runtime.launch import child_environment
from tests.support.extras import need
from tests.support.processes.device_process import DeviceProcess
from tests.support.waiting import until

need("real")

pytestmark = pytest.mark.paced

LIMITS = RobotModel().limits


def words(arm: Panda) -> str:
    """The arm's own words about its fault."""
    fault = arm.read().fault
    return "" if fault is None else str(fault.values)


REST = np.zeros(7)
TURN = np.array([0.2, 0.0, 0.0, 0.0, 0.0, 0.0, 0.3])
REFLEX, USER_STOPPED = 4, 5
# Every loopback address has its own port 1337.
ADDRESS = f"127.0.{os.getpid() % 250 + 1}.9"


@pytest.fixture
def box() -> Iterator[DeviceProcess]:
    box = DeviceProcess("arm", "--arm", ADDRESS)
    yield box
    box.close()


@pytest.fixture
def arm(box: DeviceProcess) -> Iterator[Panda]:
    arm = Panda(ArmConfig(address=ADDRESS, realtime="ignore"), LIMITS)
    until(lambda: arm.read().fault is None and arm.read().commands > 10, 15.0)
    yield arm
    arm.close()


class Hand:
    """Goes on telling the arm one velocity, as the bridge does each 4 ms."""

    def __init__(self, arm: Panda, box: DeviceProcess, velocity: np.ndarray) -> None:
        self.velocity = velocity
        self._arm, self._box = arm, box
        self._ended = threading.Event()
        self._thread = threading.Thread(target=self._tell)

    def __enter__(self) -> Self:
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._ended.set()
        self._thread.join()

    def _tell(self) -> None:
        while not self._ended.wait(0.004):
            self._arm.write(self.velocity)

    def turn(self, milliseconds: int) -> None:
        """For so many of the control box, whatever they take on this machine."""
        end = int(self._box.tell()["ticks"]) + milliseconds
        while (left := end - int(self._box.tell()["ticks"])) > 0:
            time.sleep(0.001 * left)


def turns(box: DeviceProcess, velocity: np.ndarray) -> Callable[[], bool]:
    return lambda: np.allclose(box.tell()["dq"], velocity, rtol=0.0, atol=1e-6)


def at_rest_within(milliseconds: int, box: DeviceProcess) -> bool:
    """From now, by the control box's own time."""
    end = int(box.tell()["ticks"]) + milliseconds
    until(lambda: box.tell()["still_s"] > 0.05)
    report = box.tell()
    return np.abs(report["dq"]).max() == 0.0 and report["moved_tick"] <= end


def test_it_follows_with_its_payload_set_and_holds_when_no_target_comes(arm: Panda, box: DeviceProcess) -> None:
    with Hand(arm, box, TURN):
        until(turns(box, TURN))
        until(lambda: np.allclose(arm.read().velocity, TURN, rtol=0.0, atol=1e-6))
        report = box.tell()
        assert report["load"] == 1.2
        # What is read lies between what the box says before and after.
        until(lambda: bool(np.all(arm.read().position >= np.array(report["q"]) - 1e-9)))
        told = arm.read().position
        assert np.all(told <= np.array(box.tell()["q"]) + 1e-9)
    assert at_rest_within(400, box)
    assert box.tell()["breaches"] == []


@pytest.mark.long
def test_random_targets_break_no_limit(arm: Panda, box: DeviceProcess) -> None:
    rng = random.Random(4)
    with Hand(arm, box, REST) as hand:
        end = box.tell()["ticks"] + 5000
        while box.tell()["ticks"] < end:
            speed = rng.choice([0.3, 1.0, 3.0])
            hand.velocity = np.array([rng.uniform(-speed, speed) for _ in range(7)])
            hand.turn(rng.choice([4, 20, 100, 300]))
            if rng.random() < 0.2:
                box.tell(f"drop {rng.randrange(1, 19)}")
        report = box.tell()
        assert report["breaches"] == []
        assert max(report["worst"]) > 0.9, "the limits were never reached"
        until(lambda: arm.read().fault is None)


@pytest.mark.long
def test_packets_lost_at_the_highest_speeds_break_no_limit(arm: Panda, box: DeviceProcess) -> None:
    """There libfranka's own limits would break the jerk: what the arm went on with by itself is beyond them."""
    with Hand(arm, box, REST) as hand:
        for sign in (1.0, -1.0, 1.0, -1.0, 1.0, -1.0):
            hand.velocity = np.full(7, 3.0 * sign)
            for _ in range(9):
                hand.turn(40)
                box.tell("drop 15")
    report = box.tell()
    assert report["breaches"] == []
    assert report["lost"] >= 500
    assert report["worst"][0] > 0.97, "the highest speed was never reached"


def test_a_reflex_stops_it_until_a_person_releases_it(arm: Panda, box: DeviceProcess) -> None:
    with Hand(arm, box, TURN) as hand:
        until(turns(box, TURN))
        box.tell("collide")
        until(lambda: arm.read().severe)
        fault = arm.read().fault
        assert fault is not None and fault.code == "device_fault" and "joint_reflex" in words(arm)
        hand.turn(500)
        assert box.tell()["mode"] == REFLEX
        assert box.tell()["recoveries"] == 0
        arm.release()
        until(lambda: arm.read().fault is None)
        until(turns(box, TURN))
        assert box.tell()["recoveries"] == 1


def test_a_stalled_process_is_stopped_by_the_control_box_and_stays_stopped(arm: Panda, box: DeviceProcess) -> None:
    with Hand(arm, box, TURN) as hand:
        until(turns(box, TURN))
        (process,) = [child.pid for child in active_children() if child.name == "rolling-panda-arm"]
        assert process is not None
        os.kill(process, signal.SIGSTOP)
        until(lambda: arm.read().fault == reasons.arm_silent())
        until(lambda: box.tell()["mode"] == REFLEX)
        os.kill(process, signal.SIGCONT)
        until(lambda: arm.read().severe)
        assert "communication_constraints_violation" in words(arm)
        hand.turn(300)
        assert np.abs(box.tell()["dq"]).max() == 0.0


def test_the_user_stop_is_named_and_a_person_has_to_release_the_arm_after_it(arm: Panda, box: DeviceProcess) -> None:
    box.tell("press")
    until(lambda: arm.read().severe)
    with Hand(arm, box, TURN) as hand:
        arm.release()
        hand.turn(400)
        until(lambda: arm.read().fault == reasons.arm_user_stopped())
        box.tell("free")
        hand.turn(400)
        assert arm.read().severe
        assert np.abs(box.tell()["dq"]).max() == 0.0
        arm.release()
        until(lambda: arm.read().fault is None)


def test_an_arm_that_is_only_read_is_never_commanded(box: DeviceProcess) -> None:
    arm = Panda(ArmConfig(address=ADDRESS, realtime="ignore"), LIMITS, moving=False)
    until(lambda: arm.read().fault is None, 15.0)
    with Hand(arm, box, TURN) as hand:
        hand.turn(300)
    report = box.tell()
    np.testing.assert_allclose(arm.read().position, report["q"])
    assert (report["commands"], report["load"], report["mode"]) == (0, 0.0, 1)
    arm.close()


def test_without_a_control_box_it_says_so_and_connects_when_there_is_one() -> None:
    arm = Panda(ArmConfig(address=ADDRESS, realtime="ignore"), LIMITS)
    until(lambda: "refused" in words(arm), 15.0)
    box = DeviceProcess("arm", "--arm", ADDRESS)
    until(lambda: arm.read().fault is None and arm.read().commands > 10, 15.0)
    arm.close()
    box.close()


BRIDGE = """
import time, numpy as np
from bridge.real.config import ArmConfig
from bridge.real.panda import Panda
from rolling_panda import reasons
from rolling_panda.model.robot import RobotModel
if __name__ == "__main__":
    arm = Panda(ArmConfig(address={address!r}, realtime="ignore"), RobotModel().limits)
    while True:
        arm.write(np.array([0.2, 0, 0, 0, 0, 0, 0.3]))
        time.sleep(0.005)
"""


def test_a_killed_bridge_leaves_an_arm_at_rest_and_no_process(box: DeviceProcess, tmp_path: Path) -> None:
    script = tmp_path / "killed.py"
    script.write_text(BRIDGE.format(address=ADDRESS))
    killed = subprocess.Popen([sys.executable, str(script)], env=child_environment())
    try:
        until(lambda: np.abs(box.tell()["dq"]).max() > 0.25, 20.0)
    finally:
        killed.kill()
        killed.wait()
    assert at_rest_within(400, box)
    until(lambda: box.tell()["mode"] == 1)
    assert box.tell()["breaches"] == []
