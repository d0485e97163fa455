from typing import get_args

import numpy as np
import pytest
import trimesh

from rolling_panda import messages as m
from rolling_panda.messages.perception import Capsule
from server.scene.meshes import (
    STATE_COLORS,
    capsules_mesh,
    color_of,
    drawn_kinds,
    quat_wxyz,
)


def rod(kind, start, end, radii=(0.01, 0.01)):
    return Capsule(kind, start, end, *radii)


@pytest.mark.parametrize("end", [(0.0, 0.0, 1.0), (1.0, 0.0, 0.0), (0.0, -1.0, 0.0), (0.3, 0.4, -0.5)])
def test_a_rod_is_a_closed_solid_of_about_its_size(end):
    vertices, faces = capsules_mesh("cordon", [rod("cordon", (0.0, 0.0, 0.0), end, (0.02, 0.02))])
    solid = trimesh.Trimesh(vertices, faces, process=False)
    assert solid.is_watertight
    length = float(np.linalg.norm(end))
    assert 0.85 * np.pi * 0.02**2 * length < solid.volume <= np.pi * 0.02**2 * (length + 0.01)


def test_many_rods_are_one_mesh_with_each_in_its_place():
    rods = [rod("cane", (x, 0.0, 0.0), (x, 0.0, 1.0)) for x in (0.0, 1.0, 2.0)]
    vertices, faces = capsules_mesh("cane", rods)
    bodies = trimesh.Trimesh(vertices, faces, process=False).split()
    assert sorted(round(float(body.centroid[0])) for body in bodies) == [0, 1, 2]


def test_a_rod_without_length_does_not_break_the_mesh():
    vertices, _ = capsules_mesh("node", [rod("node", (1.0, 2.0, 3.0), (1.0, 2.0, 3.0))])
    assert np.isfinite(vertices).all()


@pytest.mark.parametrize("kind", drawn_kinds())
def test_every_kind_has_a_look(kind):
    vertices, faces = capsules_mesh(kind, [rod(kind, (0.0, 0.0, 0.0), (0.0, 0.0, 1.0))])
    assert faces.max() == len(vertices) - 1


def test_what_nobody_has_seen_is_dimmer_and_what_is_seen_drawn_around_it():
    assert all(sum(color_of(kind, dim=True)) < sum(color_of(kind)) for kind in ("cane", "post", "wire"))
    rods = [rod("wire", (0.0, 0.0, 0.0), (1.0, 0.0, 0.0), (0.001, 0.001))]
    thin, thick = (np.ptp(capsules_mesh("wire", rods, grow)[0][:, 2]) for grow in (0.0, 0.002))
    assert thick - thin > 0.003


def test_viser_takes_the_scalar_first():
    assert quat_wxyz((0.1, 0.2, 0.3, 0.9)) == (0.9, 0.1, 0.2, 0.3)


def test_every_state_has_a_colour_of_its_own():
    assert set(STATE_COLORS) == set(get_args(m.PointState))
    assert len(set(STATE_COLORS.values())) == len(STATE_COLORS)
