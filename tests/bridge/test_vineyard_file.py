"""A row as a file, and the command that writes it."""

import msgspec
import numpy as np
import pytest
from PIL import Image

from bridge.sim.camera.config import CameraConfig
from bridge.sim.camera.renderer import Camera
from bridge.sim.vineyard.command import main, picture
from bridge.sim.vineyard.config import PRESETS, VineyardConfig
from bridge.sim.vineyard.file import Vineyard, cut_positions, load, save
from bridge.sim.vineyard.grow import grow
from bridge.sim.vineyard.truth import judge
from rolling_panda.errors import InputError


@pytest.mark.parametrize("training", ["cordon", "guyot"])
def test_a_row_comes_back_as_it_was_and_looks_the_same(tmp_path, training):
    config = VineyardConfig(training=training)
    written = Vineyard(7, config, grow(config, 7))
    save(tmp_path / "row.json", written)
    read = load(tmp_path / "row.json")
    assert read.seed == 7 and read.config == config
    place = np.eye(4)
    place[:3, :3] = np.column_stack([[1, 0, 0], [0, 0, -1], [0, 1, 0]])
    place[:3, 3] = [0.5, 0.0, 1.0]
    first, second = (Camera(CameraConfig(width=212, height=120), 1).render(v.row, place) for v in (written, read))
    assert np.array_equal(first.color, second.color) and np.array_equal(first.rods, second.rods)
    assert np.array_equal(cut_positions(written), cut_positions(read))


def test_a_row_that_was_cut_comes_back_cut_and_without_truth(tmp_path):
    row = grow(VineyardConfig(), 3)
    cut = next(truth.cut for truth in judge(row) if truth.cut is not None)
    after = row.sever(cut.rod, 0.5)
    save(tmp_path / "row.json", Vineyard(3, VineyardConfig(), after))
    read = load(tmp_path / "row.json").row
    assert read.revision == 1 and [rod is None for rod in read.rods] == [rod is None for rod in after.rods]
    assert msgspec.json.decode((tmp_path / "row.json").read_bytes())["truth"] == []


@pytest.mark.parametrize("text", ["", "{}", '{"format": "x"}', "[1, 2"])
def test_another_file_is_refused_in_words(tmp_path, text):
    path = tmp_path / "row.json"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(InputError, match="not a vineyard file"):
        load(path)


def test_a_file_of_another_format_or_with_orphans_is_refused(tmp_path):
    path = tmp_path / "row.json"
    save(path, Vineyard(1, VineyardConfig(), grow(VineyardConfig(), 1)))
    document = msgspec.json.decode(path.read_bytes())
    path.write_bytes(msgspec.json.encode({**document, "format": "rolling-panda vineyard 9"}))
    with pytest.raises(InputError, match="vineyard 9"):
        load(path)
    document["rods"][3][5] = 900
    path.write_bytes(msgspec.json.encode(document))
    with pytest.raises(InputError, match="parents come before"):
        load(path)


def test_a_file_from_before_there_were_presets_is_of_the_standard_one(tmp_path):
    path = tmp_path / "row.json"
    save(path, Vineyard(1, VineyardConfig(), grow(VineyardConfig(), 1)))
    document = msgspec.json.decode(path.read_bytes())
    del document["config"]["preset"], document["config"]["laterals"]
    path.write_bytes(msgspec.json.encode(document))
    assert load(path).config == VineyardConfig()


def test_a_preset_beside_a_configuration_is_refused(tmp_path, capsys):
    with pytest.raises(SystemExit):
        main(["--preset", "drooping", "--config", str(tmp_path / "a.toml"), "--out", str(tmp_path / "a.json")])
    assert "give one" in capsys.readouterr().err


def test_the_picture_shows_the_lateral_shoots_of_a_preset():
    config = VineyardConfig(vines=1)
    row = grow(config, 4)
    bare, branched = (
        np.asarray(picture(Vineyard(4, msgspec.structs.replace(config, laterals=share), row))) for share in (0.0, 0.5)
    )
    assert np.count_nonzero(np.any(bare != branched, axis=2)) > 2000


def test_the_command_writes_row_and_picture(tmp_path, capsys):
    assert main(["--seed", "4", "--vines", "1", "--training", "guyot", "--out", str(tmp_path / "a.json")]) == 0
    assert load(tmp_path / "a.json").config.training == "guyot"
    pixels = np.asarray(Image.open(tmp_path / "a.png").convert("RGB")).astype(int)
    assert np.count_nonzero((pixels[..., 0] > 200) & (pixels[..., 1] < 60)) > 50, "the right cuts are ringed"
    assert "3 cuts" in capsys.readouterr().out
    assert main(["--preset", "vigorous", "--vines", "1", "--out", str(tmp_path / "b.json")]) == 0
    assert load(tmp_path / "b.json").config == msgspec.structs.replace(PRESETS["vigorous"], vines=1)
    assert main(["--out", str(tmp_path / "nowhere" / "a.json")]) == 1
    assert "folder that exists" in capsys.readouterr().err
