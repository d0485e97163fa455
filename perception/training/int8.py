"""`python -m perception.training.int8 NET.onnx`: 8-bit integers in place of the numbers of a trained network.

The weights of each channel and the values between the layers get scales of their own; those of the values come from
pictures like the training's. The network is a third of its size and takes two thirds of its time on processors with
8-bit dot products. `python -m perception.training.familiarity` comes afterwards, since the features change a little.
"""

import argparse
import contextlib
import hashlib
import logging
import sys
import tempfile
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import msgspec
import numpy as np
import onnx
from numpy.typing import NDArray
from onnx import numpy_helper
from onnxruntime.quantization import CalibrationDataReader, QuantFormat, QuantType, quantize_static

from perception.models.cards import read_model, write_card
from perception.training.familiarity import pictures_of, without_familiarity
from rolling_panda.errors import ConfigError, RollingPandaError

#: Layers that compute with integers; what decides between the classes at the end stays as it is.
_KINDS = ["Conv", "Add", "Clip", "Relu", "Resize"]
#: Sides of calibration pictures are cut to multiples of this (px).
_MULTIPLE = 32


def main(argv: Sequence[str] | None = None) -> int:
    """Run the command; returns the exit code."""
    parser = argparse.ArgumentParser(prog="python -m perception.training.int8", description=__doc__)
    parser.add_argument("network", type=Path, metavar="NET.onnx", help="written anew, with its card")
    parser.add_argument("--rows", type=int, default=4, help="rendered rows for the scales, of three pictures each")
    parser.add_argument("--drawings", type=int, default=24, help="drawings of the training for photographs")
    words = parser.parse_args(argv)
    if words.rows < 1 and words.drawings < 1:
        parser.error("give at least one of --rows or one of --drawings")
    try:
        model = read_model(words.network)
        quantise(words.network, pictures_of(words.rows, words.drawings))
        if model.card is not None:
            digest = hashlib.sha256(words.network.read_bytes()).hexdigest()
            write_card(words.network, msgspec.structs.replace(model.card, sha256=digest))
    except RollingPandaError as error:
        print(f"python -m perception.training.int8: {error}", file=sys.stderr)
        return 1
    size = words.network.stat().st_size / 2**20
    print(f"{words.network}: {size:.1f} MiB; now add the familiarity anew")
    return 0


def quantise(path: Path, pictures: Sequence[NDArray[np.float32]]) -> None:
    """Make a network compute with 8-bit integers. Its output `strangeness`, if it has one, is taken away.

    Args:
        path: ONNX file, written anew.
        pictures: Inputs of the network (4×H×W each) that the scales are taken from.

    Raises:
        ConfigError: It does so already.
    """
    model = onnx.load(str(path))
    if any(node.op_type == "DequantizeLinear" for node in model.graph.node):
        raise ConfigError(f"{path} computes with integers already")
    without_familiarity(model)
    convolutions = [node for node in model.graph.node if node.op_type == "Conv"]
    with tempfile.TemporaryDirectory() as folder, _quietly():
        plain, new = Path(folder) / "plain.onnx", Path(folder) / "int8.onnx"
        onnx.save(model, str(plain))
        quantize_static(
            str(plain),
            str(new),
            _Pictures(pictures),
            quant_format=QuantFormat.QDQ,
            op_types_to_quantize=_KINDS,
            per_channel=True,
            activation_type=QuantType.QUInt8,
            weight_type=QuantType.QInt8,
            # The colours themselves, and what the classes are decided by.
            nodes_to_exclude=[convolutions[0].name, convolutions[-1].name],
        )
        made = onnx.load(str(new))
    _put_in_order(made.graph, [node.name for node in model.graph.node])
    properties = {each.key: each.value for each in model.metadata_props}
    del made.metadata_props[:]
    onnx.helper.set_model_props(made, properties)
    onnx.checker.check_model(made)
    onnx.save(made, str(path))


def weights_of(graph: onnx.GraphProto) -> dict[str, NDArray[np.float32]]:
    """Initialisers of a network by name, and those of 8 bits as the numbers that the layers compute with."""
    values: dict[str, Any] = {each.name: numpy_helper.to_array(each) for each in graph.initializer}
    for node in graph.node:
        if node.op_type != "DequantizeLinear" or node.input[0] not in values:
            continue
        stored, scale, zero = (values[name].astype(np.float32) for name in node.input)
        axis = next((each.i for each in node.attribute if each.name == "axis"), 0)
        if scale.size > 1:
            shape = [-1 if place == axis else 1 for place in range(stored.ndim)]
            scale, zero = scale.reshape(shape), zero.reshape(shape)
        values[node.output[0]] = (stored - zero) * scale
    return values


def _put_in_order(graph: onnx.GraphProto, names: Sequence[str]) -> None:
    """Put the layers into the order of these names again, and what was added before where it is needed."""
    makers = {output: node for node in graph.node for output in node.output}
    by_name = {node.name: node for node in graph.node}
    order: dict[str, onnx.NodeProto] = {}

    def place(node: onnx.NodeProto) -> None:
        for name in node.input:
            if name in makers and makers[name].name not in order:
                place(makers[name])
        order.setdefault(node.name, node)

    for name in [*(name for name in names if name in by_name), *by_name]:
        place(by_name[name])
    nodes = list(order.values())
    del graph.node[:]
    graph.node.extend(nodes)


class _Pictures(CalibrationDataReader):
    """Pictures one after another, as onnxruntime asks for them."""

    def __init__(self, pictures: Sequence[NDArray[np.float32]]) -> None:
        self._left = iter(pictures)

    def get_next(self) -> dict[str, NDArray[np.float32]] | None:
        picture = next(self._left, None)
        if picture is None:
            return None
        height, width = (side // _MULTIPLE * _MULTIPLE for side in picture.shape[1:])
        return {"image": np.ascontiguousarray(picture[None, :, :height, :width])}


@contextlib.contextmanager
def _quietly() -> Iterator[None]:
    """Without onnxruntime's advice on networks that it would rather have prepared."""
    before = logging.root.level
    logging.root.setLevel(logging.ERROR)
    try:
        yield
    finally:
        logging.root.setLevel(before)


if __name__ == "__main__":
    sys.exit(main())
