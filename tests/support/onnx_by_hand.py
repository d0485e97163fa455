"""Tiny ONNX files, written byte by byte, so that no test needs the package that writes them."""

import json


def _number(field: int, value: int) -> bytes:
    return _varint(field << 3) + _varint(value)


def _bytes(field: int, value: bytes | str) -> bytes:
    data = value.encode() if isinstance(value, str) else value
    return _varint(field << 3 | 2) + _varint(len(data)) + data


def _varint(value: int) -> bytes:
    out = bytearray()
    while value > 0x7F:
        out.append(value & 0x7F | 0x80)
        value >>= 7
    return bytes([*out, value])


def _value(name: str, kind: int, shape: list[int | str]) -> bytes:
    dims = b"".join(_bytes(1, _number(1, d) if isinstance(d, int) else _bytes(2, d)) for d in shape)
    return _bytes(1, name) + _bytes(2, _bytes(1, _number(1, kind) + _bytes(2, dims)))


def brightest_channel(
    classes: object,
    shape: tuple[int | str, ...] = (1, 4, "h", "w"),
    output: str = "classes",
    kind: str = "uint8",
    widening: str | None = None,
    multiple: str | None = None,
    familiar: str | None = None,
) -> bytes:
    """A model whose class of a pixel is the number of its largest channel.

    Args:
        classes: Written into the metadata as JSON; None for no metadata.
        shape: Of the input `image`.
        output: Name of the output.
        kind: uint8 or int64.
        widening: Written into the metadata.
        multiple: Written into the metadata.
        familiar: Written into the metadata.
    """
    argmax = (
        _bytes(1, "image")
        + _bytes(2, "largest")
        + _bytes(4, "ArgMax")
        + _bytes(5, _bytes(1, "axis") + _number(3, 1) + _number(20, 2))
        + _bytes(5, _bytes(1, "keepdims") + _number(3, 0) + _number(20, 2))
    )
    number = {"uint8": 2, "int64": 7}[kind]
    cast = (
        _bytes(1, "largest")
        + _bytes(2, output)
        + _bytes(4, "Cast")
        + _bytes(5, _bytes(1, "to") + _number(3, number) + _number(20, 2))
    )
    graph = (
        _bytes(1, argmax)
        + _bytes(1, cast)
        + _bytes(2, "graph")
        + _bytes(11, _value("image", 1, list(shape)))
        + _bytes(12, _value(output, number, [shape[0], *shape[2:]]))
    )
    model = _number(1, 8) + _bytes(7, graph) + _bytes(8, _number(2, 17))
    if classes is not None:
        model += _bytes(14, _bytes(1, "classes") + _bytes(2, json.dumps(classes)))
    if widening is not None:
        model += _bytes(14, _bytes(1, "widening") + _bytes(2, widening))
    for key, text in (("multiple", multiple), ("familiar", familiar)):
        if text is not None:
            model += _bytes(14, _bytes(1, key) + _bytes(2, text))
    return model
