import json
import sys

import numpy as np
import pytest

from benchmarks.__main__ import main
from benchmarks.control import reach, reach_targets
from benchmarks.control.arm_ik import ArmIk
from benchmarks.control.reach_judge import BaseBounds, Trajectory, judge, rolling, violations
from benchmarks.control.reach_run import BASE, Runner
from controller.whole_body.collision import CollisionModel
from rolling_panda.errors import InputError
from rolling_panda.model.robot import RobotModel

ROBOT = RobotModel()
GOOD = {
    "start": {"base": [0.5, -1.0, 2.0], "arm": list(reach_targets.HOME)},
    "goal": {"position": [2.0, 1.0, 0.9], "quat_xyzw": [0.0, 0.7071068, 0.0, 0.7071068]},
    "free_axis": "tool_y",
}


def still(rows=5):
    q = np.tile(reach_targets.draw(0, 1, "none")[0].q, (rows, 1))
    return Trajectory(0.01 * np.arange(rows), q, np.zeros((rows, 9)))


def test_a_file_is_read_as_it_says(tmp_path):
    path = tmp_path / "targets.json"
    path.write_text(json.dumps({"targets": [GOOD]}))
    (target,) = reach_targets.read(path)
    np.testing.assert_array_equal(target.q[:3], [0.5, -1.0, 2.0])
    assert target.free
    np.testing.assert_allclose(target.T_odom_goal.rotation[:, 2], [1.0, 0.0, 0.0], atol=1e-7)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"free_axis": "tool_x"}, "free_axis"),
        ({"start": {"base": [0, 0], "arm": [0] * 7}}, "start.base"),
        ({"goal": {"position": [0, 0, 1], "quat_xyzw": [0, 0, 0, 2]}}, "it must be 1"),
        ({"goal": {"position": [0, 0, 1e9], "quat_xyzw": [0, 0, 0, 1]}}, "position"),
        ({"extra": 1}, "extra"),
    ],
)
def test_a_wrong_file_gets_one_clear_line(tmp_path, capsys, change, words):
    path = tmp_path / "targets.json"
    path.write_text(json.dumps({"targets": [GOOD | change]}))
    assert main(["reach", "--targets", str(path)]) == 1
    error = capsys.readouterr().err
    assert words in error and error.count("\n") == 1 and "Traceback" not in error
    with pytest.raises(InputError):
        reach_targets.read(path)


@pytest.mark.parametrize("text", ["", "{}", '{"targets": []}', '{"targets": [{}]}', "[NaN]", "\xff"])
def test_what_are_no_targets_is_refused(tmp_path, text):
    path = tmp_path / "targets.json"
    path.write_bytes(text.encode("latin-1"))
    with pytest.raises(InputError):
        reach_targets.read(path)


def test_drawn_targets_are_where_they_should_be_and_repeat():
    targets = reach_targets.draw(7, 500, "none")
    assert targets == reach_targets.draw(7, 500, "none") != reach_targets.draw(8, 500, "none")
    positions = np.array([target.goal.position for target in targets])
    assert (np.abs(positions[:, :2]) <= 4.0).all() and positions[:, 2].min() >= 0.4 and positions[:, 2].max() <= 1.5
    assert np.abs(positions[:, :2]).max() > 3.9
    approach = np.array([target.T_odom_goal.rotation[:, 2] for target in targets])
    tilt = np.degrees(np.arcsin(approach[:, 2]))
    assert np.abs(tilt).max() <= 40.0 + 1e-6 and tilt.min() < -38.0 and tilt.max() > 38.0
    # Any yaw: all four quarters about alike.
    quarters = np.histogram(np.arctan2(approach[:, 1], approach[:, 0]), bins=4, range=(-np.pi, np.pi))[0]
    assert quarters.min() > 80


def test_only_what_no_posture_reaches_is_called_beyond_reach():
    ik = ArmIk(ROBOT)
    runner = Runner("hierarchy")
    for target in reach_targets.draw(5, 60, "none"):
        if reach_targets.beyond(ik, target) is not None:
            assert runner.run(target.q, target.T_odom_goal, False).refused
    assert all(reach_targets.beyond(ik, target) is None for target in reach_targets.draw(5, 60, "tool_y"))


