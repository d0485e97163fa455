"""What the simulated camera shows of a row."""

import tomllib

import msgspec
import numpy as np
import pytest
from scipy.ndimage import maximum_filter, minimum_filter

from bridge.sim.camera.config import CameraConfig
from bridge.sim.camera.renderer import Camera, RgbdImage
from bridge.sim.vineyard.config import VineyardConfig
from bridge.sim.vineyard.grow import grow
from bridge.sim.vineyard.row import Array, Rod, Row
from rolling_panda.config import load_section
from rolling_panda.messages.types import WOOD_CLASSES, WoodClass
from rolling_panda.model.robot import ARM_Q, RobotModel
from rolling_panda.resources import resource
from tests.support.cameras import looking_left

EXACT = CameraConfig(width=424, height=240, depth_unit=0.0001).ideal()


def upright_rod(kind: WoodClass, x: float, y: float, radius: float) -> Rod:
    return Rod(kind, np.array([x, y, 0.0]), np.array([x, y, 2.0]), radius, radius)


def survey() -> tuple[Row, Array, RgbdImage]:
    path = resource("assets/config/sim.toml")
    q = np.zeros(12)
    q[ARM_Q] = tomllib.loads(path.read_text(encoding="utf-8"))["controller"]["work"]["home"]
    model = RobotModel()
    T = model.pose(q, model.camera_id).homogeneous
    row = grow(load_section(path, "vineyard", VineyardConfig), 0)
    return row, T, Camera(load_section(path, "camera", CameraConfig)).render(row, T)


def share(image: RgbdImage, kind: WoodClass) -> float:
    return float(np.mean(image.labels == WOOD_CLASSES.index(kind)))


def test_depth_is_along_the_optical_axis_and_right_on_the_ground():
    height, tilt = 0.8, np.radians(50)
    T = np.eye(4)
    T[:3, :3] = np.column_stack([[1, 0, 0], [0, -np.sin(tilt), -np.cos(tilt)], [0, np.cos(tilt), -np.sin(tilt)]])
    T[:3, 3] = [0, 0, height]
    camera = Camera(EXACT)
    image = camera.render(Row(()), T)
    k = camera.intrinsics
    v = (np.arange(k.height) - k.cy) / k.fy
    expected = height / (np.sin(tilt) + v * np.cos(tilt))
    assert np.abs(image.depth - expected[:, None]).max() < 1e-4
    assert share(image, "ground") == 1.0


def test_a_post_is_as_wide_and_as_far_as_it_is():
    camera = Camera(EXACT)
    image = camera.render(Row((upright_rod("post", 0.1, 0.8, 0.04),)), looking_left())
    k = camera.intrinsics
    columns = np.flatnonzero(image.labels[100] == WOOD_CLASSES.index("post"))
    assert columns.mean() == pytest.approx(k.cx + k.fx * 0.1 / 0.8, abs=1.0)
    assert len(columns) == pytest.approx(k.fx * 0.08 / 0.8, abs=1.5)
    assert image.depth[100, round(k.cx + k.fx * 0.1 / 0.8)] == pytest.approx(0.76, abs=0.002)


def test_the_image_is_upright_and_not_mirrored():
    rods = (upright_rod("post", 0.3, 0.8, 0.03), upright_rod("trunk", -0.3, 0.8, 0.03))
    image = Camera(EXACT).render(Row(rods), looking_left())
    post = np.argwhere(image.labels == WOOD_CLASSES.index("post"))
    trunk = np.argwhere(image.labels == WOOD_CLASSES.index("trunk"))
    assert post[:, 1].min() > 212 > trunk[:, 1].max()
    assert set(np.unique(image.labels[:115])) <= {0, 2, 3}, "above the horizon there is sky"
    assert np.all(image.labels[-1] != 0), "below it there is ground"


def test_the_nearer_rod_hides_the_farther():
    rods = (upright_rod("post", 0.0, 1.0, 0.05), upright_rod("cane", 0.0, 0.6, 0.004))
    image = Camera(EXACT).render(Row(rods), looking_left())
    assert image.labels[100, 212] == WOOD_CLASSES.index("cane")
    assert image.labels[100, 204] == WOOD_CLASSES.index("post")


@pytest.mark.parametrize("distance", [0.4, 0.8, 1.6])
def test_depth_noise_grows_with_the_square_of_the_distance(distance):
    config = CameraConfig(depth_unit=0.0001, calibration_angle=0.0)
    T = np.diag([1.0, -1.0, -1.0, 1.0])
    T[2, 3] = distance
    depth = Camera(config).render(Row(()), T).depth
    sigma = 0.08 * distance**2 / (446.8 * 0.05)
    assert np.mean(depth) == pytest.approx(distance, abs=sigma / 50)
    assert np.std(depth) == pytest.approx(sigma, rel=0.02)


def test_depth_is_in_whole_units_and_within_range():
    T = np.diag([1.0, -1.0, -1.0, 1.0])
    for distance, seen in ((0.15, False), (0.25, True), (3.5, True), (4.5, False)):
        T[2, 3] = distance
        depth = Camera(CameraConfig()).render(Row(()), T).depth
        assert np.all((depth > 0) == seen)
        assert np.allclose(depth * 1000, np.round(depth * 1000), atol=1e-3)


def test_a_frame_can_be_had_again_and_the_next_one_differs():
    row, T = Row((upright_rod("post", 0.0, 0.8, 0.04),)), looking_left()
    first, again = (Camera(CameraConfig(), seed=5).render(row, T, frame=9) for _ in range(2))
    following = Camera(CameraConfig(), seed=5).render(row, T, frame=10)
    assert np.array_equal(first.depth, again.depth) and np.array_equal(first.color, again.color)
    assert not np.array_equal(first.depth, following.depth)
    assert np.array_equal(first.labels, following.labels)


