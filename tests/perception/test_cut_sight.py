"""Pictures on the last way to a cut: where its cane is, and when they do not tell."""

from dataclasses import replace

import numpy as np
import pytest

from bridge.sim.camera.config import CameraConfig
from bridge.sim.camera.frame import camera_frame
from bridge.sim.camera.renderer import Camera
from bridge.sim.vineyard.config import VineyardConfig
from bridge.sim.vineyard.grow import grow
from bridge.sim.vineyard.row import Row
from bridge.sim.vineyard.truth import RightCut, judge, judge_guyot
from controller.work.posture_search import cut_poses
from perception.config import PerceptionConfig
from perception.segmentation.frame import View, decode_frame
from perception.segmentation.segmenter import LabelImageSegmenter
from perception.tracking.cut_sight import CutFollower
from rolling_panda import messages as m
from rolling_panda import reasons
from rolling_panda.messages.perception import CloseUpResult, CutSight
from rolling_panda.messages.types import CutKind
from rolling_panda.model.wire_values import vector3
from tests.support.cameras import BASE, MODEL, POSTURE, T_TOOL_CAMERA

SEED = 210
CONFIG = PerceptionConfig()
ROW = grow(VineyardConfig(vines=1), SEED)
CUTS: tuple[RightCut, ...] = tuple(truth.cut for truth in judge(ROW) if truth.cut is not None)[::3]
#: The tool's distances from the cut on the way (m).
WAY = (0.20, 0.12, 0.06)


def view(cut: RightCut, away: float, row: Row = ROW, stamp: float = 1.1) -> View:
    """What the camera sees with the tool this far before a cut."""
    poses = cut_poses(cut.best, cut.tangent, np.array([0.0, 1.0, 0.0]), 0.15, away)
    place = (poses.clear * T_TOOL_CAMERA).homogeneous
    camera = Camera(CameraConfig(), SEED)
    seen = decode_frame(camera_frame(camera.render(row, place), camera, BASE, POSTURE, 1), MODEL)
    return replace(seen, R=place[:3, :3], t=place[:3, 3], stamp=stamp)


def sideways(cut: RightCut) -> np.ndarray:
    side = np.cross(cut.tangent, [0.0, 1.0, 0.0])
    return side / np.linalg.norm(side)


def following(cut: RightCut, aside: float = 0.0, kind: CutKind = "spur cut") -> CutFollower:
    """After a close-up, at 1 s, that has seen a cut a little aside of where its cane is now."""
    follower = CutFollower(CONFIG)
    place = vector3(cut.best + aside * sideways(cut))
    check = CloseUpResult(
        header=m.Header(1.0, "odom"),
        point_id="p1",
        number=1,
        finding="seen",
        position=place,
        tangent=vector3(cut.tangent),
    )
    follower.begin(check, kind)
    return follower


def look(follower: CutFollower, seen: View, point_id: str = "p1") -> CutSight:
    return follower.look(seen, LabelImageSegmenter(), point_id, 2)


def off(sight: CutSight, cut: RightCut) -> float:
    """From the cane to where it is seen, across it (m)."""
    apart = np.subtract(sight.position, cut.best)
    return float(np.linalg.norm(apart - cut.tangent * (apart @ cut.tangent)))


@pytest.mark.long
def test_a_cane_that_has_moved_aside_is_found_all_the_way_and_its_error_is_as_told() -> None:
    found, errors = 0, []
    for cut in CUTS:
        follower = following(cut, aside=0.006)
        for number, away in enumerate(WAY):
            sight = look(follower, view(cut, away, stamp=1.1 + 0.1 * number))
            if sight.position is None:
                continue
            found += 1
            errors.append(off(sight, cut))
            assert sight.number == 2 and sight.reason is None and sight.covariance is not None
            xx, _, _, yy, _, zz = sight.covariance
            assert errors[-1] < 3.0 * np.sqrt(xx + yy + zz)
    assert found >= 0.8 * len(CUTS) * len(WAY)
    assert np.median(errors) < 0.001 and max(errors) < 0.002


