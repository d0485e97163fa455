"""`python -m perception.training.familiarity NET.onnx`: adds how unlike its training pictures a picture is.

The features of a deep layer are averaged over a picture. Their Mahalanobis distance from those of training pictures
becomes the output `strangeness`, and its 99th percentile on pictures that were kept apart the metadata `familiar`
(Lee et al., A simple unified framework for detecting out-of-distribution samples, NeurIPS 2018, for one class).
"""

import argparse
import hashlib
import sys
from collections.abc import Sequence
from pathlib import Path

import msgspec
import numpy as np
import onnx
import onnxruntime
from numpy.typing import NDArray
from onnx import helper, numpy_helper

from perception.models.cards import read_model, write_card
from perception.segmentation.network_segmenter import FAMILIAR, STRANGENESS, network_input
from perception.training.scenes import SURVEY_VIEWS, render_scenes
from perception.training.wide.drawing import Artist
from rolling_panda.errors import ConfigError, RollingPandaError

#: The layer whose features are compared, of each kind of network.
_LAYERS = ("/_network/encoder/_blocks.10/Add_output_0", "/_network/at_16/at_16.2/at_16.2.2/Relu_output_0")
#: Share of the identity in the correlations, since pictures are few.
_SHRINKAGE = 0.1
#: Of so many pictures one is kept apart for the limit, up to which this share of them is familiar.
_APART, _SHARE = 5, 0.99
#: Rows and drawings for this begin with seeds that no training and no bench has.
_ROWS_SEED, _DRAWN_SEED = 8_500_000, 9_500_000
#: Nothing that this writes is named like a layer of a network.
_PREFIX = "familiarity/"


def main(argv: Sequence[str] | None = None) -> int:
    """Run the command; returns the exit code."""
    parser = argparse.ArgumentParser(prog="python -m perception.training.familiarity", description=__doc__)
    parser.add_argument("network", type=Path, metavar="NET.onnx", help="written anew, with its card")
    parser.add_argument("--rows", type=int, default=60, help="rendered rows, of two pictures each")
    parser.add_argument("--drawings", type=int, default=0, help="drawings of the training for photographs")
    words = parser.parse_args(argv)
    if words.rows < 10 and words.drawings < 50:
        parser.error("give at least 10 --rows or 50 --drawings")
    try:
        model = read_model(words.network)
        limit = add_familiarity(words.network, pictures_of(words.rows, words.drawings))
        if model.card is not None:
            digest = hashlib.sha256(words.network.read_bytes()).hexdigest()
            write_card(words.network, msgspec.structs.replace(model.card, sha256=digest))
    except RollingPandaError as error:
        print(f"python -m perception.training.familiarity: {error}", file=sys.stderr)
        return 1
    print(f"{words.network}: pictures up to a strangeness of {limit:.2f} are familiar")
    return 0


def pictures_of(rows: int, drawings: int) -> list[NDArray[np.float32]]:
    """Inputs of the network (each 4×H×W), mixed: of rendered rows with and without depth, and of drawings.

    Of the rows the pictures as of a survey: nothing else is judged.
    """
    out = []
    if rows:
        scenes = render_scenes(_ROWS_SEED, rows).of_views(SURVEY_VIEWS)
        for number, (color, depth) in enumerate(zip(scenes.color, scenes.depth, strict=True)):
            out.append(network_input(color, None if number % 3 == 2 else depth.astype(np.float32)))
    artist = Artist(256)
    for number in range(drawings):
        drawn = artist.draw(_DRAWN_SEED, number)
        out.append(network_input(drawn.color, drawn.depth))
    return [out[k] for k in np.random.default_rng(1).permutation(len(out))]


