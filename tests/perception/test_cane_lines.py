"""The lines by which people see which canes are known."""

import numpy as np

from perception.plant.cane_lines import cane_lines
from tests.perception.test_plant_map import cane, known, plant


def test_every_known_cane_is_a_line_along_its_axis_also_when_a_later_frame_does_not_show_it():
    both, one = plant(cane(), cane(x=0.06)), plant(cane())
    lines = cane_lines(known(both, both, one))
    assert sorted({place[0] for line in lines for place in line}) == [0.0, 0.06]
    for line in lines:
        np.testing.assert_allclose([line[0][2], line[-1][2]], [0.95, 1.45])
        assert np.all(np.diff([place[2] for place in line]) > 0.0)


def test_what_was_cut_off_is_not_drawn():
    map_ = known(plant(cane()), plant(cane()))
    map_.sever(np.array([0.0, 0.0, 1.10]))
    (line,) = cane_lines(map_)
    assert abs(line[-1][2] - 1.10) < 0.01
    map_.sever(np.array([0.0, 0.0, 0.955]))
    assert cane_lines(map_) == ()
