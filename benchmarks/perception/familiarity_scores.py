"""Other scores of how unlike the training pictures a picture is, to compare with that of the network's file.

They need the network's logits, which its file does not give; `Probe` adds them as an output in memory.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import onnxruntime
from numpy.typing import NDArray

from perception.segmentation.network_segmenter import STRANGENESS, network_input
from rolling_panda.errors import ConfigError, InputError
from rolling_panda.messages.types import WOOD_CLASSES

#: Logits of the networks of this project, for the pixels of each block of 2×2, and how many blocks a value is taken of.
_LOGITS, _PLACES, _STRIDE = "/_network/answer/answer.0/Conv_output_0", 4, 4
#: Image sides are padded to multiples of this (px), unless the metadata says more.
_MULTIPLE = "16"
_WOOD = tuple(WOOD_CLASSES.index(name) for name in ("trunk", "cordon", "spur", "cane", "node", "old cut"))
#: Fewer pixels of wood than this have no mean entropy, and the greatest possible one is taken.
_MIN_WOOD = 20
#: Bins of each colour in a histogram.
_BINS = 16
#: Share of the identity in the correlations, one of so many training pictures for the limit, and its quantile.
_SHRINKAGE, _APART, _SHARE = 0.1, 5, 0.99

Vector = NDArray[np.float64]
#: A score of each picture (N); the greater the stranger.
Score = Callable[[Sequence["Reading"]], Vector]


@dataclass(frozen=True)
class Reading:
    """What the scores need of one picture.

    Attributes:
        strangeness: As the network tells it.
        unsure: 1 less the mean of the greatest probability.
        entropy: Mean over the picture (nats).
        wood_entropy: Mean over the pixels told to be wood (nats).
        energy: Mean of the negative log of the sum of exponentials of the logits.
        histogram: Shares of red, green and blue (48).
        statistics: Brightness, contrast, dark and bright shares, gradients, sharpness, differences of colours (10).
    """

    strangeness: float
    unsure: float
    entropy: float
    wood_entropy: float
    energy: float
    histogram: Vector
    statistics: Vector


class Probe:
    """A network with its logits."""

    def __init__(self, path: Path) -> None:
        """Load it.

        Raises:
            InputError: The packages of the training are not installed.
            ConfigError: It has no logits of that name or does not tell strangeness.
        """
        try:
            import onnx
        except ImportError as error:
            raise InputError("--scores needs the packages of the training: make training") from error
        model = onnx.load(str(path))
        names = {name for node in model.graph.node for name in node.output}
        if not {_LOGITS, STRANGENESS} <= names:
            raise ConfigError(f"{path} has no {_LOGITS} or no {STRANGENESS}")
        self._multiple = int({each.key: each.value for each in model.metadata_props}.get("multiple", _MULTIPLE))
        model.graph.output.append(onnx.helper.make_tensor_value_info(_LOGITS, onnx.TensorProto.FLOAT, None))
        self._session: Any = onnxruntime.InferenceSession(model.SerializeToString(), providers=["CPUExecutionProvider"])

    def read(self, color: NDArray[np.uint8], depth: NDArray[np.floating] | None) -> Reading:
        """All scores' inputs of a picture (H×W×3) with depth (H×W, m) or without."""
        image = network_input(color, depth)
        below, right = -image.shape[1] % self._multiple, -image.shape[2] % self._multiple
        padded = np.pad(image, ((0, 0), (0, below), (0, right)), mode="edge")
        strangeness, all_logits = self._session.run([STRANGENESS, _LOGITS], {"image": padded[None]})
        logits = all_logits[0, :, ::_STRIDE, ::_STRIDE]
        # The older network's channels go by place, then class, as those of the newer one.
        logits = logits.reshape(_PLACES, len(WOOD_CLASSES), *logits.shape[1:])[0].astype(np.float64)
        greatest = logits.max(axis=0)
        weights = np.exp(logits - greatest)
        total = weights.sum(axis=0)
        likely = weights / total
        entropy = -(likely * np.log(likely + 1e-12)).sum(axis=0)
        wood = np.isin(likely.argmax(axis=0), _WOOD)
        return Reading(
            float(strangeness[0]),
            1.0 - float(likely.max(axis=0).mean()),
            float(entropy.mean()),
            float(entropy[wood].mean()) if np.count_nonzero(wood) >= _MIN_WOOD else float(np.log(len(WOOD_CLASSES))),
            -float((greatest + np.log(total)).mean()),
            _histogram(color),
            _statistics(color),
        )


