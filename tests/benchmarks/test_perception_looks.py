"""The ablation of second looks: what they refine, what they void, and what is seen after a cut."""

import numpy as np
import pytest

from benchmarks.perception.judge import RowJudge
from benchmarks.perception.looks import CloseCamera, Looks, look_again, summarise_looks
from bridge.sim.camera.config import CameraConfig
from bridge.sim.camera.renderer import Camera
from bridge.sim.vineyard.config import VineyardConfig
from bridge.sim.vineyard.grow import grow
from bridge.sim.vineyard.truth import judge
from perception.config import PerceptionConfig
from perception.segmentation.segmenter import LabelImageSegmenter
from rolling_panda.model.robot import RobotModel
from rolling_panda.model.wire_values import vector3
from tests.support.points import point as pruning_point

SEED = 210


def point(number, cut, aside=0.0):
    place = vector3(cut.best + np.array([aside, 0.0, 0.0]))
    return pruning_point(f"p{number}", place, vector3(cut.tangent), vine=1, spur=number, offset=0.02)


@pytest.mark.long
def test_a_second_look_brings_points_nearer_to_their_canes_and_voids_what_is_on_none():
    row = grow(VineyardConfig(vines=1), SEED)
    cuts = [truth.cut for truth in judge(row) if truth.cut is not None][:3]
    eye = CloseCamera(Camera(CameraConfig(), SEED), LabelImageSegmenter(), PerceptionConfig(), RobotModel())
    shown = [*(point(n, cut, 0.003) for n, cut in enumerate(cuts)), point(9, cuts[0], 0.04)]
    looks = Looks()
    look_again(shown, row, eye, RowJudge(row, SEED), looks)
    summary = summarise_looks(looks)
    assert len(looks.after) == 3 and len(looks.right_voided + looks.wrong_voided) == 1
    assert summary["two_looks_off_axis_median_m"].value < 0.0015 < summary["one_look_off_axis_median_m"].value
    assert summary["confirmed"].value == 0.75
    assert all(severed for _, severed in looks.afterwards)
    assert {finding for finding, _ in looks.afterwards} <= {"severed", "unseen"}
