import ast
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from rolling_panda import messages as m
from rolling_panda.messages.supervision import BaseVelocity
from server.config import ServerConfig
from server.robots import teleop
from server.robots.teleop import TeleopCommand, TeleopHold

HERE = m.Pose((0.1, 0.2, 0.3), (0.0, 0.0, 0.0, 1.0))
_ACTIONS = st.sampled_from(["hold", "drew", "aim", "release"])
THERE = m.Pose((0.4, 0.2, 0.3), (0.0, 0.0, 0.0, 1.0))


def holding(now=10.0):
    teleop = TeleopHold(ServerConfig())
    teleop.view_rendered("a", now, now)
    teleop.set_command("a", TeleopCommand(HERE))
    teleop.hold("a", "ann", now)
    return teleop


def test_the_newest_target_is_published_with_a_growing_sequence():
    teleop = holding()
    first = teleop.next_message(10.0)
    teleop.set_command("a", TeleopCommand(THERE))
    second = teleop.next_message(10.03)
    assert (first.hold, first.target, first.user) == (True, HERE, "ann")
    assert (second.hold, second.target) == (True, THERE)
    assert second.sequence > first.sequence


def test_nothing_is_published_before_anybody_holds():
    teleop = TeleopHold(ServerConfig())
    teleop.view_rendered("a", 10.0, 10.0)
    teleop.set_command("a", TeleopCommand(HERE))
    assert teleop.next_message(10.0) is None


def test_letting_go_ends_it_in_the_next_message_and_says_so_several_times():
    teleop = holding()
    assert teleop.release("a")
    ends = [teleop.next_message(10.01) for _ in range(8)]
    assert [end is not None and end.hold is False for end in ends] == [True] * 5 + [False] * 3
    assert teleop.next_message(10.02) is None


def test_silence_of_150_ms_ends_the_hold():
    teleop = holding()
    assert teleop.next_message(10.149).hold
    assert teleop.next_message(10.151).hold is False
    assert teleop.holder is None


def test_a_page_that_no_longer_draws_the_robot_ends_the_hold():
    teleop = holding()
    for step in range(1, 12):
        now = 10.0 + 0.05 * step
        if teleop.hold("a", "ann", now) is not None:
            break
    assert 10.5 <= now < 10.6
    assert teleop.next_message(now).hold is False


def test_the_first_holder_wins():
    teleop = holding()
    teleop.view_rendered("b", 10.0, 10.0)
    teleop.set_command("b", TeleopCommand(THERE))
    assert teleop.hold("b", "bob", 10.1).code == "held_by_other"
    assert teleop.next_message(10.1).target == HERE
    teleop.release("a")
    teleop.hold("b", "bob", 10.12)
    assert teleop.next_message(10.12).user == "bob"


def test_somebody_else_cannot_let_go_or_aim_for_the_holder():
    teleop = holding()
    assert not teleop.release("b")
    teleop.set_command("b", TeleopCommand(THERE))
    assert teleop.next_message(10.01).target == HERE


def test_a_hold_needs_a_target_and_an_eye_on_the_robot():
    teleop = TeleopHold(ServerConfig())
    teleop.set_command("a", TeleopCommand(HERE))
    assert teleop.hold("a", "ann", 10.0).code == "hold_view_stale"
    teleop = TeleopHold(ServerConfig())
    teleop.view_rendered("a", 10.0, 10.0)
    assert teleop.hold("a", "ann", 10.0).code == "hold_without_target"


def test_a_target_of_an_earlier_hold_is_not_used_again():
    teleop = holding()
    teleop.release("a")
    assert teleop.hold("a", "ann", 10.1).code == "hold_without_target"


@settings(max_examples=100)
@given(
    st.lists(st.tuples(st.sampled_from(["hold", "drew", "aim", "release"]), st.sampled_from("ab"), st.floats(0, 0.3)))
)
def test_a_target_goes_out_only_while_somebody_holds_with_a_fresh_view(steps):
    teleop = TeleopHold(ServerConfig())
    now, renewed, drawn = 0.0, {}, {}
    for action, who, pause in steps:
        now += pause
        if action == "drew":
            teleop.view_rendered(who, now, now)
            drawn[who] = now
        elif action == "aim":
            teleop.set_command(who, TeleopCommand(HERE))
        elif action == "release":
            teleop.release(who)
            renewed.pop(who, None)
        else:
            if teleop.hold(who, who, now) is None:
                renewed[who] = now
        message = teleop.next_message(now)
        if message is not None and message.hold:
            assert now - renewed[message.user] <= 0.1501
            assert now - drawn[message.user] <= 0.5001


