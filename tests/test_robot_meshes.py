import numpy as np
import pytest
from running_server import parts

from rolling_panda.robot_model import RobotModel

MODEL = RobotModel().model


def test_every_moving_body_has_a_look():
    seen = {MODEL.names[part.joint] for part in parts()}
    assert seen == {"base_phi", "wheel_left", "wheel_right", *(f"panda_joint{number}" for number in range(1, 8))}


def test_the_whole_robot_is_a_small_download():
    assert sum(part.vertices.nbytes + part.faces.nbytes for part in parts()) < 4e6


def test_the_base_has_its_size():
    base = np.concatenate([part.vertices for part in parts() if MODEL.names[part.joint] == "base_phi"])
    assert np.ptp(base[:, 1]) == pytest.approx(0.573, abs=0.005)
    assert base[:, 2].min() == pytest.approx(0.0, abs=0.01)


def test_the_tool_reaches_to_the_tip_of_the_blades():
    tool = np.concatenate([part.vertices for part in parts() if MODEL.names[part.joint] == "panda_joint7"])
    # panda_link8 is 0.107 m beyond joint 7; the tips are 0.195 m beyond it.
    assert tool[:, 2].max() == pytest.approx(0.107 + 0.195, abs=0.005)


def test_colours_of_the_urdf_and_of_the_meshes_are_kept():
    colors = {part.color for part in parts()}
    assert (230, 140, 33) in colors
    assert (255, 255, 255) in colors


def test_faces_point_at_vertices_that_exist():
    for part in parts():
        assert part.faces.max() < len(part.vertices)
        assert np.isfinite(part.vertices).all()
