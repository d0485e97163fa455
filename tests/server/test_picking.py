import math

import numpy as np
import pytest
import trimesh
from hypothesis import given
from hypothesis import strategies as st

from rolling_panda.messages.perception import Capsule
from server.scene.picking import Hit, Ray, hit_ground, hit_rods, hit_triangles, nearest

AHEAD = Ray(np.array([0.0, 0.0, 1.0]), np.array([1.0, 0.0, 0.0]))


def rod(kind, x, radius, y=0.0):
    return Capsule(kind, (x, y, 0.0), (x, y, 2.0), radius, radius)


def test_the_first_rod_in_the_line_is_met_at_its_surface():
    hit = hit_rods(AHEAD, [rod("post", 3.0, 0.1), rod("trunk", 2.0, 0.05), rod("wire", 1.0, 0.001, y=0.5)])
    assert (hit.surface, hit.distance) == ("trunk", pytest.approx(1.95))


def test_a_thin_cane_is_met_by_who_all_but_meets_it():
    assert hit_rods(AHEAD, [rod("cane", 1.0, 0.004, y=0.010)]).distance == pytest.approx(1.0)
    assert hit_rods(AHEAD, [rod("cane", 1.0, 0.004, y=0.020)]).distance == math.inf


def test_what_lies_behind_or_beyond_an_end_is_not_met():
    behind = Capsule("post", (-1.0, 0.0, 0.0), (-1.0, 0.0, 2.0), 0.1, 0.1)
    low = Capsule("post", (1.0, 0.0, 0.0), (1.0, 0.0, 0.8), 0.1, 0.1)
    assert hit_rods(AHEAD, [behind, low]).distance == math.inf
    assert hit_rods(AHEAD, []).distance == math.inf


@given(
    st.tuples(*[st.floats(-2.0, 2.0)] * 3).filter(lambda place: np.linalg.norm(place) > 1.2),
    st.tuples(*[st.floats(-0.5, 0.5)] * 3),
)
def test_a_ball_of_triangles_is_met_where_a_ball_is(start, towards):
    ball = trimesh.creation.icosphere(subdivisions=3, radius=1.0)
    origin = np.array(start)
    direction = np.subtract(towards, origin) / np.linalg.norm(np.subtract(towards, origin))
    hit = hit_triangles(Ray(origin, direction), ball.vertices[ball.faces], "ball")
    b = float(origin @ direction)
    exact = -b - math.sqrt(b * b - float(origin @ origin) + 1.0)
    assert hit.distance == pytest.approx(exact, abs=0.03)


def test_triangles_beside_the_line_are_not_met():
    away = np.array([[[1.0, 1.0, 0.0], [1.0, 2.0, 0.0], [1.0, 1.0, 2.0]]])
    assert hit_triangles(AHEAD, away, "robot").distance == math.inf
    assert hit_triangles(AHEAD, np.zeros((0, 3, 3)), "robot").distance == math.inf


def test_the_ground_is_met_from_above_alone():
    down = Ray(np.array([0.0, 0.0, 2.0]), np.array([0.6, 0.0, -0.8]))
    assert down.at(hit_ground(down).distance) == pytest.approx([1.5, 0.0, 0.0])
    assert hit_ground(AHEAD).distance == math.inf


def test_the_nearest_counts_and_nothing_is_nothing():
    far, near, none = Hit(3.0, "ground"), Hit(1.0, "cane"), Hit(math.inf, "")
    assert nearest((far, near, none)) is near
    assert nearest((none,)) is None