def test_a_cut_is_seen_in_the_next_frame():
    camera, T = Camera(EXACT), looking_left(z=1.0)
    row = Row((upright_rod("cane", 0.0, 0.7, 0.005),))
    before = camera.render(row, T)
    after = camera.render(row.sever(0, 0.5), T)
    cane = WOOD_CLASSES.index("cane")
    assert np.all(before.labels[:, 212] == cane)
    assert not np.any(after.labels[:118, 212] == cane)
    assert np.all(after.labels[122:, 212] == cane)


def test_labels_are_those_of_the_rods_that_project_there():
    row, T, image = survey()
    camera = Camera(load_section(resource("assets/config/sim.toml"), "camera", CameraConfig))
    k, T_camera_world = camera.intrinsics, np.linalg.inv(T)
    agreed = []
    for _, rod in row.standing():
        x, y, z = T_camera_world[:3, :3] @ rod.at(0.5)[0] + T_camera_world[:3, 3]
        u, v = round(k.cx + k.fx * x / z), round(k.cy + k.fy * y / z)
        if 0 <= u < k.width and 0 <= v < k.height:
            agreed.append(image.labels[v, u] == WOOD_CLASSES.index(rod.kind))
    assert len(agreed) > 100
    assert np.mean(agreed) > 0.85, "the rest are hidden behind others"


def test_from_the_survey_posture_the_camera_is_level_and_sees_a_vine():
    _, T, image = survey()
    assert np.allclose(T[:3, :3], np.column_stack([[1, 0, 0], [0, 0, -1], [0, 1, 0]]), atol=1e-3)
    assert 0.7 <= VineyardConfig().row_distance - T[1, 3] <= 0.9
    for kind, least in (("trunk", 0.005), ("cordon", 0.02), ("spur", 0.002), ("cane", 0.02), ("node", 0.002)):
        assert share(image, kind) > least
    canes = np.isin(image.labels, [WOOD_CLASSES.index("cane"), WOOD_CLASSES.index("node")])
    depth = image.depth[canes]
    assert np.mean((depth > 0.6) & (depth < 1.1)) > 0.85, "some are lost along edges"
    assert image.labels[:200].max() > 0 and not np.any(image.labels[:200] == WOOD_CLASSES.index("cordon"))


def test_an_empty_row_shows_ground_and_sky():
    image = Camera(EXACT).render(Row(()), looking_left())
    assert share(image, "background") + share(image, "ground") == 1.0
    assert image.color[0].mean() > image.color[-1].mean()


@pytest.mark.parametrize("change", [{"edge_bleed": 0.0}, {"edge_bleed": 0.3}, {"edge_bleed": 0.8}])
def test_depth_bleeds_along_edges_and_nowhere_else(change):
    config = msgspec.structs.replace(EXACT, **change)
    row = Row((upright_rod("post", 0.0, 0.8, 0.05),), backdrop=(upright_rod("post", 0.0, 3.2, 1.5),))
    image, true = (Camera(c, 3).render(row, looking_left()) for c in (config, EXACT))
    middle = (slice(20, 100), slice(150, 274))
    wrong = np.abs(image.depth - true.depth)[middle] > 0.01
    post = true.labels[middle] == WOOD_CLASSES.index("post")
    along = maximum_filter(post, 3) & ~minimum_filter(post, 3)
    assert not wrong[~along].any()
    assert abs(wrong[along].mean() - 0.7 * change["edge_bleed"]) < 0.2 * change["edge_bleed"] + 1e-9
    assert wrong[along].any() == (change["edge_bleed"] > 0.0)


def test_thin_things_lose_depth_and_broad_ones_keep_it():
    config = msgspec.structs.replace(EXACT, thin_width=3.0)
    thin, broad = upright_rod("wire", -0.2, 0.8, 0.002), upright_rod("post", 0.2, 0.8, 0.03)
    image = Camera(config, 3).render(Row((thin, broad)), looking_left())
    wire, post = (image.labels == WOOD_CLASSES.index(kind) for kind in ("wire", "post"))
    # 4 mm at 0.8 m are 1.1 pixels of this camera.
    assert np.mean(image.depth[wire] == 0.0) == pytest.approx(1 - 1.12 / 3, abs=0.15)
    assert np.all(image.depth[post] > 0.0)


@pytest.mark.long
def test_a_camera_is_as_far_off_as_its_calibration_and_always_alike():
    row, T = Row((upright_rod("post", 0.0, 1.0, 0.02),)), looking_left()
    config = msgspec.structs.replace(EXACT, width=848, height=480, calibration_angle=0.02)
    columns = []
    for seed in range(6):
        labels = [Camera(config, seed).render(row, T, frame).labels for frame in (0, 1)]
        assert np.array_equal(labels[0], labels[1])
        columns.append(np.argwhere(labels[0] == WOOD_CLASSES.index("post"))[:, 1].mean())
    # 0.02 rad are 9 pixels.
    assert 3.0 < np.std(columns) < 20.0


def test_bark_and_light_differ_from_seed_to_seed_unless_switched_off():
    row, T = Row((upright_rod("trunk", 0.0, 0.8, 0.05),)), looking_left()
    for appearance, differs in ((0.0, False), (1.0, True)):
        config = msgspec.structs.replace(EXACT, appearance=appearance)
        colors = [
            image.color[image.labels == WOOD_CLASSES.index("trunk")].mean(axis=0)
            for image in (Camera(config, seed).render(row, T) for seed in range(4))
        ]
        # The brightness of a single trunk differs anyway.
        tone = np.array(colors) / np.sum(colors, axis=1, keepdims=True)
        assert (np.std(tone, axis=0).max() > 0.004) == differs
