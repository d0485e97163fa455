from contextlib import nullcontext
from types import SimpleNamespace
from typing import get_args

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from rolling_panda.messages.page import CameraPreset
from rolling_panda.messages.perception import Capsule
from server.scene.cameras import USER_PRIORITY_S, SceneCameras, close_up, preset_pose
from server.scene.sight import blocked

TOOL = np.array([0.6, 0.5, 1.0])
SERVER = SimpleNamespace(initial_camera=SimpleNamespace())


def at(x=0.0, y=0.0, heading=0.0):
    q = np.zeros(12)
    q[:3] = x, y, heading
    return q


def view(client_id=1):
    camera = SimpleNamespace(position=np.zeros(3), look_at=np.ones(3), up_direction=None)
    return SimpleNamespace(client_id=client_id, camera=camera, atomic=nullcontext)


def placed():
    """Cameras that have seen one view, which stands beside the row."""
    cameras, mine = SceneCameras(SERVER), view()
    mine.camera.position = np.array([-1.0, -2.0, 2.0])
    cameras.step([mine], 0.0)
    return cameras, mine


@pytest.mark.parametrize("preset", get_args(CameraPreset))
def test_a_preset_goes_with_the_robot(preset):
    here, there = preset_pose(preset, at(), TOOL), preset_pose(preset, at(3.0, 0.2), TOOL + [3.0, 0.2, 0.0])
    assert there.position - here.position == pytest.approx([3.0, 0.2, 0.0])
    assert there.look_at - here.look_at == pytest.approx([3.0, 0.2, 0.0])
    assert np.linalg.norm(here.position - here.look_at) > 0.5 and here.position[2] > 0.5


def test_it_turns_with_the_base():
    turned = preset_pose("follow", at(heading=np.pi / 2), TOOL)
    straight = preset_pose("follow", at(), TOOL)
    assert turned.position == pytest.approx([-straight.position[1], straight.position[0], straight.position[2]])


def test_the_preset_of_the_tool_shows_the_blades_and_what_they_point_at():
    ahead = np.array([0.0, 1.0, 0.0])
    pose = preset_pose("tool", at(), TOOL, ahead)
    sight = (pose.look_at - pose.position) / np.linalg.norm(pose.look_at - pose.position)
    for place in (TOOL, TOOL + 0.2 * ahead):
        away = place - pose.position
        assert np.degrees(np.arccos(sight @ away / np.linalg.norm(away))) < 20.0, "both are near the middle of the view"
    arm = Capsule("post", tuple(TOOL), tuple(TOOL + 2.0 * (pose.position - TOOL)), 0.08, 0.08)
    beside = preset_pose("tool", at(), TOOL, ahead, [arm])
    # The arm begins at the tool, so that a little of it is before the tool from everywhere.
    assert blocked(beside.position, TOOL, [arm]) < 0.2 * blocked(pose.position, TOOL, [arm])


def test_a_view_of_the_tool_goes_with_it():
    cameras, mine = SceneCameras(SERVER), view()
    cameras.apply_preset("tool", [mine], at(), TOOL)
    before = mine.camera.position.copy()
    cameras.follow(at(1.0), TOOL + [0.0, 0.1, 0.2])
    assert mine.camera.position - before == pytest.approx([0.0, 0.1, 0.2])


def test_the_arm_does_not_stand_before_a_point_that_is_looked_at_closely():
    position = np.array([2.0, -0.5, 1.2])
    plain = close_up(POINT, position, 0.0)
    arm = Capsule("post", tuple(POINT + 0.4 * (plain.position - POINT)), (2.0, 0.0, 0.4), 0.08, 0.08)
    beside = close_up(POINT, position, 0.0, [arm])
    assert blocked(plain.position, POINT, [arm]) > 0.0 == blocked(beside.position, POINT, [arm])
    assert (beside.look_at == POINT).all()


def test_a_view_that_opens_later_begins_near_the_robot():
    begin = SimpleNamespace()
    cameras = SceneCameras(SimpleNamespace(initial_camera=begin))
    before = begin.position.copy()
    cameras.follow(at(0.1))
    assert begin.position == pytest.approx(before), "views are not told of every centimetre"
    cameras.follow(at(12.0, 0.5))
    assert begin.position - before == pytest.approx([12.0, 0.5, 0.0])
    assert begin.look_at == pytest.approx(preset_pose("follow", at(12.0, 0.5), TOOL).look_at)


def test_only_the_view_that_follows_goes_along_and_only_once_the_base_has_moved():
    cameras, mine, other = SceneCameras(SERVER), view(1), view(2)
    cameras.apply_preset("follow", [mine], at(), TOOL)
    cameras.apply_preset("row", [other], at(), TOOL)
    before, stays = mine.camera.position.copy(), other.camera.position.copy()
    cameras.follow(at(0.002))
    assert mine.camera.position == pytest.approx(before)
    cameras.follow(at(0.5))
    assert mine.camera.position - before == pytest.approx([0.5, 0.0, 0.0])
    assert other.camera.position == pytest.approx(stays)


def test_a_late_report_of_where_it_was_put_is_not_taken_for_a_hand():
    cameras, mine = SceneCameras(SERVER), view()
    cameras.apply_preset("follow", [mine], at(), TOOL)
    start = mine.camera.position.copy()
    late = start.copy()
    for step in range(1, 20):
        cameras.follow(at(0.02 * step))
        put = mine.camera.position.copy()
        mine.camera.position = late
        late = put
    cameras.follow(at(1.0))
    assert mine.camera.position - start == pytest.approx([1.0, 0.0, 0.0])


