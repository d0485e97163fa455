"""What stands in the way stays what it is however long the camera looks, and goes when it is seen to have gone."""

import math
from dataclasses import replace

import msgspec
import numpy as np
import pytest

from bridge.sim.camera.config import CameraConfig
from bridge.sim.camera.frame import camera_frame, camera_pose, survey_place
from bridge.sim.camera.renderer import Camera
from bridge.sim.camera.sensors import depth_sensor
from bridge.sim.vineyard.config import VineyardConfig
from bridge.sim.vineyard.grow import grow
from perception.config import ObstacleConfig
from perception.obstacles.cylinder_fit import fit_cylinders
from perception.obstacles.obstacle_map import ObstacleMap
from perception.obstacles.occupancy import OccupiedCells
from perception.segmentation.frame import decode_frame
from rolling_panda.messages.types import WOOD_CLASSES
from rolling_panda.model.robot import RobotModel

BACKGROUND, POST, TRUNK, CORDON = (WOOD_CLASSES.index(kind) for kind in ("background", "post", "trunk", "cordon"))


class Standing:
    """A robot that stands before a row: one picture without noise, and the depth camera's noise of each frame."""

    def __init__(self, seed, x=0.0, without=""):
        self.row, self.config, model = grow(VineyardConfig(), seed), CameraConfig(), RobotModel()
        self.row = replace(self.row, rods=tuple(None if rod.kind == without else rod for rod in self.row.rods))
        camera = Camera(self.config.ideal(), seed)
        base, position = survey_place(x)
        image = camera.render(self.row, camera_pose(model, base, position), 0)
        self.view = decode_frame(camera_frame(image, camera, base, position, 0), model)
        self.labels, self._rng = image.labels, np.random.default_rng(seed)
        thick = np.array([0.0 if rod is None else rod.start_radius + rod.end_radius for rod in self.row.rods])
        self._true = np.where(self.view.depth > 0.0, self.view.depth, np.float32(np.inf))
        self._width = np.full(self.labels.shape, np.inf, np.float32)
        seen = image.rods >= 0
        self._width[seen] = thick[image.rods[seen]] * camera.intrinsics.fx / self._true[seen]

    def frame(self):
        depth = depth_sensor(self.config, self.view.intrinsics.fx, self._true, self._width, self._rng)
        return replace(self.view, depth=depth)


def lean(capsule):
    """Angle to the vertical (degrees)."""
    along = np.array(capsule.end) - capsule.start
    return math.degrees(math.acos(min(1.0, abs(along[2]) / np.linalg.norm(along))))


@pytest.mark.long
@pytest.mark.parametrize("seed", [0, 11])
def test_after_minutes_of_standing_trunks_and_posts_are_upright_as_thick_as_they_are_and_in_the_row(seed):
    # Half a picture a second, as the camera at rest takes them: four minutes; the post at the row's start is in view.
    standing, known = Standing(seed, -0.5), ObstacleMap(ObstacleConfig())
    for _ in range(120):
        capsules = known.update(standing.frame(), standing.labels)
    upright = [capsule for capsule in capsules if capsule.kind in ("trunk", "post")]
    assert {capsule.kind for capsule in upright} == {"trunk", "post"}
    for capsule in upright:
        assert lean(capsule) < 15.0, capsule
        assert capsule.start_radius < 2 * (0.032 if capsule.kind == "trunk" else 0.038), capsule
    for capsule in capsules:
        for end in (capsule.start, capsule.end):
            assert abs(end[1] - 0.75) < 0.06, capsule


@pytest.mark.long
def test_what_is_seen_through_is_forgotten():
    standing, known = Standing(0, -0.5), ObstacleMap(ObstacleConfig())
    for _ in range(5):
        capsules = known.update(standing.frame(), standing.labels)
    assert any(capsule.kind == "post" for capsule in capsules)
    # The post is taken away: behind where it was there is the sky, and the ground.
    left = Standing(0, -0.5, without="post")
    for _ in range(25):
        capsules = known.update(left.frame(), left.labels)
    assert not any(capsule.kind == "post" for capsule in capsules)
    assert any(capsule.kind == "trunk" for capsule in capsules), "what still stands is still known"


@pytest.mark.parametrize("taken_for", [POST, TRUNK])
def test_a_post_that_lies_along_the_row_is_none_and_is_counted(taken_for):
    standing, known = Standing(1), ObstacleMap(ObstacleConfig())
    labels = np.where(standing.labels == CORDON, taken_for, standing.labels).astype(np.uint8)
    for _ in range(20):
        capsules = known.update(standing.frame(), labels)
    uprights = [capsule for capsule in capsules if capsule.kind in ("post", "trunk")]
    assert all(lean(capsule) < 15.0 and abs(capsule.start[0] - 0.5) < 0.05 for capsule in uprights)
    assert known.rejected[WOOD_CLASSES[taken_for], "lying"] >= 1


