"""The benchmark of what could be cut where everything is known."""

import json
from dataclasses import replace

import numpy as np
import pytest

from benchmarks.__main__ import main
from benchmarks.control import oracle
from benchmarks.control.cut_truth import wanted_cuts
from bridge.sim.vineyard.config import VineyardConfig
from bridge.sim.vineyard.grow import grow
from bridge.sim.vineyard.row import Rod
from bridge.sim.vineyard.truth import staying_rods

ROW = grow(VineyardConfig(vines=1), 7900)


@pytest.fixture(scope="module")
def searching() -> oracle.Oracle:
    return oracle.Oracle()


def test_all_that_stays_is_in_the_way_and_what_goes_is_not():
    capsules = oracle.obstacles_of(ROW).capsules
    assert {capsule.kind for capsule in capsules} == {"post", "trunk", "cordon", "wire", "hose", "cane"}
    canes = [capsule for capsule in capsules if capsule.kind == "cane"]
    assert len(canes) == len(staying_rods(ROW))
    lines = oracle.cane_lines(ROW)
    standing = {(rod.vine, rod.spur, rod.cane) for _, rod in ROW.standing() if rod.kind == "cane" and rod.organ < 0}
    assert len(lines) == len(standing) and all(len(line) > 2 for line in lines)


def test_a_cut_may_be_shifted_only_where_it_stays_right():
    for wanted in wanted_cuts(ROW):
        if (cut := wanted.cut) is None:
            continue
        point = oracle.point_of(ROW, wanted, cut)
        for along in (-point.inward, 0.0, point.outward):
            assert cut.holds(cut.rod, np.array(point.position) + along * np.array(point.tangent) * 0.999)


def test_a_cut_has_a_plan_and_has_none_where_a_post_stands_beside_it(searching):
    wanted = next(each for each in wanted_cuts(ROW) if each.cut is not None and each.kind == "spur cut")
    plan, reason = searching.search(ROW, wanted, wanted.cut)
    assert plan is not None and reason == ""
    assert np.linalg.norm(plan.poses.cut.translation - wanted.cut.best) < 0.008
    foot = wanted.cut.best + (0.0, -0.06, 0.0)
    post = Rod("post", foot * (1.0, 1.0, 0.0), foot * (1.0, 1.0, 0.0) + (0.0, 0.0, 1.9), 0.038, 0.038)
    blocked = replace(ROW, rods=(*ROW.rods, post))
    plan, reason = searching.search(blocked, wanted, wanted.cut)
    assert plan is None and "post" in reason


def test_blades_slant_to_pass_a_cane_that_stays_beside_a_cut_between_nodes(searching):
    row = grow(VineyardConfig(vines=1), 8000)
    wanted = next(each for each in wanted_cuts(row) if (each.spur, each.kind) == (2, "spur cut"))
    plan, _ = searching.search(row, wanted, wanted.cut)
    assert plan is not None and 0.26 < abs(plan.approach[2]) <= 0.55


GUYOT = grow(VineyardConfig(vines=1, training="guyot", rows_behind=0), 3601)


def test_of_a_guyot_vine_both_canes_stay_and_last_years_cane_is_in_the_way_with_the_number_of_its_spur():
    removal = next(each for each in wanted_cuts(GUYOT, guyot=True) if each.kind == "removal")
    capsules = oracle.obstacles_of(GUYOT, guyot=True).capsules
    canes = {(each.spur, each.cane) for each in capsules if each.kind == "cane"}
    assert canes == {(each.spur, each.cane) for each in wanted_cuts(GUYOT, guyot=True) if each.cane >= 0 and each.cut}
    cordons = [each for each in capsules if each.kind == "cordon"]
    arm = [rod for _, rod in GUYOT.standing() if rod.kind == "cordon"]
    point = oracle.point_of(GUYOT, removal, removal.cut, guyot=True)
    assert len(cordons) == len(arm) and {(each.vine, each.spur) for each in cordons} == {(point.vine, point.spur)}
    assert (point.kind, point.cane, point.nodes_kept, point.nodes_seen) == ("removal", -1, 0, 0)
    permanent = [each for each in oracle.obstacles_of(ROW).capsules if each.kind == "cordon"]
    assert {each.spur for each in permanent} == {-1}


@pytest.mark.long
def test_last_years_cane_has_a_plan_where_it_rises_from_the_head_and_none_where_it_lies_on_the_wire_from_there():
    guyot = oracle.Oracle(guyot=True)
    level = grow(VineyardConfig(vines=1, training="guyot", rows_behind=0, guyot_head=0.0), 3601)
    bare = replace(level, rods=tuple(None if rod is not None and rod.kind == "wire" else rod for rod in level.rods))
    for row, planned in ((GUYOT, True), (level, False), (bare, True)):
        removal = next(each for each in wanted_cuts(row, guyot=True) if each.kind == "removal")
        plan, reason = guyot.search(row, removal, removal.cut)
        assert (plan is not None) == planned and ("wire" in reason) == (not planned)
        if plan is not None:
            place = removal.cut.best + plan.along * removal.cut.tangent
            assert removal.cut.holds(removal.cut.rod, place)
            np.testing.assert_allclose(plan.poses.cut.translation, place, atol=1e-6)


@pytest.mark.long
def test_the_command_tells_shares_and_reasons_and_writes_every_cut(tmp_path, capsys):
    path = tmp_path / "oracle.json"
    assert main(["oracle", "--seed", "7900", "--count", "1", "--json", str(path)]) == 0
    document = json.loads(path.read_text())
    assert len(document["results"]) == sum(wanted.cut is not None for wanted in wanted_cuts(ROW))
    room = document["summary"]["room"]
    assert room["n"] == sum(not each["blocked"] for each in document["results"]) > 10
    assert 0.8 < room["value"] <= 1.0
    lacking = [each for each in document["results"] if not each["planned"] and not each["blocked"]]
    told = capsys.readouterr().out
    assert all(each["reason"] in told for each in lacking) and len(lacking) == round((1.0 - room["value"]) * room["n"])


def test_rows_without_a_cut_and_wrong_numbers_are_told(monkeypatch, capsys):
    monkeypatch.setattr(oracle, "wanted_cuts", lambda row, guyot: ())
    assert oracle.main(["--count", "1"]) == 0
    assert "No row has a right cut" in capsys.readouterr().out
    for words in (["--count", "0"], ["--vines", "0"]):
        with pytest.raises(SystemExit) as end:
            oracle.main(words)
        assert end.value.code == 2 and "at least 1" in capsys.readouterr().err
