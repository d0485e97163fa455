"""The table of every hard bound in `docs/safety.md`, made from the configuration's own types."""

import importlib
from collections.abc import Callable, Iterator

from msgspec import Struct

from rolling_panda.bounds import Bound, Number, numbers
from rolling_panda.generate.description import describe
from rolling_panda.generate.markdown import table

#: Where each section with numbers of safety is. By name: this is a tool of a checkout, which nothing that runs imports,
#: and the processes' packages stay unknown to what they share.
SECTIONS = {
    "robot": ("rolling_panda.config", "RobotConfig"),
    "bridge": ("bridge.config", "BridgeConfig"),
    "real": ("bridge.real.config", "RealConfig"),
    "controller": ("controller.config", "ControllerConfig"),
    "server": ("server.config", "ServerConfig"),
}


_STRICTER = {"less": "smaller", "more": "larger", "neither": "–"}


def section(name: str) -> type[Struct]:
    """The type that a section is read into."""
    module, kind = SECTIONS[name]
    found: type[Struct] = getattr(importlib.import_module(module), kind)
    return found


def bounds() -> str:
    """One row a number of safety."""
    rows = []
    for name in SECTIONS:
        kind = section(name)
        words = dict(_words(kind, ""))
        for key, those in _together(list(numbers(kind()))).items():
            usual = ", ".join(_said(each.usual, each.bound) for each in those)
            each_once = list(dict.fromkeys(str(each.bound) for each in those))
            allowed = each_once[0] if len(each_once) == 1 else ", ".join(str(each.bound) for each in those)
            stricter = _STRICTER[those[0].bound.safer]
            rows.append((f"`[{name}]`", f"`{key}`", usual, allowed, stricter, words[key]))
    return table(("section", "key", "usual", "hard bound", "stricter", "what"), rows)


def _together(those: list[Number]) -> dict[str, list[Number]]:
    """The numbers of an array under one key."""
    out: dict[str, list[Number]] = {}
    for each in those:
        out.setdefault(each.name.split("[")[0], []).append(each)
    return out


def _words(kind: type[Struct], prefix: str) -> Iterator[tuple[str, str]]:
    for field in describe(kind).fields:
        if isinstance(field.hint, type) and issubclass(field.hint, Struct):
            yield from _words(field.hint, f"{prefix}{field.name}.")
        yield prefix + field.name, field.about


def _said(value: float, bound: Bound) -> str:
    return str(bool(value)).lower() if bound.switch else f"{value:.10g}"


BLOCKS: dict[str, Callable[[], str]] = {"bounds": bounds}
