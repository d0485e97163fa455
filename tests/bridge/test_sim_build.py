import hashlib
from pathlib import Path

import numpy as np
import pytest

from bridge.core.bridge import BridgeCore
from bridge.sim.build import simulated_bridge
from bridge.sim.robot.trace import Trace, read
from rolling_panda import messages as m
from rolling_panda.model.robot import RobotModel
from rolling_panda.resources import resource
from rolling_panda.transport.codec import encode

DRIVE = RobotModel().drive
FORWARD = (*DRIVE.wheels(0.3, 0.0), 0.3, 0.1, 0.0, 0.0, 0.0, 0.0, -0.4)


@pytest.fixture
def config(tmp_path: Path) -> Path:
    """The shipped configuration with a small picture."""
    text = resource("assets/config/sim.toml").read_text().replace("width = 848", "width = 64")
    path = tmp_path / "sim.toml"
    path.write_text(text.replace("height = 480", "height = 48"))
    return path


def drive(core: BridgeCore, seconds: float, silent_after: float = 1e9) -> str:
    """Drive on with a controller that dies at `silent_after`; returns a digest of every message sent."""
    digest, echo, sequence = hashlib.sha256(), 0, 0
    for tick in range(round(seconds * 1000)):
        now = tick * 1e-3
        out = core.step(now)
        for message in (out.joints, out.odometry, out.state, out.frame, out.scenery, *out.events):
            if message is not None:
                digest.update(encode(message))
        if out.joints is not None:
            echo = out.joints.sequence
            if now < silent_after:
                sequence += 1
                xi = FORWARD if now > 0.05 else (0.0,) * 9
                core.on_token(m.TokenRequest(token="a", echo=echo, mode="TELEOP"), now)
                command = m.MotionCommand(epoch=1, token="a", sequence=sequence, echo=echo, xi=xi)  # type: ignore[arg-type]
                core.on_motion(command, now)
    core.robot.close()
    return digest.hexdigest()


def run(config: Path, trace: Path, seed: int, seconds: float = 1.0, silent_after: float = 1e9) -> tuple[str, Trace]:
    digest = drive(simulated_bridge(config, seed, trace), seconds, silent_after)
    return digest, read(trace)


def test_the_same_seed_gives_the_same_trace_and_the_same_messages(config: Path, tmp_path: Path) -> None:
    first, second = run(config, tmp_path / "a", 3), run(config, tmp_path / "b", 3)
    assert (tmp_path / "a").read_bytes() == (tmp_path / "b").read_bytes()
    assert first[0] == second[0]
    assert run(config, tmp_path / "c", 4)[0] != first[0]


def test_a_dead_controller_leaves_base_and_arm_still_within_400_ms(config: Path, tmp_path: Path) -> None:
    _, trace = run(config, tmp_path / "t", 0, seconds=1.8, silent_after=1.0)
    moving = trace.rows[trace.rows["clock"] < 1.0]
    assert moving["base_velocity"][-1][0] == pytest.approx(0.3, abs=0.01)
    assert np.abs(moving["velocity"][-1][2:]).max() > 0.3
    # The last command left at 0.999 s.
    assert trace.stopping_time(0.999) <= 0.4
    assert trace.rows["contacts"].max() == 0


def test_the_setpoint_in_the_trace_carries_the_token_it_follows_from(config: Path, tmp_path: Path) -> None:
    _, trace = run(config, tmp_path / "t", 0, seconds=0.4)
    moving = np.abs(trace.rows["setpoint"]).max(axis=1) > 0
    assert np.all(trace.rows["epoch"][moving] == 1)
    assert np.all(trace.rows["sequence"][~moving][:10] == -1)
    assert np.all(np.diff(trace.rows["sequence"]) >= 0)


def test_scenery_shows_the_row_once(config: Path) -> None:
    core = simulated_bridge(config, 0)
    sceneries = [out.scenery for out in (core.step(i * 1e-3) for i in range(100)) if out.scenery is not None]
    assert len(sceneries) == 1
    assert {"post", "cordon", "cane", "wire"} <= {capsule.kind for capsule in sceneries[0].capsules}
    assert all(encode(scenery) for scenery in sceneries)
