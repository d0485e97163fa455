"""Where the tool shall go, from what was dragged, along whichever axes the arrows lie."""

from types import SimpleNamespace

import numpy as np
import pinocchio as pin
import pytest

from rolling_panda import messages as m
from rolling_panda.model.robot import placement, pose_message
from server.scene.gizmo import SceneGizmos

TOOL = pin.SE3(pin.rpy.rpyToMatrix(0.4, -0.9, 2.0), np.array([0.3, 0.5, 0.9]))
HEADING = 0.7


class Placed:
    """One part of where viser draws a node: like viser, it sends nothing where it believes that nothing changes."""

    def __set_name__(self, owner, name):
        self._name = name

    def __get__(self, handle, owner=None):
        return handle.believed[self._name]

    def __set__(self, handle, value):
        if not np.allclose(value, handle.believed[self._name]):
            handle.believed[self._name][:] = value
            handle.seen[self._name] = np.array(value)


class Handle:
    """A gizmo as viser believes it to be drawn, and as it is `seen` in the browser."""

    position, wxyz = Placed(), Placed()

    def __init__(self, **drawn):
        self.believed = {name: np.array(drawn[name], float) for name in ("position", "wxyz")}
        self.seen = {name: value.copy() for name, value in self.believed.items()}


class View:
    def __init__(self, client_id=1):
        self.client_id = client_id
        self.scene = SimpleNamespace(add_transform_controls=self._add)
        self.gizmos = SceneGizmos()

    def _add(self, name, **options):
        self.handle = Handle(**options)
        return self.handle

    def drag(self, turn, by=(0.0, 0.0, 0.0)):
        """Turn the arrows about their own axes, and move them."""
        handle = self.handle
        turned = pin.Quaternion(*handle.seen["wxyz"]) * pin.Quaternion(pin.exp3(np.array(turn)))
        handle.seen["wxyz"] = np.array([turned.w, turned.x, turned.y, turned.z])
        handle.seen["position"] = handle.seen["position"] + np.array(by)
        return self.gizmos.drag("ada", tuple(handle.seen["position"]), tuple(handle.seen["wxyz"]))


def shown(axes):
    view = View()
    view.gizmos.heading = HEADING
    view.gizmos.show("ada", pose_message(TOOL), [view], axes)
    return view.gizmos, view


AXES = {"tool": TOOL.rotation, "base": pin.exp3(np.array([0.0, 0.0, HEADING])), "world": np.eye(3)}


@pytest.mark.parametrize("axes", AXES)
def test_the_arrows_lie_along_the_axes_that_were_chosen(axes):
    gizmos, view = shown(axes)
    assert pin.Quaternion(*view.handle.seen["wxyz"]).toRotationMatrix() == pytest.approx(AXES[axes], abs=1e-6)
    assert placement(gizmos.pose("ada")).isApprox(TOOL, 1e-6), "showing it asks for nothing"


@pytest.mark.parametrize("axes", AXES)
@pytest.mark.parametrize("turn", [(0.3, 0.0, 0.0), (0.0, -0.5, 0.0), (0.0, 0.0, 1.2)])
def test_turning_an_arc_turns_the_tool_about_that_axis(axes, turn):
    gizmos, view = shown(axes)
    aim = view.drag(turn, (0.01, 0.02, 0.03))
    about = AXES[axes] @ np.array(turn)
    wanted = pin.SE3(pin.exp3(about) @ TOOL.rotation, TOOL.translation + [0.01, 0.02, 0.03])
    assert placement(aim).isApprox(wanted, 1e-6)
    assert gizmos.pose("ada") == aim


def test_letting_go_brings_the_arrows_back_to_the_tool_and_their_axes():
    gizmos, view = shown("world")
    view.drag((0.0, 0.0, 0.4), (0.1, 0.0, 0.0))
    gizmos.reset("ada", pose_message(TOOL))
    assert pin.Quaternion(*view.handle.seen["wxyz"]).toRotationMatrix() == pytest.approx(np.eye(3), abs=1e-6)
    assert view.handle.seen["position"] == pytest.approx(TOOL.translation)
    assert placement(gizmos.pose("ada")).isApprox(TOOL, 1e-6)


def test_let_go_where_the_tool_is_not_known_the_arrows_are_back_as_soon_as_it_is():
    gizmos, view = shown("tool")
    view.drag((0.0, 0.0, 0.4), (0.1, 0.0, 0.0))
    gizmos.follow(pose_message(TOOL), holder=None)
    assert view.handle.seen["position"] != pytest.approx(TOOL.translation)
    gizmos.reset("ada", None)
    gizmos.follow(pose_message(TOOL), holder=None)
    assert view.handle.seen["position"] == pytest.approx(TOOL.translation)


def test_arrows_that_are_no_rotation_aim_nowhere():
    gizmos, _ = shown("tool")
    before = gizmos.pose("ada")
    assert gizmos.drag("ada", (0.1, 0.2, 0.3), (0.0, 0.0, 0.0, 0.0)) is None
    assert gizmos.pose("ada") == before


def test_a_gizmo_that_is_not_shown_aims_nowhere():
    gizmos, _ = shown("tool")
    assert gizmos.drag("bob", (0.1, 0.2, 0.3), (1.0, 0.0, 0.0, 0.0)) is None
    assert gizmos.pose("bob") is None


def test_a_view_that_opens_later_draws_the_arrows_where_they_were_dragged():
    gizmos, view = shown("base")
    view.drag((0.0, 0.0, 0.4), (0.1, 0.0, 0.0))
    aim = gizmos.pose("ada")
    later = View(client_id=2)
    gizmos.attach("ada", later)
    for name, value in view.handle.seen.items():
        assert later.handle.seen[name] == pytest.approx(value)
    assert gizmos.drag("ada", tuple(later.handle.position), tuple(later.handle.wxyz)) == aim


def test_what_nobody_dragged_follows_the_tool():
    gizmos, view = shown("base")
    moved = m.Pose((1.0, 0.5, 0.9), pose_message(TOOL).quat_xyzw)
    gizmos.follow(moved, holder=None)
    assert view.handle.seen["position"] == pytest.approx((1.0, 0.5, 0.9))
    gizmos.follow(pose_message(TOOL), holder="ada")
    assert view.handle.seen["position"] == pytest.approx((1.0, 0.5, 0.9))
