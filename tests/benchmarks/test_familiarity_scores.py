# ruff: noqa: E402
"""Other scores of how unlike the training pictures a picture is."""

import pytest
import skimage.data

from tests.support.extras import need

need("training")

from benchmarks.perception.familiarity_scores import Probe
from perception.segmentation.network_segmenter import NetworkSegmenter
from perception.segmentation.segmenter import SHIPPED
from rolling_panda.resources import resource


def test_the_probe_tells_the_strangeness_that_perception_is_told():
    cat = skimage.data.chelsea()
    segmenter = NetworkSegmenter(resource(SHIPPED))
    segmenter.classify(cat, None)
    probe = Probe(resource(SHIPPED))
    assert probe.read(cat, None).strangeness == pytest.approx(segmenter.strangeness, rel=1e-3)
