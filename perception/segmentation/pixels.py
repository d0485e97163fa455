"""Where in an image the pixels of some classes are."""

import numpy as np
from numpy.typing import NDArray

Index = NDArray[np.intp]


def pixels_of(labels: NDArray[np.uint8], kinds: tuple[int, ...]) -> tuple[Index, Index]:
    """Rows and columns of all pixels of some classes, row by row.

    Most of an image is of no class that anyone asks for, so that a mask of bytes is all that is made of its whole size.

    Args:
        labels: H×W class indices.
        kinds: At least one class.
    """
    mask = labels == kinds[0]
    for kind in kinds[1:]:
        mask |= labels == kind
    rows, cols = np.divmod(np.flatnonzero(mask), labels.shape[1])
    return rows, cols
