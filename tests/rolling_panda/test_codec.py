"""Every wire message survives the round trip; everything that is not exactly one is refused whole."""

import copy
import math
import re
from collections.abc import Iterator
from functools import cache
from typing import Any, get_args

import msgspec
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from rolling_panda import messages as m
from rolling_panda.errors import MessageError
from rolling_panda.generate.description import reachable
from rolling_panda.reasons import text_of
from rolling_panda.topics import SERVICES, TOPICS
from rolling_panda.transport.codec import StrictDecoder, UndecodableError, encode

KINDS: list[Any] = [topic.message for topic in TOPICS] + [r for s in SERVICES for r in s.requests] + [m.Answer]
DECODERS = {kind: StrictDecoder(kind) for kind in KINDS}
#: Fields that may be None.
OPTIONAL = {
    field.encode_name
    for struct in reachable(KINDS)
    for field in msgspec.structs.fields(struct)
    if type(None) in get_args(field.type)
}
MODEST = settings(max_examples=150, deadline=None)


@cache
def a_struct(cls: type[msgspec.Struct]) -> st.SearchStrategy[Any]:
    """Structs of a type, which may contain others of it."""
    fields = msgspec.inspect.type_info(cls).fields
    return st.deferred(lambda: st.builds(cls, **{field.name: values(field.type) for field in fields}))


def values(info: Any) -> st.SearchStrategy[Any]:
    """Values of a type as msgspec describes it, bounds and all."""
    match info:
        case msgspec.inspect.BoolType():
            return st.booleans()
        case msgspec.inspect.IntType():
            return st.integers(info.ge if info.ge is not None else 0, info.le)
        case msgspec.inspect.FloatType():
            low = info.ge if info.ge is not None else info.gt
            return st.floats(low, info.le, exclude_min=info.gt is not None)
        case msgspec.inspect.StrType() if info.pattern is not None:
            allowed = [letter for letter in "afZ09_.:-" if re.search(info.pattern, letter)]
            return st.text(allowed, min_size=info.min_length or 0, max_size=info.max_length)
        case msgspec.inspect.StrType():
            return st.text(min_size=info.min_length or 0, max_size=min(info.max_length or 20, 20))
        case msgspec.inspect.BytesType():
            return st.binary(max_size=20)
        case msgspec.inspect.NoneType():
            return st.none()
        case msgspec.inspect.LiteralType():
            return st.sampled_from(info.values)
        case msgspec.inspect.TupleType():
            return st.tuples(*(values(item) for item in info.item_types))
        case msgspec.inspect.VarTupleType():
            return st.lists(values(info.item_type), max_size=3).map(tuple)
        case msgspec.inspect.UnionType():
            return st.one_of(*(values(item) for item in info.types))
        case msgspec.inspect.DictType():
            return st.dictionaries(values(info.key_type), values(info.value_type), max_size=3)
        case msgspec.inspect.StructType():
            return a_struct(info.cls)
        case msgspec.inspect.Metadata():
            return values(info.type)
    raise AssertionError(f"a message holds {info}: say here how to make one")


MESSAGES = st.one_of(*(values(msgspec.inspect.type_info(kind)) for kind in KINDS))


def plain(message: Any) -> Any:
    """The maps and lists that go over the wire, to be spoilt."""
    return msgspec.msgpack.decode(encode(message))


def places(tree: Any) -> Iterator[tuple[Any, Any]]:
    """Every (container, key) in a tree."""
    for key in list(tree) if isinstance(tree, dict) else range(len(tree)):
        yield tree, key
        if isinstance(tree[key], dict | list):
            yield from places(tree[key])


def refused(kind: Any, tree: Any) -> None:
    with pytest.raises(MessageError):
        DECODERS[kind].decode(msgspec.msgpack.encode(tree))


@given(MESSAGES)
@MODEST
def test_round_trip(message: Any) -> None:
    assert DECODERS[type(message)].decode(encode(message)) == message


@given(MESSAGES, st.data(), st.sampled_from([math.nan, math.inf, -math.inf, 1e308, True, "1", None]))
@MODEST
def test_a_number_that_is_none_is_refused(message: Any, data: st.DataObject, bad: Any) -> None:
    tree = plain(message)
    numbers = [
        (container, key)
        for container, key in places(tree)
        if isinstance(container[key], int | float) and not isinstance(container[key], bool)
    ]
    if not numbers:
        return
    container, key = data.draw(st.sampled_from(numbers))
    if bad is None and key in OPTIONAL:
        return
    # The value of a reason may be text.
    if bad == "1" and isinstance(container, list) and isinstance(container[0], str):
        return
    container[key] = bad
    refused(type(message), tree)


@given(MESSAGES, st.data())
@MODEST
def test_a_field_that_is_not_in_the_table_is_refused_at_any_depth(message: Any, data: st.DataObject) -> None:
    tree = plain(message)
    maps = [tree] + [container[key] for container, key in places(tree) if isinstance(container[key], dict)]
    data.draw(st.sampled_from(maps))["xj"] = 0
    refused(type(message), tree)


