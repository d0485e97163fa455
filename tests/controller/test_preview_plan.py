"""The room that a motion takes up leaves no gaps."""

import numpy as np

from controller.planning.preview_plan import STEP, sweep
from controller.whole_body.collision import CollisionModel
from rolling_panda.model.robot import ARM_Q, RobotModel
from tests.support.controller_at_work import CONFIG

MODEL = CollisionModel(RobotModel())
START = np.zeros(12)
START[ARM_Q] = CONFIG.work.home


def test_its_places_are_close_to_each_other_and_from_the_first_to_the_last():
    way = np.linspace(0.0, 0.5, 400)[:, None] * np.array([1.0, 0.1, 0.4, 0, 0, 0.8, -0.5, 0.6, 0.4, -0.9, 0.7, 1.5])
    swept = sweep(MODEL, np.arange(400) / 100.0, START + way)
    assert (swept.time[0], swept.time[-1]) == (0.0, 3.99)
    assert 50 < len(swept.time) < 400
    for index, name in ((0, "base"), (len(swept.shapes.parts) - 1, "camera")):
        assert swept.shapes.parts[index] == name
        corner = np.array([1.0, -1.0, 1.0]) * (swept.shapes.half[index] + swept.shapes.around[index] / np.sqrt(3.0))
        turns, middles = swept.placed[:, index, :9].reshape(-1, 3, 3), swept.placed[:, index, 9:]
        assert np.linalg.norm(np.diff(middles + turns @ corner, axis=0), axis=1).max() <= STEP


def test_a_robot_that_stands_is_there_at_the_beginning_and_at_the_end():
    swept = sweep(MODEL, (0.0, 1.0, 2.0), (START, START, START))
    assert swept.time.tolist() == [0.0, 2.0]
    assert sweep(MODEL, (), ()).placed.shape == (0, len(swept.shapes.parts), 12)
