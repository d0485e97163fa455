"""The bench of what stands in the way: how often it looks, what it counts, and that it says what is wrong."""

import json

import numpy as np
import pytest

from benchmarks.perception.obstacle_judge import ObstacleJudge
from benchmarks.perception.obstacles import CONDITIONS, main, pictured, places_of
from bridge.sim.camera.config import CameraConfig
from bridge.sim.camera.frame import camera_pose, survey_place
from bridge.sim.camera.renderer import Camera
from bridge.sim.vineyard.config import VineyardConfig
from bridge.sim.vineyard.grow import grow
from perception.config import ObstacleConfig
from rolling_panda.messages.perception import Capsule
from rolling_panda.model.robot import RobotModel

NEAR = {"standing": 1e-9, "survey": 0.16, "work": 0.4}
FRAMES = {"standing": 300, "survey": 1200, "work": 1200}


@pytest.mark.parametrize("condition", CONDITIONS)
def test_ten_minutes_have_as_many_frames_as_the_camera_takes_and_no_more_pictures_than_asked(condition):
    places = places_of(condition, 0, 600.0)
    shown = list(pictured(places, 100))
    assert len(places) == len(shown) == FRAMES[condition]
    assert 60 <= len({picture for picture, _ in shown}) <= 100
    # A picture stands for frames from about where it was taken.
    for (_, there), place in zip(shown, places, strict=True):
        assert abs(there.base.x - place.base.x) < NEAR[condition]


def judged(*capsules):
    row, config = grow(VineyardConfig(), 1), ObstacleConfig()
    judge, camera, model = ObstacleJudge(row, config), Camera(CameraConfig(), 1), RobotModel()
    place = camera_pose(model, *survey_place())
    for number in range(config.min_hits):
        judge.see(camera.render(row, place, number), camera.intrinsics, place)
    judge.judge(capsules, final=True)
    return row, judge.verdict()


def trunk(bottom, top, radius):
    return Capsule("trunk", bottom, top, radius, radius)


@pytest.mark.long
def test_a_trunk_as_it_is_is_right_and_what_is_in_view_without_an_obstacle_is_missing():
    row, verdict = judged()
    true = next(rod for _, rod in row.standing() if rod.kind == "trunk" and rod.start[2] > 0.7)
    (told,) = judged(trunk(tuple(true.start.tolist()), tuple(true.end.tolist()), true.start_radius))[1].told
    assert told.angle_deg < 1.0 and abs(told.thickness - 1.0) < 1e-9 and told.p95 < 0.005
    assert verdict.seen["trunk"] > 0.1 and verdict.missing == pytest.approx(verdict.seen)


@pytest.mark.long
def test_a_trunk_that_leans_is_too_thick_or_far_behind_is_told_as_that():
    y = VineyardConfig().row_distance
    leaning = trunk((0.5, y, 0.6), (0.7, y, 0.8), 0.03)
    thick, behind = trunk((0.5, y, 0.6), (0.5, y, 0.8), 0.09), trunk((0.5, y + 0.5, 0.6), (0.5, y + 0.5, 0.8), 0.03)
    first, second, third = judged(leaning, thick, behind)[1].told
    assert first.angle_deg == pytest.approx(45.0, abs=6.0)
    assert second.thickness > 2.5 and second.p95 > 0.05
    assert third.p95 > 0.4


@pytest.mark.long
def test_the_command_writes_what_it_measured(tmp_path, capsys):
    out = tmp_path / "out.json"
    words = ["--seeds", "0", "--minutes", "0.3", "--pictures", "6", "--segmenter", "labels", "--json", str(out)]
    assert main(words) == 0
    document = json.loads(out.read_text())
    assert set(document["summary"]) == set(CONDITIONS)
    standing = document["summary"]["standing"]
    assert standing["greatest_angle_deg"] < 15.0 and standing["greatest_p95_m"] < 0.03
    assert np.isclose(standing["missing_trunk"], 0.0)
    assert "seed 0, work" in capsys.readouterr().out


def test_minutes_that_are_none_are_refused(capsys):
    with pytest.raises(SystemExit):
        main(["--minutes", "0"])
    assert "more than 0 minutes" in capsys.readouterr().err
