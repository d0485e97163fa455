"""The session's plan in the running system: what is accepted over REST is planned and can be read there."""

import os
from pathlib import Path
from typing import Any

import httpx
import psutil
import pytest

from tests.support.processes.live_robot import LiveRobot

# What the planner answers is tested in test_planner_process.py, what the page shows in test_page_plan.py.
pytestmark = [pytest.mark.alone, pytest.mark.slow]


def proposed(robot: LiveRobot) -> list[dict[str, Any]]:
    return [row for row in robot.points() if row["entry"]["state"] == "PROPOSED"]


def plan_of(robot: LiveRobot, wanted: set[str]) -> dict[str, Any] | None:
    """The plan, once it holds and is for these points."""
    response: httpx.Response = robot.client.get("/api/plan")
    if response.status_code != 200:
        return None
    plan: dict[str, Any] = response.json()
    named = {each["point_id"] for each in plan["points"]}
    return plan if plan["state"] == "valid" and named == wanted else None


def shown(robot: LiveRobot) -> list[str]:
    """The planned points as the page lists them, where their numbers say the same."""
    rows = [row for row in robot.points() if row["plan"] and row["plan"]["order"]]
    numbered = [row["plan"]["order"] for row in rows] == list(range(1, len(rows) + 1))
    return [row["point"]["point_id"] for row in rows] if numbered else []


def lowered_threads(robot: LiveRobot) -> set[int]:
    """Threads of the controller that step back; its loop would wait while they hold the interpreter's lock."""
    threads = {thread.id for thread in psutil.Process(robot.processes["controller"].pid).threads()}
    usual = os.getpriority(os.PRIO_PROCESS, 0)
    return {thread for thread in threads if os.getpriority(os.PRIO_PROCESS, thread) > usual}


def test_accepted_points_are_planned_in_an_order_with_times_or_refused_with_reasons(tmp_path: Path) -> None:
    with LiveRobot(tmp_path) as robot:
        robot.wait(lambda: len(proposed(robot)) >= 3, 60, "three proposed points")
        chosen = proposed(robot)[:3]
        for row in chosen:
            robot.post(f"points/{row['point']['point_id']}/accept", revision=row["point"]["revision"])
        ids = {row["point"]["point_id"] for row in chosen}
        plan = robot.wait(lambda: plan_of(robot, ids), 60, "a plan of the accepted points")
        assert len(plan["plan_hash"]) == 64
        planned = [each for each in plan["points"] if each["order"]]
        refused = [each for each in plan["points"] if not each["order"]]
        assert planned and [each["order"] for each in planned] == list(range(1, len(planned) + 1))
        assert all(each["reason"] for each in refused)
        for each in planned:
            rolled = each["rollout"]
            assert rolled.get("reason") is None and rolled["begins_s"] < rolled["cut_s"] < rolled["ends_s"]
            assert rolled["clearance"] > 0.0 and rolled["manipulability"] > 0.0
        beside = psutil.Process(robot.processes["controller"].pid).children()
        assert beside and {os.sched_getscheduler(child.pid) for child in beside} == {os.SCHED_OTHER}
        assert any(os.getpriority(os.PRIO_PROCESS, child.pid) > os.getpriority(os.PRIO_PROCESS, 0) for child in beside)
        assert not lowered_threads(robot)
        order = [each["point_id"] for each in planned]
        robot.wait(lambda: shown(robot) == order, 10, "the queue on the page in the plan's order")
        robot.post(f"points/{order[0]}/reject", reason="not this one")
        other = robot.wait(lambda: plan_of(robot, ids - {order[0]}), 60, "a plan without the rejected point")
        assert other["plan_hash"] != plan["plan_hash"]
