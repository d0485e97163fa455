import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from controller.whole_body.obstacle import Axes, Obstacle
from rolling_panda.errors import InputError


@given(st.integers(0, 2**32 - 1))
def test_gap_of_a_sphere_is_that_of_the_nearest_point_of_the_axis(seed):
    rng = np.random.default_rng(seed)
    start, end, center = rng.uniform(-1, 1, (3, 3))
    obstacle = Obstacle("wire", "wire", tuple(start), tuple(end), 0.01)
    along = start + np.linspace(0.0, 1.0, 4001)[:, None] * (end - start)
    expected = np.linalg.norm(along - center, axis=1).min() - 0.2 - 0.01
    assert Axes((obstacle,)).gaps(center[None], np.array([0.2]))[0, 0] == pytest.approx(expected, abs=1e-6)


@given(st.integers(0, 2**32 - 1), st.booleans())
def test_gap_of_a_capsule_is_that_of_the_nearest_points_of_both_axes(seed, parallel):
    rng = np.random.default_rng(seed)
    start, end, first, last = rng.uniform(-1, 1, (4, 3))
    last = first + 0.7 * (end - start) if parallel else last
    along = start + np.linspace(0.0, 1.0, 101)[:, None] * (end - start)
    own = first + np.linspace(0.0, 1.0, 101)[:, None] * (last - first)
    expected = np.linalg.norm(along[:, None] - own[None], axis=2).min() - 0.2 - 0.01
    axes = Axes((Obstacle("wire", "wire", tuple(start), tuple(end), 0.01),))
    assert axes.capsule_gaps(first[None], last[None], np.array([0.2]))[0, 0] == pytest.approx(expected, abs=2e-2)
    # Samples of the axes are never nearer than their nearest points.
    assert axes.capsule_gaps(first[None], last[None], np.array([0.2]))[0, 0] <= expected + 1e-9


def test_an_axis_without_length_is_a_ball():
    ball = Obstacle("head", "trunk", (1.0, 0.0, 0.0), (1.0, 0.0, 0.0), 0.1)
    assert Axes((ball,)).gaps(np.zeros((1, 3)), np.array([0.2]))[0, 0] == pytest.approx(0.7)
    middle, side = np.zeros((1, 3)), np.array([[0.0, 0.3, 0.0]])
    assert Axes((ball,)).capsule_gaps(middle, middle, np.array([0.2]))[0, 0] == pytest.approx(0.7)
    assert Axes((ball,)).capsule_gaps(-side, side, np.array([0.2]))[0, 0] == pytest.approx(0.7)


def test_no_obstacles_have_no_gaps():
    assert Axes(()).gaps(np.zeros((4, 3)), np.ones(4)).shape == (4, 0)


@pytest.mark.parametrize(
    ("start", "radius"), [((float("nan"), 0.0, 0.0), 0.1), ((0.0, 0.0, 0.0), 0.0), ((0.0, 0.0, 0.0), float("inf"))]
)
def test_what_is_no_capsule_is_refused(start, radius):
    with pytest.raises(InputError, match="'post 1'.*radius"):
        Obstacle("post 1", "post", start, (0.0, 0.0, 1.0), radius)
