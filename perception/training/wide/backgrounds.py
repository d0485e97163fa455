"""Real pictures without vines that stand behind drawn ones."""

from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from rolling_panda.errors import InputError

#: Pictures are kept at most this wide (px).
_WIDTH, _SUFFIXES = 1280, (".jpg", ".jpeg", ".png", ".webp")


def load_backgrounds(folder: Path | None) -> tuple[NDArray[np.uint8], ...]:
    """All pictures of a folder in the order of their names; none without a folder.

    Raises:
        InputError: It holds no picture, or one that cannot be read.
    """
    if folder is None:
        return ()
    files = sorted(path for path in folder.glob("*") if path.suffix.lower() in _SUFFIXES)
    if not files:
        raise InputError(f"{folder} holds no picture; give a folder with {', '.join(_SUFFIXES)} files")
    out = []
    for path in files:
        try:
            with Image.open(path) as image:
                image.thumbnail((_WIDTH, _WIDTH))
                out.append(np.asarray(image.convert("RGB"), dtype=np.uint8))
        except (OSError, SyntaxError, ValueError) as error:
            raise InputError(f"cannot read the picture {path}: {error}") from error
    return tuple(out)