def test_the_judge_counts_what_is_broken_and_how_much():
    assert violations(ROBOT, BASE, still()).total == 0
    outside = still()
    outside.q[:, 6] = ROBOT.limits.upper[6] + 0.2
    found = violations(ROBOT, BASE, outside)
    assert (found.position, found.velocity, found.acceleration) == (5, 0, 0)
    assert found.position_size == pytest.approx(0.2)
    jump = still()
    jump.q[3:, 5] += 0.05
    found = violations(ROBOT, BASE, jump)
    assert found.velocity == 1 and found.velocity_size == pytest.approx(5.0 - 2.175)
    assert found.acceleration == 2 and found.acceleration_size == pytest.approx(500.0 - 15.0)


def test_the_judge_sees_a_base_that_is_too_fast_or_slips():
    t = 0.01 * np.arange(300)
    q, xi = np.tile(still().q[0], (300, 1)), np.zeros((300, 9))
    xi[:-1, :2] = 1.0 / ROBOT.drive.wheel_radius * np.minimum(1.0, np.minimum(t[1:], t[:0:-1]))[:, None]
    q[1:, 3:5] = np.cumsum(xi[:-1, :2], axis=0) * 0.01
    q[:, 0] = q[:, 3] * ROBOT.drive.wheel_radius
    done = Trajectory(t, q, xi)
    assert rolling(ROBOT, done) < 1e-9
    assert violations(ROBOT, BaseBounds(1.1, 0.6), done).total == 0
    found = violations(ROBOT, BASE, done)
    assert found.velocity > 50 and found.velocity_size == pytest.approx(0.2)
    q[150:, 1] += 1e-3
    assert rolling(ROBOT, done) == pytest.approx(1e-3)


def test_standing_still_away_from_the_goal_is_not_reaching():
    target = reach_targets.draw(0, 1, "none")[0]
    quality = judge(ROBOT, CollisionModel(RobotModel()), BASE, still(), target.T_odom_goal, False)
    assert not quality.reached and quality.position_error > 0.5 and quality.duration == pytest.approx(0.04)
    at_home = judge(ROBOT, CollisionModel(RobotModel()), BASE, still(), ROBOT.pose(still().q[0], ROBOT.tool_id), False)
    assert at_home.reached and at_home.omega_mean == pytest.approx(0.095, abs=0.002)


@pytest.mark.long
@pytest.mark.parametrize("free_axis", ["none", "tool_y"])
def test_goals_anywhere_are_reached_without_breaking_a_limit(free_axis, tmp_path):
    rows = reach.run(reach_targets.draw(21, 12, free_axis), "hierarchy", 0, 1, tmp_path)
    summary = reach.summarise(rows)
    assert summary["reached_share_of_the_others"] == 1.0
    assert all(summary["violations"][kind]["count"] == 0 for kind in ("position", "velocity", "acceleration"))
    assert summary["rolling_largest"] < 1e-9 and summary["clearance_m_least"] > 0.0
    assert summary["duration_s_max"] <= 30.0
    with np.load(tmp_path / "target_0003.npz") as file:
        t, q, xi = file["t"], file["q"], file["xi"]
    assert q.shape == (len(t), 12) and xi.shape == (len(t), 9)
    assert t[-1] == pytest.approx(rows[3].quality.duration)


@pytest.mark.long
def test_no_motion_from_anywhere_comes_below_the_clearance_that_it_began_with():
    rows = reach.run(reach_targets.draw(48, 12, "none", anywhere=True), "hierarchy", 0, 1)
    clear = [row.quality for row in rows if row.quality.clearance_start > 0.0]
    within = [row.quality for row in rows if row.quality.clearance_start <= 0.0]
    assert len(clear) >= 6 and within
    assert max(quality.clearance_lost for quality in clear) <= 0.0
    # Where parts overlap, their nearest points jump from face to face.
    assert max(quality.clearance_lost for quality in within) < 0.002


