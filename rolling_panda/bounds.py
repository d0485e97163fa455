"""Hard bounds of the numbers of safety: part of a field's type, so that no configuration can leave them.

A field says `Annotated[float, at_most(0.2)]` and what is usual as its default. A value on the safe side of the default
is taken without a word; one between default and bound is taken, and `wider` says it; one outside is refused.
"""

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Annotated, Any, Literal, get_args, get_origin, get_type_hints

from msgspec import Meta, Struct, structs

from rolling_panda.errors import ConfigError

_SAFETY = "safety"


@dataclass(frozen=True)
class Bound:
    """What a number of safety may be.

    Attributes:
        low: Smallest value; 0 itself is not allowed.
        high: Largest value.
        safer: Which side of the usual value is the stricter one.
        or_zero: 0 is allowed too, and means that another source has the number.
        switch: It is true or false, 1 or 0 in the other attributes.
    """

    low: float
    high: float
    safer: Literal["less", "more", "neither"]
    or_zero: bool = False
    switch: bool = False

    def allows(self, value: float) -> bool:
        """Whether a value may be set at all."""
        if self.switch:
            return self.low <= value <= self.high
        return (self.or_zero and value == 0.0) or (self.low <= value <= self.high and (value > 0.0 or self.low < 0.0))

    def wider(self, value: float, usual: float) -> bool:
        """Whether a value that is allowed is less strict than the usual one."""
        if self.safer == "neither":
            return False
        return value > usual if self.safer == "less" else value < usual

    def __str__(self) -> str:
        """In words."""
        if self.switch:
            return "true or false" if self.low < self.high else "true" if self.low else "false"
        span = (
            f"from {self.low:.10g} to {self.high:.10g}" if self.low != 0.0 else f"more than 0, at most {self.high:.10g}"
        )
        return f"0 or {span}" if self.or_zero else span


def at_most(high: float, low: float = 0.0) -> Meta:
    """A number that is safer the smaller it is: more than 0, or from `low` on, up to `high`."""
    return _meta(Bound(low, high, "less"))


def at_least(low: float, high: float) -> Meta:
    """A number that is safer the larger it is, from `low` to `high`."""
    return _meta(Bound(low, high, "more"))


def within(low: float, high: float, or_zero: bool = False) -> Meta:
    """A number that is right or wrong, as a calibration: from `low` to `high`, or 0 where that means "not measured"."""
    return _meta(Bound(low, high, "neither", or_zero))


def always_on() -> Meta:
    """A switch that no configuration may turn off."""
    return Meta(extra={_SAFETY: Bound(1.0, 1.0, "more", switch=True)})


def usually_on() -> Meta:
    """A switch that a configuration may turn off, which is said."""
    return Meta(extra={_SAFETY: Bound(0.0, 1.0, "more", switch=True)})


def _meta(bound: Bound) -> Meta:
    low = 0.0 if bound.or_zero else bound.low
    extra = {_SAFETY: bound}
    if low == 0.0 and not bound.or_zero:
        return Meta(gt=0.0, le=bound.high, extra=extra)
    return Meta(ge=low, le=bound.high, extra=extra)


@dataclass(frozen=True)
class Number:
    """A number of safety as a section has it.

    Attributes:
        name: Key, with those of inner sections before it: `base.deadline_s`, `home[3]`.
        value: As set.
        usual: Its default.
        bound: What it may be.
    """

    name: str
    value: float
    usual: float
    bound: Bound


def numbers(config: Struct) -> Iterator[Number]:
    """Every number of safety of a section, in the order of its keys."""
    yield from _numbers(config, type(config)(), "")


def _numbers(config: Struct, usual: Struct, prefix: str) -> Iterator[Number]:
    hints = get_type_hints(type(config), include_extras=True)
    for field in structs.fields(type(config)):
        value, default, hint = getattr(config, field.name), getattr(usual, field.name), hints[field.name]
        if isinstance(value, Struct):
            yield from _numbers(value, default, f"{prefix}{field.encode_name}.")
        elif get_origin(hint) is tuple:
            for i, (each, one, kind) in enumerate(zip(value, default, _kinds(hint, len(value)), strict=True)):
                bound = bound_of(kind)
                if bound is not None:
                    yield Number(f"{prefix}{field.encode_name}[{i}]", each, one, bound)
        else:
            bound = bound_of(hint)
            if bound is not None:
                yield Number(prefix + field.encode_name, value, default, bound)


