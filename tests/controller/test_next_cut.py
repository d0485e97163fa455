import numpy as np

from controller.work.point_queue import PointQueue
from controller.work.posture_search import NextCut, Unreachable
from rolling_panda import messages as m
from rolling_panda import reasons
from tests.controller.test_core_work import CONFIG, point

SEARCHED = reasons.out_of_reach(2.0, 1.0)


class Searches:
    """A search that finds nothing, and counts."""

    def __init__(self) -> None:
        self.begun = 0

    def find(self, point, q, azimuth=None, tried=()):
        self.begun += 1
        return self.look()

    def look(self):
        yield
        return Unreachable(SEARCHED)


def queue():
    q = PointQueue(CONFIG.work)
    shown = (point("a", (0.2, 0.75, 1.0)), point("b", (0.6, 0.75, 1.0)))
    q.update(m.PruningPoints(header=m.Header(), segmenter="none", frames=1, points=shown))
    for each in shown:
        assert q.accept(each.point_id, 1, "ada") is None
    return q


def test_what_a_plan_knows_is_not_searched_for() -> None:
    search, known = Searches(), Unreachable(reasons.no_square_approach())
    coming = NextCut(search, queue(), 10, lambda ticket: known if ticket.point.point_id == "a" else None)
    assert coming.search(np.zeros(12))
    assert coming.point_id == "a" and coming.found is known and search.begun == 0
    coming.step()
    assert coming.found is known


def test_what_it_does_not_know_is_searched_for_and_its_order_is_followed() -> None:
    search, points = Searches(), queue()
    points.arrange(("b", "a"))
    coming = NextCut(search, points, 10, lambda ticket: None)
    assert coming.search(np.zeros(12))
    assert coming.point_id == "b" and coming.found is None and search.begun == 1
    coming.step()
    assert coming.found.reason == SEARCHED


def test_a_new_order_is_looked_at_anew() -> None:
    search, points = Searches(), queue()
    coming = NextCut(search, points, 10)
    coming.search(np.zeros(12))
    assert coming.point_id == "a" and coming.stands
    points.arrange(("b", "a"))
    assert not coming.stands
    coming.search(np.zeros(12))
    assert coming.point_id == "b" and search.begun == 2
