"""Pruning points of a single picture."""

import json

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from PIL import Image
from scipy.ndimage import distance_transform_edt

from bridge.sim.camera.config import CameraConfig
from bridge.sim.camera.renderer import Camera
from bridge.sim.vineyard.config import VineyardConfig
from bridge.sim.vineyard.grow import grow
from bridge.sim.vineyard.truth import judge
from perception.config import PerceptionConfig
from perception.segmentation.frame import BACKGROUND, CANE, CORDON, NODE, SPUR, TRUNK
from perception.single_image import Photograph, Undecided, cane_width, find_cuts, load_photograph, segment_photograph
from rolling_panda import reasons
from rolling_panda.errors import InputError
from rolling_panda.messages.robot import Intrinsics
from tests.support.cameras import looking_left

PLACE = looking_left(0.5, -0.05, 1.05)


@pytest.fixture(scope="module")
def picture():
    """A row, its picture with the simulator's labels, and where each right cut is."""
    row = grow(VineyardConfig(), 101)
    camera = Camera(CameraConfig(), 101)
    image = camera.render(row, PLACE)
    photograph = Photograph(image.color, image.depth, camera.intrinsics, False, (848, 480))
    return photograph, image.labels, np.array([truth.cut.best for truth in judge(row) if truth.cut is not None])


def test_with_depth_the_cuts_have_places_before_the_camera(picture):
    photograph, labels, right = picture
    result = find_cuts(photograph, labels, PerceptionConfig())
    cuts = [point.cut for point in result.cuts if point.cut.kind == "spur cut"]
    assert len(cuts) >= 4 and result.scale == "depth image"
    # A level camera's frame is the world's but for its place.
    gaps = [np.linalg.norm(right - (cut.position + PLACE[:3, 3]), axis=1).min() for cut in cuts]
    assert np.mean(np.array(gaps) < 0.012) >= 0.8


def test_without_depth_they_are_pixels_near_the_same_places(picture):
    photograph, labels, right = picture
    flat = Photograph(photograph.color, None, photograph.intrinsics, True, (848, 480))
    result = find_cuts(flat, labels, PerceptionConfig())
    points = [point for point in result.cuts if point.cut.kind == "spur cut"]
    assert len(points) >= 2 and "no depth" in result.scale
    k = photograph.intrinsics
    x, y, z = ((right - PLACE[:3, 3]) @ PLACE[:3, :3]).T
    pixels = np.stack([k.cx + k.fx * x / z, k.cy + k.fy * y / z], axis=1)
    gaps = [np.linalg.norm(pixels - point.pixel, axis=1).min() for point in points]
    # 20 mm are 11 pixels here.
    assert np.median(gaps) < 6.0


def test_a_picture_without_wood_gives_a_reason_and_no_point(picture):
    photograph, labels, _ = picture
    flat = Photograph(photograph.color, None, photograph.intrinsics, True, (848, 480))
    for picture_without, why in ((photograph, reasons.no_cane_with_depth()), (flat, reasons.no_cane_recognised())):
        result = find_cuts(picture_without, np.zeros_like(labels), PerceptionConfig())
        assert not result.cuts and result.undecided == (Undecided(why),)


def test_canes_at_the_cordon_without_a_spur_are_told_with_their_places(picture):
    """As of a network that knows wood, but neither spurs nor nodes."""
    photograph, labels, _ = picture
    flat = Photograph(photograph.color, None, photograph.intrinsics, True, (848, 480))
    spurs = find_cuts(flat, labels, PerceptionConfig()).spurs
    plain = np.where(np.isin(labels, (SPUR, NODE)), CANE, labels).astype(np.uint8)
    result = find_cuts(flat, plain, PerceptionConfig())
    bases = np.array([each.pixel for each in result.undecided if each.reason == reasons.cane_without_spur()])
    assert not result.cuts and spurs / 2 <= len(bases) <= 2 * spurs
    old = distance_transform_edt(~np.isin(labels, (TRUNK, CORDON)))
    assert all(old[round(v), round(u)] < 40.0 for u, v in bases)


def test_specks_do_not_decide_how_wide_canes_are():
    labels = np.zeros((200, 200), np.uint8)
    labels[:, 95:105] = CANE
    labels[::4, :80:4] = CANE
    assert 8.0 <= cane_width(labels) <= 11.0


def test_depth_that_is_nowhere_on_wood_gives_no_point(picture):
    photograph, labels, _ = picture
    blind = Photograph(photograph.color, np.zeros_like(photograph.depth), photograph.intrinsics, False, (848, 480))
    result = find_cuts(blind, labels, PerceptionConfig())
    assert not result.cuts and result.undecided == (Undecided(reasons.no_cane_with_depth()),)


def test_every_point_has_its_reason_and_a_direction_along_the_wood(picture):
    photograph, labels, _ = picture
    for point in find_cuts(photograph, labels, PerceptionConfig()).cuts:
        assert (
            point.cut.reason.code.startswith("spur_cut")
            or point.cut.reason.code == "renewal_cut"
            and 0.0 < point.cut.confidence <= 1.0
        )
        # Away from the cordon is up in this picture.
        assert point.beyond[1] < point.pixel[1]


@pytest.fixture
def image(tmp_path):
    path = tmp_path / "vine.png"
    Image.fromarray(np.random.default_rng(0).integers(0, 255, (120, 200, 3), dtype=np.uint8)).save(path)
    return path


def depth_png(path, counts):
    Image.fromarray(counts.astype(np.uint16)).save(path)
    return path


