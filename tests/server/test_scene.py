"""The 3-D view as a whole, without a browser: what viser is told of points."""

from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from rolling_panda import messages as m
from rolling_panda.messages.perception import Capsule, MovedCapsule, Obstacles, Scenery, SceneryMotion
from rolling_panda.model.robot import RobotModel
from server.scene.cut_canes import FALLS_COLOR
from server.scene.scene import Scene
from server.scene.solids import build_solids
from tests.support.played_server import bridge, point


class Drawn(Scene):
    """The scene, and what viser has of it."""

    def handle(self, name: str) -> Any:
        return self._server.scene.get_handle_by_name(name)

    def kept(self) -> list[Any]:
        """Messages that viser keeps for views that open later."""
        return list(self._server._websock_server._broadcast_buffer.message_from_id.values())


@pytest.fixture
def scene() -> Iterator[Drawn]:
    def soon(function: Any, *arguments: Any) -> object:
        return function(*arguments)

    def nothing(*_: object) -> None:
        return None

    made = Drawn(RobotModel().model, replace(build_solids(), robot=()), soon, nothing, nothing, nothing)
    yield made
    made.close()


# --- what is cut off -------------------------------------------------------------------------------------------------


def cane(x: float, y: float = 0.8, top: float = 1.8) -> tuple[m.Vector3, ...]:
    return tuple((x, y, float(z)) for z in np.linspace(0.5, top, 9))


def highest(scene: Drawn, x: float, *names: str) -> float:
    """The highest place (m) of the drawn canes at x, whether they will fall or not; minus infinity without one."""
    drawn = [scene.handle(f"/plant/{name}") for name in names or ("canes", "falls")]
    places = np.concatenate([np.zeros((0, 3)), *(np.asarray(each.vertices) for each in drawn if each is not None)])
    return float(places[np.abs(places[:, 0] - x) < 0.01, 2].max(initial=-np.inf))


def late_view(scene: Drawn) -> set[str]:
    """Names of all that a view is sent that opens now."""
    return {
        message.name for message in scene.kept() if type(message).__name__.endswith(("MeshMessage", "SegmentsMessage"))
    }


def falling(scene: Drawn, layer: str) -> Any:
    names = [name for name in late_view(scene) if name.startswith(f"/{layer}/falling")]
    assert len(names) <= 1, names
    return scene.handle(names[0]) if names else None


def at_work(scene: Drawn, state: m.PointState, outcome: m.Outcome = "") -> None:
    """Point 1 in a state, and what the blades have told of its cut."""
    rows = (point(1, state, cut_id="c1"), point(2, "ACCEPTED"))
    scene.show_points(rows)
    scene.show_cuts(rows, bridge(cut_id="c1", outcome=outcome), now=100.0)


def test_what_the_blades_have_cut_off_falls_for_a_second_and_is_gone(scene: Drawn) -> None:
    scene.show_canes((cane(0.2), cane(0.4)))
    at_work(scene, "CUTTING")
    assert highest(scene, 0.2) == pytest.approx(1.8, abs=0.008) and falling(scene, "plant") is None
    at_work(scene, "CUTTING", "DONE")
    assert highest(scene, 0.2) == pytest.approx(0.9, abs=0.008), "perception still tells it at its full length"
    assert highest(scene, 0.4) == pytest.approx(1.8, abs=0.008), "its neighbour stands"
    piece = falling(scene, "plant")
    low, high = np.asarray(piece.vertices)[:, 2].min(), np.asarray(piece.vertices)[:, 2].max()
    assert (low, high) == (pytest.approx(0.9, abs=0.008), pytest.approx(1.8, abs=0.008)), "all that was above the cut"
    scene.falling.step(100.2)
    assert piece.position[2] == pytest.approx(-0.5 * 9.81 * 0.04)
    scene.falling.step(100.8)
    assert piece.position[2] == pytest.approx(-0.9, abs=0.008), "it lies on the ground, and fades"
    assert 0.0 < piece.opacity < 1.0
    scene.falling.step(101.0)
    assert falling(scene, "plant") is None
    at_work(scene, "DONE", "DONE")
    scene.show_canes((cane(0.2, top=1.81), cane(0.4)))
    assert highest(scene, 0.2) == pytest.approx(0.9, abs=0.008) and falling(scene, "plant") is None, (
        "and does not fall again"
    )


