"""`rolling-panda models`, and the network that perception starts with."""

import argparse
import hashlib
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from perception import __main__ as process
from perception.dataset.dataset import UNLABELLED, Entry, Manifest, read_dataset, write_manifest
from perception.models.__main__ import main
from perception.models.cards import Card, Data, chosen, photographs, read_model, shipped, write_card
from perception.models.judge import judge_held_out, worse
from perception.segmentation.frame import CANE, TRUNK
from perception.segmentation.network_segmenter import NetworkSegmenter
from rolling_panda.errors import ConfigError, InputError
from rolling_panda.messages.types import WOOD_CLASSES
from rolling_panda.resources import resource
from tests.support.onnx_by_hand import brightest_channel

#: Of this colour, as of a bright sky, `brightest_channel` and the shipped network say background.
FAR_AWAY = (250, 240, 240)


def dataset(folder, truth) -> str:
    """One picture to train on and one held out, with a black patch of a class, and a cane that nobody can see."""
    for part in ("pictures", "masks"):
        (folder / part).mkdir(parents=True)
    picture = np.full((64, 96, 3), FAR_AWAY, np.uint8)
    picture[28:36, 40:50] = 0
    for number, name in enumerate(("a", "b")):
        picture[0, 0] = (250, 240, 240 + number)
        Image.fromarray(picture).save(folder / "pictures" / f"{name}.png")
        labels = np.zeros((64, 96), np.uint8)
        labels[28:36, 40:50] = truth
        labels[:10, 60:] = CANE
        Image.fromarray(labels).save(folder / "masks" / f"{name}.png")
    write_manifest(folder, Manifest("made up", "own", (Entry("a.png", "train"), Entry("b.png", "held-out"))))
    return str(folder)


@pytest.fixture
def good(tmp_path):
    """Of this network black is trunk, since its largest channel is the depth that is not there."""
    path = tmp_path / "good.onnx"
    path.write_bytes(brightest_channel(list(WOOD_CLASSES)))
    return path


def test_held_out_pictures_are_judged_and_unlabelled_pixels_are_not(tmp_path, good):
    data = read_dataset(Path(dataset(tmp_path / "set", TRUNK)))
    figures = judge_held_out(NetworkSegmenter(good), data)
    assert figures["trunk"]["recall"] == 1.0 and figures["trunk"]["precision"] == 1.0
    assert figures["cane"]["recall"] == 0.0 and figures["cordon"]["recall"] is None
    mask = tmp_path / "set" / "masks" / "b.png"
    labels = np.array(Image.open(mask))
    labels[:, 40:50] = UNLABELLED
    labels[:, 20:24] = TRUNK
    Image.fromarray(labels).save(mask)
    figures = judge_held_out(NetworkSegmenter(good), data)
    assert figures["trunk"]["recall"] == 0.0 and figures["trunk"]["precision"] is None
    write_manifest(tmp_path / "set", Manifest("made up", "own", (Entry("a.png", "train"),)))
    with pytest.raises(InputError, match="--held-out"):
        judge_held_out(NetworkSegmenter(good), read_dataset(tmp_path / "set"))


def figures(cane, both) -> dict:
    return {
        "cane": {"recall": 0.5, "f": cane},
        "trunk and cordon": {"recall": None if both is None else 0.5, "f": both},
    }


@pytest.mark.parametrize(
    ("old", "new", "losses"),
    [
        (figures(0.5, 0.5), figures(0.497, 0.9), 0),
        (figures(0.5, 0.5), figures(0.49, 0.9), 1),
        (figures(0.5, 0.5), figures(0.9, 0.1), 1),
        (figures(0.5, 0.5), figures(None, None), 2),
        (figures(0.5, None), figures(0.5, None), 0),
        (figures(None, None), figures(0.1, None), 0),
    ],
)
def test_a_network_is_worse_where_a_class_that_is_shown_has_a_lower_f(old, new, losses):
    new["trunk and cordon"]["recall"] = old["trunk and cordon"]["recall"]
    assert len(worse(old, new)) == losses


def use(state, *words) -> int:
    return main(["use", *map(str, words), "--state", str(state)])


def started_with(state, weights="") -> str:
    """The network that perception would load."""
    config = state.parent / "config.toml"
    config.write_text(f'[perception]\nweights = "{weights}"\n', encoding="utf-8")
    arguments = argparse.Namespace(state=state, robot_id="r1")
    section = process.load_section(config, "perception", process.PerceptionConfig)
    path = process.network_file(section, arguments)
    return "shipped" if path is None else hashlib.sha256(path.read_bytes()).hexdigest()


