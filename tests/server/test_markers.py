"""Markers of pruning points: a shape for each state, as large on the screen at every distance."""

import asyncio
import math
from contextlib import nullcontext
from types import SimpleNamespace
from typing import Any, get_args

import numpy as np
import pytest

from rolling_panda import messages as m
from rolling_panda import reasons
from rolling_panda.messages.perception import UndecidedSite
from server.scene.marker_shapes import MARKERS, SHAPE_OF
from server.scene.markers import CHOSEN_PX, MARKER_PX, PointMarkers
from tests.support.played_server import point

HEIGHT, FOV = 800, 0.82


class FakeScene:
    """Keeps the nodes as viser does."""

    def __init__(self) -> None:
        self.nodes: dict[str, Any] = {}
        self.drawings = 0

    def get_handle_by_name(self, name: str) -> Any:
        return self.nodes.get(name)

    def remove_by_name(self, name: str) -> None:
        self.nodes.pop(name, None)

    def _add(self, name: str, *_: Any, **looks: Any) -> Any:
        self.drawings += 1
        node = SimpleNamespace(**looks, clicked=None)
        node.on_click = lambda callback: setattr(node, "clicked", callback)
        self.nodes[name] = node
        return node

    add_batched_meshes_simple = add_mesh_simple = _add


def view(client_id: int = 1, ratio: float = 1.0) -> Any:
    camera = SimpleNamespace(
        position=np.array([0.0, -2.0, 1.0]), wxyz=np.array([1.0, 0, 0, 0]), fov=FOV, image_height=round(HEIGHT * ratio)
    )
    return SimpleNamespace(client_id=client_id, camera=camera, scene=FakeScene(), atomic=nullcontext)


def shown(*rows: Any, ratio: float = 1.0, sites: tuple[UndecidedSite, ...] = ()) -> tuple[PointMarkers, Any, list[Any]]:
    clicks: list[Any] = []
    markers, one = PointMarkers(lambda *click: clicks.append(click)), view(ratio=ratio)
    markers.attach(one, ratio, True, "")
    markers.show(rows, sites)
    markers.step(1.0)
    return markers, one, clicks


def pixels(one: Any, name: str) -> np.ndarray:
    """Widths (CSS px) of the markers of a shape on the screen of a view."""
    node = one.scene.nodes[name]
    far = np.linalg.norm(np.asarray(node.batched_positions) - one.camera.position, axis=1)
    across: np.ndarray = np.asarray(node.batched_scales) / (2 * far * math.tan(FOV / 2)) * HEIGHT
    return across


@pytest.mark.parametrize("ratio", [1.0, 1.5])
@pytest.mark.parametrize("away", [0.3, 2.0, 9.0])
def test_a_marker_is_as_large_as_a_finger_needs_at_every_distance(away: float, ratio: float) -> None:
    markers, one, _ = shown(point(1, "PROPOSED"), point(2, "PROPOSED"), ratio=ratio)
    one.camera.position = np.array([0.3, 0.8 - away, 1.0])
    markers.step(2.0)
    assert (pixels(one, "/markers/proposed/white") > 32.0).all()
    assert (pixels(one, "/markers/proposed/white") < 1.2 * MARKER_PX).all()


def test_every_state_has_a_shape_and_the_five_that_matter_differ() -> None:
    assert set(SHAPE_OF) == set(get_args(m.PointState))
    five = [SHAPE_OF[state] for state in ("PROPOSED", "ACCEPTED", "UNREACHABLE", "DONE", "UNKNOWN")]
    assert len(set(five)) == 5
    outlines = {MARKERS[shape].white.vertices.tobytes() for shape in five}
    assert len(outlines) == 5
    for marker in MARKERS.values():
        for layer in (marker.white, marker.tint):
            assert layer.faces.max() < len(layer.vertices) and np.abs(layer.vertices).max() < 0.6


def test_a_point_changes_its_shape_with_its_state() -> None:
    markers, one, _ = shown(point(1, "PROPOSED"))
    markers.show([point(1, "ACCEPTED")])
    markers.step(2.0)
    assert set(one.scene.nodes) == {"/markers/accepted/white", "/markers/accepted/tint"}


def test_a_place_to_decide_is_marked_and_one_that_needs_another_look_is_not() -> None:
    why = reasons.not_queued_yet()
    sites = tuple(UndecidedSite(why, need, 1, 1, (0.5, 0.8, 1.0)) for need in ("operator", "another look"))
    _, one, clicks = shown(sites=sites)
    assert len(one.scene.nodes["/markers/decide/tint"].batched_positions) == 1
    asyncio.run(one.scene.nodes["/markers/decide/tint"].clicked(SimpleNamespace(instance_index=0)))
    assert clicks == []


def test_a_click_names_the_point_under_it() -> None:
    markers, one, clicks = shown(point(1, "PROPOSED"), point(2, "PROPOSED"))
    node = one.scene.nodes["/markers/proposed/glass"]
    asyncio.run(node.clicked(SimpleNamespace(instance_index=1)))
    markers.show([])
    asyncio.run(node.clicked(SimpleNamespace(instance_index=0)))
    assert clicks == [(1, "p2")], "a click onto what has just gone is none"


def test_the_chosen_one_is_larger_and_has_a_halo_on_that_view_alone() -> None:
    markers, one, _ = shown(point(1, "PROPOSED"), point(2, "PROPOSED"))
    other = view(2)
    markers.attach(other, 1.0, True, "")
    markers.choose(1, "p2")
    markers.step(2.0)
    first, second = pixels(one, "/markers/proposed/white")
    assert second / first == pytest.approx(CHOSEN_PX / MARKER_PX, rel=0.02)
    assert "/markers/halo" in one.scene.nodes and "/markers/halo" not in other.scene.nodes
    markers.choose(1, "")
    markers.step(3.0)
    assert "/markers/halo" not in one.scene.nodes


def test_a_camera_at_rest_is_sent_nothing_and_one_that_moves_not_too_often() -> None:
    markers, one, _ = shown(point(1, "PROPOSED"))
    node = one.scene.nodes["/markers/proposed/white"]
    before = node.batched_scales
    markers.step(2.0)
    assert node.batched_scales is before
    one.camera.position = one.camera.position + [0.0, 1.0, 0.0]
    markers.step(3.0)
    near = node.batched_scales
    assert near[0] < 0.7 * before[0]
    one.camera.position = one.camera.position - [0.0, 1.0, 0.0]
    markers.step(3.05)
    assert node.batched_scales is near
    markers.step(3.5)
    assert node.batched_scales[0] == pytest.approx(before[0]) and one.scene.drawings == 3, "nothing is made anew"


def test_a_hidden_layer_has_no_markers_until_it_is_shown() -> None:
    markers, one, _ = shown(point(1, "PROPOSED"))
    markers.set_visible(1, False)
    markers.step(2.0)
    assert one.scene.nodes == {}
    markers.set_visible(1, True)
    markers.step(3.0)
    assert "/markers/proposed/white" in one.scene.nodes