def _kinds(hint: Any, count: int) -> tuple[Any, ...]:
    arguments = get_args(hint)
    return (arguments[0],) * count if arguments[-1] is Ellipsis else arguments


def bound_of(hint: Any) -> Bound | None:
    """The bound that an annotation carries."""
    for meta in _metas(hint):
        bound = (meta.extra or {}).get(_SAFETY)
        if isinstance(bound, Bound):
            return bound
    return None


def _metas(hint: Any) -> tuple[Meta, ...]:
    metas = get_args(hint)[1:] if get_origin(hint) is Annotated else ()
    return tuple(meta for meta in metas if isinstance(meta, Meta))


def wider(section: str, config: Struct) -> tuple[str, ...]:
    """Each number of safety of a section that is less strict than usual, in words."""
    return tuple(
        f"[{section}] {each.name} = {_said(each.value)}, usually {_said(each.usual)} (allowed: {each.bound})"
        for each in numbers(config)
        if each.bound.wider(each.value, each.usual)
    )


def check(where: str, section: str, table: Mapping[str, Any], kind: type[Struct]) -> None:
    """Refuse a value of a configuration file that is outside what its key may be.

    Args:
        where: The file, for the error.
        section: Name of the section or of one inside it.
        table: As read; values of a wrong type are left to the decoder.
        kind: What the section is read into.

    Raises:
        ConfigError: What was got, what is allowed and what to do.
    """
    hints = get_type_hints(kind, include_extras=True)
    defaults = {field.encode_name: field.default for field in structs.fields(kind)}
    for field in structs.fields(kind):
        name = field.encode_name
        if name not in table:
            continue
        value, hint = table[name], hints[field.name]
        if isinstance(hint, type) and issubclass(hint, Struct):
            if isinstance(value, Mapping):
                check(where, f"{section}.{name}", value, hint)
        elif get_origin(hint) is tuple and isinstance(value, list):
            for i, (each, one) in enumerate(zip(value, _kinds(hint, len(value)), strict=False)):
                _check_one(f"{where}: [{section}] {name}[{i}]", each, one, "")
        else:
            _check_one(f"{where}: [{section}] {name}", value, hint, defaults[name])


def _check_one(what: str, value: Any, hint: Any, usual: Any) -> None:
    bound = bound_of(hint)
    # Whatever is of a wrong type is refused by the decoder.
    if isinstance(value, bool) != (bound is not None and bound.switch) or not isinstance(value, int | float):
        return
    if bound is not None:
        if bound.allows(value):
            return
        allowed, why = str(bound), ": the program itself has this bound, for safety"
    else:
        outside = [_limits(meta) for meta in _metas(hint) if _is_outside(value, meta)]
        if not outside and math.isfinite(value):
            return
        allowed, why = outside[0] if outside else "a finite number", ""
    leave = f", or leave the line out for the usual {_said(usual)}" if isinstance(usual, int | float) else ""
    raise ConfigError(f"{what} is {_said(value)}; allowed is {allowed}{why}. Choose such a value{leave}.")


def _is_outside(value: float, meta: Meta) -> bool:
    return not all(
        (
            meta.gt is None or value > meta.gt,
            meta.ge is None or value >= meta.ge,
            meta.lt is None or value < meta.lt,
            meta.le is None or value <= meta.le,
        )
    )


def _limits(meta: Meta) -> str:
    pairs = (("more than", meta.gt), ("at least", meta.ge), ("less than", meta.lt), ("at most", meta.le))
    return ", ".join(f"{word} {limit:g}" for word, limit in pairs if limit is not None)


def _said(value: Any) -> str:
    if isinstance(value, bool):
        return str(value).lower()
    return f"{value:.10g}" if isinstance(value, float) else str(value)
