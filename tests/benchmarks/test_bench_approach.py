import json

import numpy as np
import pytest

from benchmarks.__main__ import main
from benchmarks.control import approach
from benchmarks.control.arm_path import ArmPath
from benchmarks.control.plan_limits import plan_limits
from controller.whole_body.collision import CollisionModel
from controller.whole_body.obstacle import Obstacle
from rolling_panda.model.robot import ARM_Q, RobotModel

LIMITS = plan_limits(RobotModel(), 0.8, 0.6, clearance=0.005)
POST = Obstacle("post", "post", (0.55, 0.0, 0.0), (0.55, 0.0, 2.0), 0.05)
LEFT, RIGHT = np.array([1.0, 0.6, 0.0, -1.5, 0.0, 2.1, 0.8]), np.array([-1.0, 0.6, 0.0, -1.5, 0.0, 2.1, 0.8])


@pytest.mark.long
def test_a_task_begins_and_ends_clear_of_what_stays_and_stands():
    (first, *others) = approach.tasks(4200, LIMITS)
    assert others
    collision = CollisionModel(RobotModel())
    collision.set_obstacles(first.obstacles)
    assert {obstacle.kind for obstacle in first.obstacles} >= {"post", "wire", "cordon", "trunk", "cane"}
    at_goal = first.q.copy()
    at_goal[ARM_Q] = first.goal
    for q in (first.q, at_goal):
        assert collision.least(q).distance >= LIMITS.clearance


def test_a_way_that_is_too_near_is_seen_though_its_ends_are_clear(monkeypatch):
    q = np.zeros(12)
    q[ARM_Q] = LEFT
    task = approach.Task(0, q, RIGHT, (POST,))
    straight = ArmPath(np.array([LEFT, RIGHT]))
    monkeypatch.setattr(approach.ArmPathPlanner, "find", lambda self, q, goal: straight)
    judged = approach.way(task, "ours", LIMITS, 1.0)
    assert judged.found and judged.clearance < 0.0 and judged.corners == 0
    assert approach.summarise([judged])["too_near"] == 1


@pytest.mark.long
def test_the_command_prints_each_planner_and_writes_every_way(tmp_path, capsys):
    path = tmp_path / "approach.json"
    assert main(["approach", "--seed", "4200", "--count", "1", "--most", "3", "--json", str(path)]) == 0
    document = json.loads(path.read_text())
    assert document["summary"]["ours"]["tasks"] == 3 and len(document["results"]) == 3
    assert "planned_ms_p99" in capsys.readouterr().out


@pytest.mark.parametrize("words", [["--count", "0"], ["--most", "0"], ["--seconds", "0"], ["--planner", "prm"]])
def test_wrong_numbers_and_unknown_planners_are_refused(words, capsys):
    with pytest.raises(SystemExit) as end:
        approach.main(words)
    assert end.value.code == 2
    assert "at least 1" in (error := capsys.readouterr().err) or "invalid choice" in error