@given(MESSAGES, st.sampled_from([kind.__name__ for kind in KINDS] + ["Pose", "", None]))
@MODEST
def test_another_type_is_refused(message: Any, name: Any) -> None:
    tree = plain(message)
    if name != tree["type"]:
        refused(type(message), tree | {"type": name})
        refused(type(message), {key: value for key, value in tree.items() if key != "type"})


def test_an_empty_type_is_refused() -> None:
    for tree in ({"type": ""}, {"type": "", "ok": True}):
        with pytest.raises(MessageError):
            StrictDecoder(m.Answer).decode(msgspec.msgpack.encode(tree))


@pytest.mark.parametrize("length", [0, 8, 10])
def test_a_vector_of_another_length_is_refused(length: int) -> None:
    refused(m.MotionCommand, {"type": "MotionCommand", "epoch": 1, "sequence": 1, "echo": 1, "xi": [0.0] * length})


def test_what_is_out_of_range_is_refused_not_clamped() -> None:
    good = {"type": "MotionCommand", "epoch": 1, "sequence": 1, "echo": 1, "xi": [100.0] * 9}
    assert DECODERS[m.MotionCommand].decode(msgspec.msgpack.encode(good)).xi == (100.0,) * 9
    refused(m.MotionCommand, good | {"xi": [100.1, *[0.0] * 8]})
    refused(m.MotionCommand, good | {"sequence": -1})
    refused(m.MotionCommand, good | {"sequence": 1.5})


@pytest.mark.parametrize("cut_id", ["", "c 1", "c1\n", "\nc1", "c1\nc2", "ç"])
def test_a_name_that_is_none_is_refused(cut_id: str) -> None:
    good = {"type": "CutCommand", "epoch": 1, "cut_id": "c1", "point_id": "p1"}
    assert DECODERS[m.CutCommand].decode(msgspec.msgpack.encode(good)).cut_id == "c1"
    refused(m.CutCommand, good | {"cut_id": cut_id})


def test_a_refusal_names_the_field() -> None:
    tree = plain(m.MotionCommand(epoch=1, sequence=1, echo=1, xi=(0.0,) * 9))
    tree["xi"][3] = math.nan
    with pytest.raises(MessageError, match=r"\$\.xi\[3\]|\$\.xi\[\.\.\.\]"):
        DECODERS[m.MotionCommand].decode(msgspec.msgpack.encode(tree))


def test_a_refusal_has_a_reason_and_its_text() -> None:
    data = b"no message"
    with pytest.raises(UndecodableError) as caught:
        DECODERS[m.MotionCommand].decode(data)
    reason = caught.value.reason
    assert (reason.code, dict(reason.values)["size"]) == ("message_undecodable", len(data))
    assert str(caught.value) == text_of(reason)


@given(st.binary(max_size=300), st.sampled_from(KINDS))
@settings(max_examples=400, deadline=None)
def test_random_bytes_are_refused_and_do_nothing_else(data: bytes, kind: Any) -> None:
    with pytest.raises(MessageError):
        DECODERS[kind].decode(data)


@given(MESSAGES, st.data())
@MODEST
def test_a_damaged_message_is_refused_or_is_still_a_whole_one(message: Any, data: st.DataObject) -> None:
    raw = bytearray(encode(message))
    for _ in range(data.draw(st.integers(1, 4))):
        raw[data.draw(st.integers(0, len(raw) - 1))] = data.draw(st.integers(0, 255))
    cut = bytes(raw[: data.draw(st.integers(0, len(raw)))])
    decoder = DECODERS[type(message)]
    try:
        decoded = decoder.decode(cut)
    except MessageError:
        return
    assert decoder.decode(encode(decoded)) == decoded


@pytest.mark.parametrize("start", [b"", b"\x82\xa1a", b"\x81\xa4type"])
@pytest.mark.parametrize("nesting", [b"\x91", b"\x81\xa1a"])
def test_nesting_without_end_is_refused(start: bytes, nesting: bytes) -> None:
    """In place of a message, and in a value that is passed over on the way to the type."""
    with pytest.raises(MessageError):
        DECODERS[m.Answer].decode(start + nesting * 100_000)


@pytest.mark.parametrize("text", ["82a474797065a6416e73776572a6726561736f6ea2fffe", "81a474797065a2fffe"])
def test_text_that_is_not_utf_8_is_refused(text: str) -> None:
    with pytest.raises(MessageError):
        DECODERS[m.Answer].decode(bytes.fromhex(text))


def test_messages_cannot_be_changed() -> None:
    message = m.Answer(ok=True)
    with pytest.raises(AttributeError):
        message.ok = False  # type: ignore[misc]
    assert copy.copy(message) == message
