"""The controller's side of the fencing token."""

import itertools

from controller.supervision.fencing import FencingToken
from rolling_panda import messages as m
from rolling_panda import reasons
from tests.support.fake_wire import as_received


def drawn():
    return FencingToken((f"t{number}" for number in itertools.count()).__next__)


def bridge(token="", epoch=1):
    return m.BridgeState(
        header=m.Header(1.0), kind="sim", epoch=epoch, watchdog=False, stop_id="", stopped_by=None, cutter="open",
        cut_id="", outcome="", real_time_factor=1.0, holder=m.fingerprint(token) if token else "",
    )  # fmt: skip


def test_it_is_asked_for_five_times_a_second_and_at_once_in_another_mode():
    it = drawn()
    asked = [it.request(3, "IDLE", tick / 100) for tick in range(200)]
    assert sum(request is not None for request in asked) == 10
    assert asked[0] == m.TokenRequest(token="t0", echo=3, mode="IDLE")
    assert it.request(3, "READY", 1.995).mode == "READY"
    assert it.request(3, "READY", 2.0) is None


def test_it_is_held_when_the_bridge_says_so_and_lost_when_that_names_another_one():
    it = drawn()
    assert it.update(bridge(), 0.0) is None and it.token is None and not it.waits
    assert it.update(bridge("t0", 4), 0.1) == reasons.controller_commands(4)
    assert (it.token.epoch, it.token.nonce) == (4, "t0")
    assert it.update(bridge("t0", 4), 0.2) is None
    assert it.update(bridge("other", 5), 0.3) == reasons.controller_waits()
    assert it.token is None and it.overruled and it.waits
    assert it.update(bridge("other", 5), 0.4) is None
    assert it.update(bridge("t0", 6), 0.5) == reasons.controller_commands(6) and not it.waits


def test_before_the_bridge_has_said_who_commands_a_controller_keeps_silent_for_a_second():
    it = drawn()
    assert it.token is None and it.waits
    for now in (7.0, 7.9):
        it.update(None, now)
        assert it.waits and not it.overruled
    it.update(None, 8.0)
    assert not it.waits


def test_who_gives_it_back_says_so_at_once_asks_under_another_one_and_is_not_overruled_by_the_former():
    it = drawn()
    it.update(bridge("t0"), 0.0)
    assert it.request(1, "READY", 0.0) is not None
    given = it.release_token()
    assert given == m.TokenRequest(token="t0", releases=True) and it.token is None
    assert it.request(1, "READY", 0.01) == given
    assert it.request(1, "READY", 0.02).token == "t1"
    for holder in ("t0", ""):
        it.update(bridge(holder), 0.03)
        assert it.token is None and not it.overruled
    it.update(bridge("t1", 2), 0.05)
    assert it.token.epoch == 2


def test_each_start_draws_a_token_of_its_own_that_the_wire_carries():
    asked = [as_received(FencingToken().request(1, "IDLE", 0.0)) for _ in range(2)]
    assert asked[0].token != asked[1].token and all(len(each.token) == 16 for each in asked)