@pytest.mark.parametrize("height", [1.47, 1.485])
def test_goals_near_the_end_of_the_reach_are_kept_to_although_the_arm_is_almost_straight(height):
    target = reach_targets.Target(
        reach_targets.Start((0.0, 0.0, 0.0), reach_targets.HOME),
        reach_targets.Goal((3.0, 1.0, height), (0.0, 0.7071068, 0.0, 0.7071068)),
    )
    (row,) = reach.run([target], "hierarchy", 0, 1)
    assert row.quality.reached and row.quality.violations.total == 0
    assert row.quality.omega_least < 0.04


@pytest.mark.slow
def test_driving_first_takes_longer_and_a_straight_screw_reaches_less():
    targets = reach_targets.draw(21, 4, "none")
    by_method = {method: reach.run(targets, method, 0, 1) for method in ("hierarchy", "decoupled", "nullspace")}
    together, apart = (
        [row.quality.duration for row in by_method[method] if row.quality.reached]
        for method in ("hierarchy", "decoupled")
    )
    assert len(together) == len(apart) and np.mean(apart) > np.mean(together) + 0.5
    straight = sum(row.quality.reached for row in by_method["nullspace"])
    assert straight < len(together)


@pytest.mark.long
@pytest.mark.parametrize("goals", ["anywhere", "row"])
def test_no_motion_is_quicker_than_its_lower_bound(goals):
    rows = reach.run(reach_targets.draw(22, 6, "none", goals=goals), "hierarchy", 0, 1)
    bounds = [(row.least_s, row.quality) for row in rows if row.least_s is not None]
    assert len(bounds) >= 5
    for least_s, quality in bounds:
        assert 0.3 < least_s < quality.duration
        assert quality.settled is not None and quality.settled <= quality.duration
    assert 1.0 < reach.summarise(rows)["settled_over_least_median"] < 4.0


def test_goals_like_cuts_are_left_of_the_base_with_the_tool_across_the_row():
    for target in reach_targets.draw(23, 30, "none", goals="row"):
        goal = target.T_odom_goal
        assert -0.5 <= goal.translation[0] <= 2.0 and 0.65 <= goal.translation[1] <= 0.85
        assert goal.rotation[1, 2] > 0.7 and goal.rotation[2, 1] > 0.85


def test_a_pair_loses_clearance_only_below_what_is_kept_of_it_or_what_it_began_with():
    q = still(40).q
    # A posture that runs the tool into the base.
    q = np.linspace(q[0], reach_targets.draw(43, 83, "none", anywhere=True)[82].q, 40)
    t, xi = 0.01 * np.arange(40), np.zeros((40, 9))
    goal, collision = ROBOT.pose(q[-1], ROBOT.tool_id), CollisionModel(RobotModel())
    came_nearer = judge(ROBOT, collision, BASE, Trajectory(t, q, xi), goal, False)
    began_there = judge(ROBOT, collision, BASE, Trajectory(t, np.tile(q[-1], (40, 1)), xi), goal, False)
    assert came_nearer.clearance_least == began_there.clearance_least < 0.0
    assert came_nearer.clearance_lost > 0.0 and began_there.clearance_lost == pytest.approx(0.0, abs=1e-9)


def test_settled_is_when_the_tool_comes_for_good_and_none_where_it_leaves_again():
    q = still(9).q
    q[3:6, 11] += 0.5
    goal = ROBOT.pose(q[0], ROBOT.tool_id)
    moving = Trajectory(0.01 * np.arange(9), q, np.zeros((9, 9)))
    assert judge(ROBOT, CollisionModel(RobotModel()), BASE, moving, goal, False).settled == pytest.approx(0.06)
    gone = Trajectory(0.01 * np.arange(5), q[:5], np.zeros((5, 9)))
    assert judge(ROBOT, CollisionModel(RobotModel()), BASE, gone, goal, False).settled is None


