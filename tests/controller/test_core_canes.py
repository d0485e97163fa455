"""Canes that stay among accepted cuts: the controller with a robot that has no mass goes round them or says why not."""

import numpy as np
import pinocchio as pin
import pytest

from controller.config import ControllerConfig
from controller.motion.surroundings import obstacles_of
from controller.planning.work_plan import PlanRequest, WorkPlan
from controller.whole_body.collision import CollisionModel
from controller.whole_body.collision_geometry import BLADES
from rolling_panda import commands as intents
from rolling_panda.messages.perception import Capsule
from rolling_panda.messages.supervision import TeleopTarget
from rolling_panda.model.robot import RobotModel, pose_message
from rolling_panda.reasons import text_of
from tests.support.controller_at_work import entry, robot, run_until, working
from tests.support.points import point
from tests.support.sent import newest

CUT = (0.45, 0.75, 1.10)
STAND_OFF = ControllerConfig().work.stand_off


def cane(x, y=0.75, top=1.09, spur=1, foot=0.95):
    return Capsule("cane", (x, y, foot), (x, y, top), 0.004, 0.004, 1, spur)


OWN = cane(CUT[0])
OTHER = point("b", (0.8, 0.75, 1.1))


class Judge:
    """Watches every part of the robot beside these canes."""

    def __init__(self, *canes):
        self._model = CollisionModel(RobotModel())
        self._model.set_obstacles(obstacles_of(canes))
        self.least = {}

    def look(self, q):
        near = self._model.distances(q, 0.1)
        for (part, name), distance in zip(near.pairs, near.distance.tolist(), strict=True):
            if name.startswith(("cane", "cordon")):
                key = ("blades" if part == BLADES else "rest", int(name.split()[1].rstrip(",")))
                self.least[key] = min(self.least.get(key, 1.0), distance)


def work(*canes, limit_s=25.0, **changes):
    """Makes the cut among canes; what happened, and how near everything came."""
    r, judge = working((point("a", CUT, **changes),), obstacles=canes), Judge(*canes)
    run_until(r, lambda s: s is not None and s.mode == "AUTO", 2.0)
    while r.state.mode == "AUTO":
        r.step()
        judge.look(r.q)
        assert r.now < limit_s, r.state.reason
    return r, judge


def test_the_blades_go_to_the_spur_that_is_cut_and_nothing_else_goes_near_any():
    """Neighbours stand as near as spurs do, and what stays of the cane ends just below the cut."""
    r, judge = work(OWN, cane(CUT[0] - 0.09, spur=2, top=1.15), cane(CUT[0] + 0.09, spur=3, top=1.15))
    assert entry(r, "a").state == "DONE", entry(r, "a").reason
    assert judge.least["blades", 0] < 0.015, "the blades have their work there"
    assert judge.least["rest", 0] > 0.008
    assert all(distance > 0.004 for (_, number), distance in judge.least.items() if number > 0)


def cordon(start, end, spur=1):
    """A piece of cordon; with a spur it is last year's cane of a Guyot vine."""
    return Capsule("cordon", start, end, 0.007, 0.007, 0, spur)


#: Last year's cane, which rises from the head and lies along the row.
RISES = (0.8, 0.0, 0.6)
HEAD, BENT = (CUT[0] - 0.048, CUT[1], CUT[2] - 0.036), (CUT[0] + 0.08, CUT[1], CUT[2] + 0.06)
LIES = cordon(BENT, (BENT[0] + 0.4, CUT[1], BENT[2]))


def test_the_guard_lets_the_blades_close_on_last_years_cane_and_keeps_all_else_off_it():
    """It is seen 5 mm nearer to one of the blades than the point has it: with its distance they would not get there."""
    aside = (-0.003, 0.0, 0.004)
    start, end = (tuple(np.add(each, aside).tolist()) for each in (HEAD, BENT))
    r, judge = work(cordon(start, end), LIES, spur=1, kind="removal", tangent=RISES, cane=-1, radius=0.007)
    assert entry(r, "a").state == "DONE", entry(r, "a").reason
    np.testing.assert_allclose(r.cuts[0][1][:3, 3], CUT, atol=0.002)
    kept = ControllerConfig().whole_body.hierarchy
    assert 0.0 < judge.least["blades", 0] < kept.blade_distance
    assert judge.least["rest", 0] > kept.cutter_distance - 0.001
    assert min(judge.least[part, 1] for part in ("blades", "rest") if (part, 1) in judge.least) > kept.blade_distance


