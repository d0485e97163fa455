import time
from multiprocessing import active_children

import numpy as np
import pytest

from bridge.core.picture import Picture
from bridge.sim.camera.config import CameraConfig
from bridge.sim.camera.render_process import CameraRenderer, RenderProcess
from bridge.sim.camera.renderer import InlineRenderer
from bridge.sim.vineyard.row import Rod, Row

pytestmark = pytest.mark.paced

LENS = CameraConfig(width=64, height=48)
ROW = Row((Rod("post", np.array([0.0, 1.0, 0.0]), np.array([0.0, 1.0, 2.0]), 0.05, 0.05),))
# From (0, 0, 1) along +y, upright.
EYE = np.array([[1.0, 0, 0, 0], [0, 0, 1, 0], [0, -1, 0, 1], [0, 0, 0, 1]])


def wait(renderer: CameraRenderer) -> Picture:
    end = time.monotonic() + 20
    while time.monotonic() < end:
        picture = renderer.ready()
        if picture is not None:
            return picture
        time.sleep(0.005)
    raise AssertionError("no picture came")


@pytest.mark.long
def test_beside_the_physics_the_pictures_are_the_same_and_a_killed_renderer_comes_back() -> None:
    others = set(active_children())
    inline, beside = InlineRenderer(LENS, 7), RenderProcess(LENS, 7)
    try:
        for row in (ROW, ROW, Row(())):
            assert inline.expose(row, EYE, 0.0, np.zeros(6))
            assert beside.expose(row, EYE, 0.0, np.zeros(6))
            assert not beside.expose(row, EYE, 0.0, np.zeros(6))
            assert wait(beside) == inline.ready()
            assert inline.ready() is None
            assert beside.ready() is None
        (process,) = set(active_children()) - others
        process.kill()
        assert beside.expose(ROW, EYE, 0.0, np.zeros(6))
        assert wait(beside).intrinsics == LENS.intrinsics()
    finally:
        beside.close()
        beside.close()
    assert set(active_children()) <= others
