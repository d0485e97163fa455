"""Hard bounds of the safety values. A bound is part of a field's type, so that no configuration can go beyond it.

A field is annotated with `Annotated[float, at_most(0.2)]`; its default is the usual value. A value as strict as the
default or stricter is accepted. A value between default and bound is accepted and reported by `wider`. A value outside
is refused.
"""

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Annotated, Any, Literal, get_args, get_origin, get_type_hints

from msgspec import Meta, Struct, structs

from rolling_panda import reasons
from rolling_panda.errors import ConfigError
from rolling_panda.messages.types import Reason

_SAFETY = "safety"


@dataclass(frozen=True)
class Bound:
    """Allowed range of a safety value.

    Attributes:
        low: Smallest value; 0 itself is not allowed.
        high: Largest value.
        safer: Stricter side of the usual value.
        or_zero: Whether 0 is allowed too; it means that the value comes from another source.
        switch: Whether the value is a bool, with 1 or 0 in the other attributes.
    """

    low: float
    high: float
    safer: Literal["less", "more", "neither"]
    or_zero: bool = False
    switch: bool = False

    def allows(self, value: float) -> bool:
        """Whether a value is allowed."""
        if self.switch:
            return self.low <= value <= self.high
        return (self.or_zero and value == 0.0) or (self.low <= value <= self.high and (value > 0.0 or self.low < 0.0))

    def wider(self, value: float, usual: float) -> bool:
        """Whether an allowed value is less strict than the usual one."""
        if self.safer == "neither":
            return False
        return value > usual if self.safer == "less" else value < usual

    def __str__(self) -> str:
        """Range as text."""
        if self.switch:
            return "true or false" if self.low < self.high else "true" if self.low else "false"
        span = (
            f"from {self.low:.10g} to {self.high:.10g}" if self.low != 0.0 else f"more than 0, at most {self.high:.10g}"
        )
        return f"0 or {span}" if self.or_zero else span


def at_most(high: float, low: float = 0.0) -> Meta:
    """Bound of a value that is stricter the smaller it is: more than 0, or at least `low`, and at most `high`."""
    return _meta(Bound(low, high, "less"))


def at_least(low: float, high: float) -> Meta:
    """Bound of a value that is stricter the larger it is, from `low` to `high`."""
    return _meta(Bound(low, high, "more"))


def within(low: float, high: float, or_zero: bool = False) -> Meta:
    """Bound of a value without a stricter side, such as a calibration: `low` to `high`, or 0 for "not measured"."""
    return _meta(Bound(low, high, "neither", or_zero))


def always_on() -> Meta:
    """Bound of a switch that no configuration can turn off."""
    return Meta(extra={_SAFETY: Bound(1.0, 1.0, "more", switch=True)})


def usually_on() -> Meta:
    """Bound of a switch that a configuration can turn off; `wider` reports it."""
    return Meta(extra={_SAFETY: Bound(0.0, 1.0, "more", switch=True)})


def _meta(bound: Bound) -> Meta:
    low = 0.0 if bound.or_zero else bound.low
    extra = {_SAFETY: bound}
    if low == 0.0 and not bound.or_zero:
        return Meta(gt=0.0, le=bound.high, extra=extra)
    return Meta(ge=low, le=bound.high, extra=extra)


@dataclass(frozen=True)
class Number:
    """A safety value of a section.

    Attributes:
        name: Key, prefixed by the keys of its sections: `base.deadline_s`, `home[3]`.
        value: Current value.
        usual: Default.
        bound: Allowed range.
    """

    name: str
    value: float
    usual: float
    bound: Bound


def numbers(config: Struct) -> Iterator[Number]:
    """All safety values of a section, in the order of its keys."""
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


def wider(section: str, config: Struct) -> tuple[Reason, ...]:
    """The safety values of a section that are less strict than usual."""
    found = []
    for each in numbers(config):
        key, bound = f"[{section}] {each.name}", each.bound
        if not bound.wider(each.value, each.usual):
            continue
        if bound.switch:
            found.append(reasons.safeguard_off(key))
        elif bound.safer == "less":
            found.append(reasons.limit_raised(key, each.value, each.usual, bound.high))
        else:
            found.append(reasons.limit_lowered(key, each.value, each.usual, bound.low))
    return tuple(found)


def check(where: str, section: str, table: Mapping[str, Any], kind: type[Struct]) -> None:
    """Refuse values of a configuration file that are out of range.

    Args:
        where: File, for the error.
        section: Name of the section or subsection.
        table: Parsed section; the decoder checks the types of its values.
        kind: Type of the section.

    Raises:
        ConfigError: A value is out of range. The text has the value, the range and the remedy.
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
    if get_origin(hint) is Literal and isinstance(value, str) and value not in get_args(hint):
        raise ConfigError(f"{what} is {value!r}; known are {', '.join(map(str, get_args(hint)))}")
    bound = bound_of(hint)
    # The decoder refuses values of a wrong type.
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
    leave = f", or leave the line out for the usual {_shown(usual)}" if isinstance(usual, int | float) else ""
    raise ConfigError(f"{what} is {_shown(value)}; allowed is {allowed}{why}. Choose such a value{leave}.")


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


def _shown(value: Any) -> str:
    if isinstance(value, bool):
        return str(value).lower()
    return f"{value:.10g}" if isinstance(value, float) else str(value)