@pytest.mark.parametrize(("spur", "kind"), [(-1, "removal"), (1, "by hand")])
def test_a_permanent_cordon_is_not_cut_nor_last_years_cane_by_another_cut(spur, kind):
    r, _ = work(cordon(HEAD, BENT, spur), spur=1, kind=kind, tangent=RISES, cane=-1, radius=0.007)
    assert entry(r, "a").state == "FAILED_NOT_CUT" and not r.cuts
    assert "no_clear_posture" in str(entry(r, "a").reason) and "cordon 0" in str(entry(r, "a").reason)


@pytest.mark.long
def test_a_cane_before_the_cut_is_gone_around():
    before = cane(CUT[0], y=0.66, spur=2, top=1.30)
    free, _ = work(OWN)
    r, judge = work(OWN, before)
    assert entry(r, "a").state == "DONE", entry(r, "a").reason
    assert min(distance for (_, number), distance in judge.least.items() if number == 1) > 0.003
    assert abs(r.cuts[0][1][0, 2]) > 0.2, "from aside"
    assert abs(free.cuts[0][1][0, 2]) < 0.1


def test_a_cut_behind_canes_is_refused_with_the_reason_before_anything_moves_there():
    fence = [cane(CUT[0] + dx, y=0.68, spur=2 + k, top=1.35) for k, dx in enumerate(np.arange(-0.24, 0.25, 0.04))]
    r, judge = work(OWN, *fence)
    ended = entry(r, "a")
    assert ended.state == "FAILED_NOT_CUT"
    assert "no_clear_posture" in str(ended.reason)
    assert r.cuts == [] and all(distance > 0.0 for distance in judge.least.values())


def test_beside_another_spur_the_blades_keep_clear_of_it():
    """Two canes 30 mm apart: the blades, open to 25 mm at either side, come from where they fit between."""
    r, judge = work(OWN, cane(CUT[0] + 0.03, spur=2, top=1.2))
    blades = judge.least.get(("blades", 1), 1.0)
    if entry(r, "a").state == "DONE":
        assert blades > 0.0
    else:
        assert "no_clear_posture" in str(entry(r, "a").reason) and not r.cuts


def test_a_cane_that_is_seen_somewhat_elsewhere_all_the_time_neither_stops_nor_shakes_the_work():
    rng = np.random.default_rng(4)
    r = working((point("a", CUT),), obstacles=(OWN, cane(CUT[0] + 0.1, spur=2)))
    run_until(r, lambda s: s is not None and s.mode == "AUTO", 2.0)
    jumps = []
    while r.state.mode == "AUTO":
        if round(r.now / r.dt) % 50 == 0:
            x, y = rng.uniform(-0.008, 0.008, 2)
            r.obstacles = (OWN, cane(CUT[0] + 0.1 + float(x), 0.75 + float(y), spur=2))
        r.step()
        jumps.append(float(np.abs(np.diff(r.record[-2:], axis=0)).max()) if len(r.record) > 1 else 0.0)
        assert r.now < 25.0
    assert entry(r, "a").state == "DONE"
    calm, _ = work(OWN)
    # Nothing changes faster than it does without: every change is within the accelerations that work uses anyway.
    assert max(jumps) <= float(np.abs(np.diff(calm.record, axis=0)).max()) + 1e-9