def test_who_moves_the_camera_keeps_it_so_and_it_goes_along():
    cameras, mine = SceneCameras(SERVER), view()
    cameras.apply_preset("follow", [mine], at(), TOOL)
    mine.camera.position, mine.camera.look_at = np.array([2.0, 2.0, 2.0]), np.array([0.0, 1.0, 1.0])
    cameras.follow(at(0.3))
    assert mine.camera.position == pytest.approx([2.3, 2.0, 2.0])
    assert mine.camera.look_at == pytest.approx([0.3, 1.0, 1.0])


def test_a_closed_view_and_one_that_chose_another_preset_follow_no_more():
    cameras, mine, closed = SceneCameras(SERVER), view(1), view(2)
    cameras.apply_preset("follow", [mine, closed], at(), TOOL)
    cameras.apply_preset("top", [mine], at(), TOOL)
    cameras.forget(2)
    before = mine.camera.position.copy(), closed.camera.position.copy()
    cameras.follow(at(1.0))
    assert (mine.camera.position == before[0]).all() and (closed.camera.position == before[1]).all()


POINT = np.array([2.0, 0.75, 1.0])
TICK = 1.0 / 30.0


def brought(cameras, views, since, until):
    """Let time pass (s); returns the path of the first view's camera."""
    path = []
    for now in np.arange(since, until, TICK):
        cameras.step(views, float(now))
        path.append(views[0].camera.position.copy())
    return np.array(path)


def looks_at_it(one):
    away = np.linalg.norm(one.camera.position - POINT)
    return bool(0.49 < away < 1.01 and np.allclose(one.camera.look_at, POINT))


def test_a_camera_flies_to_the_point_that_was_chosen_and_stays_there():
    cameras, mine, other = SceneCameras(SERVER), view(1), view(2)
    mine.camera.position = other.camera.position = np.array([-1.0, -2.0, 2.0])
    cameras.step([mine, other], 0.0)
    cameras.fly([mine], POINT)
    path = brought(cameras, [mine, other], 0.0, 1.0)
    assert looks_at_it(mine) and (other.camera.position == [-1.0, -2.0, 2.0]).all()
    assert np.linalg.norm(np.diff(path, axis=0), axis=1).max() < 0.5, "it flies, it does not jump"
    cameras.follow(at(1.0))
    assert looks_at_it(mine), "and goes along with the robot no more"


COORDINATE = st.floats(-4.0, 4.0)


@given(st.tuples(COORDINATE, COORDINATE, COORDINATE), st.sampled_from([0.0, np.pi, 0.7]))
def test_from_wherever_it_comes_it_rests_near_the_point_before_the_row_and_above(position, heading):
    side = np.array([-np.sin(heading), np.cos(heading), 0.0])
    there = close_up(POINT, np.array(position), heading)
    away = there.position - POINT
    assert 0.499 < np.linalg.norm(away) < 1.001 and (there.look_at == POINT).all()
    assert away @ side < 0.0 and away[2] > -0.2


def test_who_has_just_moved_the_camera_is_taken_along_a_while_later_and_at_once_by_choosing():
    cameras, mine = placed()
    mine.camera.position = np.array([-1.2, -2.0, 2.0])
    cameras.step([mine], 10.0)
    cameras.fly([mine], POINT, wait_for_user=True)
    path = brought(cameras, [mine], 10.0, 10.0 + USER_PRIORITY_S - 0.1)
    assert (path == [-1.2, -2.0, 2.0]).all(), "it is theirs for a while"
    brought(cameras, [mine], 10.0 + USER_PRIORITY_S, 11.0 + USER_PRIORITY_S)
    assert looks_at_it(mine)
    mine.camera.position = mine.camera.position + [0.3, 0.0, 0.0]
    cameras.step([mine], 30.0)
    cameras.fly([mine], POINT)
    brought(cameras, [mine], 30.0, 31.0)
    assert looks_at_it(mine)


def test_a_hand_at_the_camera_ends_its_flight():
    cameras, mine = placed()
    cameras.fly([mine], POINT)
    brought(cameras, [mine], 0.0, 0.2)
    mine.camera.position = np.array([0.0, -3.0, 3.0])
    brought(cameras, [mine], 0.2, 20.0)
    assert (mine.camera.position == [0.0, -3.0, 3.0]).all()


def test_a_preset_is_kept_for_a_while_too():
    cameras, mine = SceneCameras(SERVER), view()
    cameras.step([mine], 5.0)
    cameras.apply_preset("top", [mine], at(), TOOL)
    there = mine.camera.position.copy()
    cameras.fly([mine], POINT, wait_for_user=True)
    brought(cameras, [mine], 5.0, 5.0 + USER_PRIORITY_S - 0.1)
    assert (mine.camera.position == there).all()
    brought(cameras, [mine], 5.0 + USER_PRIORITY_S, 6.0 + USER_PRIORITY_S)
    assert looks_at_it(mine)


def test_late_reports_of_a_flight_are_not_taken_for_a_hand():
    cameras, mine = placed()
    cameras.fly([mine], POINT)
    there = mine.camera.position.copy()
    late = [there] * 3
    for now in np.arange(0.0, 1.5, TICK):
        told = mine.camera.position
        cameras.step([mine], float(now))
        # What is put is true at once in the browser, and told a tenth of a second later.
        there = there if mine.camera.position is told else mine.camera.position
        late.append(there)
        mine.camera.position = late.pop(0)
    assert looks_at_it(mine)
    cameras.fly([mine], POINT + [0.3, 0.0, 0.0], wait_for_user=True)
    brought(cameras, [mine], 1.5, 2.5)
    assert mine.camera.look_at == pytest.approx(POINT + [0.3, 0.0, 0.0]), "nobody has moved it"
