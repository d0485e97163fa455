import numpy as np

from rolling_panda import messages as m
from rolling_panda.messages.supervision import PreviewRow
from server.scene.ghost import moment

ROWS = tuple(
    PreviewRow(0.1 * i, m.PlanarPose(0.01 * i, 0.0, 0.0), (0.0, 0.0, 0.2 * i, *[0.0] * 6), (0.0, 0.0, 1.0))
    for i in range(5)
)


def test_a_moment_between_two_rows_is_between_them():
    q = moment(ROWS, 0.15)
    np.testing.assert_allclose((q[0], q[5]), (0.015, 0.3))


def test_before_the_first_and_after_the_last_row_the_robot_stands():
    np.testing.assert_allclose(moment(ROWS, 0.0)[5], 0.0)
    np.testing.assert_allclose(moment(ROWS, 99.0)[5], 0.8)
    np.testing.assert_allclose(moment(ROWS[:1], 5.0)[5], 0.0)
