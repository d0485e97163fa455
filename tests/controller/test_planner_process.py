"""The planner's own process: it answers as the planner does, steps back, and never outlives who started it."""

import os
import signal
import subprocess
import sys

import numpy as np
import psutil
import pytest

from controller.planner_process import PlannerProcess
from controller.planning.preview_plan import PreviewRequest
from controller.planning.rollout import Rollout
from rolling_panda import reasons
from rolling_panda.config import RobotConfig
from rolling_panda.generate.__main__ import ROOT
from rolling_panda.reasons import text_of
from tests.controller.test_cuts import CONFIG, PLANNER, POST, point, request
from tests.support.waiting import until

pytestmark = pytest.mark.processes


@pytest.fixture
def worker():
    worker = PlannerProcess(CONFIG, RobotConfig())
    yield worker
    worker.close()
    assert worker.pid is None or not psutil.pid_exists(worker.pid)


def answered(worker, asked):
    worker.ask(asked)
    made = []
    until(lambda: made.extend(worker.take()) or made)
    assert made[0].request.number == asked.number
    return made[0]


@pytest.mark.long
def test_it_answers_as_the_planner_in_this_process_does_and_at_low_priority(worker) -> None:
    asked = request(point("a", 0.3), point("in", 0.5), point("b", 1.4), obstacles=(POST,))
    made = answered(worker, asked)
    here = PLANNER.plan(asked)
    assert made.digest == here.digest and made.refused == here.refused
    np.testing.assert_array_equal(made.track, here.track)
    assert [cut.rollout for cut in made.cuts] == [cut.rollout for cut in here.cuts]
    np.testing.assert_array_equal(made.cuts[0].cut.poses.clear.homogeneous, here.cuts[0].cut.poses.clear.homogeneous)
    assert os.sched_getscheduler(worker.pid) == os.SCHED_OTHER
    assert psutil.Process(worker.pid).nice() >= 5


@pytest.mark.long
def test_what_cannot_be_planned_from_is_answered_with_a_failure_and_a_dead_process_is_replaced(worker) -> None:
    broken = request(point("a", 0.3), number=2)
    broken.q[0] = np.nan
    assert "every coordinate must be finite" in text_of(answered(worker, broken).failure)
    first = worker.pid
    os.kill(first, signal.SIGKILL)
    until(lambda: not psutil.pid_exists(first) or psutil.Process(first).status() == psutil.STATUS_ZOMBIE)
    assert answered(worker, request(point("a", 0.3), number=3)).failure == reasons.planner_ended()
    assert len(answered(worker, request(point("a", 0.3), number=4)).cuts) == 1
    assert worker.pid != first


@pytest.mark.long
def test_it_ends_with_a_parent_that_is_killed() -> None:
    program = (
        "import time\n"
        "from controller.config import ControllerConfig\n"
        "from controller.planner_process import PlannerProcess\n"
        "from controller.planning.work_plan import PlanRequest\n"
        "from rolling_panda.config import RobotConfig\n"
        "import numpy as np\n"
        "if __name__ == '__main__':\n"
        "    worker = PlannerProcess(ControllerConfig(), RobotConfig())\n"
        "    worker.ask(PlanRequest(1, np.zeros(12), ()))\n"
        "    while worker.pid is None:\n"
        "        time.sleep(0.02)\n"
        "    print(worker.pid, flush=True)\n"
        "    time.sleep(60)\n"
    )
    parent = subprocess.Popen([sys.executable, "-c", program], cwd=ROOT, stdout=subprocess.PIPE, text=True)
    with parent:
        assert parent.stdout is not None
        child = int(parent.stdout.readline())
        parent.kill()
    until(lambda: not psutil.pid_exists(child))


@pytest.mark.long
def test_a_preview_is_answered_as_the_rollout_in_this_process_does_before_a_plan_that_waits(worker) -> None:
    asked = request(point("a", 0.3), number=7)
    wanted = PreviewRequest(1, asked.q, asked.points)
    worker.ask(asked)
    worker.ask(wanted)
    made = []
    until(lambda: made.extend(worker.take()) or len(made) == 2)
    assert made[0].digest == Rollout(CONFIG, RobotConfig()).roll(wanted).digest
    assert made[1].request.number == 7
