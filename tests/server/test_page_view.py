import msgspec
import numpy as np
import pinocchio as pin
import pytest

from rolling_panda import messages as m
from rolling_panda import reasons, topics
from rolling_panda.messages.page import PagePlan
from rolling_panda.messages.robot import CameraFrame, Intrinsics, JointState
from rolling_panda.messages.supervision import PointPlan, SessionPlan
from rolling_panda.model.map_frame import MapFrame
from rolling_panda.model.robot import RobotModel, configuration, placement
from server.robots.link import RobotLink
from server.robots.page_view import PageView, project, speed_ratios
from tests.support.fake_wire import (
    ARM,
    HEADER,
    FakeWire,
    bridge_state,
    controller_state,
    joints,
    located,
    odometry,
    pruning_point,
    pruning_points,
)

MODEL, HERE = RobotModel(), MapFrame()


@pytest.fixture
def wire():
    return FakeWire()


@pytest.fixture
def view(wire):
    link = RobotLink(wire)
    yield PageView(link, MODEL)
    link.close()


def frame(base=None, sequence=1):
    return CameraFrame(
        header=HEADER, sequence=sequence, intrinsics=Intrinsics(640, 480, 600.0, 600.0, 320.0, 240.0),
        base=base or m.PlanarPose(), position=(0.0, 0.0, *ARM), color_jpeg=b"", depth_zlib=b"", depth_unit=1e-4,
    )  # fmt: skip


def in_camera(x, y, z):
    camera = MODEL.pose(configuration(m.PlanarPose(), (0.0, 0.0, *ARM)), MODEL.camera_id)
    return tuple(float(value) for value in camera.rotation @ np.array([x, y, z]) + camera.translation)


def test_a_point_on_the_optical_axis_is_at_the_principal_point():
    assert project([in_camera(0.0, 0.0, 0.8)], frame(), MODEL, HERE) == [(320.0, 240.0)]


def test_right_and_down_in_the_camera_are_right_and_down_in_the_image():
    assert project([in_camera(0.1, 0.05, 0.6)], frame(), MODEL, HERE) == [(420.0, 290.0)]


def test_a_point_in_map_is_where_the_camera_sees_it_though_odom_has_drifted(wire, view):
    drift = pin.SE3(pin.rpy.rpyToMatrix(0.0, 0.02, 0.1), np.array([0.4, -0.1, 0.01]))
    place = tuple(float(value) for value in drift.act(np.array(in_camera(0.1, 0.05, 0.6))))
    assert project([place], frame(), MODEL, MapFrame(drift)) == [(420.0, 290.0)]
    wire.deliver(topics.JOINTS, joints(), at=10.0)
    wire.deliver(topics.ODOMETRY, odometry(x=0.5), at=10.0)
    before = placement(view.tool(10.0))
    wire.deliver(topics.LOCALISATION, located(drift), at=10.0)
    np.testing.assert_allclose(placement(view.tool(10.0)).homogeneous, (drift * before).homogeneous, atol=1e-9)
    wire.deliver(topics.POINTS, pruning_points(pruning_point("p1", position=place)), at=10.0)
    wire.deliver(topics.CAMERA, frame(), at=10.0)
    assert view.points(10.0).points[0].pixel == (420.0, 290.0)


def test_what_is_behind_or_beside_the_image_has_no_pixel():
    places = [in_camera(0.0, 0.0, -0.5), in_camera(1.0, 0.0, 0.5)]
    assert project(places, frame(), MODEL, HERE) == [None, None]
    assert project(places, None, MODEL, HERE) == [None, None]


def test_everything_ages_and_nothing_disappears(wire, view):
    wire.deliver(topics.JOINTS, joints(), at=10.0)
    wire.deliver(topics.ODOMETRY, odometry(x=0.5), at=10.0)
    wire.deliver(topics.CONTROLLER, controller_state(), at=11.0)
    state = view.state(1, 0, now=20.0)
    assert state.base.x == 0.5
    assert state.controller_age_s == pytest.approx(9.0)
    assert state.bridge_age_s is None
    ages = {row.process: row.age_s for row in state.processes}
    assert ages["bridge"] == pytest.approx(10.0)
    assert ages["perception"] is None


def test_what_any_process_has_set_wider_than_usual_is_shown_once(wire):
    link = RobotLink(wire)
    own = reasons.limit_raised("[server] invite_s", 900.0, 600.0, 3600.0)
    fade = reasons.limit_raised("[bridge] fade_s", 0.1, 0.05, 0.1)
    both = reasons.limit_raised("[robot] wheel_acceleration", 17.9, 15.0, 18.0)
    view = PageView(link, MODEL, (own,))
    wire.deliver(topics.BRIDGE, msgspec.structs.replace(bridge_state(), relaxed_limits=(fade, both)))
    wire.deliver(topics.CONTROLLER, msgspec.structs.replace(controller_state(), relaxed_limits=(both,)))
    assert view.state(1, 0, now=0.0).relaxed_limits == (fade, both, own)
    link.close()


def test_a_process_that_is_gone_is_shown_as_gone(wire, view):
    wire.processes.discard("controller")
    gone = {row.process for row in view.state(1, 0, now=0.0).processes if not row.present}
    assert gone == {"controller"}