def test_a_page_holds_by_what_it_shows_itself_and_not_by_another_page_of_the_same_person():
    teleop = TeleopHold(ServerConfig())
    teleop.set_command("ann", TeleopCommand(HERE))
    teleop.view_rendered("page 1", 10.0, 10.0)
    assert teleop.hold("ann", "ann", 10.0, view="page 2").code == "hold_view_stale"
    teleop.hold("ann", "ann", 10.0, view="page 1", client="c1")
    teleop.view_rendered("page 2", 10.45, 10.5)
    for now in (10.1, 10.2, 10.3, 10.4, 10.5):
        teleop.hold("ann", "ann", now, view="page 1", client="c1")
    assert teleop.next_message(10.51).hold is False


def test_how_late_the_holders_view_is_goes_out_with_the_target():
    teleop = TeleopHold(ServerConfig())
    teleop.set_command("ann", TeleopCommand(HERE))
    teleop.view_rendered("page 1", 10.0, 10.21)
    teleop.view_rendered("page 2", 10.0, 10.05)
    teleop.hold("ann", "ann", 10.25, view="page 1", client="c1")
    target = teleop.next_message(10.25)
    assert target.client == "c1"
    assert target.round_trip_s == pytest.approx(0.21)
    # The same state said again says nothing new.
    teleop.view_rendered("page 1", 10.0, 10.4)
    assert teleop.next_message(10.26).round_trip_s == pytest.approx(0.21)


def test_while_the_base_is_held_no_gizmo_is_followed():
    teleop = holding()
    drive = TeleopCommand(base=BaseVelocity(0.2, 0.0))
    teleop.set_command("a", drive)
    teleop.hold("a", "ann", 10.0)
    sent = teleop.next_message(10.01)
    assert (sent.target, sent.base) == (None, drive.base)
    assert not teleop.follows_gizmo
    teleop.release("a")
    teleop.set_command("a", TeleopCommand(THERE))
    teleop.hold("a", "ann", 10.02)
    assert teleop.next_message(10.03).target == THERE and teleop.follows_gizmo


def test_the_share_of_the_speed_goes_out_and_is_that_of_the_newest_renewal():
    teleop = holding()
    assert teleop.next_message(10.0).speed_scale == 1.0
    teleop.hold("a", "ann", 10.01, speed_scale=0.25)
    teleop.set_command("a", TeleopCommand(THERE))
    assert teleop.next_message(10.02).speed_scale == 0.25


def test_after_a_short_silence_the_next_word_goes_on():
    teleop = holding()
    assert teleop.next_message(10.5).hold is False
    teleop.view_rendered("a", 10.9, 10.9)
    teleop.set_command("a", TeleopCommand(HERE))
    teleop.hold("a", "ann", 10.9)
    assert teleop.next_message(10.9).hold


def test_after_a_long_silence_only_a_new_hold_moves_anything():
    teleop = holding()
    assert teleop.next_message(10.5).hold is False
    teleop.view_rendered("a", 11.1, 11.1)
    teleop.set_command("a", TeleopCommand(HERE))
    # The first may have waited in a server that stood still.
    for word in (11.1, 11.13):
        assert teleop.hold("a", "ann", word).code == "hold_overdue"
        assert teleop.holder is None
    teleop.release("a")
    teleop.set_command("a", TeleopCommand(HERE))
    teleop.hold("a", "ann", 11.15)
    assert teleop.next_message(11.15).hold


def test_a_hold_that_lapsed_is_not_another_holders():
    teleop = holding()
    teleop.expire(12.0)
    teleop.view_rendered("b", 12.0, 12.0)
    teleop.set_command("b", TeleopCommand(THERE))
    teleop.hold("b", "bea", 12.0)
    assert teleop.next_message(12.0).user == "bea"


@pytest.mark.long
def test_one_object_alone_writes_the_aim_and_sends_the_target():
    package = Path(teleop.__file__).resolve().parents[1]
    for name in ("set_command", "clear_target", "next_message", "send_teleop", "follows_gizmo"):
        users = {
            file.relative_to(package).as_posix()
            for file in package.rglob("*.py")
            for node in ast.walk(ast.parse(file.read_text(encoding="utf-8")))
            if isinstance(node, ast.Attribute) and node.attr == name
        }
        assert users == {"robots/teleop.py"}, name
