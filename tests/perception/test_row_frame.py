"""Frames are taken in odom, the plant is kept in map. Without drift the two are the same."""

import numpy as np
import pinocchio as pin
import pytest

from bridge.sim.camera.config import CameraConfig
from bridge.sim.camera.frame import camera_frame, camera_pose, survey_frame, survey_place
from bridge.sim.camera.renderer import Camera
from bridge.sim.vineyard.config import VineyardConfig
from bridge.sim.vineyard.grow import grow
from perception.config import PerceptionConfig
from perception.localisation.row_frame import RowFrame
from perception.pipeline import Perception
from perception.plant.model import Cane, Plant, Spur
from perception.segmentation.segmenter import LabelImageSegmenter
from perception.tracking.camera_rays import Ray
from rolling_panda import messages as m
from rolling_panda import reasons
from rolling_panda.messages.perception import CloseUpResult
from rolling_panda.model.robot import RobotModel, placement
from rolling_panda.model.wire_values import vector3
from rolling_panda.transport.codec import encode

UP = np.array([0.0, 0.0, 1.0])
HEADER = m.Header(1.0, "odom")
POINT = (0.4, 0.75, 1.0)


def drifted() -> RowFrame:
    frame = RowFrame(True)
    frame._T = pin.SE3(pin.exp3(np.array([0.01, -0.02, 0.1])), np.array([0.05, -0.02, 0.01]))
    return frame


def plant() -> Plant:
    axis = np.array([[0.4, 0.75, 0.9], [0.4, 0.75, 1.0]])
    cane = Cane(axis, np.array([0.0, 0.1]), 0.004, (), (), "free", 0.0)
    return Plant((Spur(axis[0], axis, 0.006, (cane,)),), axis[:1], (axis,))


@pytest.mark.parametrize("on", [False, True])
def test_without_drift_everything_stays_the_very_same_object(on):
    frame, seen = RowFrame(on), plant()
    assert frame.plant_in_map(seen) is seen
    assert frame.message(1.0).state == ("odometry" if on else "off") and frame.lost is None


def test_what_is_kept_in_the_map_is_where_a_close_up_tells_it_in_odom():
    frame, seen = drifted(), plant()
    cane = frame.plant_in_map(seen).spurs[0].canes[0]
    tangent = frame.T_map_odom.rotation @ UP
    check = CloseUpResult(
        header=HEADER,
        point_id="p1",
        number=1,
        finding="seen",
        position=vector3(cane.axis[1]),
        tangent=vector3(tangent),
    )
    told = frame.check_in_odom(check)
    assert told.position == pytest.approx(POINT) and told.tangent == pytest.approx(UP)
    ray = frame.ray_in_map(Ray(np.array(POINT), UP))
    assert ray.origin == pytest.approx(cane.axis[1]) and ray.direction == pytest.approx(tangent)


def test_a_robot_that_is_lost_says_why():
    frame = RowFrame(True)
    frame.predict(np.zeros(3), 10.0)
    frame.predict(np.array([5.0, 0.0, 0.0]), 10.1)
    assert frame.lost == reasons.lost_in_row(reasons.lost_by_odometry())
    told = frame.message(10.1)
    assert told.state == "lost" and told.reason == frame.lost and told.covariance[0] > 0.1**2 / 2
    off = RowFrame(False)
    off.predict(np.zeros(3), 10.0)
    off.predict(np.array([5.0, 0.0, 0.0]), 10.1)
    assert off.lost is None and off.message(10.1).state == "off"


@pytest.fixture(scope="module")
def seen_row():
    return grow(VineyardConfig(), 1), Camera(CameraConfig(), 1), RobotModel()


def perception(model: RobotModel, localise: bool) -> Perception:
    return Perception(PerceptionConfig(localise=localise), LabelImageSegmenter(), model)


@pytest.mark.long
def test_with_exact_odometry_the_points_are_the_same_byte_for_byte(seen_row):
    row, camera, model = seen_row
    on, off = perception(model, True), perception(model, False)
    for k, x in enumerate((0.0, 0.0, 0.15, 0.3, 0.45)):
        frame = survey_frame(camera, row, model, k, x)
        assert encode(on.process(frame)) == encode(off.process(frame))
        assert on.obstacles == off.obstacles
    assert on.localisation.state == "located" and on.points().points


@pytest.mark.long
def test_a_point_stays_on_its_cane_though_the_odometry_has_slipped(seen_row):
    row, camera, model = seen_row
    sees = perception(model, True)
    for k in range(4):
        before = sees.process(survey_frame(camera, row, model, k))
    at = np.zeros(3)
    for k, x in enumerate((0.1, 0.2, 0.3), 4):
        true, position = survey_place(x)
        at = np.array([1.05 * x, 0.02 * x, -0.04 * x])
        base = m.PlanarPose(*at.tolist())
        image = camera.render(row, camera_pose(model, true, position), k)
        after = sees.process(camera_frame(image, camera, base, position, k))
    slip = pin.SE3(pin.exp3(np.array([0.0, 0.0, at[2]])), np.array([at[0], at[1], 0.0]))
    slip = pin.SE3(np.eye(3), np.array([0.3, 0.0, 0.0])) * slip.inverse()
    places = {point.point_id: np.array(point.position) for point in after.points}
    kept = [(np.array(p.position), places[p.point_id]) for p in before.points if p.point_id in places]
    told = sees.localisation
    assert len(kept) >= 3 and told.state == "located"
    moved = [float(np.linalg.norm(now - then)) for then, now in kept]
    T_map_odom = placement(told.T_map_odom)
    off = [float(np.linalg.norm(T_map_odom.actInv(now) - slip.actInv(then))) for then, now in kept]
    slipped = float(np.linalg.norm(slip.act(kept[0][0]) - kept[0][0]))
    assert slipped > 0.02 and np.median(moved) < 0.003 and np.median(off) < 0.006
