"""What a closer look before a cut allows."""

import msgspec
import pytest
from controller_at_work import entry, finish, point, run_until, working

from controller.confirmation import not_as_accepted
from controller.queue import Ticket
from rolling_panda import messages as m
from rolling_panda.look_messages import CloseLook

ACCEPTED = point("a", (0.5, 0.75, 1.0))
TICKET = Ticket(ACCEPTED, "ACCEPTED", accepted=ACCEPTED)


def look(finding="seen", dx=0.0, reason=""):
    position = (0.5 + dx, 0.75, 1.0) if finding == "seen" else None
    return CloseLook(
        header=m.Header(), point_id="a", number=1, finding=finding, reason=reason, position=position, tangent=(0, 0, 1)
    )


@pytest.mark.parametrize(
    ("seen", "words"),
    [
        (look(dx=0.0049), ""),
        (look(dx=0.007), "moved 7 mm on a closer look: accept it again"),
        (look("changed", reason="a node is seen 3 mm from the cut"), "a node is seen 3 mm from the cut"),
        (look("severed"), "off already"),
        (look("unseen", reason="its cane is hidden"), "its cane is hidden"),
    ],
)
def test_only_what_is_seen_where_it_was_accepted_is_cut(seen, words):
    why = not_as_accepted(seen, TICKET, 0.005)
    assert words in why and bool(why) == bool(words)


def test_without_an_acceptance_nothing_is_cut():
    assert not_as_accepted(look(), Ticket(ACCEPTED), 0.005)
    assert not_as_accepted(look(), None, 0.005)


def looking(r, *, dx=0.0, finding="seen", point_id="a"):
    """Let the robot's camera show one point otherwise than the others."""
    usual = r._looked

    def looked(request):
        sample = usual(request)
        if request.point_id != point_id or sample.message.finding != "seen":
            return sample
        x, y, z = sample.message.position
        changed = {"position": (x + dx, y, z)} if finding == "seen" else {"finding": finding, "position": None}
        return type(sample)(msgspec.structs.replace(sample.message, **changed), sample.at)

    r._looked = looked
    return r


def test_a_point_that_moved_is_not_cut_says_why_and_the_work_goes_on():
    r = looking(working((point("a", (0.5, 0.75, 1.0)), point("b", (0.8, 0.75, 1.05)))), dx=0.007)
    finish(r, 60.0)
    assert [cut[0] for cut in r.cuts] == ["b"]
    assert entry(r, "a").state == "PROPOSED" and "moved 7 mm on a closer look" in entry(r, "a").reason
    assert entry(r, "b").state == "DONE"


def test_within_five_millimetres_the_place_of_the_closer_look_is_cut():
    r = looking(working((point("a", (0.5, 0.75, 1.0)),)), dx=0.004)
    finish(r, 30.0)
    assert entry(r, "a").state == "DONE"
    assert abs(r.cuts[0][1][0, 3] - 0.504) < 0.0015


def test_the_phase_is_told_while_the_robot_looks_and_the_blades_stay_out_of_the_canes():
    r = working((point("a", (0.5, 0.75, 1.0)),))
    r._looked = lambda request: None
    run_until(r, lambda s: s is not None and s.phase == "LOOK", 20.0)
    for _ in range(150):
        r.step()
    assert r.state.phase == "LOOK" and r.state.T_odom_tool.position[1] < 0.75 - 0.19
    finish(r, 40.0)
    assert not r.cuts and "no picture of it came" in entry(r, "a").reason
