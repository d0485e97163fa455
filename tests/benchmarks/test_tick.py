import json
import sys

import numpy as np
import pinocchio as pin
import pytest

from benchmarks.__main__ import main
from benchmarks.control import tick
from benchmarks.peers import run
from benchmarks.peers.problem import write_problem
from controller.config import ControllerConfig


@pytest.mark.long
def test_tick_writes_the_figures_it_prints(tmp_path, capsys):
    file = tmp_path / "tick.json"
    assert main(["tick", "--steps", "150", "--json", str(file)]) == 0
    figures = json.loads(file.read_text())
    assert figures["steps"] == 150
    assert 0 < figures["median_us"] <= figures["p99_us"] <= figures["max_us"]
    assert sum(figures["histogram"].values()) == 150
    parts = figures["parts"]
    assert {"kinematics", "collision", "tipping", "bounds", "step", "nullspace step"} <= parts.keys()
    assert all(0 < times["median_us"] <= times["max_us"] for name, times in parts.items() if "null space" not in name)
    assert parts["collision"]["median_us"] < parts["step"]["median_us"]
    assert f"median {figures['median_us']} us" in capsys.readouterr().out


def test_no_steps_are_refused(capsys):
    with pytest.raises(SystemExit) as end:
        tick.main(["--steps", "0"])
    assert end.value.code == 2
    assert "at least 1" in capsys.readouterr().err


def test_an_unknown_benchmark_is_refused_with_the_known_ones(capsys):
    with pytest.raises(SystemExit) as end:
        main(["tock"])
    assert end.value.code == 2
    assert "tick" in capsys.readouterr().err


def script(folder, body):
    """A peer's script with this body."""
    path = folder / "peer.py"
    path.write_text(body)
    return path


def answer(failed):
    figures = {"name": "Peer", "version": "1", "note": "", "median_us": 1.0, "p99_us": 2.0, "max_us": 3.0}
    return f"print({json.dumps(json.dumps(figures | {'steps': 100, 'failed': failed}))})"


def test_a_peer_that_is_not_installed_is_absent_and_says_why(tmp_path):
    found = run.run_script(sys.executable, script(tmp_path, "import no_such_solver"), tmp_path)
    assert found == {"absent": "ModuleNotFoundError: No module named 'no_such_solver'"}


def test_a_peer_that_finds_no_answers_has_no_time(tmp_path):
    assert run.run_script(sys.executable, script(tmp_path, answer(2)), tmp_path)["median_us"] == 1.0
    found = run.run_script(sys.executable, script(tmp_path, answer(90)), tmp_path)
    assert found == {"absent": "no answer to 90 of 100 problems"}


def test_peers_get_the_same_robot_and_the_same_problems(tmp_path):
    config = ControllerConfig()
    demands = tick.recorded(60)
    write_problem(tmp_path, demands, config)
    theirs = pin.buildModelFromUrdf(str(tmp_path / "robot.urdf"))
    problem = np.load(tmp_path / "problem.npz")
    order = [problem["names"].tolist().index(name) for name in list(theirs.names)[1:]]
    data = theirs.createData()
    for i in (0, 30, 59):
        pin.framesForwardKinematics(theirs, data, problem["q"][i][order])
        T = data.oMf[theirs.getFrameId("tool")]
        assert np.allclose(T.homogeneous, demands[i].kinematics.T_odom_tool.homogeneous)
        moved = problem["target"][i][:3, 3] - T.translation
        assert np.allclose(moved, demands[i].tool.twist[:3] / config.rate_hz)
