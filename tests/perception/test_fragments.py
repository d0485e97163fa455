"""Fragments of cane."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from perception.skeleton.fragments import _nearest

SIDE = 24


@given(st.integers(0, 2**32 - 1), st.integers(1, 12), st.integers(1, 40))
def test_every_pixel_joins_a_nearest_pixel_of_the_skeleton_near_or_far(seed, bones, pixels):
    draw = np.random.default_rng(seed)
    bone = np.stack(np.divmod(draw.choice(SIDE**2, bones, replace=False), SIDE), axis=1)
    pixel = draw.integers(0, SIDE, (pixels, 2))
    found = _nearest((SIDE, SIDE), *bone.T, *pixel.T)
    squared = ((pixel[:, None] - bone[None]) ** 2).sum(axis=2)
    assert (squared[np.arange(pixels), found] == squared.min(axis=1)).all()
