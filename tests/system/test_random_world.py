"""Whatever happens in whatever order: nothing moves or is cut without leave, nothing twice, and stops stay."""

from contextlib import ExitStack
from unittest.mock import patch

import pytest

from tests.support.worlds.random_parts import Movement
from tests.support.worlds.random_world import RandomWorld


def lived(steps, seed, **changes):
    """A world after so many control periods; the judge has seen each of them."""
    with ExitStack() as stack:
        # One period of the bridge for one of the controller: what is told keeps its rate.
        for name, ticks in (("_STATE_TICKS", 5), ("_ODOMETRY_TICKS", 2)):
            stack.enter_context(patch(f"bridge.core.bridge.{name}", ticks))
        stack.enter_context(patch("controller.core._STATE_S", 0.0))
        stack.enter_context(patch("controller.core.Movement", Movement))
        stack.enter_context(patch("controller.core.controller_state", lambda **_: None))
        world = RandomWorld(seed, **changes)
        for _ in range(steps):
            world.step()
    return world


@pytest.mark.long
def test_random_steps_of_everything_together_break_nothing():
    told = lived(8_000, seed=2).judge.told
    for what in ("cuts", "releases", "starts of the bridge", "starts of the controller", "READY to TELEOP"):
        assert told[what] > 0, told


@pytest.mark.slow
def test_a_million_random_steps_of_everything_together_break_nothing(capsys):
    worlds = [lived(100_000, seed) for seed in range(10, 20)]
    told = sum((world.judge.told for world in worlds), start=type(worlds[0].judge.told)())
    with capsys.disabled():
        print(f"\n{sum(world.steps for world in worlds)} steps, 0 breaches; {dict(told.most_common())}")
    assert told["cuts"] > 1000


@pytest.mark.long
@pytest.mark.parametrize(("kills", "steps"), [(5, 3_000), pytest.param(500, 10_000, marks=pytest.mark.slow)])
def test_a_controller_that_is_killed_around_a_cut_never_cuts_twice_and_asks_a_person(kills, steps, capsys):
    killed, seed, unknown = 0, 50, 0
    while killed < kills:
        judge = lived(steps, seed, kill_in_intent=True).judge
        killed, seed = killed + judge.kills_in_intent, seed + 1
        unknown += judge.told["after a kill UNKNOWN"]
        assert judge.kills_in_intent > 0
    assert unknown > 0
    with capsys.disabled():
        print(f"\n{killed} kills with a cut's intent made and its end not known: 0 cut twice or unaccepted")
