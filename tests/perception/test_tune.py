# ruff: noqa: E402
"""`rolling-panda train`: fine-tuning on one's own pictures."""

import json
import shutil
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from tests.support.extras import need

need("training")

import torch

from perception.dataset.dataset import UNLABELLED, Entry, Manifest, read_dataset, write_manifest
from perception.models.cards import read_model
from perception.segmentation.frame import CANE, GROUND
from perception.segmentation.network_segmenter import NetworkSegmenter
from perception.training.wide.export import write_onnx
from perception.training.wide.network import PhotographNetwork
from perception.training.wide.tune import Tuner, load_exported, main
from rolling_panda.errors import InputError
from rolling_panda.messages.types import WOOD_CLASSES
from tests.support.onnx_by_hand import brightest_channel


@pytest.fixture(scope="module")
def vineyard(tmp_path_factory) -> Path:
    """Pictures that can be learned at once: bright is cane, dark is ground."""
    folder = tmp_path_factory.mktemp("data") / "rows"
    for part in ("pictures", "masks"):
        (folder / part).mkdir(parents=True)
    rng, entries = np.random.default_rng(0), []
    for number in range(3):
        bright = np.kron(rng.integers(0, 2, (4, 5)), np.ones((20, 20))).astype(bool)
        color = np.where(bright[..., None], (230, 220, 200), (25, 20, 15)).astype(np.uint8)
        labels = np.where(bright, CANE, GROUND).astype(np.uint8)
        labels[:6] = UNLABELLED
        Image.fromarray(color).save(folder / "pictures" / f"{number}.png")
        Image.fromarray(labels).save(folder / "masks" / f"{number}.png")
        entries.append(Entry(f"{number}.png", "train" if number < 2 else "held-out"))
    write_manifest(folder, Manifest("made up", "CC0", tuple(entries)))
    return folder


def train(folder, out, *more) -> int:
    words = ["--from", "imagenet", "--data", str(folder), "--out", str(out), "--work", str(out.parent / "work")]
    return main([*words, "--size", "64", "--judge-every", "5", *map(str, more)])


def tuner(folder) -> Tuner:
    torch.manual_seed(0)
    return Tuner(PhotographNetwork(len(WOOD_CLASSES)).eval(), [read_dataset(folder)], 64, 1, "mark")


def test_a_killed_training_ends_as_one_that_was_not(vineyard, tmp_path):
    whole, first, second = (tuner(vineyard) for _ in range(3))
    told = [whole.train_step() for _ in range(4)]
    begun = [first.train_step() for _ in range(2)]
    first.judge()
    torch.save(first.state(), tmp_path / "state.pt")
    second.restore(torch.load(tmp_path / "state.pt", weights_only=True), tmp_path / "state.pt")
    assert begun + [second.train_step() for _ in range(2)] == pytest.approx(told, rel=1e-4)
    for name, value in whole.state()["network"].items():
        torch.testing.assert_close(second.state()["network"][name], value, rtol=1e-3, atol=1e-5)
    assert [each.f for each in second.curve] == [each.f for each in first.curve] and second.step == 4
    with pytest.raises(InputError, match="--work"):
        second.restore({"mark": "other"}, tmp_path / "state.pt")


def test_unlabelled_pixels_teach_nothing(vineyard, tmp_path):
    whole = read_dataset(vineyard)
    copy = tmp_path / "copy"
    shutil.copytree(vineyard, copy)
    for name in whole.names("train"):
        labels = np.full_like(whole.load(name)[1], UNLABELLED)
        Image.fromarray(labels).save(copy / "masks" / name)
    empty = [tuner(copy).train_step() for _ in range(2)]
    assert np.isfinite(empty).all() and empty[0] == empty[1]
    for name in whole.names("train"):
        Image.fromarray(255 - whole.load(name)[0]).save(copy / "pictures" / name)
    # Other colours, and nothing labelled: only the drawn picture counts.
    assert tuner(copy).train_step() == pytest.approx(empty[0], rel=1e-5)
    assert tuner(vineyard).train_step() != pytest.approx(empty[0], rel=1e-3)