def test_depth_comes_as_counts_or_as_metres(tmp_path, image):
    counts = np.full((120, 200), 800)
    as_counts = load_photograph(image, depth_png(tmp_path / "d.png", counts))
    np.save(tmp_path / "d.npy", counts / 1000.0)
    as_metres = load_photograph(image, tmp_path / "d.npy")
    np.save(tmp_path / "tenth.npy", (counts * 10).astype(np.uint16))
    as_tenths = load_photograph(image, tmp_path / "tenth.npy", depth_unit=0.0001)
    for photograph in (as_counts, as_metres, as_tenths):
        assert np.allclose(photograph.depth, 0.8)


def test_values_that_are_no_depth_become_none(tmp_path, image):
    values = np.full((120, 200), 0.8)
    values[0, :4] = [np.nan, np.inf, -1.0, 0.0]
    np.save(tmp_path / "d.npy", values)
    depth = load_photograph(image, tmp_path / "d.npy").depth
    assert np.all(depth[0, :4] == 0.0) and np.all(depth[1] == np.float32(0.8))


def test_a_wide_photograph_is_made_smaller_with_depth_and_intrinsics(tmp_path):
    Image.fromarray(np.zeros((900, 1696, 3), np.uint8)).save(tmp_path / "a.jpg")
    counts = np.tile(np.arange(1696) + 500, (900, 1))
    k = {"width": 1696, "height": 900, "fx": 1000.0, "fy": 1000.0, "cx": 847.5, "cy": 449.5}
    (tmp_path / "k.json").write_text(json.dumps(k), encoding="utf-8")
    whole = load_photograph(tmp_path / "a.jpg", depth_png(tmp_path / "d.png", counts), tmp_path / "k.json")
    got = whole.scaled(848)
    assert whole.scaled(1696) is whole
    assert got.color.shape == (450, 848, 3) and got.size == (1696, 900) and not got.assumed
    assert (got.intrinsics.fx, got.intrinsics.cx) == (500.0, 423.5)
    # A pixel looks the same way before and after.
    assert abs(got.depth[0, 100] - (201 + 500) / 1000) < 0.0011


class Dark:
    """Takes dark pixels for canes."""

    def classify_surely(self, color, depth):
        return np.where(color[..., 0] < 128, CANE, BACKGROUND).astype(np.uint8), None


@settings(max_examples=20, deadline=None)
@given(width=st.integers(3, 60), wide=st.integers(600, 3000))
def test_canes_are_seen_as_large_as_is_of_use(width, wide):
    color = np.full((300, wide, 3), 255, np.uint8)
    for left in range(40, wide - 60, 120):
        color[:, left : left + width] = 0
    scaled, (labels, _) = segment_photograph(
        Photograph(color, None, Intrinsics(wide, 300, 900.0, 900.0, wide / 2, 150.0), True, (wide, 300)), Dark()
    )
    shown = scaled.color.shape[1]
    assert labels.shape == scaled.color.shape[:2]
    assert min(848, wide) <= shown <= min(1920, wide if width > 6 else 2 * wide)
    # Of a few pixels a width is known to a pixel only.
    assert shown == min(848, wide) or cane_width(labels) < 12.0 * 1.4
    assert shown >= min(1920, wide) or cane_width(labels) > 12.0 / 1.4


def test_narrow_canes_are_enlarged_unless_there_is_depth():
    color = np.full((200, 400, 3), 255, np.uint8)
    color[:, 20:380:20] = color[:, 21:380:20] = 0
    k = Intrinsics(400, 200, 400.0, 400.0, 200.0, 100.0)
    scaled, (labels, _) = segment_photograph(Photograph(color, None, k, True, (400, 200)), Dark())
    assert scaled.color.shape == (400, 800, 3) and labels.shape == (400, 800) and scaled.intrinsics.fx == 800.0
    depth = np.full((200, 400), 0.8, np.float32)
    assert segment_photograph(Photograph(color, depth, k, True, (400, 200)), Dark())[0].color.shape == color.shape


def test_intrinsics_that_nobody_gave_are_called_a_guess(image):
    assert load_photograph(image).assumed


@pytest.mark.parametrize(
    ("counts", "unit", "says"),
    [
        (np.full((120, 200), 800), 1.0, "--depth-unit"),
        (np.full((120, 200), 800), 0.00001, "--depth-unit"),
        (np.zeros((120, 200)), 0.001, "no depth at all"),
        (np.full((100, 200), 800), 0.001, "one value a pixel"),
    ],
)
def test_a_depth_that_cannot_be_is_refused(tmp_path, image, counts, unit, says):
    with pytest.raises(InputError, match=says):
        load_photograph(image, depth_png(tmp_path / "d.png", counts), depth_unit=unit)


def test_files_that_are_something_else_are_refused(tmp_path, image):
    text = tmp_path / "x.png"
    text.write_text("hello", encoding="utf-8")
    with pytest.raises(InputError, match="cannot read the image"):
        load_photograph(text)
    with pytest.raises(InputError, match="cannot read the depth"):
        load_photograph(image, text)
    with pytest.raises(InputError, match="cannot read the intrinsics"):
        load_photograph(image, None, text)
    (tmp_path / "k.json").write_text('{"width":2,"height":2,"fx":1,"fy":1,"cx":0,"cy":0}', encoding="utf-8")
    with pytest.raises(InputError, match="is for 2×2"):
        load_photograph(image, None, tmp_path / "k.json")
    Image.fromarray(np.zeros((20, 20, 3), np.uint8)).save(tmp_path / "small.png")
    with pytest.raises(InputError, match="at least"):
        load_photograph(tmp_path / "small.png")
