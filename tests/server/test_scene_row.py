import numpy as np
import pytest
import trimesh

from rolling_panda.messages.perception import Capsule
from server.scene.row import color_of, drawn_kinds, rods_mesh


def rod(kind, start, end, radii=(0.01, 0.01)):
    return Capsule(kind, start, end, *radii)


@pytest.mark.parametrize("end", [(0.0, 0.0, 1.0), (1.0, 0.0, 0.0), (0.0, -1.0, 0.0), (0.3, 0.4, -0.5)])
def test_a_rod_is_a_closed_solid_of_about_its_size(end):
    vertices, faces = rods_mesh("cordon", [rod("cordon", (0.0, 0.0, 0.0), end, (0.02, 0.02))])
    solid = trimesh.Trimesh(vertices, faces, process=False)
    assert solid.is_watertight
    length = float(np.linalg.norm(end))
    assert 0.85 * np.pi * 0.02**2 * length < solid.volume <= np.pi * 0.02**2 * length


def test_many_rods_are_one_mesh_with_each_in_its_place():
    rods = [rod("cane", (x, 0.0, 0.0), (x, 0.0, 1.0)) for x in (0.0, 1.0, 2.0)]
    vertices, faces = rods_mesh("cane", rods)
    bodies = trimesh.Trimesh(vertices, faces, process=False).split()
    assert sorted(round(float(body.centroid[0])) for body in bodies) == [0, 1, 2]


def test_a_rod_without_length_does_not_break_the_mesh():
    vertices, _ = rods_mesh("node", [rod("node", (1.0, 2.0, 3.0), (1.0, 2.0, 3.0))])
    assert np.isfinite(vertices).all()


@pytest.mark.parametrize("kind", drawn_kinds())
def test_every_kind_has_a_look(kind):
    vertices, faces = rods_mesh(kind, [rod(kind, (0.0, 0.0, 0.0), (0.0, 0.0, 1.0))])
    assert faces.max() == len(vertices) - 1


def test_what_nobody_has_seen_is_dimmer_and_what_is_seen_drawn_around_it():
    assert all(sum(color_of(kind, dim=True)) < sum(color_of(kind)) for kind in ("cane", "post", "wire"))
    rods = [rod("wire", (0.0, 0.0, 0.0), (1.0, 0.0, 0.0), (0.001, 0.001))]
    thin, thick = (np.ptp(rods_mesh("wire", rods, grow)[0][:, 2]) for grow in (0.0, 0.002))
    assert thick - thin > 0.003
