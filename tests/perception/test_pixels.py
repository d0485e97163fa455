"""Pixels of some classes."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import array_shapes, arrays

from perception.segmentation.pixels import pixels_of


@given(
    arrays(np.uint8, array_shapes(min_dims=2, max_dims=2), elements=st.integers(0, 4)),
    st.lists(st.integers(0, 4), min_size=1, max_size=3),
)
def test_all_pixels_of_the_classes_and_no_others_row_by_row(labels, kinds):
    rows, cols = pixels_of(labels, tuple(kinds))
    found = list(zip(rows.tolist(), cols.tolist(), strict=True))
    assert found == [(r, c) for r, c in np.ndindex(labels.shape) if labels[r, c] in kinds]


def test_a_window_of_an_image_counts_from_its_own_corner():
    labels = np.zeros((6, 8), np.uint8)
    labels[3, 5] = 2
    rows, cols = pixels_of(labels[2:5, 4:8], (2,))
    assert (rows.tolist(), cols.tolist()) == ([1], [1])
