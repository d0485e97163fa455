from contextlib import nullcontext
from types import SimpleNamespace
from typing import get_args

import numpy as np
import pytest

from rolling_panda.page_messages import CameraPreset
from server.scene_cameras import SceneCameras, shot

TOOL = np.array([0.6, 0.5, 1.0])
SERVER = SimpleNamespace(initial_camera=SimpleNamespace())


def at(x=0.0, y=0.0, heading=0.0):
    q = np.zeros(12)
    q[:3] = x, y, heading
    return q


def view(client_id=1):
    camera = SimpleNamespace(position=np.zeros(3), look_at=np.ones(3), up_direction=None)
    return SimpleNamespace(client_id=client_id, camera=camera, atomic=nullcontext)


@pytest.mark.parametrize("preset", get_args(CameraPreset))
def test_a_preset_goes_with_the_robot(preset):
    here, there = shot(preset, at(), TOOL), shot(preset, at(3.0, 0.2), TOOL + [3.0, 0.2, 0.0])
    assert there.position - here.position == pytest.approx([3.0, 0.2, 0.0])
    assert there.look_at - here.look_at == pytest.approx([3.0, 0.2, 0.0])
    assert np.linalg.norm(here.position - here.look_at) > 0.5 and here.position[2] > 0.5


def test_it_turns_with_the_base():
    turned = shot("follow", at(heading=np.pi / 2), TOOL)
    straight = shot("follow", at(), TOOL)
    assert turned.position == pytest.approx([-straight.position[1], straight.position[0], straight.position[2]])


def test_the_preset_of_the_tool_looks_at_it():
    assert shot("tool", at(), TOOL).look_at == pytest.approx(TOOL)


def test_a_view_that_opens_later_begins_near_the_robot():
    begin = SimpleNamespace()
    cameras = SceneCameras(SimpleNamespace(initial_camera=begin))
    before = begin.position.copy()
    cameras.follow(at(0.1))
    assert begin.position == pytest.approx(before), "views are not told of every centimetre"
    cameras.follow(at(12.0, 0.5))
    assert begin.position - before == pytest.approx([12.0, 0.5, 0.0])
    assert begin.look_at == pytest.approx(shot("follow", at(12.0, 0.5), TOOL).look_at)


def test_only_the_view_that_follows_goes_along_and_only_once_the_base_has_moved():
    cameras, mine, other = SceneCameras(SERVER), view(1), view(2)
    cameras.take("follow", [mine], at(), TOOL)
    cameras.take("row", [other], at(), TOOL)
    before, stays = mine.camera.position.copy(), other.camera.position.copy()
    cameras.follow(at(0.002))
    assert mine.camera.position == pytest.approx(before)
    cameras.follow(at(0.5))
    assert mine.camera.position - before == pytest.approx([0.5, 0.0, 0.0])
    assert other.camera.position == pytest.approx(stays)


def test_a_late_report_of_where_it_was_put_is_not_taken_for_a_hand():
    cameras, mine = SceneCameras(SERVER), view()
    cameras.take("follow", [mine], at(), TOOL)
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
    cameras.take("follow", [mine], at(), TOOL)
    mine.camera.position, mine.camera.look_at = np.array([2.0, 2.0, 2.0]), np.array([0.0, 1.0, 1.0])
    cameras.follow(at(0.3))
    assert mine.camera.position == pytest.approx([2.3, 2.0, 2.0])
    assert mine.camera.look_at == pytest.approx([0.3, 1.0, 1.0])


def test_a_closed_view_and_one_that_chose_another_preset_follow_no_more():
    cameras, mine, closed = SceneCameras(SERVER), view(1), view(2)
    cameras.take("follow", [mine, closed], at(), TOOL)
    cameras.take("top", [mine], at(), TOOL)
    cameras.forget(2)
    before = mine.camera.position.copy(), closed.camera.position.copy()
    cameras.follow(at(1.0))
    assert (mine.camera.position == before[0]).all() and (closed.camera.position == before[1]).all()
