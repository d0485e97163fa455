"""Agreement of classes with masks that people drew."""

import json

import numpy as np
import pytest
from PIL import Image

from benchmarks.perception.masks import Agreement, edge
from benchmarks.perception.photographs import compared, load_mask, main
from perception.segmentation.frame import BACKGROUND, CANE, CORDON, NODE, OLD_CUT, SPUR, TRUNK
from rolling_panda.errors import InputError
from rolling_panda.messages.types import WOOD_CLASSES
from tests.support.onnx_by_hand import brightest_channel

CLASSES = ("background", "trunk", "cane", "cordon")


def stripe(first: int, last: int, size: int = 60) -> np.ndarray:
    out = np.zeros((size, size), bool)
    out[:, first:last] = True
    return out


def agreement(true, told, tolerance=3.0, likely=None):
    out = Agreement()
    out.add(true, told, tolerance, likely)
    return out.figures()


def test_what_is_off_by_no_more_than_the_tolerance_is_found_and_right():
    near, far = agreement(stripe(20, 24), stripe(23, 27)), agreement(stripe(20, 24), stripe(28, 32))
    assert (near["recall"], near["precision"]) == (1.0, 1.0) and near["iou"] == pytest.approx(1 / 7)
    # Columns 20 and 21 are further than three pixels from column 25; 28 is 5 from 23.
    assert agreement(stripe(20, 24), stripe(25, 29))["recall"] == 0.5
    assert (far["recall"], far["precision"], far["f"]) == (0.0, 0.0, 0.0)


def test_recall_misses_what_is_not_told_and_precision_counts_what_is_not_there():
    half = stripe(20, 24)
    half[30:] = False
    missed = agreement(stripe(20, 24), half, 0.0)
    assert (missed["recall"], missed["precision"]) == (0.5, 1.0)
    invented = agreement(half, stripe(20, 24), 0.0)
    assert (invented["recall"], invented["precision"]) == (1.0, 0.5)


def test_figures_of_nothing_are_none_and_not_zero():
    nothing = np.zeros((60, 60), bool)
    assert agreement(nothing, nothing) == dict.fromkeys(("recall", "precision", "f", "iou", "boundary_f", "ece"))
    assert agreement(stripe(3, 9), nothing)["recall"] == 0.0 and agreement(stripe(3, 9), nothing)["precision"] is None


def test_a_boundary_is_where_a_mask_ends_but_not_where_the_picture_does():
    assert np.flatnonzero(edge(stripe(20, 24))[0]).tolist() == [20, 23]
    assert np.flatnonzero(edge(stripe(0, 5))[0]).tolist() == [4]
    # A stripe three times as wide contains the true one, and has its boundaries elsewhere.
    assert agreement(stripe(25, 35), stripe(15, 45))["boundary_f"] == 0.0
    assert agreement(stripe(25, 35), stripe(24, 36))["boundary_f"] == 1.0


def test_calibration_error_is_the_gap_between_what_was_said_and_what_was_so():
    true, told = stripe(0, 30), stripe(0, 60)
    assert agreement(true, told, likely=np.full((60, 60), 0.5))["ece"] == pytest.approx(0.0, abs=1e-9)
    assert agreement(true, told, likely=np.full((60, 60), 0.9))["ece"] == pytest.approx(0.4)
    split = np.where(true, 0.95, 0.05)
    assert agreement(true, told, likely=split)["ece"] == pytest.approx(0.05)
    certain = agreement(told, told, likely=np.ones((60, 60)))
    assert certain["ece"] == pytest.approx(0.0)


def test_pictures_add_up_pixel_by_pixel():
    both = Agreement()
    both.add(stripe(0, 10), stripe(0, 10), 0.0)
    both.add(stripe(0, 30), stripe(40, 50), 0.0)
    assert both.figures()["recall"] == 0.25 and both.figures()["precision"] == 0.5


def test_kinds_of_wood_that_people_do_not_tell_apart_are_one():
    told = np.array([[BACKGROUND, TRUNK, CORDON, OLD_CUT, CANE, NODE, SPUR]], np.uint8)
    nothing = {name: np.zeros((1, 7), bool) for name in CLASSES[1:]}
    said = {name: np.flatnonzero(mask[0]).tolist() for name, _, mask in compared(nothing, told)}
    assert said == {
        "trunk": [1],
        "cane": [4, 5, 6],
        "cordon": [2, 3],
        "trunk and cordon": [1, 2, 3],
        "wood": [1, 2, 3, 4, 5, 6],
    }


