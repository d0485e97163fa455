"""Presence of wood at known positions."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from perception.segmentation.frame import (
    BACKGROUND,
    CANE,
    CORDON,
    GROUND,
    HOSE,
    NODE,
    OLD_CUT,
    POST,
    SPUR,
    TRUNK,
    WIRE,
    View,
)
from perception.tracking.presence import wood_presence
from rolling_panda.messages.robot import Intrinsics

AT = np.array([0.0, 0.0, 0.8])


def view(behind=3.0, cane_depth=0.8, cols=slice(78, 83), kind=BACKGROUND):
    """A camera at the origin of odom, looking along z at one upright cane before something."""
    labels, depth = np.full((120, 160), kind, np.uint8), np.full((120, 160), behind, np.float32)
    labels[:, cols], depth[:, cols] = CANE, cane_depth
    return View(0, 0.0, Intrinsics(160, 120, 200.0, 200.0, 79.5, 59.5), depth, labels, b"", np.eye(3), np.zeros(3))


@pytest.mark.parametrize(
    ("seen", "place", "said"),
    [
        (view(), AT, "present"),
        (view(), AT + [0.006, 0.0, 0.01], "present"),
        (view(), AT + [0.05, 0.0, 0.0], "gone"),
        (view(cane_depth=0.9), AT, "gone"),
        (view(behind=0.5), AT + [0.05, 0.0, 0.0], "not visible"),
        (view(behind=0.9, kind=POST), AT + [0.05, 0.0, 0.0], "not visible"),
        (view(behind=0.9, kind=TRUNK), AT + [0.05, 0.0, 0.0], "not visible"),
        (view(behind=0.0, kind=POST), AT + [0.05, 0.0, 0.0], "not visible"),
        (view(behind=1.0, kind=POST), AT + [0.05, 0.0, 0.0], "gone"),
        (view(behind=0.9, kind=CORDON), AT + [0.05, 0.0, 0.0], "gone"),
        (view(cane_depth=0.0), AT, "not visible"),
        (view(cane_depth=6.5535), AT, "not visible"),
        (view(), AT + [0.5, 0.0, 0.0], "not visible"),
        (view(), np.array([0.0, 0.0, 0.2]), "not visible"),
        (view(), -AT, "not visible"),
    ],
)
def test_wood_is_there_or_not_or_the_place_cannot_be_seen(seen, place, said):
    assert wood_presence(seen, seen.labels, place) == [said]


@pytest.mark.parametrize("kind", [TRUNK, CORDON, SPUR, CANE, NODE, OLD_CUT])
def test_last_years_cane_is_there_whatever_class_of_wood_a_picture_gives_it(kind):
    seen = view()
    labels = np.where(seen.labels == CANE, np.uint8(kind), seen.labels)
    assert wood_presence(seen, labels, AT, kind="removal") == ["present"]
    own = kind in (SPUR, CANE, NODE)
    assert (wood_presence(seen, labels, AT) == ["present"]) is own


@pytest.mark.parametrize("kind", [BACKGROUND, POST, WIRE, HOSE])
def test_what_is_no_wood_of_a_vine_is_no_last_years_cane(kind):
    seen = view()
    assert wood_presence(seen, np.full_like(seen.labels, kind), AT, kind="removal") != ["present"]
    assert wood_presence(view(cane_depth=0.9), seen.labels, AT, kind="removal") == ["gone"]


def test_last_years_cane_is_not_gone_where_the_network_takes_it_for_the_ground():
    seen = view()
    ground = np.where(seen.labels == CANE, np.uint8(GROUND), seen.labels)
    assert wood_presence(seen, ground, AT, kind="removal") == ["not visible"]
    assert wood_presence(seen, ground, AT) == ["gone"], "a thin cane can have the depth of the wood behind it"


@given(x=st.floats(-2, 2), y=st.floats(-2, 2), z=st.floats(-2, 3))
def test_where_nothing_is_wood_nothing_stands(x, y, z):
    seen = view()
    bare = replace(seen, labels=np.zeros_like(seen.labels))
    assert wood_presence(bare, bare.labels, np.array([x, y, z])) != ["present"]
