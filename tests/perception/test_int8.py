# ruff: noqa: E402
"""A trained network with 8-bit integers in place of its numbers."""

import hashlib
import shutil

import msgspec
import numpy as np
import pytest

from tests.support.extras import need

need("training")

import torch

from perception.models.cards import photographs, read_model, write_card
from perception.segmentation.network_segmenter import NetworkSegmenter
from perception.training.familiarity import add_familiarity, pictures_of
from perception.training.int8 import main as command
from perception.training.int8 import quantise
from perception.training.wide.drawing import Artist
from perception.training.wide.export import write_onnx
from perception.training.wide.network import PhotographNetwork
from perception.training.wide.tune import load_exported
from rolling_panda.errors import ConfigError
from rolling_panda.messages.types import WOOD_CLASSES


@pytest.fixture(scope="module")
def pictures():
    return pictures_of(0, 6)


@pytest.fixture(scope="module")
def plain(tmp_path_factory):
    """The network as it would be before the quantisation: in floating point, with its own weights."""
    network = PhotographNetwork(len(WOOD_CLASSES))
    load_exported(network, photographs().path)
    path = tmp_path_factory.mktemp("plain") / "plain.onnx"
    write_onnx(path, network, 1.0)
    return path


def test_the_classes_stay_nearly_the_same_and_the_file_is_small(plain, tmp_path, pictures):
    path = tmp_path / "net.onnx"
    shutil.copy(plain, path)
    quantise(path, pictures)
    assert path.stat().st_size < plain.stat().st_size / 2.5
    before, after = NetworkSegmenter(plain), NetworkSegmenter(path)
    artist = Artist(192)
    same = []
    for number in range(4):
        drawn = artist.draw(77, number)
        same.append((before.classify(drawn.color, drawn.depth) == after.classify(drawn.color, drawn.depth)).mean())
    assert np.mean(same) > 0.9


def test_it_can_be_trained_further_from_its_8_bits(plain, tmp_path, pictures):
    path = tmp_path / "net.onnx"
    shutil.copy(plain, path)
    quantise(path, pictures)
    exact, rounded = PhotographNetwork(len(WOOD_CLASSES)).eval(), PhotographNetwork(len(WOOD_CLASSES)).eval()
    load_exported(exact, plain)
    load_exported(rounded, path)
    picture = torch.from_numpy(pictures[0][None, :, :64, :64])
    with torch.no_grad():
        told, again = exact(picture), rounded(picture)
    assert float((told - again).abs().mean()) < 0.1 * float(told.abs().mean())


def test_familiarity_is_told_anew_and_never_an_old_limit(plain, tmp_path, pictures):
    path = tmp_path / "net.onnx"
    shutil.copy(plain, path)
    many = pictures * 10
    add_familiarity(path, many)
    quantise(path, pictures)
    assert NetworkSegmenter(path).familiar is None
    limit = add_familiarity(path, many)
    assert NetworkSegmenter(path).familiar == pytest.approx(limit, abs=1e-4)


def test_the_command_keeps_the_card_with_its_file(plain, tmp_path, capsys):
    path = tmp_path / "net.onnx"
    shutil.copy(plain, path)
    digest = hashlib.sha256(path.read_bytes()).hexdigest()
    write_card(path, msgspec.structs.replace(photographs().card, sha256=digest))
    assert command([str(path), "--rows", "0", "--drawings", "2"]) == 0
    assert read_model(path).card.sha256 == hashlib.sha256(path.read_bytes()).hexdigest()
    assert "MiB" in capsys.readouterr().out


def test_one_of_8_bits_already_is_refused_and_left_alone(plain, tmp_path, pictures):
    path = tmp_path / "net.onnx"
    shutil.copy(plain, path)
    quantise(path, pictures)
    before = path.read_bytes()
    with pytest.raises(ConfigError, match="integers already"):
        quantise(path, pictures)
    assert path.read_bytes() == before