def test_masks_with_a_palette_are_read_by_index(tmp_path):
    image = Image.fromarray(np.array([[0, 1], [2, 3]], np.uint8), mode="P")
    image.putpalette([9, 9, 9] * 256)
    image.save(tmp_path / "a.png")
    masks = load_mask(tmp_path / "a.png", CLASSES)
    assert {name: np.argwhere(mask).tolist() for name, mask in masks.items()} == {
        "trunk": [[0, 1]],
        "cane": [[1, 0]],
        "cordon": [[1, 1]],
    }


def photograph(folder, name, size=(96, 64), mask_size=None, value=2, mode="L"):
    (folder / "photographs").mkdir(exist_ok=True)
    (folder / "masks").mkdir(exist_ok=True)
    rng = np.random.default_rng(0)
    color = rng.integers(90, 110, (size[1], size[0], 3)).astype(np.uint8)
    color[:, 40:44] = (190, 150, 60)
    Image.fromarray(color).save(folder / "photographs" / f"{name}.png")
    width, height = mask_size or size
    mask = np.zeros((height, width), np.uint8)
    mask[:, 40:44] = value
    Image.fromarray(mask).convert(mode).save(folder / "masks" / f"{name}.png")
    return [str(folder / "photographs"), "--masks", str(folder / "masks")]


def test_the_command_measures_draws_and_writes_what_it_found(tmp_path, capsys):
    photograph(tmp_path, "one")
    words = photograph(tmp_path, "two")
    words += ["--method", "ridge", "--gallery", str(tmp_path / "g" / "worst.png"), "--json", str(tmp_path / "f.json")]
    assert main(words) == 0
    found = json.loads((tmp_path / "f.json").read_text(encoding="utf-8"))
    assert found["photographs"] == 2 and [each["photograph"] for each in found["results"]] == ["one.png", "two.png"]
    assert found["summary"]["cane"]["recall"] > 0.95 and found["summary"]["cane"]["precision"] > 0.8
    assert found["summary"]["trunk"]["recall"] is None and found["summary"]["cane"]["ece"] is None
    assert "cane" in capsys.readouterr().out
    with Image.open(tmp_path / "g" / "worst.png") as gallery:
        assert gallery.width == 1920 and gallery.height == 2 * 640


def test_the_network_sees_the_photograph_and_answers_at_its_own_size(tmp_path):
    """Of this network dark pixels are trunk, since their largest channel is the depth that is not there."""
    weights = tmp_path / "dark.onnx"
    weights.write_bytes(brightest_channel(list(WOOD_CLASSES)))
    words = photograph(tmp_path, "wide", size=(1200, 400), value=1)
    picture = np.full((400, 1200, 3), (230, 20, 20), np.uint8)
    picture[300:320, 900:960] = 10
    Image.fromarray(picture).save(tmp_path / "photographs" / "wide.png")
    Image.fromarray(np.where(picture[..., 0] == 10, 1, 0).astype(np.uint8)).save(tmp_path / "masks" / "wide.png")
    assert main([*words, "--weights", str(weights), "--json", str(tmp_path / "f.json")]) == 0
    found = json.loads((tmp_path / "f.json").read_text(encoding="utf-8"))
    assert found["weights"] == "dark.onnx" and found["summary"]["trunk"]["iou"] > 0.9
    assert found["summary"]["cane"]["recall"] is None and found["summary"]["trunk and cordon"]["precision"] == 1.0


@pytest.mark.parametrize(
    ("change", "named"),
    [
        ({"mask_size": (96, 60)}, "one.png"),
        ({"value": 4}, "one.png"),
        ({"mode": "RGB"}, "one.png"),
    ],
)
def test_masks_that_do_not_fit_are_named(tmp_path, change, named):
    words = photograph(tmp_path, "one", **change)
    with pytest.raises(InputError, match=named):
        main([*words, "--method", "ridge"])


def test_a_missing_or_broken_mask_or_photograph_is_named(tmp_path):
    words = [*photograph(tmp_path, "one"), "--method", "ridge"]
    mask = tmp_path / "masks" / "one.png"
    mask.write_bytes(mask.read_bytes()[:80])
    with pytest.raises(InputError, match="one.png"):
        main(words)
    mask.unlink()
    with pytest.raises(InputError, match="one.png"):
        main(words)
    photograph(tmp_path, "one")
    picture = tmp_path / "photographs" / "one.png"
    picture.write_bytes(picture.read_bytes()[:200])
    with pytest.raises(InputError, match="one.png"):
        main(words[:3])
    with pytest.raises(InputError, match="one.png"):
        main(words)
    picture.unlink()
    with pytest.raises(InputError, match="photographs"):
        main(words)
    with pytest.raises(InputError, match="nowhere"):
        main([str(tmp_path / "nowhere"), "--masks", str(tmp_path)])
