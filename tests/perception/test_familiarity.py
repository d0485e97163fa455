# ruff: noqa: E402
"""How unlike its training pictures a picture is, added to a trained network."""

import hashlib
import shutil

import numpy as np
import pytest

from tests.support.extras import need

need("training")

from perception.models.cards import read_model
from perception.segmentation.network_segmenter import NetworkSegmenter, network_input
from perception.segmentation.segmenter import SHIPPED
from perception.training.familiarity import add_familiarity
from perception.training.familiarity import main as command
from rolling_panda.errors import ConfigError
from rolling_panda.resources import resource
from tests.support import onnx_by_hand


def striped(rng, width):
    color = rng.integers(90, 130, (64, 96, 3)).astype(np.uint8)
    color[:, ::width] = rng.integers(180, 220)
    return color


def test_pictures_like_those_of_the_training_are_familiar_and_others_are_not(tmp_path):
    path = tmp_path / "net.onnx"
    shutil.copy(resource(SHIPPED), path)
    before = NetworkSegmenter(path).classify(striped(np.random.default_rng(9), 8), None)
    rng = np.random.default_rng(0)
    pictures = [network_input(striped(rng, 8), None) for _ in range(200)]
    limit = add_familiarity(path, pictures)
    again = path.read_bytes()
    assert add_familiarity(path, pictures) == pytest.approx(limit) and path.read_bytes() == again
    segmenter = NetworkSegmenter(path)
    assert segmenter.familiar == pytest.approx(limit, abs=1e-4)
    unfamiliar = 0
    for _ in range(50):
        segmenter.classify(striped(rng, 8), None)
        unfamiliar += segmenter.unfamiliar is not None
    assert unfamiliar <= 5
    segmenter.classify(striped(rng, 3), None)
    assert segmenter.unfamiliar.code == "picture_unfamiliar"
    assert np.array_equal(segmenter.classify(striped(np.random.default_rng(9), 8), None), before)


def test_the_command_keeps_the_card_with_its_file(tmp_path, capsys):
    for suffix in (".onnx", ".json"):
        shutil.copy(resource(SHIPPED).with_suffix(suffix), tmp_path / f"net{suffix}")
    assert command([str(tmp_path / "net.onnx"), "--rows", "0", "--drawings", "50"]) == 0
    model = read_model(tmp_path / "net.onnx")
    assert model.card.sha256 == hashlib.sha256((tmp_path / "net.onnx").read_bytes()).hexdigest()
    assert "familiar" in capsys.readouterr().out


def test_a_network_of_another_kind_is_refused_and_left_alone(tmp_path):
    path = tmp_path / "other.onnx"
    path.write_bytes(onnx_by_hand.brightest_channel(["a"]))
    before = path.read_bytes()
    with pytest.raises(ConfigError, match="no network of this project"):
        add_familiarity(path, [])
    assert path.read_bytes() == before