def test_what_was_exported_is_what_training_goes_on_from(tmp_path):
    torch.manual_seed(3)
    network = PhotographNetwork(len(WOOD_CLASSES))
    with torch.no_grad():
        for module in network.modules():
            if isinstance(module, torch.nn.BatchNorm2d):
                module.running_mean.uniform_(-0.3, 0.3)
                module.running_var.uniform_(0.5, 2.0)
                module.weight.uniform_(0.5, 1.5)
                module.bias.uniform_(-0.3, 0.3)
    network.eval()
    image = torch.rand(1, 4, 64, 96) * 2.0 - 1.0
    with torch.inference_mode():
        meant = network(image).clone()
        write_onnx(tmp_path / "n.onnx", network, 1.0)
        again = PhotographNetwork(len(WOOD_CLASSES))
        load_exported(again, tmp_path / "n.onnx")
        torch.testing.assert_close(again.eval()(image), meant, rtol=1e-3, atol=1e-3)


def test_another_network_is_refused(tmp_path):
    (tmp_path / "other.onnx").write_bytes(brightest_channel(list(WOOD_CLASSES)))
    with pytest.raises(InputError, match="other.onnx is no network of"):
        load_exported(PhotographNetwork(len(WOOD_CLASSES)), tmp_path / "other.onnx")
    (tmp_path / "other.onnx").write_bytes(b"vine")
    with pytest.raises(InputError, match="cannot read the network"):
        load_exported(PhotographNetwork(len(WOOD_CLASSES)), tmp_path / "other.onnx")


def test_the_command_learns_writes_a_card_and_goes_on_from_its_own_file(vineyard, tmp_path, capsys):
    out = tmp_path / "mine.onnx"
    assert train(vineyard, out, "--steps", "5") in (0, 1)
    capsys.readouterr()
    assert train(vineyard, out, "--steps", "40") == 0
    assert "continues after step 5" in capsys.readouterr().out
    curve = (tmp_path / "work" / "curve.csv").read_text(encoding="utf-8").splitlines()
    assert [line.split(",")[0] for line in curve[:3]] == ["step", "0", "5"]
    model = read_model(out)
    assert model.card.data[0].licence == "CC0" and model.card.data[0].pictures == 2 and model.card.begun_from == ""
    cane = model.card.figures["rows, 1 held out"]["cane"]
    best = max(float(line.split(",")[2]) for line in curve[1:])
    assert cane["f"] == pytest.approx(best, abs=1e-3) and best > 0.8
    color, labels = read_dataset(vineyard).load("2.png")
    said, likely = NetworkSegmenter(out).classify_surely(color, None)
    assert np.mean((said == CANE)[6:] == (labels == CANE)[6:]) > 0.7 and likely is not None
    (tmp_path / "more").mkdir()
    again = ["--from", str(out), "--data", str(vineyard), "--out", str(tmp_path / "more" / "n.onnx"), "--size", "64"]
    main([*again, "--work", str(tmp_path / "more"), "--steps", "1", "--judge-every", "1"])
    first = float((tmp_path / "more" / "curve.csv").read_text(encoding="utf-8").splitlines()[1].split(",")[2])
    assert first == pytest.approx(cane["f"], abs=0.02)


def test_training_that_helps_nothing_writes_nothing_and_bad_words_are_named(vineyard, tmp_path, capsys, monkeypatch):
    monkeypatch.setattr(Tuner, "train_step", lambda self: setattr(self, "step", self.step + 1) or 1.0)
    assert train(vineyard, tmp_path / "n.onnx", "--steps", "100") == 1
    said = capsys.readouterr()
    assert "no better" in said.err and "after 30 steps" in said.err and not (tmp_path / "n.onnx").exists()
    for words, named in ((["--size", "65"], "--size 65"), (["--steps", "0"], "--steps 0")):
        assert train(vineyard, tmp_path / "n.onnx", *words) == 1
        assert named in capsys.readouterr().err
    assert train(tmp_path, tmp_path / "n.onnx") == 1
    assert "dataset.json" in capsys.readouterr().err
    manifest = json.loads((vineyard / "dataset.json").read_text(encoding="utf-8"))
    other = tmp_path / "all"
    (other).mkdir()
    for part in ("pictures", "masks"):
        (other / part).symlink_to(vineyard / part)
    for entry in manifest["pictures"]:
        entry["split"] = "train"
    (other / "dataset.json").write_text(json.dumps(manifest), encoding="utf-8")
    assert train(other, tmp_path / "n.onnx") == 1
    assert "--held-out" in capsys.readouterr().err
