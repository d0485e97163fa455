"""The judge of pruning points, and the benchmark's summary."""

import json

import numpy as np
import pytest
from PIL import Image

from benchmarks.__main__ import main as bench
from benchmarks.perception.judge import RowJudge
from benchmarks.perception.survey import STEP, Survey, main, summarise, survey_row
from bridge.config import BridgeConfig
from bridge.sim.camera.config import CameraConfig
from bridge.sim.camera.renderer import Camera
from bridge.sim.vineyard.config import VineyardConfig
from bridge.sim.vineyard.grow import grow
from bridge.sim.vineyard.row import Rod, Row
from bridge.sim.vineyard.truth import judge
from bridge.sim.world.config import WorldConfig
from bridge.sim.world.growth import overgrown
from controller.config import ControllerConfig
from perception.config import PerceptionConfig
from perception.pipeline import Perception
from perception.segmentation.segmenter import LabelImageSegmenter
from rolling_panda import messages as m
from rolling_panda.config import load_section
from rolling_panda.model.robot import RobotModel
from rolling_panda.model.wire_values import vector3
from rolling_panda.resources import resource
from tests.support.points import point as pruning_point

ROW = grow(VineyardConfig(vines=1), 11)
TRUTHS = [truth for truth in judge(ROW) if truth.cut is not None]


def point(position, tangent) -> m.PruningPoint:
    tangent = np.array(tangent) / np.linalg.norm(tangent)
    return pruning_point("p1", vector3(np.array(position)), vector3(tangent), vine=1, spur=1)


@pytest.mark.parametrize("past", [0.0, 0.006, -0.006])
def test_a_point_in_the_right_stretch_of_the_right_cane_is_right(past):
    for truth in TRUTHS:
        cut = truth.cut
        judged = RowJudge(ROW, 11).point(point(cut.best + past * cut.tangent, cut.tangent))
        assert judged.right_cane and judged.right and judged.nodes_left == 2
        assert judged.along_error == pytest.approx(past, abs=1e-9) and judged.plane_error == pytest.approx(
            0.0, abs=1e-4
        )
        assert (judged.vine, judged.spur) == (truth.vine, truth.spur)


def test_a_point_past_the_next_node_is_on_the_right_cane_and_wrong():
    truth = next(t for t in TRUTHS if len(t.nodes) > 3)
    beyond = truth.nodes[2] + 0.02 * truth.cut.tangent
    judged = RowJudge(ROW, 11).point(point(beyond, truth.cut.tangent))
    assert judged.right_cane and not judged.right and judged.nodes_left == 3


def test_a_point_on_another_cane_or_beside_the_wood_is_wrong():
    truth = next(t for t in TRUTHS if t.canes > 1)
    other = [
        rod
        for _, rod in ROW.standing()
        if (rod.vine, rod.spur) == (truth.vine, truth.spur) and rod.cane not in (-1, truth.keeper)
    ]
    judged = RowJudge(ROW, 11).point(point(other[4].start, other[4].end - other[4].start))
    assert not judged.right_cane and not judged.right and judged.along_error is None
    aside = RowJudge(ROW, 11).point(point(truth.cut.best + [0.0, 0.02, 0.0], truth.cut.tangent))
    assert not aside.right


def test_what_grows_on_canes_changes_no_opinion_and_a_point_on_a_lateral_is_wrong():
    grown = overgrown(ROW, WorldConfig(laterals=1.0, tendrils=1.0, leaves=1.0), 11)
    bare, full = RowJudge(ROW, 11), RowJudge(grown, 11)
    for truth in TRUTHS[:4]:
        here = point(truth.cut.best, truth.cut.tangent)
        assert full.point(here) == bare.point(here)
        assert full.blocked(truth.vine, truth.spur) == bare.blocked(truth.vine, truth.spur)
    truth, other = [truth for truth in TRUTHS if not bare.blocked(truth.vine, truth.spur)][:2]
    beside = truth.cut.best + [0.0, 0.02, 0.0]
    numbers = truth.cut.rod - 1, truth.vine, truth.spur, truth.keeper
    lateral = Rod("cane", ROW.rods[truth.cut.rod].start, beside, 0.002, 0.001, *numbers, organ=0)
    assert not RowJudge(Row((*ROW.rods, lateral)), 11).point(point(beside, truth.cut.tangent)).right
    cut, numbers = truth.cut, (other.cut.rod, other.vine, other.spur, other.keeper)
    through = Rod("cane", cut.least, cut.most, 0.002, 0.001, *numbers, organ=0)
    assert RowJudge(Row((*ROW.rods, through)), 11).blocked(truth.vine, truth.spur) == "", "the blades may cut it along"