def test_points_come_in_the_order_of_work_and_new_ones_last(wire, view):
    wire.deliver(topics.POINTS, pruning_points(pruning_point("a"), pruning_point("b"), pruning_point("c")))
    queue = (m.QueueEntry("c", "CUTTING"), m.QueueEntry("a", "ACCEPTED"))
    wire.deliver(topics.CONTROLLER, controller_state(queue))
    rows = view.points(0.0).points
    assert [row.point.point_id for row in rows] == ["c", "a", "b"]
    assert rows[2].entry.state == "PROPOSED"


def test_a_point_that_was_cut_off_stays_while_the_queue_knows_it(wire, view):
    wire.deliver(topics.POINTS, pruning_points(pruning_point("a")))
    wire.deliver(topics.CONTROLLER, controller_state((m.QueueEntry("a", "DONE"),)))
    view.points(0.0)
    wire.deliver(topics.POINTS, pruning_points())
    assert [row.entry.state for row in view.points(0.0).points] == ["DONE"]
    wire.deliver(topics.CONTROLLER, controller_state())
    assert view.points(0.0).points == ()


def test_what_perception_does_not_show_after_a_restart_is_shown_as_recorded(wire, view):
    wire.deliver(topics.POINTS, pruning_points())
    entry = m.QueueEntry("a", "UNKNOWN", "look", recorded=pruning_point("a"))
    wire.deliver(topics.CONTROLLER, controller_state((entry,)))
    (row,) = view.points(0.0).points
    assert row.point == pruning_point("a") and row.entry.state == "UNKNOWN"


def test_the_same_points_are_the_same_object(wire, view):
    wire.deliver(topics.POINTS, pruning_points(pruning_point("a")))
    first = view.points(0.0)
    wire.deliver(topics.POINTS, pruning_points(pruning_point("a")))
    wire.deliver(topics.CONTROLLER, controller_state())
    assert view.points(0.0) is first


def test_a_count_of_frames_alone_is_renewed_only_now_and_then(wire, view):
    counted = pruning_points(pruning_point("a"))
    wire.deliver(topics.POINTS, counted)
    first = view.points(100.0)
    wire.deliver(topics.POINTS, msgspec.structs.replace(counted, frames=7))
    assert view.points(101.0) is first
    wire.deliver(topics.POINTS, msgspec.structs.replace(counted, frames=9))
    assert view.points(106.0).frames == 9


def plan_of(*points, state="valid"):
    return SessionPlan(
        header=HEADER, state=state, reason=None, plan_hash="ab", duration_s=9.0,
        points=points,
    )  # fmt: skip


def test_an_accepted_point_comes_with_what_the_plan_that_holds_says_of_it(wire, view):
    wire.deliver(topics.POINTS, pruning_points(pruning_point("a"), pruning_point("b"), pruning_point("c")))
    queue = (m.QueueEntry("a", "ACCEPTED"), m.QueueEntry("b", "UNREACHABLE"), m.QueueEntry("c", "DONE"))
    wire.deliver(topics.CONTROLLER, controller_state(queue))
    assert view.points(0.0).plan is None
    first = PointPlan(point_id="a", revision=1, order=1)
    refused = PointPlan(point_id="b", revision=1, order=0, reason=reasons.out_of_reach(1.0, 1.0))
    done = PointPlan(point_id="c", revision=1, order=2)
    wire.deliver(topics.PLAN, plan_of(first, refused, done))
    shown = view.points(0.0)
    assert [row.plan for row in shown.points] == [first, refused, None]
    assert shown.plan == PagePlan("valid", None, "ab", 9.0)
    wire.deliver(topics.PLAN, plan_of(first, refused, done))
    assert view.points(0.0) is shown, "the same plan, repeated, is not sent again"
    wire.deliver(topics.PLAN, plan_of(first, refused, done, state="void"))
    shown = view.points(0.0)
    assert [row.plan for row in shown.points] == [None, None, None] and shown.plan.state == "void"


@pytest.mark.parametrize(
    ("along", "angle"), [((1, 0, 0), 0.0), ((0, 1, 0), 1.57), ((-1, -1, 0), -2.36), ((0, 0, 1), None)]
)
def test_a_canes_direction_in_the_image_goes_with_its_point(wire, view, along, angle):
    tangent = np.subtract(in_camera(*along), in_camera(0.0, 0.0, 0.0)) / np.linalg.norm(along)
    point = msgspec.structs.replace(pruning_point(position=in_camera(0.0, 0.0, 0.8)), tangent=tuple(tangent.tolist()))
    wire.deliver(topics.CAMERA, frame())
    wire.deliver(topics.POINTS, pruning_points(point))
    (row,) = view.points(0.0).points
    assert row.pixel == (320.0, 240.0)
    assert row.cane_angle == (None if angle is None else pytest.approx(angle, abs=0.01))


def test_speeds_are_fractions_of_each_actuators_limit():
    velocity = (-5.6, 0.0, 0.0, 2.175, 0.0, 0.0, 0.0, 0.0, -1.305)
    state = JointState(header=HEADER, sequence=1, position=(50.0, -50.0, *ARM), velocity=velocity)
    shares = speed_ratios(state, RobotModel().limits)
    assert shares == pytest.approx((0.5, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 0.5), abs=1e-3)
