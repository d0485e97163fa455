"""`rolling-panda perceive` on pictures, good and bad."""

import json
import subprocess

import numpy as np
import pytest
import skimage.data
from PIL import Image

from bridge.sim.camera.config import CameraConfig
from bridge.sim.camera.renderer import Camera
from bridge.sim.vineyard.config import VineyardConfig
from bridge.sim.vineyard.grow import grow
from bridge.sim.vineyard.truth import judge
from perception.perceive import main
from rolling_panda.messages.types import WOOD_CLASSES
from rolling_panda.runtime.launch import child_environment, python_command
from tests.support import onnx_by_hand
from tests.support.cameras import looking_left

#: For a machine that is busy with other things.
PATIENCE_S = 120.0
PLACE = looking_left(0.5, -0.05, 1.05)


@pytest.fixture(scope="module")
def files(tmp_path_factory):
    """A rendered vine as somebody would bring it: photograph, depth in millimetres, intrinsics."""
    folder = tmp_path_factory.mktemp("photograph")
    row = grow(VineyardConfig(), 301)
    camera = Camera(CameraConfig(), 301)
    image = camera.render(row, PLACE)
    Image.fromarray(image.color).save(folder / "vine.jpg", quality=92)
    Image.fromarray(np.round(image.depth * 1000).astype(np.uint16)).save(folder / "depth.png")
    k = camera.intrinsics
    document = {"width": 848, "height": 480, "fx": k.fx, "fy": k.fy, "cx": k.cx, "cy": k.cy}
    (folder / "k.json").write_text(json.dumps(document), encoding="utf-8")
    right = np.array([truth.cut.best for truth in judge(row) if truth.cut is not None])
    return folder, image, right


def run(folder, out, *more) -> dict:
    assert main([str(folder / "vine.jpg"), "--out", str(out), *more]) == 0
    return json.loads((out / "points.json").read_text(encoding="utf-8"))


def test_a_photograph_with_depth_gives_points_classes_and_an_overlay(files, tmp_path):
    folder, image, right = files
    said = run(folder, tmp_path, "--depth", str(folder / "depth.png"), "--intrinsics", str(folder / "k.json"))
    assert said["scale"] == "depth image" and said["intrinsics"] == "given"
    cuts = [point for point in said["points"] if point["kind"] == "spur cut"]
    assert len(cuts) >= 3
    # Camera coordinates are x right, y down, z forward.
    world = [PLACE[:3, :3] @ np.array(cut["position"]) + PLACE[:3, 3] for cut in cuts]
    gaps = np.array([np.linalg.norm(right - place, axis=1).min() for place in world])
    assert np.mean(gaps < 0.015) >= 0.6
    with Image.open(tmp_path / "classes.png") as mask:
        classes = np.asarray(mask)
    assert classes.shape == (480, 848) and np.mean(classes == image.labels) > 0.9
    canes = image.labels == WOOD_CLASSES.index("cane")
    assert np.mean(np.isin(classes[canes], [WOOD_CLASSES.index("cane"), WOOD_CLASSES.index("node")])) > 0.8
    overlay = np.asarray(Image.open(tmp_path / "overlay.png").convert("RGB")).astype(int)
    u, v = (round(value) for value in cuts[0]["pixel"])
    near = overlay[v - 3 : v + 4, u - 3 : u + 4]
    assert np.any((near[..., 0] > 180) & (near[..., 1] < 80)), "the cut is marked in red"


def test_without_depth_points_are_pixels_only(files, tmp_path):
    folder, _, _ = files
    said = run(folder, tmp_path)
    assert "no depth" in said["scale"] and said["intrinsics"] == "assumed"
    for point in said["points"]:
        assert point["position"] is None and point["tangent"] is None and point["radius"] is None
        assert 0 <= point["pixel"][0] < 848 and 0 <= point["pixel"][1] < 480 and point["reason"]


@pytest.mark.long
def test_the_files_have_the_size_of_the_photograph(files, tmp_path):
    folder, _, _ = files
    with Image.open(folder / "vine.jpg") as image:
        image.resize((1500, 849)).save(tmp_path / "vine.jpg")
    said = run(tmp_path, tmp_path / "out")
    assert said["size"] == [1500, 849]
    for name in ("classes.png", "overlay.png"):
        with Image.open(tmp_path / "out" / name) as image:
            assert image.size == (1500, 849)