def test_what_will_fall_is_red_and_stands_no_more_as_wood_as_soon_as_its_cut_is_accepted(scene: Drawn) -> None:
    scene.show_canes((cane(0.2), cane(0.4)))
    scene.show_points((point(1, "PROPOSED"), point(2, "PROPOSED")))
    assert scene.handle("/plant/falls") is None and highest(scene, 0.2) == pytest.approx(1.8, abs=0.008)
    scene.show_points((point(1, "ACCEPTED"), point(2, "PROPOSED")))
    red = scene.handle("/plant/falls")
    heights = np.asarray(red.vertices)[:, 2]
    assert (heights.min(), heights.max()) == (pytest.approx(0.9, abs=0.008), pytest.approx(1.8, abs=0.008))
    assert tuple(np.asarray(red.color).tolist()) == FALLS_COLOR and 0.0 < red.opacity < 1.0
    assert highest(scene, 0.2, "canes") == pytest.approx(0.9, abs=0.008)
    assert highest(scene, 0.4, "canes") == pytest.approx(1.8, abs=0.008)
    scene.show_points((point(1, "REJECTED"), point(2, "PROPOSED")))
    assert scene.handle("/plant/falls") is None and highest(scene, 0.2) == pytest.approx(1.8, abs=0.008)


def test_a_trunk_stands_on_the_ground_though_the_camera_has_not_looked_so_low(scene: Drawn) -> None:
    trunk = Capsule("trunk", (0.5, 0.8, 0.4), (0.5, 0.8, 0.8), 0.03, 0.02)
    high = Capsule("post", (2.5, 0.8, 1.4), (2.5, 0.8, 1.9), 0.03, 0.03)
    scene.show_plant(Obstacles(header=m.Header(), capsules=(trunk, high)))
    assert np.asarray(scene.handle("/plant/trunk").vertices)[:, 2].min() == pytest.approx(0.0, abs=0.03)
    assert np.asarray(scene.handle("/plant/post").vertices)[:, 2].min() > 1.3, "of this only the top was seen"


def test_what_was_cut_before_anybody_looked_is_gone_without_a_fall(scene: Drawn) -> None:
    scene.show_canes((cane(0.2),))
    at_work(scene, "DONE")
    assert highest(scene, 0.2) == pytest.approx(0.9, abs=0.008) and falling(scene, "plant") is None


def test_a_cane_that_is_seen_to_stand_after_its_cut_is_drawn_again(scene: Drawn) -> None:
    scene.show_canes((cane(0.2),))
    at_work(scene, "CUTTING")
    at_work(scene, "CUTTING", "DONE")
    at_work(scene, "FAILED_NOT_CUT", "DONE")
    assert highest(scene, 0.2) == pytest.approx(1.8, abs=0.008)


def test_of_canes_that_cross_at_the_cut_only_the_one_that_was_cut_is_gone(scene: Drawn) -> None:
    across = tuple((float(x), 0.81, 0.9) for x in np.linspace(-0.3, 0.7, 9))
    beside = cane(0.235)
    scene.show_canes((across, cane(0.2), beside))
    at_work(scene, "DONE")
    assert highest(scene, 0.235) == pytest.approx(1.8, abs=0.008)
    assert highest(scene, 0.7) == pytest.approx(0.9, abs=0.008), "the one that lies across is whole"
    assert highest(scene, 0.2) == pytest.approx(0.9, abs=0.008)
    scene.show_canes((across, cane(0.2, top=0.9), beside))
    assert highest(scene, 0.235) == pytest.approx(1.8, abs=0.008), "nor once perception knows of the cut"


def row(revision: int, *rods: Capsule) -> Scenery:
    return Scenery(header=m.Header(), revision=revision, capsules=rods)


def test_what_the_simulator_severed_falls_too_and_another_row_does_not(scene: Drawn) -> None:
    foot = Capsule("cane", (0.2, 0.8, 0.5), (0.2, 0.8, 1.0), 0.005, 0.005)
    tip = Capsule("cane", (0.2, 0.8, 1.0), (0.2, 0.8, 1.5), 0.005, 0.004)
    post = Capsule("post", (1.0, 0.8, 0.0), (1.0, 0.8, 2.0), 0.05, 0.05)
    scene.show_row(row(0, foot, tip, post), now=100.0)
    assert falling(scene, "row") is None
    short = Capsule("cane", (0.2, 0.8, 0.5), (0.2, 0.8, 0.9), 0.005, 0.005)
    scene.show_row(row(1, short, post), now=101.0)
    piece = falling(scene, "row")
    heights = np.asarray(piece.vertices)[:, 2]
    assert (heights.min(), heights.max()) == (pytest.approx(0.9, abs=0.008), pytest.approx(1.5, abs=0.008))
    assert np.asarray(scene.handle("/row/cane").vertices)[:, 2].max() == pytest.approx(0.9, abs=0.008)
    scene.falling.step(102.0)
    assert late_view(scene) >= {"/row/cane", "/row/post"} and falling(scene, "row") is None
    scene.show_row(row(40, post), now=103.0)
    scene.show_row(row(0, foot, tip, post), now=104.0)
    assert falling(scene, "row") is None


# --- what wind and arm displace --------------------------------------------------------------------------------------

STANDS = (
    Capsule("cane", (0.2, 0.8, 0.5), (0.2, 0.8, 1.0), 0.005, 0.005),
    Capsule("post", (1.0, 0.8, 0.0), (1.0, 0.8, 2.0), 0.05, 0.05),
    Capsule("cane", (0.2, 0.8, 1.0), (0.2, 0.8, 1.5), 0.005, 0.004),
)


