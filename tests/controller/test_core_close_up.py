"""A close-up that sees a cut elsewhere than planned: the way in is checked there before the tool enters the canes."""

import msgspec
import numpy as np
import pytest

from controller.planning import preview
from rolling_panda import commands as intents
from rolling_panda.messages.perception import Capsule
from rolling_panda.model.wire_values import vector3
from rolling_panda.reasons import text_of
from tests.support.controller_at_work import CONFIG, entry, run_until, working
from tests.support.points import point
from tests.support.previewed import Previewed
from tests.support.worlds.kinematic_robot import KinematicRobot

CUT = (0.45, 0.75, 1.10)
CLEAR = CUT[1] - CONFIG.work.clearance


def cane(x, y=0.75, foot=0.95, top=1.09, spur=1, number=-1):
    return Capsule("cane", (x, y, foot), (x, y, top), 0.004, 0.004, 1, spur, cane=number)


def wire(height, y=CUT[1]):
    return Capsule("wire", (-0.5, y, height), (2.0, y, height), 0.002, 0.002)


OWN = cane(CUT[0], number=0)


class SeesElsewhere(KinematicRobot):
    """Its close-ups see each cut `off` where it was shown (3, m), and `news` is known to stand around from then on."""

    off = (0.0, 0.0, 0.0)
    news: tuple[Capsule, ...] = ()
    pictures = 0

    def close_up(self, request):
        seen = super().close_up(request)
        if seen.position is None:
            return seen
        self.pictures += 1
        self.obstacles = (*self.obstacles, *(each for each in self.news if each not in self.obstacles))
        return msgspec.structs.replace(seen, position=vector3(np.add(seen.position, self.off)))


def work(monkeypatch, *obstacles, off=(0.0, 0.0, 0.0), news=(), **room):
    """Makes the cut; the robot, and how deep the tool came in (m, y) before each approach was given up."""
    monkeypatch.setattr("tests.support.controller_at_work.KinematicRobot", SeesElsewhere)
    monkeypatch.setattr(SeesElsewhere, "off", off)
    monkeypatch.setattr(SeesElsewhere, "news", news)
    cut = point("a", CUT, vine=1, spur=1, cane=0, **room)
    r, deepest = working((cut,), obstacles=(OWN, *obstacles)), -1.0
    run_until(r, lambda s: s is not None and s.mode == "AUTO", 2.0)
    while r.state.mode == "AUTO":
        r.step()
        deepest = max(deepest, float(r.model.kinematics(r.q).T_odom_tool.translation[1]))
        assert r.now < 60.0, r.state.reason
    return r, deepest


def turned(r):
    return [text for text in r.events if "another way, for" in text]


def refused(r):
    return [text for text in r.events if "No approach has room where the close-up sees the cut" in text]


@pytest.mark.parametrize("off", [(0.0, 0.0, 0.0), (0.008, 0.004, 0.006), (-0.012, -0.01, 0.0)])
def test_a_cut_with_room_is_entered_at_once_wherever_it_is_seen(monkeypatch, off):
    r, _ = work(monkeypatch, off=off)
    assert entry(r, "a").state == "DONE", text_of(entry(r, "a").reason)
    assert r.cuts[0][1][:3, 3] == pytest.approx(np.add(CUT, off), abs=0.002)
    assert not turned(r)


def test_a_cut_that_is_seen_nearer_to_a_wire_is_approached_another_way_and_looked_at_again(monkeypatch):
    """Where it was accepted the cutter passes below the wire; 14 mm higher the wire would hold it."""
    over = wire(CUT[2] + 0.045, CUT[1] - 0.04)
    straight, _ = work(monkeypatch, over)
    assert entry(straight, "a").state == "DONE" and not turned(straight)
    r, _ = work(monkeypatch, over, off=(0.0, 0.0, 0.014))
    assert entry(r, "a").state == "DONE", text_of(entry(r, "a").reason)
    assert len(turned(r)) == 1 and r.cuts[0][1][2, 2] > straight.cuts[0][1][2, 2] + 0.1, "from below"
    assert r.cuts[0][1][:3, 3] == pytest.approx(np.add(CUT, (0.0, 0.0, 0.014)), abs=0.002)


