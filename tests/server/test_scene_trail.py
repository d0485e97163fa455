from types import SimpleNamespace

import numpy as np

from server.scene.trail import SceneTrail


def drawn_by():
    drawn = []
    scene = SimpleNamespace(add_line_segments=lambda name, points, **looks: drawn.append((points, looks["colors"])))
    return SceneTrail(SimpleNamespace(scene=scene)), drawn


def test_the_trail_grows_as_the_tool_goes_and_noise_adds_nothing():
    trail, drawn = drawn_by()
    assert trail.take((0.0, 0.0, 1.0))
    assert not trail.take((0.001, 0.0, 1.0)) and drawn == []
    assert trail.take((0.02, 0.0, 1.0))
    points, colors = drawn[-1]
    assert np.allclose(points, [[[0.0, 0.0, 1.0], [0.02, 0.0, 1.0]]])
    assert colors.shape == (1, 2, 3) and colors[0, 1].sum() > colors[0, 0].sum(), "the newest is the brightest"


def test_what_is_long_ago_goes():
    trail, drawn = drawn_by()
    for step in range(500):
        trail.take((0.02 * step, 0.0, 1.0))
    points, _ = drawn[-1]
    assert len(points) < 250 and points[-1, 1, 0] > 9.9 and points[0, 0, 0] > 4.0