def test_a_network_that_is_no_worse_is_copied_and_perception_starts_with_it(tmp_path, good, capsys):
    state, data = tmp_path / "state", dataset(tmp_path / "set", TRUNK)
    assert started_with(state) == "shipped" and not state.exists()
    assert use(state, good, "--data", data) == 0
    digest = hashlib.sha256(good.read_bytes()).hexdigest()
    good.unlink()
    assert started_with(state) == digest
    card = chosen(state).card
    assert card.sha256 == digest and card.figures["set, 1 held out"]["trunk"]["recall"] == 1.0
    assert main(["list", "--state", str(state)]) == 0
    said = capsys.readouterr().out
    assert f"* {digest[:12]}.onnx {digest[:12]}" in said and f"  vine.onnx {shipped().sha256[:12]}" in said
    assert use(state, "shipped") == 0
    assert started_with(state) == "shipped"


def test_the_shipped_network_for_photographs_is_taken_into_use_by_its_name(tmp_path, capsys):
    state = tmp_path / "state"
    assert use(state, "photographs") == 0
    assert started_with(state) == photographs().sha256
    assert main(["list", "--state", str(state)]) == 0
    said = capsys.readouterr().out
    assert f"* photographs.onnx {photographs().sha256[:12]}" in said and "  vine.onnx" in said


def test_a_worse_network_is_refused_and_the_one_in_use_stays(tmp_path, good, capsys):
    state, data = tmp_path / "state", dataset(tmp_path / "set", TRUNK)
    assert use(state, good, "--data", data) == 0
    before = sorted(state.rglob("*")), (state / "model.json").read_bytes()
    capsys.readouterr()
    assert use(state, resource("assets/network/vine.onnx"), "--data", data) == 1
    said = capsys.readouterr()
    assert "worse" in said.err and "trunk and cordon" in said.err and "The network in use stays" in said.err
    assert (sorted(state.rglob("*")), (state / "model.json").read_bytes()) == before
    assert use(state, good) == 1
    assert "--data" in capsys.readouterr().err


def test_two_networks_are_compared(tmp_path, good, capsys):
    assert main(["compare", "shipped", str(good), "--data", dataset(tmp_path / "set", TRUNK)]) == 0
    first, second, last = capsys.readouterr().out.splitlines()
    assert first.startswith("vine.onnx") and "trunk and cordon: recall 1.000, precision 1.000" in second
    assert "1 held-out" in last


def test_a_chosen_network_that_was_changed_or_lost_stops_the_start_with_a_remedy(tmp_path, good):
    state, data = tmp_path / "state", dataset(tmp_path / "set", TRUNK)
    assert use(state, good, "--data", data) == 0
    path = chosen(state).path
    content = path.read_bytes()
    path.write_bytes(content + b"x")
    with pytest.raises(ConfigError, match="another network"):
        started_with(state)
    path.with_suffix(".json").unlink()
    with pytest.raises(ConfigError, match="models use"):
        started_with(state)
    path.unlink()
    with pytest.raises(ConfigError, match="cannot read the network"):
        started_with(state)
    (state / "model.json").write_text("{", encoding="utf-8")
    with pytest.raises(InputError, match="models use"):
        started_with(state)
    assert use(state, "shipped") == 0
    assert started_with(state) == "shipped"


def test_the_shipped_card_is_of_the_shipped_network():
    model = shipped()
    assert model.card is not None and model.card.data[0].pictures == 1600
    assert set(model.card.figures["survey"]) == set(WOOD_CLASSES)


def test_a_card_is_of_one_file_and_a_damaged_one_is_named(good):
    assert read_model(good).card is None
    write_card(good, Card("0" * 64, (Data("rows", "own", 3),), "train"))
    with pytest.raises(ConfigError, match=r"good.json is the card of another network"):
        read_model(good)
    good.with_suffix(".json").write_text("{", encoding="utf-8")
    with pytest.raises(ConfigError, match=r"good.json"):
        read_model(good)
    with pytest.raises(ConfigError, match=r"none.onnx"):
        read_model(good.with_name("none.onnx"))


def test_bad_words_end_in_one_line(tmp_path, good, capsys):
    (tmp_path / "no.onnx").write_bytes(b"no network")
    data = dataset(tmp_path / "set", TRUNK)
    for words in (["nowhere.onnx", "--data", data], [tmp_path / "no.onnx", "--data", data], [good, "--data", tmp_path]):
        assert use(tmp_path / "state", *words) == 1
        said = capsys.readouterr().err
        assert said.startswith("rolling-panda models use: ") and said.count("\n") == 1
        assert not (tmp_path / "state").exists()


def test_the_networks_of_the_tree_are_those_of_their_cards_with_the_command_and_the_licences():
    networks = (shipped(), photographs())
    assert sum(each.path.stat().st_size for each in networks) < 25e6
    for each in networks:
        assert each.card is not None and each.card.sha256 == hashlib.sha256(each.path.read_bytes()).hexdigest()
        assert each.card.command.startswith("python -m perception.training")
        assert each.card.data and all(data.source and data.licence for data in each.card.data)
