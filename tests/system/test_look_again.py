"""A place that needs another look gets it when an operator asks, and comes out of it a point or a person's."""

import pytest

from rolling_panda import commands as intents
from rolling_panda import messages as m
from rolling_panda.reasons import text_of
from tests.support.worlds.closed_loop import ClosedLoop

#: Far enough from the end of the row for the base to come before it (m, odom).
REACH = (0.2, 1.6)


def unclear(told: m.PruningPoints) -> list[m.UndecidedSite]:
    return [
        each
        for each in told.undecided_sites
        if each.needs == "another look" and each.position is not None and REACH[0] < each.position[0] < REACH[1]
    ]


@pytest.mark.slow
@pytest.mark.parametrize("seed", [871])
def test_what_was_unclear_is_settled_by_looking_again(seed: int) -> None:
    """Slow: the camera takes some thirty pictures. A row that was looked at for nothing else."""
    with ClosedLoop(seed) as loop:
        loop.run(6.0)
        points = loop.inbox.newest(m.PruningPoints)
        assert points is not None
        open_places = unclear(points.message)
        assert open_places, "this row has nothing unclear: take another seed"
        place = open_places[0]
        assert loop.command(intents.Arm(user="ada")).ok
        assert loop.command(intents.LookAgain(user="ada", vine=place.vine, spur=place.spur)).ok
        assert loop.run_until(lambda: loop.controller.mode == "READY", 60.0), loop.controller.mode
        told = loop.inbox.newest(m.PruningPoints).message
        assert (place.vine, place.spur) not in {(each.vine, each.spur) for each in unclear(told)}
        shown = [point for point in told.points if (point.vine, point.spur) == (place.vine, place.spur)]
        left = [each for each in told.undecided_sites if (each.vine, each.spur) == (place.vine, place.spur)]
        assert shown or all(each.needs == "operator" and each.reason for each in left)
        assert any(
            f"looked again at vine {place.vine}, spur {place.spur}" in text_of(event.reason) for event in loop.events
        )
