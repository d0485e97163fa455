"""Real pictures without vines that stand behind drawn ones, each with its licence."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from rolling_panda.errors import InputError

#: Pictures are kept at most this wide (px).
_WIDTH, _SUFFIXES = 1280, (".jpg", ".jpeg", ".png", ".webp")
#: In the folder: a line for each picture, `NAME: author, licence`.
_LICENCES = "LICENCES.txt"


@dataclass(frozen=True)
class Background:
    """A picture (H×W×3), its file's name, and its author and licence."""

    name: str
    credit: str
    picture: NDArray[np.uint8]


def load_backgrounds(folder: Path | None) -> tuple[Background, ...]:
    """All pictures of a folder in the order of their names; none without a folder.

    Raises:
        InputError: It holds no picture, one that cannot be read, or one without a licence in LICENCES.txt.
    """
    if folder is None:
        return ()
    files = sorted(path for path in folder.glob("*") if path.suffix.lower() in _SUFFIXES)
    if not files:
        raise InputError(f"{folder} holds no picture; give a folder with {', '.join(_SUFFIXES)} files")
    credits = _credits(folder / _LICENCES)
    out = []
    for path in files:
        if path.name not in credits:
            raise InputError(
                f"{path} has no licence; add a line '{path.name}: author, licence' to {folder / _LICENCES}"
            )
        try:
            with Image.open(path) as image:
                image.thumbnail((_WIDTH, _WIDTH))
                out.append(Background(path.name, credits[path.name], np.asarray(image.convert("RGB"), dtype=np.uint8)))
        except (OSError, SyntaxError, ValueError) as error:
            raise InputError(f"cannot read the picture {path}: {error}") from error
    return tuple(out)


def _credits(path: Path) -> dict[str, str]:
    try:
        lines = path.read_text(encoding="utf-8").splitlines()
    except FileNotFoundError:
        return {}
    except (OSError, ValueError) as error:
        raise InputError(f"cannot read {path}: {error}") from error
    pairs = (line.partition(":") for line in lines if line.strip())
    return {name.strip(): credit.strip() for name, _, credit in pairs if credit.strip()}
