import math

import numpy as np
import pytest

from bridge.sim.camera.config import CameraConfig
from bridge.sim.camera.frame import survey_arm, survey_frame
from bridge.sim.camera.renderer import Camera
from bridge.sim.vineyard.config import VineyardConfig
from bridge.sim.vineyard.grow import grow
from perception.config import ObstacleConfig, PerceptionConfig
from perception.obstacles.obstacle_map import ObstacleMap
from perception.pipeline import Perception
from perception.segmentation.frame import decode_frame
from perception.segmentation.segmenter import LabelImageSegmenter, choose_segmenter
from rolling_panda.messages.perception import Capsule
from rolling_panda.model.robot import RobotModel


def distance(point, start, end):
    """From a point to a segment (m)."""
    span = end - start
    share = np.clip((point - start) @ span / (span @ span), 0.0, 1.0)
    return float(np.linalg.norm(point - start - share * span))


@pytest.fixture(scope="module", params=[1, 104])
def seen(request):
    """The row's own rods, and what was made of four frames each from two places."""
    model, row = RobotModel(), grow(VineyardConfig(), request.param)
    camera, known = Camera(CameraConfig(), request.param), ObstacleMap(ObstacleConfig())
    capsules: tuple[Capsule, ...] = ()
    for x in (-0.4, 0.4):
        for k in range(4):
            view = decode_frame(survey_frame(camera, row, model, k, x), model)
            capsules = known.update(view, LabelImageSegmenter().segment(view))
    return row, capsules


@pytest.mark.long
def test_every_rod_found_lies_on_one_of_its_kind(seen):
    row, capsules = seen
    assert {"wire", "cordon", "trunk"} <= {capsule.kind for capsule in capsules}
    for capsule in capsules:
        same = [rod for _, rod in row.standing() if rod.kind == capsule.kind]
        for share in np.linspace(0.0, 1.0, 7):
            point = np.array(capsule.start) + share * (np.array(capsule.end) - np.array(capsule.start))
            gap = min(distance(point, rod.start, rod.end) for rod in same)
            # The ends of two arms that nearly meet may become one rod.
            assert gap < 0.032, (capsule, gap)


def test_the_wires_before_the_robot_are_all_there(seen):
    row, capsules = seen
    wires = [capsule for capsule in capsules if capsule.kind == "wire"]
    config = VineyardConfig()
    # The one 0.3 m above the cordon is the one that the arm works under.
    height = config.cordon_height + config.wires[0]
    near = [wire for wire in wires if abs(wire.start[2] - height) < 0.03]
    assert sum(math.dist(wire.start, wire.end) for wire in near) > 1.0


@pytest.mark.long
@pytest.mark.parametrize("name", ["labels", "network"])
def test_no_wire_goes_past_the_end_post(name):
    segmenter = choose_segmenter(name)
    model, row = RobotModel(), grow(VineyardConfig(), 0)
    camera, known = Camera(CameraConfig(), 0), ObstacleMap(ObstacleConfig())
    posts = [rod.start[0] for _, rod in row.standing() if rod.kind == "post"]
    last, capsules = max(posts), ()
    for x in (last - 0.8, last - 0.2, last + 0.3):
        for number in range(2):
            view = decode_frame(survey_frame(camera, row, model, number, x), model)
            capsules = known.update(view, segmenter.segment(view))
    ends = [max(capsule.start[0], capsule.end[0]) for capsule in capsules if capsule.kind == "wire"]
    assert last - 0.3 < max(ends) < last + VineyardConfig().post_radius


def elbow(angle):
    """The arm beside a cut, its fourth joint at this angle (7, rad)."""
    return (-0.046, -1.034, 0.504, angle, 1.96, 1.944, 0.392)


