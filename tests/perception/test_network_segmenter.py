"""The network as a segmenter: what it accepts, and what it declines."""

import hashlib
import io

import numpy as np
import pytest
import skimage.data
from PIL import Image

from bridge.sim.camera.config import CameraConfig
from bridge.sim.camera.renderer import Camera
from bridge.sim.vineyard.config import VineyardConfig
from bridge.sim.vineyard.grow import grow
from perception.segmentation.frame import CorruptFrameError, UnusablePictureError, View
from perception.segmentation.network_segmenter import NetworkSegmenter, PhotographSegmenter, network_input
from perception.segmentation.segmenter import PHOTOGRAPHS, SHIPPED, NoSegmenter, choose_segmenter
from rolling_panda import reasons
from rolling_panda.errors import ConfigError, ModelError
from rolling_panda.messages.robot import Intrinsics
from rolling_panda.messages.types import WOOD_CLASSES
from rolling_panda.resources import resource
from tests.support import onnx_by_hand
from tests.support.cameras import looking_left

CLASSES = list(WOOD_CLASSES)


def written(tmp_path, data: bytes):
    path = tmp_path / "net.onnx"
    path.write_bytes(data)
    return path


def view(color, depth=None) -> View:
    height, width = color.shape[:2]
    data = io.BytesIO()
    Image.fromarray(color).save(data, "JPEG", quality=95)
    k = Intrinsics(width, height, 400.0, 400.0, width / 2, height / 2)
    depth = np.zeros((height, width), np.float32) if depth is None else depth
    return View(0, 0.0, k, depth, None, data.getvalue(), np.eye(3), np.zeros(3))


def test_the_input_is_colour_around_zero_and_nearness():
    color = np.zeros((2, 2, 3), np.uint8)
    color[0, 0] = 255
    depth = np.array([[0.4, 0.8], [0.0, 0.05]], np.float32)
    image = network_input(color, depth)
    assert image.dtype == np.float32 and image[:3, 0, 0].tolist() == [1, 1, 1] and image[:3, 1, 1].tolist() == [-1] * 3
    assert image[3].ravel() == pytest.approx([0.5, 0.25, 0.0, 0.0])
    assert np.all(network_input(color, None)[3] == 0.0)