def test_a_cut_that_is_seen_beside_a_wire_is_made_a_little_along_the_wood_and_told(monkeypatch):
    """The wire becomes known with the picture."""
    off = (0.004, 0.0, 0.002)
    seen = np.add(CUT, off)
    r, _ = work(monkeypatch, off=off, news=(wire(seen[2] + 0.0115),), inward=0.005)
    assert entry(r, "a").state == "DONE", text_of(entry(r, "a").reason)
    assert not turned(r)
    along = r.cuts[0][1][:3, 3] - seen
    assert along[:2] == pytest.approx([0.0, 0.0], abs=0.001) and -0.006 < along[2] < -0.0015
    assert any("along the wood" in text for text in r.events)


def test_nothing_moves_into_a_cut_that_has_no_room_where_it_is_seen(monkeypatch):
    r, deepest = work(monkeypatch, wire(CUT[2] + 0.04), off=(0.0, 0.0, 0.03))
    ended = entry(r, "a")
    assert ended.state == "FAILED_NOT_CUT" and "no_room_where_seen" in str(ended.reason)
    assert r.cuts == [] and deepest < CLEAR + 0.05


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_blades_do_not_close_over_a_cane_that_stays_where_the_cut_is_seen(monkeypatch, side):
    """A cane behind the cut and far aside; the cut is seen just before it, where the open blades pass it."""
    stays = cane(CUT[0] + 0.045 * side, CUT[1] + 0.017, foot=0.9, top=1.3, spur=2, number=0)
    straight, _ = work(monkeypatch, stays)
    assert entry(straight, "a").state == "DONE", text_of(entry(straight, "a").reason)
    r, deepest = work(monkeypatch, stays, off=(0.043 * side, 0.0, 0.0))
    assert refused(r) and r.cuts == [] and deepest < CLEAR + 0.05


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_a_cane_that_the_map_has_between_the_blades_is_not_cut_either(monkeypatch, side):
    """It becomes known with the picture, which shows the cut farther from it: perhaps all wood is shifted alike."""
    news = cane(CUT[0] + 0.006 * side, CUT[1] + 0.006, foot=0.9, top=1.3, spur=2, number=0)
    r, deepest = work(monkeypatch, off=(-0.03 * side, 0.0, 0.0), news=(news,))
    for _, T in r.cuts:
        at_map = T[:3, 3] + [0.03 * side, 0.0, 0.0]
        # Where the upright cane passes the plane of the blades, which may lean.
        level = T[:3, :3].T @ (np.array([news.start[0], news.start[1], T[2, 3]]) - at_map)
        upwards = T[2, :3]
        across, _, ahead = level - upwards * level[1] / upwards[1]
        assert abs(across) > 0.019 or abs(ahead) > 0.022
    assert r.cuts or (refused(r) and deepest < CLEAR + 0.05)


def test_an_approach_that_was_shown_and_approved_is_not_left_for_another_one(monkeypatch):
    """The cut is put off: another way is another preview, which a person has not seen."""
    monkeypatch.setattr("tests.support.controller_at_work.KinematicRobot", SeesElsewhere)
    monkeypatch.setattr(SeesElsewhere, "off", (0.0, 0.0, 0.014))
    # Nobody makes the session's plan.
    monkeypatch.setattr(preview, "_PLAN_S", 0.0)
    over = wire(CUT[2] + 0.045, CUT[1] - 0.04)
    p = Previewed((point("a", CUT, vine=1, spur=1, cane=0),), obstacles=(OWN, over))
    assert p.ask(intents.RequirePreview, required=True) == ""
    p.previewed("a")
    assert p.ask(intents.ApprovePreview, preview_hash=p.state.preview_hash) == ""
    assert p.ask(intents.Start) == ""
    r = p.robot
    run_until(r, lambda s: s.mode != "AUTO", r.now + 40.0)
    assert refused(r) and not turned(r) and r.cuts == []
    assert entry(r, "a").state == "ACCEPTED" and p.state.phase == "expired"


def test_a_cane_that_became_known_since_the_plan_is_gone_around(monkeypatch):
    news = cane(CUT[0], CUT[1] - 0.08, foot=0.9, top=1.4, spur=2)
    r, _ = work(monkeypatch, news=(news,))
    assert entry(r, "a").state == "DONE", text_of(entry(r, "a").reason)
    assert len(turned(r)) == 1 and abs(r.cuts[0][1][0, 2]) > 0.2, "from aside"
    assert r.pictures >= 2
