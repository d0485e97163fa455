# ruff: noqa: E402
"""The training of the segmentation network."""

import numpy as np
import pytest

from tests.support.extras import need

need("training")

import torch

from perception.models.cards import read_model
from perception.segmentation.network_segmenter import NetworkSegmenter, network_input
from perception.training.compact import CompactLabeller
from perception.training.export import write_network
from perception.training.fit import (
    WEIGHTS,
    Trainer,
)
from perception.training.network import Labeller
from perception.training.scenes import VIEWS, Scenes, render_scenes
from perception.training.score import (
    Confusion,
    confusion,
)
from rolling_panda.messages.types import WOOD_CLASSES


@pytest.fixture(scope="module")
def scenes() -> Scenes:
    """Two pictures that a network can learn at once: bright is cane, dark is ground."""
    rng = np.random.default_rng(0)
    bright = np.kron(rng.integers(0, 2, (2, 16, 16)), np.ones((1, 16, 16))).astype(bool)
    color = np.where(bright[..., None], 230, 20).astype(np.uint8).repeat(3, axis=-1)
    labels = np.where(bright, WOOD_CLASSES.index("cane"), WOOD_CLASSES.index("ground")).astype(np.uint8)
    return Scenes(color, np.full(bright.shape, 0.8, np.float16), labels)


def losses(trainer: Trainer, scenes: Scenes, until: int) -> list[float]:
    return [progress.loss for progress in trainer.run(scenes, until)]


def test_the_same_seed_trains_the_same_network_also_in_two_goes(scenes):
    whole = losses(Trainer(3, 4, 1), scenes, 4)
    first, second = Trainer(3, 4, 1), Trainer(3, 4, 1)
    begun = losses(first, scenes, 2)
    second.restore(first.state())
    assert begun + losses(second, scenes, 4) == pytest.approx(whole, rel=1e-3)
    assert losses(Trainer(4, 4, 1), scenes, 1)[0] != pytest.approx(whole[0], rel=1e-3)


def test_a_training_goes_on_from_another_one_and_the_card_tells_both(scenes, tmp_path):
    first = Trainer(1, 16, 2)
    begun = losses(first, scenes, 6)
    second = Trainer(2, 2, 3, first.state())
    assert np.mean(losses(second, scenes, 2)) < np.mean(begun[:2])
    score = confusion(Labeller(second.network, WEIGHTS), scenes)
    write_network(tmp_path / "net.onnx", second, {"all": score}, 0.0)
    card = (tmp_path / "net.md").read_text(encoding="utf-8")
    assert "8 steps of" in card and "--seed 1 --rows 2 --steps 16 --until 6 --out net.onnx" in card
    assert "--seed 2 --rows 3 --steps 2 --start build/training/state_1_16.pt --out net.onnx" in card
    kept = read_model(tmp_path / "net.onnx").card
    assert kept is not None and kept.command.count("python -m perception.training --seed") == 2
    (figures,) = kept.figures.values()
    assert figures["cane"] == {"iou": score.overlap()["cane"], "recall": score.found()["cane"]}


def test_pictures_of_rows_are_varied_and_always_the_same():
    scenes, again, others = (render_scenes(seed, 2) for seed in (8_900_000, 8_900_000, 8_900_002))
    for name in ("color", "depth", "labels"):
        assert np.array_equal(getattr(scenes, name), getattr(again, name))
        assert not np.array_equal(getattr(scenes, name), getattr(others, name))
    assert len(scenes.color) == len(scenes.depth) == len(scenes.labels) == 2 * VIEWS
    assert all((scenes.labels == WOOD_CLASSES.index(kind)).any() for kind in ("cane", "node", "cordon", "wire"))


def test_what_was_learned_survives_the_export(scenes, tmp_path):
    trainer = Trainer(1, 16, 2)
    told = losses(trainer, scenes, 16)
    assert np.mean(told[-4:]) < 0.7 * np.mean(told[:4])
    score = confusion(Labeller(trainer.network, WEIGHTS), scenes)
    write_network(tmp_path / "net.onnx", trainer, {"all": score}, 0.25)
    said = NetworkSegmenter(tmp_path / "net.onnx").classify(scenes.color[0], scenes.depth[0].astype(np.float32))
    image = network_input(scenes.color[0], scenes.depth[0].astype(np.float32))
    with torch.inference_mode():
        meant = Labeller(trainer.network, WEIGHTS)(torch.from_numpy(image)[None])[0].numpy()
    assert len(np.unique(meant)) > 1 and np.mean(said == meant) > 0.999
    assert NetworkSegmenter(tmp_path / "net.onnx").width_bias == 0.25
    card = (tmp_path / "net.md").read_text(encoding="utf-8")
    assert (
        f"| cane | {score.overlap()['cane']:.3f}, {score.found()['cane']:.3f} |" in card
        and "--seed 1 --rows 2 --steps 16" in card
    )


def test_the_form_that_is_exported_says_the_same_as_the_one_that_was_trained():
    network = Trainer(5, 2, 1).network
    with torch.inference_mode():
        network.answer[0].weight.mul_(50.0)
        labeller = Labeller(network, WEIGHTS).eval()
        image = torch.rand((2, 4, 48, 80), generator=torch.Generator().manual_seed(0))
        meant, said = labeller(image), CompactLabeller(labeller).eval()(image)
    assert said.shape == meant.shape and said.dtype == torch.uint8
    assert len(torch.unique(meant)) > 2 and (said == meant).float().mean() > 0.999


def test_overlap_is_intersection_over_union():
    counts = np.zeros((len(WOOD_CLASSES),) * 2, np.int64)
    counts[0, 0], counts[0, 1], counts[1, 1] = 6, 2, 4
    score = Confusion(counts)
    assert score.overlap() == {"background": 0.75, "ground": 0.667} and score.found() == {
        "background": 0.75,
        "ground": 1.0,
    }


def test_what_counted_double_in_training_is_not_drawn_too_wide_for_it():
    """Where two classes are equally likely, training makes the logit of the heavier one larger by log 2."""
    logits = torch.zeros(1, 3, 1, 2)
    logits[0, 1] = float(np.log(2.0))
    logits[0, 2, 0, 0] = 0.1
    logits[0, 1, 0, 1] += 0.1
    told = Labeller(torch.nn.Identity(), (1.0, 2.0, 1.0))(logits)
    assert told.tolist() == [[[2, 1]]]
