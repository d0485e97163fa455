"""How the bench spoils frames, and the scores that it compares."""

import itertools
import sys
from dataclasses import replace

import numpy as np
import pytest
import skimage.data

from benchmarks.perception.familiarity import SPOILT, area, spoilt
from benchmarks.perception.familiarity_scores import Probe, Reading, scores
from perception.segmentation.segmenter import SHIPPED
from rolling_panda.errors import InputError
from rolling_panda.resources import resource

COMMON = np.array([0.5, 0.5])


def readings(rng, count, **strange):
    """Pictures of one kind, with some of their values moved away."""
    out = []
    for _ in range(count):
        plain = rng.normal(1.0, 0.1, 5)
        reading = Reading(*(float(value) for value in plain), COMMON, rng.normal(0.0, 1.0, 10))
        out.append(replace(reading, **{name: getattr(reading, name) + by for name, by in strange.items()}))
    return out


def test_a_score_finds_what_it_looks_at_and_both_together_find_either():
    rng = np.random.default_rng(0)
    compared = scores(readings(rng, 500))
    for name, kind, others in (
        ("strangeness", "strangeness", ("entropy", "energy")),
        ("entropy", "entropy", ("strangeness",)),
        ("image statistics", "statistics", ("strangeness",)),
    ):
        strange = readings(rng, 50, **{kind: 5.0})
        score, limit = compared[name]
        assert np.all(score(strange) > limit)
        for other in others:
            score, limit = compared[other]
            assert np.mean(score(strange) > limit) < 0.2
    score, limit = compared["strangeness or entropy"]
    for kind in ("strangeness", "entropy"):
        assert np.all(score(readings(rng, 50, **{kind: 5.0})) > limit)
    assert np.mean(score(readings(rng, 500)) > limit) < 0.06


def test_more_of_a_frame_is_spoilt_by_a_greater_degree_and_its_depth_stays():
    color, depth = skimage.data.astronaut(), np.ones((512, 512), np.float32)
    for kind, degrees in SPOILT.items():
        changed = []
        for degree in degrees:
            after, same = spoilt((color, depth), kind, degree, np.random.default_rng(0))
            assert after.shape == color.shape and after.dtype == np.uint8 and np.array_equal(same, depth)
            changed.append(np.abs(after.astype(float) - color).mean())
        assert min(changed) > 1.0
        # Of darkness the degree is the light that is left.
        assert all(less < more for less, more in itertools.pairwise(changed))


def test_the_area_is_the_probability_that_the_stranger_picture_is_the_strange_one():
    assert area(np.array([1.0, 2.0]), np.array([3.0, 4.0])) == 1.0
    assert area(np.array([1.0, 3.0]), np.array([2.0])) == 0.5
    assert area(np.array([1.0]), np.array([1.0])) == 0.5


def test_without_the_packages_of_the_training_the_scores_say_what_is_missing(monkeypatch):
    monkeypatch.setitem(sys.modules, "onnx", None)
    with pytest.raises(InputError, match="make training"):
        Probe(resource(SHIPPED))
