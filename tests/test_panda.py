"""The arm's driver: its own process with the unmodified libfranka, against a control box in another process."""

import os
import random
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("panda_py", reason="the extra `real` is not installed: pip install '.[real]'")

from device_process import DeviceProcess  # noqa: E402

from bridge.real.config import ArmConfig  # noqa: E402
from bridge.real.panda import Panda  # noqa: E402
from rolling_panda.launch import child_environment  # noqa: E402
from rolling_panda.robot_model import RobotModel  # noqa: E402

pytestmark = pytest.mark.alone

LIMITS = RobotModel().limits
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
    until(lambda: arm.read().fault == "" and arm.read().commands > 10, 15.0)
    yield arm
    arm.close()


def until(condition: Callable[[], bool], limit_s: float = 5.0) -> None:
    end = time.monotonic() + limit_s
    while not condition():
        assert time.monotonic() < end, "waited in vain"
        time.sleep(0.01)


def turn(arm: Panda, velocity: np.ndarray, seconds: float) -> None:
    end = time.monotonic() + seconds
    while time.monotonic() < end:
        arm.write(velocity)
        time.sleep(0.004)


def test_it_follows_with_its_payload_set_and_holds_when_no_target_comes(arm: Panda, box: DeviceProcess) -> None:
    turn(arm, TURN, 0.8)
    report = box.tell()
    np.testing.assert_allclose(report["dq"], TURN, atol=1e-6)
    assert report["load"] == 1.2
    np.testing.assert_allclose(arm.read().position, report["q"], atol=0.01)
    np.testing.assert_allclose(arm.read().velocity, TURN, atol=1e-6)
    time.sleep(0.4)
    report = box.tell()
    assert np.abs(report["dq"]).max() == 0.0
    assert report["still_s"] > 0.05
    assert report["breaches"] == []


def test_random_targets_break_no_limit(arm: Panda, box: DeviceProcess) -> None:
    rng = random.Random(4)
    end = time.monotonic() + 5.0
    while time.monotonic() < end:
        speed = rng.choice([0.3, 1.0, 3.0])
        turn(arm, np.array([rng.uniform(-speed, speed) for _ in range(7)]), rng.choice([0.004, 0.02, 0.1, 0.3]))
        if rng.random() < 0.2:
            box.tell(f"drop {rng.randrange(1, 19)}")
    report = box.tell()
    assert report["breaches"] == []
    assert max(report["worst"]) > 0.9, "the limits were never reached"
    assert arm.read().fault == ""


def test_packets_lost_at_the_highest_speeds_break_no_limit(arm: Panda, box: DeviceProcess) -> None:
    """There libfranka's own limits would break the jerk: what the arm went on with by itself is beyond them."""
    for sign in (1.0, -1.0, 1.0, -1.0, 1.0, -1.0):
        for _ in range(9):
            turn(arm, np.full(7, 3.0 * sign), 0.04)
            box.tell("drop 15")
    report = box.tell()
    assert report["breaches"] == []
    assert report["lost"] >= 500
    assert report["worst"][0] > 0.97, "the highest speed was never reached"


def test_a_reflex_stops_it_until_a_person_releases_it(arm: Panda, box: DeviceProcess) -> None:
    turn(arm, TURN, 0.3)
    box.tell("collide")
    until(lambda: arm.read().severe)
    assert "reflex" in arm.read().fault and "joint_reflex" in arm.read().fault
    turn(arm, TURN, 0.5)
    assert box.tell()["mode"] == REFLEX
    assert box.tell()["recoveries"] == 0
    arm.release()
    until(lambda: arm.read().fault == "")
    turn(arm, TURN, 0.5)
    report = box.tell()
    np.testing.assert_allclose(report["dq"], TURN, atol=1e-6)
    assert report["recoveries"] == 1


def test_a_stalled_process_is_stopped_by_the_control_box_and_stays_stopped(arm: Panda, box: DeviceProcess) -> None:
    turn(arm, TURN, 0.3)
    process = arm._process.pid
    assert process is not None
    os.kill(process, signal.SIGSTOP)
    turn(arm, TURN, 1.0)
    assert "no state" in arm.read().fault
    assert box.tell()["mode"] == REFLEX
    os.kill(process, signal.SIGCONT)
    until(lambda: arm.read().severe)
    assert "communication_constraints_violation" in arm.read().fault
    turn(arm, TURN, 0.3)
    assert np.abs(box.tell()["dq"]).max() == 0.0


def test_the_user_stop_is_named_and_a_person_has_to_release_the_arm_after_it(arm: Panda, box: DeviceProcess) -> None:
    box.tell("press")
    until(lambda: arm.read().severe)
    arm.release()
    turn(arm, TURN, 0.4)
    assert "user stop" in arm.read().fault.lower()
    box.tell("free")
    turn(arm, TURN, 0.4)
    assert arm.read().severe
    assert np.abs(box.tell()["dq"]).max() == 0.0
    arm.release()
    until(lambda: arm.read().fault == "")


def test_an_arm_that_is_only_read_is_never_commanded(box: DeviceProcess) -> None:
    arm = Panda(ArmConfig(address=ADDRESS, realtime="ignore"), LIMITS, moving=False)
    until(lambda: arm.read().fault == "", 15.0)
    turn(arm, TURN, 0.3)
    report = box.tell()
    np.testing.assert_allclose(arm.read().position, report["q"])
    assert (report["commands"], report["load"], report["mode"]) == (0, 0.0, 1)
    arm.close()


def test_without_a_control_box_it_says_so_and_connects_when_there_is_one() -> None:
    arm = Panda(ArmConfig(address=ADDRESS, realtime="ignore"), LIMITS)
    until(lambda: "refused" in arm.read().fault, 15.0)
    box = DeviceProcess("arm", "--arm", ADDRESS)
    until(lambda: arm.read().fault == "" and arm.read().commands > 10, 15.0)
    arm.close()
    box.close()


BRIDGE = """
import time, numpy as np
from bridge.real.config import ArmConfig
from bridge.real.panda import Panda
from rolling_panda.robot_model import RobotModel
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
    time.sleep(0.4)
    assert np.abs(box.tell()["dq"]).max() == 0.0
    until(lambda: box.tell()["mode"] == 1)
    assert box.tell()["breaches"] == []
