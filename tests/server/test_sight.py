"""Where a point is looked at from."""

import numpy as np
import pytest

from rolling_panda.messages.perception import Capsule
from server.scene.sight import blocked, clear_direction, directions

POINT = np.array([0.0, 0.0, 1.0])
BEFORE, ASIDE = np.array([0.0, -1.0, 0.0]), np.array([1.0, 0.0, 0.0])
ARM = Capsule("post", (0.0, -0.4, 0.0), (0.0, -0.4, 2.0), 0.08, 0.08)


def test_an_arm_before_the_point_blocks_and_one_beside_it_does_not():
    assert blocked(POINT + 0.8 * BEFORE, POINT, [ARM]) > 0.05
    assert blocked(POINT + 0.8 * ASIDE, POINT, [ARM]) == 0.0
    assert blocked(POINT + 0.8 * BEFORE, POINT, []) == 0.0


def test_the_blades_at_the_point_do_not_count():
    blades = Capsule("post", (0.0, -0.02, 1.0), (0.0, 0.02, 1.0), 0.01, 0.01)
    assert blocked(POINT + 0.8 * BEFORE, POINT, [blades]) == 0.0


def test_the_wanted_direction_is_taken_where_it_is_free_and_the_nearest_free_one_elsewhere():
    around = directions(np.radians(np.arange(0, 360, 20)).tolist(), [0.0], np.eye(3))
    assert clear_direction(POINT, 0.8, ASIDE, around, [ARM]) is ASIDE
    taken = clear_direction(POINT, 0.8, BEFORE, around, [ARM])
    assert blocked(POINT + 0.8 * taken, POINT, [ARM]) == 0.0
    assert np.degrees(np.arccos(taken @ BEFORE)) < 45.0


def test_where_everything_is_hidden_it_still_answers():
    shell = [
        Capsule("post", (0.4 * np.cos(a), 0.4 * np.sin(a), -1.0), (0.4 * np.cos(a), 0.4 * np.sin(a), 3.0), 0.2, 0.2)
        for a in np.linspace(0, 2 * np.pi, 12)
    ]
    around = directions([0.0, 1.0, 2.0], [0.0], np.eye(3))
    assert np.linalg.norm(clear_direction(POINT, 0.8, BEFORE, around, shell)) == pytest.approx(1.0)