def test_wood_before_or_behind_the_row_is_none_and_is_counted():
    standing, known = Standing(1), ObstacleMap(ObstacleConfig())
    for _ in range(20):
        view, labels = standing.frame(), standing.labels.copy()
        # A stone behind the row, taken for a trunk in every frame.
        labels[440:, 600:640] = TRUNK
        view.depth[440:, 600:640] = 1.4
        capsules = known.update(view, labels)
    assert [capsule for capsule in capsules if capsule.kind == "trunk"]
    assert all(abs(capsule.start[1] - 0.75) < 0.06 for capsule in capsules)
    assert known.rejected["trunk", "off the row"] == 1


def test_what_is_taken_for_a_trunk_within_a_post_is_the_post():
    standing, known = Standing(0, -0.5), ObstacleMap(ObstacleConfig())
    labels = standing.labels.copy()
    rows, cols = np.nonzero(labels == POST)
    edge = (cols > np.quantile(cols, 0.8)) & (rows > 350)
    labels[rows[edge], cols[edge]] = TRUNK
    for _ in range(10):
        capsules = known.update(standing.frame(), labels)
    at_post = [capsule.kind for capsule in capsules if abs(capsule.start[0] + 0.4) < 0.1 and lean(capsule) < 15.0]
    assert at_post == ["post"]


def test_what_ends_above_the_cordon_is_no_post_where_its_foot_would_have_been_seen():
    standing, known, cut_off = Standing(0, -0.5), ObstacleMap(ObstacleConfig()), ObstacleMap(ObstacleConfig())
    post = standing.labels == POST
    row = int(np.median(np.nonzero(standing.labels == CORDON)[0])) + 20
    below = np.arange(len(post))[:, None] > row
    for _ in range(10):
        view, labels = standing.frame(), standing.labels.copy()
        labels[post & below], view.depth[post & below] = BACKGROUND, 3.0
        capsules = known.update(view, labels)
        # The same where the picture ends there.
        top = slice(0, row), slice(0, labels.shape[1])
        part = replace(view, depth=view.depth[top], intrinsics=msgspec.structs.replace(view.intrinsics, height=row))
        shown = cut_off.update(part, labels[top])
    assert not any(capsule.kind == "post" for capsule in capsules)
    assert any(capsule.kind == "trunk" for capsule in capsules) and known.rejected["post", "above the cordon"] == 1
    assert any(capsule.kind == "post" for capsule in shown), "nobody has seen that it has no foot"


def test_two_things_far_apart_and_at_different_heights_are_not_one_wire():
    rng, place = np.random.default_rng(0), np.zeros((60, 3))
    place[:, 0] = np.concatenate([np.arange(30) * 0.02, 2.0 + np.arange(30) * 0.02])
    place[:, 1] = 0.75 + rng.normal(0.0, 0.002, 60)
    place[:, 2] = np.repeat([0.88, 0.93], 30) + rng.normal(0.0, 0.002, 60)
    cells = OccupiedCells(place, np.zeros((60, 3)), np.tile([0.0, 1.0, 0.0], (60, 1)), np.ones(60))
    rods, _ = fit_cylinders("wire", cells, ObstacleConfig())
    assert sorted(round(float(np.linalg.norm(rod.end - rod.start)), 1) for rod in rods) == [0.6, 0.6]
    place[:, 2] = 0.88
    rods, _ = fit_cylinders("wire", cells, ObstacleConfig())
    assert [round(float(np.linalg.norm(rod.end - rod.start)), 1) for rod in rods] == [2.6]


def test_a_few_places_far_apart_are_no_wire():
    rng = np.random.default_rng(0)
    x = np.arange(12) * 0.35
    place = np.stack([x, 0.75 + rng.normal(0.0, 0.01, 12), 0.97 + rng.normal(0.0, 0.01, 12)], axis=1)
    cells = OccupiedCells(place, np.zeros((12, 3)), np.tile([0.0, 1.0, 0.0], (12, 1)), np.ones(12))
    assert fit_cylinders("wire", cells, ObstacleConfig())[0] == []


@pytest.mark.long
def test_what_is_remembered_is_bounded_and_what_is_near_stays():
    known = ObstacleMap(ObstacleConfig(max_cells=1000))
    for x in np.arange(-0.4, 4.4, 0.6):
        standing = Standing(3, float(x))
        for _ in range(4):
            capsules = known.update(standing.frame(), standing.labels)
    cordons = [capsule for capsule in capsules if capsule.kind == "cordon"]
    assert all(min(capsule.start[0], capsule.end[0]) > 0.3 for capsule in cordons), "the farthest is forgotten"
    assert any(capsule.kind == "cordon" and abs(capsule.start[0] - x - 0.5) < 0.3 for capsule in capsules)