def test_a_peer_that_is_not_installed_is_refused_with_how_to_get_it(monkeypatch, capsys):
    monkeypatch.setitem(sys.modules, "mink", None)
    assert main(["reach", "--count", "1", "--jobs", "1", "--method", "mink"]) == 1
    assert "mink is not installed" in (error := capsys.readouterr().err) and "make peers" in error
    monkeypatch.setitem(sys.modules, "crocoddyl", None)
    assert main(["reach", "--count", "1", "--jobs", "1", "--method", "mpc"]) == 1
    assert "mpc is not installed" in (error := capsys.readouterr().err) and "make peers" in error


@pytest.mark.long
def test_methods_are_judged_beside_each_other_on_the_same_goals(tmp_path, capsys):
    path = tmp_path / "reach.json"
    words = ["--count", "2", "--seed", "41", "--goals", "row", "--jobs", "1", "--json", str(path)]
    assert reach.main([*words, "--method", "hierarchy", "holistic"]) == 0
    ours, theirs = json.loads(path.read_text())["methods"]
    assert [ours["method"], theirs["method"]] == ["hierarchy", "holistic"]
    assert [row["least_s"] for row in ours["results"]] == [row["least_s"] for row in theirs["results"]]
    for document in (ours, theirs):
        assert document["summary"]["violations"]["velocity"]["count"] == 0
        assert document["summary"]["violations"]["acceleration"]["count"] == 0
        assert document["summary"]["step_us_p99"] > 10.0
    assert theirs["summary"]["near"] >= 1
    table = capsys.readouterr().out.splitlines()[-2:]
    assert table[0].startswith("hierarchy") and table[1].startswith("holistic")


@pytest.mark.long
@pytest.mark.long
def test_kinds_of_goals_are_taken_in_turn_until_the_time_is_over_with_the_same_goals_for_all(tmp_path, capsys):
    path = tmp_path / "reach.json"
    words = ["--count", "3", "--seed", "41", "--goals", "row", "axis_free", "--method", "nullspace", "hierarchy"]
    assert reach.main([*words, "--minutes", "0", "--json", str(path)]) == 0
    documents = json.loads(path.read_text())["methods"]
    assert [(document["kind"], document["method"]) for document in documents] == [
        ("row", "nullspace"),
        ("row", "hierarchy"),
        ("axis_free", "nullspace"),
        ("axis_free", "hierarchy"),
    ]
    # No time at all is one goal each, the first one.
    assert [[row["target"] for row in document["results"]] for document in documents] == [[0]] * 4
    distances = [document["results"][0]["distance"] for document in documents]
    assert distances[0] == distances[1] != distances[2] == distances[3]
    assert documents[2]["targets"] == "drawn: seed 41, free axis tool_y, goals anywhere"
    shown = capsys.readouterr().out
    assert "row " in shown and "axis_free" in shown


def test_a_time_for_goals_of_a_file_is_refused(tmp_path, capsys):
    assert main(["reach", "--minutes", "9", "--targets", str(tmp_path / "none.json")]) == 1
    assert "--minutes is for drawn goals" in capsys.readouterr().err


@pytest.mark.long
def test_a_motion_that_is_stuck_ends_before_the_time_is_over():
    target = reach_targets.draw(41, 1, "none", goals="anywhere")[0]
    (row,) = reach.run([target], "nullspace", 0, 1)
    assert not row.quality.reached and 3.0 < row.quality.duration < 15.0


def test_the_command_prints_a_table_and_writes_every_figure(tmp_path, capsys):
    path = tmp_path / "folder" / "reach.json"
    assert reach.main(["--count", "2", "--seed", "21", "--jobs", "2", "--json", str(path)]) == 0
    printed = capsys.readouterr().out
    assert "reached (1 mm, 0.5°, 30 s)" in printed and "acceleration limits broken" in printed
    document = json.loads(path.read_text())
    assert len(document["results"]) == 2
    assert {"reached", "position_error", "violations", "omega_mean", "reason"} <= document["results"][0].keys()