def blown(x: float, *indices: int, revision: int = 0) -> SceneryMotion:
    """These capsules, so far aside at their ends."""
    moved = tuple(MovedCapsule(index, STANDS[index].start, (0.2 + x, 0.8, STANDS[index].end[2])) for index in indices)
    return SceneryMotion(header=m.Header(), revision=revision, moved=moved)


def reach(scene: Drawn, name: str) -> tuple[float, float]:
    """The lowest and the highest place of a mesh of the simulated row (m)."""
    heights = np.asarray(scene.handle(f"/row/{name}").vertices)[:, 2]
    return float(heights.min()), float(heights.max())


def test_blown_canes_are_drawn_where_they_are_and_no_longer_where_they_stood(scene: Drawn) -> None:
    scene.show_row_motion(blown(0.03, 2))
    scene.show_row(row(0, *STANDS), now=100.0)
    assert late_view(scene).isdisjoint({"/row/moved cane"})
    scene.show_row_motion(blown(0.03, 2))
    assert np.asarray(scene.handle("/row/moved cane").vertices)[:, 0].max() == pytest.approx(0.23, abs=0.01)
    assert reach(scene, "moved cane") == (pytest.approx(1.0, abs=0.01), pytest.approx(1.5, abs=0.01))
    assert reach(scene, "cane")[1] == pytest.approx(1.0, abs=0.01)
    scene.show_row_motion(blown(0.0))
    assert scene.handle("/row/moved cane") is None and reach(scene, "cane")[1] == pytest.approx(1.5, abs=0.01)


def test_of_canes_that_go_on_swaying_only_the_vertices_are_sent_again(scene: Drawn) -> None:
    scene.show_row(row(0, *STANDS), now=100.0)
    scene.show_row_motion(blown(0.03, 0, 2))
    mesh, rest, kept = scene.handle("/row/moved cane"), scene.handle("/row/cane"), None
    still = np.array(rest.vertices)
    for x in (0.02, 0.01, -0.01):
        scene.show_row_motion(blown(x, 0, 2))
        assert scene.handle("/row/moved cane") is mesh and scene.handle("/row/cane") is rest
        assert np.asarray(mesh.vertices)[:, 0].min() == pytest.approx(min(0.2, 0.2 + x), abs=0.01)
        kept = kept or len(scene.kept())
        assert len(scene.kept()) == kept, "a view that opens later gets the newest motion alone"
    assert np.array_equal(rest.vertices, still)


def test_a_motion_of_another_revision_waits_for_its_row_and_a_cut_row_begins_at_rest(scene: Drawn) -> None:
    scene.show_row(row(0, *STANDS), now=100.0)
    scene.show_row_motion(blown(0.03, 2))
    drawn = np.array(scene.handle("/row/moved cane").vertices)
    scene.show_row_motion(blown(0.02, 0, revision=1))
    assert np.array_equal(scene.handle("/row/moved cane").vertices, drawn)
    scene.show_row(row(1, *STANDS[:2]), now=101.0)
    assert scene.handle("/row/moved cane") is None and reach(scene, "cane")[1] == pytest.approx(1.0, abs=0.01)
    scene.show_row_motion(blown(0.02, 0, revision=1))
    assert reach(scene, "moved cane") == (pytest.approx(0.5, abs=0.01), pytest.approx(1.0, abs=0.01))


def test_after_a_cut_wood_of_another_kind_that_had_moved_stands_where_it_stood(scene: Drawn) -> None:
    node = Capsule("node", (0.2, 0.8, 1.0), (0.2, 0.8, 1.02), 0.006, 0.006)
    scene.show_row(row(0, STANDS[0], node, STANDS[2]), now=100.0)
    moved = tuple(MovedCapsule(index, (0.23, 0.8, 1.0), (0.23, 0.8, 1.02)) for index in (1, 2))
    scene.show_row_motion(SceneryMotion(header=m.Header(), revision=0, moved=moved))
    assert reach(scene, "node")[1] - reach(scene, "node")[0] < 1e-6
    scene.show_row(row(1, STANDS[0], node), now=101.0)
    assert reach(scene, "node") == (pytest.approx(0.995, abs=0.01), pytest.approx(1.02, abs=0.01))
    assert scene.handle("/row/moved node") is None and scene.handle("/row/moved cane") is None


def test_a_row_at_rest_that_is_told_again_sends_nothing(scene: Drawn) -> None:
    scene.show_row(row(0, *STANDS), now=100.0)
    before = [id(each) for each in scene.kept()]
    scene.show_row(row(0, *STANDS), now=102.0)
    assert [id(each) for each in scene.kept()] == before
    scene.show_row_motion(blown(0.03, 2))
    mesh = scene.handle("/row/moved cane")
    scene.show_row(row(0, *STANDS), now=104.0)
    assert scene.handle("/row/moved cane") is mesh, "nor does it end a motion"
