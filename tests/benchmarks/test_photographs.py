"""`rolling-panda bench photographs`: photographs and the masks that people drew."""

import json

import numpy as np
import pytest
from PIL import Image

from benchmarks.perception.photographs import bases, load_mask, main
from rolling_panda.errors import InputError
from rolling_panda.messages.types import WOOD_CLASSES
from tests.support.onnx_by_hand import brightest_channel

CLASSES = ("background", "trunk", "cane", "cordon")


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


def test_canes_begin_where_their_mask_meets_the_cordon():
    mask = np.zeros((100, 300), np.uint8)
    mask[60:70] = 3
    mask[10:60, 50:54] = mask[10:60, 200:205] = mask[:30, 250:254] = 2
    truth = {name: mask == k for k, name in enumerate(CLASSES)}
    assert np.allclose(bases(truth), [[51.5, 59.0], [202.0, 59.0]], atol=1.0)


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
