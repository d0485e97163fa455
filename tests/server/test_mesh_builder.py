import subprocess
import sys

import numpy as np
import pytest
import trimesh

from rolling_panda.errors import ModelError
from rolling_panda.model.robot import RobotModel
from server.scene.mesh_builder import simplified
from server.scene.solids import build_solids

MODEL = RobotModel().model


def test_every_moving_body_has_a_look():
    seen = {MODEL.names[part.joint] for part in build_solids().robot}
    assert seen == {"base_phi", "wheel_left", "wheel_right", *(f"panda_joint{number}" for number in range(1, 8))}


def test_the_whole_robot_is_little_to_download_and_to_draw():
    assert sum(part.vertices.nbytes + part.faces.nbytes for part in build_solids().robot) < 1e6
    assert sum(len(part.faces) for part in build_solids().robot) < 25_000


def test_fewer_faces_keep_the_shape():
    vertices = np.random.default_rng(0).normal(size=(3, 3))
    ball = trimesh.creation.icosphere(subdivisions=6, radius=0.1)
    fewer = simplified(ball.vertices, ball.faces)
    assert len(fewer.faces) < len(ball.faces) / 10
    assert np.linalg.norm(fewer.vertices, axis=1) == pytest.approx(0.1, abs=0.002)
    assert fewer.volume == pytest.approx(ball.volume, rel=0.02)
    assert simplified(vertices, np.array([[0, 1, 2]])).area == pytest.approx(
        trimesh.Trimesh(vertices, [[0, 1, 2]]).area
    )


def test_the_base_has_its_size():
    base = np.concatenate([part.vertices for part in build_solids().robot if MODEL.names[part.joint] == "base_phi"])
    assert np.ptp(base[:, 1]) == pytest.approx(0.573, abs=0.005)
    assert base[:, 2].min() == pytest.approx(0.0, abs=0.01)


def test_the_tool_reaches_to_the_tip_of_the_blades():
    tool = np.concatenate([part.vertices for part in build_solids().robot if MODEL.names[part.joint] == "panda_joint7"])
    # panda_link8 is 0.107 m beyond joint 7; the tips are 0.195 m beyond it.
    assert tool[:, 2].max() == pytest.approx(0.107 + 0.195, abs=0.005)


def test_colours_of_the_urdf_and_of_the_meshes_are_kept():
    colors = {part.color for part in build_solids().robot}
    assert (230, 140, 33) in colors
    assert (255, 255, 255) in colors


def test_faces_point_at_vertices_that_exist():
    for part in build_solids().robot:
        assert part.faces.max() < len(part.vertices)
        assert np.isfinite(part.vertices).all()


@pytest.mark.long
def test_the_server_does_without_the_mesh_library():
    found = (
        "import sys, server.service; print([name for name in ('trimesh', 'scipy', 'networkx') if name in sys.modules])"
    )
    done = subprocess.run([sys.executable, "-c", found], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"


def test_a_mesh_that_cannot_be_built_is_told(monkeypatch):
    monkeypatch.setattr(sys, "executable", "/bin/false")
    with pytest.raises(ModelError, match="exit code 1"):
        build_solids.__wrapped__()
