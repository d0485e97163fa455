"""Where the program's data lies: the checkout's folders, or the copies that the wheel carries."""

from functools import cache
from importlib import metadata
from pathlib import Path

from rolling_panda.errors import ModelError

_PACKAGE = Path(__file__).resolve().parent


def resource(name: str) -> Path:
    """Path of `assets/...` or `web/...`, in a checkout or installed.

    Raises:
        ModelError: There is no such file in this installation.
    """
    for root in (_PACKAGE.parent, _PACKAGE / "data"):
        path = root / name
        if path.exists():
            return path
    raise ModelError(f"{name} is not part of this installation; install rolling-panda again")


@cache
def panda_description() -> Path:
    """Folder `panda_description` of the example-robot-data wheel: urdf/, meshes/, srdf/.

    Located through the wheel's file list, since the wheel holds models only and cannot be imported.

    Raises:
        ModelError: The wheel is not installed.
    """
    try:
        files = metadata.files("example-robot-data") or []
    except metadata.PackageNotFoundError as error:
        raise ModelError("example-robot-data is not installed; run: pip install example-robot-data") from error
    for file in files:
        if file.parts[-3:] == ("panda_description", "urdf", "panda.urdf"):
            return Path(str(file.locate())).resolve().parents[1]
    raise ModelError("this example-robot-data has no panda_description/urdf/panda.urdf; install version 6")
