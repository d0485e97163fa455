"""Files with a row and its truth: JSON, lengths in metres."""

from pathlib import Path

import msgspec
import numpy as np

from bridge.sim.vineyard.config import VineyardConfig
from bridge.sim.vineyard.row import Array, Rod, Row
from bridge.sim.vineyard.truth import RightCut, judge, judge_guyot
from rolling_panda.errors import ConfigError, InputError
from rolling_panda.messages.types import Vector3, WoodClass
from rolling_panda.model.wire_values import vector3

_FORMAT = "rolling-panda vineyard 1"


class _Rod(msgspec.Struct, frozen=True, forbid_unknown_fields=True, array_like=True):
    kind: WoodClass
    start: Vector3
    end: Vector3
    start_radius: float
    end_radius: float
    parent: int
    vine: int
    spur: int
    cane: int


class _Right(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    kind: str
    vine: int
    spur: int
    cane: int
    rod: int
    least: Vector3
    best: Vector3
    most: Vector3


class _File(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    format: str
    seed: int
    config: VineyardConfig
    revision: int
    rods: tuple[_Rod | None, ...]
    backdrop: tuple[_Rod, ...]
    truth: list[_Right]


class Vineyard(msgspec.Struct, frozen=True):
    """A row with its seed and configuration.

    Attributes:
        seed: Random seed of the row.
        config: Configuration of the row.
        row: Current row.
    """

    seed: int
    config: VineyardConfig
    row: Row


def save(path: Path, vineyard: Vineyard) -> None:
    """Write a row without what lies on the ground; an uncut one with its truth.

    Args:
        path: File to write.
        vineyard: The row.

    Raises:
        ConfigError: The file cannot be written.
    """
    row = vineyard.row
    document = _File(
        format=_FORMAT,
        seed=vineyard.seed,
        config=vineyard.config,
        revision=row.revision,
        rods=tuple(None if rod is None else _encoded(rod) for rod in row.rods),
        backdrop=tuple(_encoded(rod) for rod in row.backdrop),
        truth=_truth(vineyard) if row.revision == 0 else [],
    )
    try:
        path.write_bytes(msgspec.json.encode(document))
    except OSError as error:
        raise ConfigError(f"cannot write {path}: {error.strerror}; give a file in a folder that exists") from error


def load(path: Path) -> Vineyard:
    """Read a row back.

    Args:
        path: As written by `save`.

    Raises:
        InputError: It is not there or not such a file.
    """
    try:
        document = msgspec.json.decode(path.read_bytes(), type=_File)
    except (OSError, msgspec.MsgspecError) as error:
        raise InputError(f"{path} is not a vineyard file: {error}") from error
    if document.format != _FORMAT:
        raise InputError(f"{path} has format {document.format!r}; this version reads {_FORMAT!r}")
    rods = tuple(None if rod is None else _decoded(rod) for rod in document.rods)
    for index, rod in enumerate(rods):
        if rod is not None and rod.parent >= index:
            raise InputError(f"{path}: rod {index} has parent {rod.parent}; parents come before their children")
    row = Row(rods, document.revision, tuple(_decoded(rod) for rod in document.backdrop))
    return Vineyard(document.seed, document.config, row)


def cut_positions(vineyard: Vineyard) -> Array:
    """Best position of every right cut (N×3, m, world)."""
    return np.array([cut.best for cut in _truth(vineyard)]).reshape(-1, 3)


def _encoded(rod: Rod) -> _Rod:
    start, end = vector3(rod.start), vector3(rod.end)
    radii = float(rod.start_radius), float(rod.end_radius)
    return _Rod(rod.kind, start, end, *radii, rod.parent, rod.vine, rod.spur, rod.cane)


def _decoded(rod: _Rod) -> Rod:
    start, end = np.array(rod.start), np.array(rod.end)
    return Rod(rod.kind, start, end, rod.start_radius, rod.end_radius, rod.parent, rod.vine, rod.spur, rod.cane)


def _truth(vineyard: Vineyard) -> list[_Right]:
    """All right cuts."""
    out: list[_Right] = []
    if vineyard.config.training == "guyot":
        for vine in judge_guyot(vineyard.row):
            out += _right(vine.vine, 0, vine.lower, "spur cut", vine.spur_cut)
            out += _right(vine.vine, 0, vine.upper, "cane cut", vine.cane_cut)
            out += _right(vine.vine, 0, -1, "removal", vine.removal)
        return out
    for spur in judge(vineyard.row):
        out += _right(spur.vine, spur.spur, spur.keeper, "spur cut", spur.cut)
        out += _right(spur.vine, spur.spur, -1, "renewal cut", spur.renewal)
    return out


def _right(vine: int, spur: int, cane: int, kind: str, cut: RightCut | None) -> list[_Right]:
    if cut is None:
        return []
    return [_Right(kind, vine, spur, cane, cut.rod, vector3(cut.least), vector3(cut.best), vector3(cut.most))]