def test_a_hand_that_leads_the_tool_into_a_cane_is_held_and_told_why():
    r = robot()
    tool = r.model.kinematics(r.q).T_odom_tool
    at = tool.translation + 0.2 * tool.rotation[:, 2]
    x, y, z = at.tolist()
    r.obstacles = (Capsule("cane", (x, y, z - 0.3), (x, y, z + 0.3), 0.004, 0.004, 2, 7),)
    judge = Judge(*r.obstacles)
    r.run(0.3)
    assert r.ask(intents.Arm(user="ada")).ok
    r.run(0.05)
    target = pose_message(pin.SE3(tool.rotation, tool.translation + 0.4 * tool.rotation[:, 2]))
    r.teleop = TeleopTarget(sequence=1, hold=True, user="ada", target=target)
    reasons = set()
    for _ in range(400):
        r.step()
        judge.look(r.q)
        reasons.add(text_of(r.state.reason))
    assert min(judge.least.values()) > 0.0
    assert any("cane 0, vine 2, spur 7" in reason for reason in reasons), reasons


def test_out_of_the_canes_the_tool_gets_on_its_line_also_when_work_was_broken_off():
    """Another cane of the spur is within an open blade; the blades stay exempt until they are drawn out."""
    beside = cane(CUT[0] + 0.022, top=1.2)
    r = working((point("a", CUT), OTHER), obstacles=(OWN, beside))
    # Else the tool would turn until no blade is beside it.
    assert r.ask(intents.SetApproach(user="ada", point_id="a", azimuth=0.0)).ok
    run_until(r, lambda s: s is not None and s.phase == "CUT", 25.0)
    beside_blades = r.model.kinematics(r.q).T_odom_tool.rotation.T @ [0.022, 0.0, 0.0]
    assert abs(beside_blades[0]) > 0.02, "where one of them is open"
    assert r.ask(intents.Pause(user="ada")).ok
    r.run(1.0)
    assert r.ask(intents.Resume(user="ada")).ok and r.ask(intents.Start(user="ada")).ok
    run_until(r, lambda s: s.mode == "AUTO", r.now + 1.0)
    inside = [np.array(CUT)]
    while inside[-1][1] > CUT[1] - 0.1:
        r.step()
        inside.append(r.model.kinematics(r.q).T_odom_tool.translation.copy())
        assert r.now < 40.0, r.state.reason
    assert len(inside) > 20 and np.abs(np.array(inside)[:, 0] - CUT[0]).max() < 0.003
    run_until(r, lambda s: s.mode != "AUTO", 60.0)
    assert entry(r, "a").state == entry(r, "b").state == "DONE"


def test_the_way_in_beside_a_cane_is_not_left():
    """At full speed into a gap: what slows the tool down is the same as on the way itself, so that nothing jumps."""
    r = working((point("a", CUT),), obstacles=(OWN, cane(CUT[0] + 0.045, spur=2, top=1.2)))
    run_until(r, lambda s: s is not None and s.phase == "ADVANCE", 25.0)
    away, began = 0.0, r.now
    while r.state.phase == "ADVANCE":
        r.step()
        away = max(away, r.controller.tracking.position_error if r.controller.tracking else 0.0)
        assert r.now < began + 6.0
    assert entry(r, "a").state in ("CUTTING", "DONE"), entry(r, "a").reason
    assert away < 0.008


def test_while_the_tool_is_in_the_canes_a_plan_is_asked_for_from_where_it_will_be_clear():
    r = working((point("a", CUT), OTHER), obstacles=(OWN,))
    answered, asked, shown = False, [], False
    while not asked:
        request = newest(r.step(), PlanRequest)
        if request is not None and not answered:
            # It says nothing of any point, and is void as soon as another one is accepted.
            r.hear(WorkPlan(request))
            answered = True
        elif request is not None:
            asked.append(request.q)
        if not shown and r.state is not None and r.state.phase == "CUT":
            shown = True
            r.show((point("a", CUT), OTHER, point("c", (1.0, 0.75, 1.1))))
            r.step()
            assert r.ask(intents.AcceptPoint(user="ada", point_id="c", revision=1)).ok
        assert r.now < 40.0
    assert r.state.phase in ("CUT", "RETREAT") and r.model.pose(r.q, r.model.tool_id).translation[1] > 0.7
    assert r.model.pose(asked[0], r.model.tool_id).translation[1] < CUT[1] - STAND_OFF