def test_what_hangs_behind_a_board_is_hidden_and_what_is_before_it_is_clear():
    camera = Camera(CameraConfig().ideal(), 1)
    place = np.eye(4)
    place[:3, :3] = np.column_stack([[1, 0, 0], [0, 0, -1], [0, 1, 0]])
    place[:3, 3] = [0.5, 0.0, 1.05]
    image = camera.render(ROW, place)
    open_view, covered = RowJudge(ROW, 11), RowJudge(ROW, 11)
    open_view.look(image, camera.intrinsics, place)
    clear = [place for place in open_view.spurs() if open_view.visibility(*place) == "clear"]
    assert len(clear) >= 4
    image.rods[:] = -1
    covered.look(image, camera.intrinsics, place)
    assert not covered.spurs()


def test_the_summary_has_a_figure_an_interval_and_a_number_for_each_measure():
    survey = Survey(
        spurs=[{"kind": "spur cut", "visibility": "clear", "blocked": "", "point": True, "right": True}] * 9
        + [
            {"kind": "spur cut", "visibility": "clear", "blocked": "cane", "point": False, "right": False},
            {"kind": "spur cut", "visibility": "hidden", "blocked": "", "point": False, "right": False},
        ]
    )
    survey.points = [RowJudge(ROW, 11).point(point(t.cut.best, t.cut.tangent)) for t in TRUTHS[:4]]
    summary = summarise(survey)
    assert summary["recall"].value == 0.9 and summary["recall"].n == 10
    assert summary["undecided"].value == pytest.approx(0.1)
    assert summary["blocked"].value == pytest.approx(0.1) and summary["recall_unblocked"].value == 1.0
    assert summary["recall_unblocked"].n == 9 and summary["undecided_unblocked"].value == 0.0
    assert summary["right_cane"].value == 1.0 and summary["right_cane"].low < 0.6 and summary["right_cane"].n == 4


def test_the_bench_looks_as_often_as_a_survey_does():
    camera = load_section(resource("assets/config/sim.toml"), "bridge", BridgeConfig)
    assert pytest.approx(ControllerConfig().work.survey_speed / camera.camera_moving_hz) == STEP


def test_a_step_that_leads_nowhere_is_refused(capsys):
    with pytest.raises(SystemExit):
        main(["--step", "0"])
    assert "more than 0 m" in capsys.readouterr().err


@pytest.mark.long
def test_the_command_writes_what_it_measured(tmp_path, capsys):
    path = tmp_path / "p.json"
    words = ["--seed", "100", "--vines", "1", "--segmenter", "labels"]
    assert main([*words, "--step", "0.15", "--json", str(path)]) == 0
    document = json.loads(path.read_text(encoding="utf-8"))
    assert document["step_m"] == 0.15
    assert document["confusion"]["cane"]["cane"] == 1.0 and 50 < document["memory_mib"] < 2000
    assert {
        "right_cane",
        "along_error_median_m",
        "along_error_p95_m",
        "node_count_right",
        "undecided",
        "recall",
        "frame_ms_median",
    } <= set(document["summary"])
    assert all({"value", "low", "high", "n"} == set(figure) for figure in document["summary"].values())
    assert len(document["results"]) >= 6 and document["summary"]["right_cane"]["value"] >= 0.8
    assert document["summary"]["along_error_median_m"]["value"] < 0.005
    assert bench(["perception", "--weights", str(tmp_path / "none.onnx")]) == 1
    assert "cannot load" in capsys.readouterr().err


@pytest.mark.slow
def test_wrong_points_are_pictured(tmp_path, monkeypatch):
    monkeypatch.setattr("benchmarks.perception.judge.ON_AXIS", -1.0)
    words = ["--seed", "100", "--vines", "1", "--step", "0.15", "--segmenter", "labels", "--gallery", str(tmp_path)]
    assert main(words) == 0
    pictures = [np.asarray(Image.open(path)) for path in sorted(tmp_path.glob("100_p*.png"))]
    assert len(pictures) >= 6
    # Colours left, classes right: the right halves have few colours.
    for picture in pictures:
        half = picture.shape[1] // 2
        colors = [len(np.unique(side.reshape(-1, 3), axis=0)) for side in (picture[:, :half], picture[:, half:])]
        assert colors[1] < 15 < colors[0]


@pytest.mark.long
@pytest.mark.parametrize("seed", [3, 101])
def test_points_of_a_rendered_row_are_where_a_grower_would_cut(seed):
    survey, model = Survey(), RobotModel()
    survey_row(
        seed, 1, Perception(PerceptionConfig(), LabelImageSegmenter(), model), model, CameraConfig(), survey, step=0.3
    )
    figures = summarise(survey)
    assert figures["right"].n >= 4 and figures["right"].value >= 0.8
    assert figures["along_error_median_m"].value < 0.003
