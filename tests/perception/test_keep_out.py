"""Cuts keep away from wires."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from msgspec.structs import replace as replace_message

from controller.config import HierarchyConfig
from controller.whole_body.collision_geometry import _TOOL_CAPSULES, BLADES
from controller.work.posture_search import _ROOM
from perception.config import RuleConfig
from perception.rules.keep_out import frame_keep_out, map_keep_out, wire_in_image
from perception.segmentation.frame import View
from rolling_panda import messages as m
from rolling_panda.messages.perception import Capsule
from rolling_panda.messages.robot import Intrinsics

WIRE, HOSE, CANE = (m.WOOD_CLASSES.index(kind) for kind in ("wire", "hose", "cane"))
RULE = RuleConfig()
LENS = Intrinsics(width=320, height=240, fx=400.0, fy=400.0, cx=159.5, cy=119.5)
CUT = np.array([0.0, 0.0, 0.8])


def view(wire_row: int, wire_depth: float) -> View:
    """A camera at the origin of odom, looking along z at a cane and one horizontal wire."""
    depth = np.full((240, 320), 3.0, np.float32)
    labels = np.zeros((240, 320), np.uint8)
    depth[:, 158:162], labels[:, 158:162] = 0.8, CANE
    hidden = slice(158, 162) if wire_depth > 0.8 else slice(0, 0)
    keep = labels.copy(), depth.copy()
    labels[wire_row], depth[wire_row] = WIRE, wire_depth
    labels[wire_row, hidden], depth[wire_row, hidden] = keep[0][wire_row, hidden], keep[1][wire_row, hidden]
    return View(
        sequence=1, stamp=0.0, intrinsics=LENS, depth=depth, labels=labels, color_jpeg=b"", R=np.eye(3), t=np.zeros(3)
    )


@pytest.mark.parametrize(
    ("above", "depth", "near"),
    [(0.010, 0.80, True), (0.014, 0.81, True), (0.030, 0.80, False), (0.010, 0.70, True), (0.010, 1.5, False)],
)
def test_a_wire_beside_the_cut_or_in_the_way_keeps_the_blades_out(above: float, depth: float, near: bool) -> None:
    seen = view(round(119.5 - above * 400 / 0.8), depth)
    assert seen.labels is not None
    assert wire_in_image(seen, seen.labels, CUT, 0.018) is near


@given(x=st.floats(-3, 3), y=st.floats(-3, 3))
def test_cuts_out_of_the_image_are_answered_too(x: float, y: float) -> None:
    seen = view(100, 0.8)
    assert seen.labels is not None
    outside = replace(seen, labels=np.zeros_like(seen.labels))
    assert outside.labels is not None
    assert wire_in_image(outside, outside.labels, np.array([x, y, 0.8]), 0.018) is False


@pytest.mark.parametrize("kind", [WIRE, HOSE])
def test_the_drip_hose_is_kept_away_from_like_a_wire(kind: int) -> None:
    assert RULE.wire_distance >= 0.015
    for above, near in ((0.014, True), (0.030, False)):
        seen = view(round(119.5 - above * 400 / 0.8), 0.8)
        assert seen.labels is not None
        seen.labels[seen.labels == WIRE] = kind
        assert bool(frame_keep_out(seen, seen.labels, (), RULE).reason(CUT)) is near


@pytest.mark.parametrize("kind", ["wire", "hose", "cordon", "trunk"])
def test_what_was_seen_before_keeps_the_blades_out_too(kind: m.WoodClass) -> None:
    least = 0.020 if kind in ("cordon", "trunk") else 0.015
    for gap, near in ((least - 0.001, True), (0.03, False)):
        rod = Capsule(kind, (-1.0, 0.01 + gap, 0.8), (1.0, 0.01 + gap, 0.8), 0.01, 0.01)
        assert bool(map_keep_out((rod,), RULE).reason(CUT)) is near, f"{kind} at {gap} m"
    assert map_keep_out((), RULE).reason(CUT) is None


def test_last_years_cane_goes_itself_and_keeps_nothing_out_but_by_the_spur_rule() -> None:
    old = Capsule("cordon", (-1.0, 0.02, 0.8), (1.0, 0.02, 0.8), 0.007, 0.007, vine=1, spur=1)
    guyot = replace_message(RULE, system="guyot")
    assert map_keep_out((old,), guyot).reason(CUT) is None
    for stays, rule in ((old, RULE), (replace_message(old, vine=-1, spur=-1), guyot)):
        reason = map_keep_out((stays,), rule).reason(CUT)
        assert reason is not None and dict(reason.values)["kind"] == "cordon"


@pytest.mark.parametrize(("lean", "fits"), [(0.0, True), (25.0, False), (-25.0, False)])
def test_on_wood_that_leans_one_blade_is_nearer_to_the_wire_than_the_cut_is(lean: float, fits: bool) -> None:
    # Odom: x along the row, z up.
    wire = Capsule("wire", (-1.0, 0.8, 1.022), (1.0, 0.8, 1.022), 0.002, 0.002)
    tangent = np.array([np.sin(np.radians(lean)), 0.0, np.cos(np.radians(lean))])
    place = np.array([0.0, 0.8, 1.0])
    known = map_keep_out((wire,), RULE)
    assert known.reason(place) is None, "it is far enough from the cut itself"
    assert known.fits(place, tangent) is fits
    assert map_keep_out((), RULE).fits(place, tangent)


def test_blades_that_fit_are_as_far_from_a_wire_as_the_controller_keeps_them() -> None:
    blades = [(abs(x), radius) for part, _, (x, _, _), _, radius, _ in _TOOL_CAPSULES if part == BLADES]
    assert blades
    for aside, radius in blades:
        assert RULE.blade_reach >= aside
        assert RULE.blade_clearance >= radius + HierarchyConfig().blade_distance + _ROOM


@pytest.mark.parametrize(("lean", "fits"), [(0.0, True), (25.0, False), (-25.0, False)])
def test_so_it_is_with_a_wire_that_only_this_frame_shows(lean: float, fits: bool) -> None:
    seen = view(round(119.5 - 0.021 * 400 / 0.8), 0.8)
    assert seen.labels is not None
    tangent = np.array([np.sin(np.radians(lean)), -np.cos(np.radians(lean)), 0.0])
    keep_out = frame_keep_out(seen, seen.labels, (), RULE)
    assert keep_out.reason(CUT) is None
    assert keep_out.fits(CUT, tangent) is fits