def scores(training: Sequence[Reading]) -> dict[str, tuple[Score, float]]:
    """Each score with its limit, the 99th percentile on training pictures.

    Args:
        training: Of pictures like those the network was trained on. Where a score has to be fitted, one of five decides
            the limit only.
    """
    apart = np.arange(len(training)) % _APART == 0
    fitted = [each for each, kept in zip(training, apart, strict=True) if not kept]
    others = [each for each, kept in zip(training, apart, strict=True) if kept]
    mean = np.mean([each.histogram for each in fitted], axis=0)
    plain: dict[str, Score] = {
        "strangeness": lambda all: np.array([each.strangeness for each in all]),
        "unsure": lambda all: np.array([each.unsure for each in all]),
        "entropy": lambda all: np.array([each.entropy for each in all]),
        "entropy of wood": lambda all: np.array([each.wood_entropy for each in all]),
        "energy": lambda all: np.array([each.energy for each in all]),
        "colours": lambda all: np.array([_chi_square(each.histogram, mean) for each in all]),
        "image statistics": _mahalanobis(np.array([each.statistics for each in fitted])),
    }
    out = {name: (score, float(np.quantile(score(others), _SHARE))) for name, score in plain.items()}
    first, second = out["strangeness"], out["entropy"]
    out["strangeness or entropy"] = (
        lambda all: np.maximum(first[0](all) / first[1], second[0](all) / second[1]),
        1.0,
    )
    return out


def _mahalanobis(rows: Vector) -> Score:
    mean, deviation = rows.mean(axis=0), rows.std(axis=0) + 1e-6
    correlation = np.cov(((rows - mean) / deviation).T)
    inverse = np.linalg.inv((1.0 - _SHRINKAGE) * correlation + _SHRINKAGE * np.eye(len(mean)))

    def score(readings: Sequence[Reading]) -> Vector:
        off = (np.array([each.statistics for each in readings]) - mean) / deviation
        out: Vector = np.sqrt(np.einsum("ij,jk,ik->i", off, inverse, off) / len(mean))
        return out

    return score


def _chi_square(first: Vector, second: Vector) -> float:
    return float((((first - second) ** 2) / (first + second + 1e-9)).sum() / 2.0)


def _histogram(color: NDArray[np.uint8]) -> Vector:
    part = color[::2, ::2].reshape(-1, 3)
    return np.concatenate([np.histogram(part[:, k], _BINS, (0, 256))[0] / len(part) for k in range(3)])


def _statistics(color: NDArray[np.uint8]) -> Vector:
    part = color[::2, ::2].astype(float)
    grey = part.mean(axis=2)
    down, across = np.abs(np.diff(grey, axis=0)), np.abs(np.diff(grey, axis=1))
    bend = 4.0 * grey[1:-1, 1:-1] - grey[:-2, 1:-1] - grey[2:, 1:-1] - grey[1:-1, :-2] - grey[1:-1, 2:]
    red, green, blue = (part[..., k].mean() for k in range(3))
    return np.array(
        [
            *(grey.mean(), grey.std(), (grey < 8.0).mean(), (grey > 247.0).mean()),
            *(down.mean(), across.mean(), bend.std()),
            *(red - green, green - blue, (part.max(axis=2) - part.min(axis=2)).mean()),
        ]
    )