def test_a_picture_of_noise_gives_no_point(tmp_path):
    noise = np.random.default_rng(0).integers(0, 255, (480, 640, 3), dtype=np.uint8)
    Image.fromarray(noise).save(tmp_path / "vine.jpg")
    said = run(tmp_path, tmp_path / "out")
    assert said["points"] == [] and said["undecided"]


@pytest.mark.long
def test_a_picture_of_something_else_is_called_unfamiliar(tmp_path):
    Image.fromarray(skimage.data.hubble_deep_field()).save(tmp_path / "vine.jpg")
    said = run(tmp_path, tmp_path / "out")
    (only,) = said["undecided"]
    assert said["points"] == [] and only["reason"].startswith("Unfamiliar picture") and only["pixel"] is None


@pytest.mark.parametrize(
    ("words", "says"),
    [
        (["--weights", "net.onnx"], "its classes are"),
        (["--nodes-kept", "9"], "1 to 5"),
        (["--offset", "0.5"], "0.05 m"),
        (["--depth-unit", "0"], "more than 0"),
        (["--depth", "vine.jpg"], "one value a pixel"),
        (["--depth", "far.npy"], "--depth-unit"),
        (["--depth", "nan.npy"], "no depth at all"),
    ],
)
def test_what_cannot_be_is_refused_in_words_and_nothing_is_written(files, tmp_path, monkeypatch, capsys, words, says):
    folder, _, _ = files
    monkeypatch.chdir(tmp_path)
    (tmp_path / "vine.jpg").write_bytes((folder / "vine.jpg").read_bytes())
    (tmp_path / "net.onnx").write_bytes(onnx_by_hand.brightest_channel(["sky"]))
    np.save(tmp_path / "far.npy", np.full((480, 848), 800.0))
    np.save(tmp_path / "nan.npy", np.full((480, 848), np.nan))
    assert main(["vine.jpg", "--out", "out", *words]) == 1
    assert says in capsys.readouterr().err
    assert not (tmp_path / "out").exists()


@pytest.mark.long
@pytest.mark.parametrize(
    "words",
    [
        ["absent.jpg"],
        ["vine.png", "--depth", "absent.npy"],
        ["vine.png", "--intrinsics", "absent.json"],
        ["vine.png", "--weights", "absent.onnx"],
        [".", "--depth", "absent.npy"],
    ],
)
def test_the_command_ends_with_an_error_that_names_the_missing_file(tmp_path, words):
    Image.fromarray(np.full((240, 320, 3), 90, np.uint8)).save(tmp_path / "vine.png")
    command = python_command("rolling_panda", ["perceive", *words, "--out", "out"])
    ended = subprocess.run(
        command, cwd=tmp_path, env=child_environment(), capture_output=True, text=True, timeout=PATIENCE_S
    )
    assert ended.returncode == 1, ended
    named = "image ." if words[0] == "." else words[-1]
    assert ended.stdout == "" and ended.stderr.startswith("rolling-panda perceive: ") and named in ended.stderr
    assert "Traceback" not in ended.stderr and not (tmp_path / "out").exists()


def test_a_missing_photograph_is_said_before_the_network_is_loaded(tmp_path, monkeypatch, capsys):
    monkeypatch.setattr("perception.perceive.PhotographSegmenter", lambda path: pytest.fail("the network was loaded"))
    assert main([str(tmp_path / "absent.jpg"), "--out", str(tmp_path / "out")]) == 1
    assert "cannot read the image" in capsys.readouterr().err


@pytest.mark.parametrize("color", [0, 255])
def test_a_black_or_white_picture_is_refused(tmp_path, capsys, color):
    Image.fromarray(np.full((240, 320, 3), color, np.uint8)).save(tmp_path / "vine.jpg")
    assert main([str(tmp_path / "vine.jpg"), "--out", str(tmp_path / "out")]) == 1
    assert "is blank" in capsys.readouterr().err
