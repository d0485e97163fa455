"""What the server checks of an approval before it passes it on."""

import math

import msgspec
import numpy as np
import pinocchio as pin
import pytest

from rolling_panda import messages as m
from rolling_panda import reasons
from rolling_panda.messages.supervision import PreviewState
from rolling_panda.model.map_frame import MapFrame
from server.api.preview import outdated
from server.robots.link import Posture

HERE = MapFrame()
ARM = (0.0, -0.5, 0.0, -2.0, 0.0, 1.5, 0.8)
STATE = PreviewState(
    header=m.Header(),
    required=True,
    phase="ready",
    preview_hash="ab" * 32,
    start=m.PlanarPose(1.0, 0.0, 0.0),
    position=(3.0, 3.0, *ARM),
    duration_s=9.0,
)


def posture(x=1.0, phi=0.0, wheels=3.0, first=0.0, where=HERE):
    return Posture(m.PlanarPose(x, 0.0, phi), (wheels, wheels, first, *ARM[1:]), 0.01, where)


def test_what_is_as_it_was_passes_however_far_the_wheels_have_turned():
    assert outdated(STATE, STATE.preview_hash, posture(x=1.04, phi=0.04, wheels=30.0, first=0.09)) is None


def test_a_preview_in_the_row_passes_where_odom_has_drifted_and_the_robot_has_not_moved():
    drift = MapFrame(pin.SE3(np.eye(3), np.array([-0.6, 0.0, 0.0])))
    assert outdated(STATE, STATE.preview_hash, posture(x=1.6, where=drift)) is None
    assert outdated(STATE, STATE.preview_hash, posture(x=1.0, where=drift)).code == "preview_base_moved"


@pytest.mark.parametrize(
    ("where", "code", "values"),
    [
        (posture(x=1.31), "preview_base_moved", [0.31]),
        (posture(phi=0.2), "preview_base_turned", [math.degrees(0.2)]),
        (posture(first=0.3), "preview_arm_moved", [0.3]),
        (None, "posture_unknown", []),
    ],
)
def test_a_robot_that_stands_elsewhere_is_told_how(where, code, values):
    refused = outdated(STATE, STATE.preview_hash, where)
    assert refused.code == code
    assert [value for _, value in refused.values] == pytest.approx(values)


def test_another_hash_an_expired_one_and_none_are_refused():
    assert outdated(STATE, "cd" * 32, posture()) == reasons.preview_replaced("abababab", "cdcdcdcd")
    gone = msgspec.structs.replace(STATE, phase="expired", reason=reasons.revised("a"))
    assert outdated(gone, STATE.preview_hash, posture()) == reasons.preview_expired(reasons.revised("a"))
    none = msgspec.structs.replace(STATE, phase="rolling")
    assert outdated(none, STATE.preview_hash, posture()) == reasons.preview_missing()