@pytest.mark.parametrize("size", [(96, 128), (50, 70)])
def test_any_size_comes_back_pixel_by_pixel(tmp_path, size):
    segmenter = NetworkSegmenter(written(tmp_path, onnx_by_hand.brightest_channel(CLASSES)))
    color = np.full((*size, 3), 60, np.uint8)
    color[: size[0] // 2, :, 1] = 200
    color[size[0] // 2 :, :, 2] = 200
    said = segmenter.classify(color, None)
    assert said.shape == size and said.dtype == np.uint8
    assert np.all(said[: size[0] // 2] == 1) and np.all(said[size[0] // 2 :] == 2)


def test_a_frame_is_decoded_and_its_depth_used(tmp_path):
    content = onnx_by_hand.brightest_channel(CLASSES)
    segmenter = NetworkSegmenter(written(tmp_path, content))
    color = np.random.default_rng(0).integers(90, 110, (64, 64, 3), dtype=np.uint8)
    near = np.zeros((64, 64), np.float32)
    near[:32] = 0.3
    said = segmenter.segment(view(color, near))
    assert np.all(said[:32] == 3) and segmenter.name == f"network net.onnx {hashlib.sha256(content).hexdigest()[:12]}"


@pytest.mark.parametrize("color", [np.zeros((64, 64, 3), np.uint8), np.full((64, 64, 3), 255, np.uint8)])
def test_a_picture_of_nothing_is_declined(tmp_path, color):
    segmenter = NetworkSegmenter(written(tmp_path, onnx_by_hand.brightest_channel(CLASSES)))
    with pytest.raises(UnusablePictureError) as refused:
        segmenter.classify(color, None)
    assert refused.value.reason == reasons.picture_blank(float(color.max()))


def test_a_frame_without_a_picture_is_refused(tmp_path):
    segmenter = NetworkSegmenter(written(tmp_path, onnx_by_hand.brightest_channel(CLASSES)))
    broken = view(np.zeros((64, 64, 3), np.uint8))
    with pytest.raises(CorruptFrameError):
        segmenter.segment(View(0, 0.0, broken.intrinsics, broken.depth, None, b"", broken.R, broken.t))


@pytest.mark.parametrize(
    ("data", "says"),
    [
        (onnx_by_hand.brightest_channel(CLASSES, shape=(1, 3, "h", "w")), "1×4×H×W"),
        (onnx_by_hand.brightest_channel(CLASSES, shape=(1, 4, 240, 424)), "free height and width"),
        (onnx_by_hand.brightest_channel(CLASSES, output="mask"), "the output 'classes'"),
        (onnx_by_hand.brightest_channel(CLASSES, kind="int64"), "tensor\\(uint8\\)"),
        (onnx_by_hand.brightest_channel(["cane", "sky"]), "its classes are \\['cane', 'sky'\\]"),
        (onnx_by_hand.brightest_channel(None), "its classes are None"),
        (b"no network", "cannot load"),
        (onnx_by_hand.brightest_channel(CLASSES, widening="much"), "'widening' is 'much'"),
        (onnx_by_hand.brightest_channel(CLASSES, widening="nan"), "'widening' is"),
        (onnx_by_hand.brightest_channel(CLASSES, widening="40"), "'widening' is"),
        (onnx_by_hand.brightest_channel(CLASSES, familiar="1.2"), "'familiar' is '1.2'"),
        (onnx_by_hand.brightest_channel(CLASSES, familiar="nan"), "'familiar' is"),
        (onnx_by_hand.brightest_channel(CLASSES, multiple="12"), "'multiple' is '12'"),
    ],
)
def test_a_network_that_does_not_fit_is_refused_in_words(tmp_path, data, says):
    with pytest.raises(ConfigError, match=says):
        NetworkSegmenter(written(tmp_path, data))


def test_segmenters_go_by_name(tmp_path):
    assert choose_segmenter("labels").name == "simulator labels"
    with pytest.raises(ConfigError, match="network, labels"):
        choose_segmenter("magic")
    with pytest.raises(ConfigError, match="cannot load"):
        choose_segmenter("network", tmp_path / "nowhere.onnx")


def test_without_the_shipped_weights_every_frame_is_declined_with_the_reason(monkeypatch):
    def missing(path):
        raise ModelError(f"{path} is not part of this installation")

    monkeypatch.setattr("perception.segmentation.segmenter.resource", missing)
    segmenter = choose_segmenter("network")
    assert isinstance(segmenter, NoSegmenter)
    with pytest.raises(UnusablePictureError) as refused:
        segmenter.segment(view(np.zeros((64, 64, 3), np.uint8)))
    missing_file = "assets/network/vine.onnx is not part of this installation"
    assert refused.value.reason == reasons.network_missing(missing_file)


def test_the_shipped_network_is_small_and_carries_its_card():
    path = resource(SHIPPED)
    assert path.stat().st_size <= 4 * 2**20 and resource(PHOTOGRAPHS).stat().st_size <= 25 * 2**20
    assert "mate_Wood.jpg" in resource(PHOTOGRAPHS).with_suffix(".md").read_text(encoding="utf-8")
    card = path.with_suffix(".md").read_text(encoding="utf-8")
    assert "python -m perception.training" in card and "Limits:" in card


def test_the_shipped_network_sees_rows_it_was_not_trained_on():
    place = np.eye(4)
    place[:3, :3] = np.column_stack([[1, 0, 0], [0, 0, -1], [0, 1, 0]])
    place[:3, 3] = [0.5, -0.03, 1.05]
    segmenter = choose_segmenter("network")
    found = []
    for seed in (901, 902):
        image = Camera(CameraConfig(), seed).render(grow(VineyardConfig(vines=2), seed), place)
        said = segmenter.classify(image.color, image.depth)
        for kind, least in (("cordon", 0.85), ("spur", 0.7), ("cane", 0.8), ("node", 0.7)):
            true = image.labels == CLASSES.index(kind)
            found.append((kind, np.mean(said[true] == CLASSES.index(kind)) >= least))
    assert all(good for _, good in found), found


def test_a_network_says_how_much_too_wide_it_draws_canes(tmp_path):
    said = [
        NetworkSegmenter(written(tmp_path, onnx_by_hand.brightest_channel(CLASSES, widening=text))).width_bias
        for text in ("0.4", None)
    ]
    assert said == [0.4, 0.0]
    assert abs(choose_segmenter("network").width_bias) < 0.2 and choose_segmenter("labels").width_bias == 0.0


def test_each_picture_is_for_the_network_that_knows_such_pictures():
    row = grow(VineyardConfig(), 4)
    image = Camera(CameraConfig(), 4).render(row, looking_left(0.5, -0.05, 1.05))
    segmenter = PhotographSegmenter(resource(SHIPPED), resource(PHOTOGRAPHS))
    labels, likely = segmenter.classify_surely(image.color, image.depth)
    assert segmenter.used.name.startswith("network vine.onnx") and likely is None
    assert np.mean(labels == image.labels) > 0.95
    labels, likely = segmenter.classify_surely(skimage.data.chelsea(), None)
    assert segmenter.used.name.startswith("network photographs.onnx") and likely.shape == labels.shape