# As it comes to rest after the cut; and jogged up from there, near the post, rolled, and turned over.
@pytest.mark.long
@pytest.mark.parametrize("after", [elbow(-2.213), elbow(-1.471), elbow(-1.021), elbow(-0.098)])
def test_what_the_network_takes_for_wood_near_by_or_turned_over_is_nothing_in_the_way(after):
    model, row, camera = RobotModel(), grow(VineyardConfig(), 0), Camera(CameraConfig(), 0)
    seen, number = Perception(PerceptionConfig(), choose_segmenter("network", threads=1), model), 0
    for x, arm, frames in ((0.0, survey_arm(), 5), (0.0615, after, 8)):
        for _ in range(frames):
            seen.process(survey_frame(camera, row, model, number, x, arm))
            number += 1
        if frames == 5:
            points = {point.point_id for point in seen.points().points}
    # What is behind the row is in nobody's way.
    thick = [each for each in seen.obstacles if each.kind in ("post", "trunk", "cordon") and each.start[1] < 1.2]
    assert thick and points
    for capsule in thick:
        same = [rod for _, rod in row.standing() if rod.kind == capsule.kind]
        for end in (capsule.start, capsule.end):
            assert min(distance(np.array(end), rod.start, rod.end) for rod in same) < 0.05, capsule
        assert capsule.start_radius < 0.06, capsule
    assert points <= {point.point_id for point in seen.points().points}, "nothing was cut"


@pytest.mark.long
def test_while_a_joint_is_jogged_nothing_is_taken_for_cut_or_left_open():
    model, row, camera = RobotModel(), grow(VineyardConfig(), 5), Camera(CameraConfig(), 5)
    seen = Perception(PerceptionConfig(), choose_segmenter("network", threads=1), model)
    told = []
    for number, turned in enumerate([0.0] * 6 + [0.9, 1.0, 1.1, 1.2, 1.2, 1.2, 1.2, 1.2]):
        arm = np.array(survey_arm()) + [0.0, 0.0, 0.0, turned, 0.0, 0.0, 0.0]
        points = seen.process(survey_frame(camera, row, model, number, 0.2, tuple(arm.tolist())))
        told.append(({point.point_id for point in points.points}, len(points.undecided_sites)))
    assert told[5][0] and all(each == told[5] for each in told[6:])


@pytest.mark.long
def test_wood_that_is_known_otherwise_is_no_part_of_the_map_and_what_has_fallen_is_forgotten():
    model, row, camera = RobotModel(), grow(VineyardConfig(), 1), Camera(CameraConfig(), 1)
    known, views = ObstacleMap(ObstacleConfig()), []
    for k in range(4):
        views.append(decode_frame(survey_frame(camera, row, model, k), model))
        whole = known.update(views[-1], views[-1].labels)
    other = max((each for each in whole if each.kind == "cordon"), key=lambda each: math.dist(each.start, each.end))
    middle = (np.array(other.start) + np.array(other.end)) / 2

    def nearest(capsules):
        ends = [(np.array(each.start), np.array(each.end)) for each in capsules if each.kind == "cordon"]
        return min(distance(middle, *each) for each in ends)

    assert nearest(whole) < 0.005
    apart = known.update(views[-1], views[-1].labels, apart=(other,))
    assert nearest(apart) > 0.04
    assert sum(each.kind == "wire" for each in apart) == sum(each.kind == "wire" for each in whole)
    assert nearest(known.update(views[-1], views[-1].labels)) < 0.01
    known.forget((other,))
    blank = np.zeros_like(views[-1].labels)
    assert nearest(known.update(views[-1], blank, only_add=True)) > 0.04


def test_nothing_seen_is_nothing_known():
    assert ObstacleMap(ObstacleConfig()).update(blank_view(), np.zeros((48, 64), dtype=np.uint8)) == ()


def blank_view():
    camera = Camera(CameraConfig(width=64, height=48), 0)
    model, empty = RobotModel(), grow(VineyardConfig(first_vine_x=500.0), 0)
    return decode_frame(survey_frame(camera, empty, model, 0), model)


def test_of_too_many_rods_the_nearest_are_told():
    camera, model, row = Camera(CameraConfig(), 1), RobotModel(), grow(VineyardConfig(), 1)
    every, few = ObstacleMap(ObstacleConfig()), ObstacleMap(ObstacleConfig(max_capsules=8))
    for k in range(4):
        view = decode_frame(survey_frame(camera, row, model, k), model)
        labels = LabelImageSegmenter().segment(view)
        known, told = every.update(view, labels), few.update(view, labels)
    assert len(told) == 6 < len(known) and set(told) <= set(known)

    def away(capsule):
        return distance(view.t, np.array(capsule.start), np.array(capsule.end)) - capsule.start_radius

    assert max(map(away, told)) <= min(away(capsule) for capsule in known if capsule not in told)