def test_nearer_than_the_camera_measures_depth_it_tells_nothing() -> None:
    cut = CUTS[0]
    near = look(following(cut), view(cut, 0.02))
    assert near.position is None and near.reason.code == "camera_not_at_standoff"


def test_a_cane_farther_aside_than_canes_sway_is_another_one_until_it_had_time() -> None:
    cut = CUTS[0]
    jumped = look(following(cut, aside=0.012), view(cut, 0.12, stamp=1.01))
    assert jumped.position is None and jumped.reason.code == "cane_jumped"
    swayed = look(following(cut, aside=0.012), view(cut, 0.12, stamp=1.2))
    assert off(swayed, cut) < 0.002


def test_after_a_jump_the_cane_is_found_where_it_was(monkeypatch) -> None:
    cut = CUTS[0]
    follower = following(cut)
    seen = view(cut, 0.12)
    # Another cane stands 12 mm aside, and hides the own one.
    aside = replace(seen, t=seen.t + 0.012 * sideways(cut), stamp=1.02)
    assert look(follower, aside).position is None
    assert off(look(follower, replace(seen, stamp=1.12)), cut) < 0.002


def test_where_two_canes_could_be_the_one_it_tells_nothing() -> None:
    cut = CUTS[0]
    own = ROW.rods[cut.rod]
    assert own is not None
    numbers = (own.vine, own.spur, own.cane)
    # The same cane once more, 9 mm aside: halfway between the two nobody knows which is which.
    twins = [
        replace(rod, start=rod.start + 0.011 * sideways(cut), end=rod.end + 0.011 * sideways(cut))
        for _, rod in ROW.standing()
        if (rod.vine, rod.spur, rod.cane) == numbers
    ]
    both = Row((*ROW.rods, *twins), ROW.revision + 1, ROW.backdrop)
    seen = look(following(cut, aside=0.0055), view(cut, 0.10, both, stamp=1.2))
    assert seen.position is None and seen.reason.code == "which_cane_unclear"


def test_a_cane_that_is_hidden_or_gone_is_not_made_up() -> None:
    cut = CUTS[0]
    seen = view(cut, 0.12)
    hidden = look(following(cut), replace(seen, depth=np.full_like(seen.depth, 0.2), labels=np.zeros_like(seen.labels)))
    assert hidden.position is None and hidden.reason == reasons.no_cane_at_place()


@pytest.mark.parametrize("kind", ["cordon", "spur", "old cut"])
def test_last_years_cane_is_followed_whatever_wood_it_is_taken_for(kind: m.WoodClass) -> None:
    row = grow(VineyardConfig(vines=1, training="guyot"), 11)
    cut = judge_guyot(row)[0].removal
    seen = view(cut, 0.12, row, stamp=1.2)
    assert seen.labels is not None
    classes = [m.WOOD_CLASSES.index(each) for each in ("cordon", kind)]
    taken = replace(seen, labels=np.where(seen.labels == classes[0], np.uint8(classes[1]), seen.labels))
    assert off(look(following(cut, 0.005, "removal"), taken), cut) < 0.002
    assert look(following(cut, 0.005), taken).position is None, "that of a spur cut is a cane"


def test_what_no_close_up_has_seen_is_not_followed() -> None:
    cut = CUTS[0]
    seen = view(cut, 0.12)
    for follower in (CutFollower(CONFIG), following(CUTS[1])):
        if follower is not None:
            other = look(follower, seen, "p2")
            assert other.position is None and other.reason == reasons.cut_not_followed()
    follower = following(cut)
    follower.begin(CloseUpResult(header=m.Header(1.05), point_id="p1", number=2, finding="unseen"), kind="spur cut")
    assert look(follower, seen).reason == reasons.cut_not_followed()