def add_familiarity(path: Path, pictures: Sequence[NDArray[np.float32]]) -> float:
    """Give a network the output `strangeness`, in place of an earlier one.

    Args:
        path: ONNX file, written anew.
        pictures: Inputs of the network like those it was trained on, in random order; one of five decides the limit.

    Returns:
        Strangeness up to which a picture is familiar.

    Raises:
        ConfigError: The file holds no network of this project.
    """
    model = onnx.load(str(path))
    without_familiarity(model)
    layers = {name for node in model.graph.node for name in node.output}
    layer = next((name for name in _LAYERS if name in layers), None)
    if layer is None:
        raise ConfigError(f"{path} is no network of this project: it has none of the layers {', '.join(_LAYERS)}")
    features = _features(model, layer, pictures)
    apart = np.arange(len(features)) % _APART == 0
    mean, whitening = _whitening(features[~apart])
    limit = float(np.quantile(np.sqrt((((features[apart] - mean) @ whitening) ** 2).mean(axis=1)), _SHARE))
    _append(model, layer, mean, whitening)
    properties = {each.key: each.value for each in model.metadata_props}
    del model.metadata_props[:]
    helper.set_model_props(model, properties | {FAMILIAR: f"{limit:.4f}"})
    onnx.checker.check_model(model)
    new = path.with_suffix(".new.onnx")
    onnx.save(model, str(new))
    new.replace(path)
    return limit


def _features(model: onnx.ModelProto, layer: str, pictures: Sequence[NDArray[np.float32]]) -> NDArray[np.float64]:
    """Mean of the layer's features over each picture (N×C)."""
    probe = onnx.ModelProto()
    probe.CopyFrom(model)
    probe.graph.output.append(helper.make_tensor_value_info(layer, onnx.TensorProto.FLOAT, None))
    session = onnxruntime.InferenceSession(probe.SerializeToString(), providers=["CPUExecutionProvider"])
    out = []
    for picture in pictures:
        below, right = -picture.shape[1] % 32, -picture.shape[2] % 32
        padded = np.pad(picture, ((0, 0), (0, below), (0, right)), mode="edge")
        out.append(session.run([layer], {"image": padded[None]})[0][0].mean(axis=(1, 2)))
    return np.array(out, np.float64)


def _whitening(features: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Mean (C), and a matrix (C×C) that makes the features uncorrelated with variance 1."""
    mean, deviation = features.mean(axis=0), features.std(axis=0) + 1e-6
    correlation = np.cov(((features - mean) / deviation).T)
    shrunk = (1.0 - _SHRINKAGE) * correlation + _SHRINKAGE * np.eye(len(mean))
    return mean, np.linalg.cholesky(np.linalg.inv(shrunk)) / deviation[:, None]


def _append(model: onnx.ModelProto, layer: str, mean: NDArray[np.float64], whitening: NDArray[np.float64]) -> None:
    names = {key: _PREFIX + key for key in ("pooled", "off", "white", "square", "mean_square", "mean", "whitening")}
    model.graph.initializer.extend(
        [
            numpy_helper.from_array(mean.astype(np.float32), names["mean"]),
            numpy_helper.from_array(whitening.astype(np.float32), names["whitening"]),
        ]
    )
    model.graph.node.extend(
        [
            helper.make_node("ReduceMean", [layer], [names["pooled"]], axes=[2, 3], keepdims=0),
            helper.make_node("Sub", [names["pooled"], names["mean"]], [names["off"]]),
            helper.make_node("MatMul", [names["off"], names["whitening"]], [names["white"]]),
            helper.make_node("Mul", [names["white"], names["white"]], [names["square"]]),
            helper.make_node("ReduceMean", [names["square"]], [names["mean_square"]], axes=[1], keepdims=0),
            helper.make_node("Sqrt", [names["mean_square"]], [STRANGENESS]),
        ]
    )
    model.graph.output.append(helper.make_tensor_value_info(STRANGENESS, onnx.TensorProto.FLOAT, [1]))


def without_familiarity(model: onnx.ModelProto) -> None:
    """Take the output `strangeness` and its limit away, where an earlier run has added them."""

    def own(name: str) -> bool:
        return name.startswith(_PREFIX) or name == STRANGENESS

    graph = model.graph
    kept_nodes = [node for node in graph.node if not own(node.output[0])]
    kept_values = [value for value in graph.initializer if not own(value.name)]
    kept_outputs = [value for value in graph.output if not own(value.name)]
    for field, kept in ((graph.node, kept_nodes), (graph.initializer, kept_values), (graph.output, kept_outputs)):
        del field[:]
        field.extend(kept)
    properties = {each.key: each.value for each in model.metadata_props if each.key != FAMILIAR}
    del model.metadata_props[:]
    helper.set_model_props(model, properties)


if __name__ == "__main__":
    sys.exit(main())
