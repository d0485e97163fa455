"""Camera, base and arm are calibrated by the command, through the real robot's drivers: every device a fake."""

import re
import subprocess
from pathlib import Path

import msgspec
import numpy as np
import pinocchio as pin
import pytest

from bridge.sim.world.config import WorldConfig
from bridge.sim.world.errors import draw_errors
from rolling_panda.config import load_section
from rolling_panda.messages.perception import CameraMount
from rolling_panda.model.robot import RobotModel, mount_pose, turn_and_shift
from rolling_panda.resources import resource
from rolling_panda.runtime.launch import child_environment, python_command
from tests.support.extras import need
from tests.support.processes.demo import Demo
from tests.support.processes.local_router import free_port

need("real")

# Eight processes for minutes, half of them at a kilohertz.
pytestmark = [pytest.mark.alone, pytest.mark.slow]

ADDRESS, SEED = "127.0.0.47", 3
#: What the board has to find, and the board.
WORLD = """
[camera]
board = true
calibration_angle = 0.0

[world]
hand_eye_angle = 0.01
hand_eye_shift = 0.005
joint_offset = 0.005
wheel_error = 0.01

[vineyard]
vines = 1
rows_behind = 0
"""


def calibrate(demo: Demo, what: str) -> str:
    """Run `rolling-panda calibrate`, as somebody at the robot does; what it says."""
    link = demo.client.post("/api/invite", json={"user": f"who calibrates {what}", "role": "supervisor"}).json()["link"]
    ran = subprocess.run(
        python_command("rolling_panda", ["calibrate", what, link, "--yes"]),
        env=child_environment(),
        capture_output=True,
        text=True,
        timeout=400.0,
        check=False,
    )
    assert ran.returncode == 0, f"{ran.stdout}\n{ran.stderr}"
    return ran.stdout


def test_camera_arm_and_base_are_found_by_libfranka_ros_and_librealsense(tmp_path: Path) -> None:
    config = tmp_path / "fakes.toml"
    config.write_text(resource("assets/config/fakes.toml").read_text().replace("127.0.0.41", ADDRESS) + WORLD)
    errors = draw_errors(load_section(config, "world", WorldConfig), SEED)
    demo = Demo(free_port(), SEED, config, "--bridge", "real", "--fakes", points=0)
    try:
        assert demo.state()["bridge"]["kind"] == "fakes"
        demo.wait(lambda: all(demo.client.get(f"/api/{path}").is_success for path in ("camera", "calibration")), 60.0)
        assert re.search(r"\d\d views", calibrate(demo, "arm"))
        arm = demo.state()["bridge"]["arm"]
        assert np.abs(np.array(arm["offsets"])[1:6] - errors.joint_offset[1:6]).max() < 0.0005
        mount = msgspec.convert(demo.client.get("/api/camera").json()["mount"], CameraMount)
        true = RobotModel().T_flange_camera * pin.SE3(errors.hand_eye, errors.hand_eye_shift)
        # Joint 7's offset turns the camera about the flange's axis, which no picture tells from another mount.
        last = pin.SE3(pin.exp3(-errors.joint_offset[6] * np.eye(3)[2]), np.zeros(3))
        turn, shift = turn_and_shift(last * true, mount_pose(mount))
        assert turn < 0.002 and shift < 0.0015
        calibrate(demo, "base")
        base, drawn = demo.state()["bridge"]["base"], RobotModel().drive
        assert base["left"] == pytest.approx(drawn.wheel_radius * errors.wheels[0], rel=3e-3)
        assert base["right"] == pytest.approx(drawn.wheel_radius * errors.wheels[1], rel=3e-3)
        assert base["track"] == pytest.approx(2 * drawn.half_track * errors.track, rel=6e-3)
    finally:
        demo.close()
