"""Semantic segmentation by the trained network."""

import hashlib
import json
from pathlib import Path

import numpy as np
import onnxruntime
from numpy.typing import NDArray
from onnxruntime.capi import onnxruntime_pybind11_state as ort

from perception.arrays import Labels
from perception.segmentation.frame import UnusablePictureError, View
from rolling_panda import reasons
from rolling_panda.errors import ConfigError
from rolling_panda.messages.types import WOOD_CLASSES, Reason

#: Output of how unlike the training pictures a picture is, and metadata up to which value it is familiar.
STRANGENESS, FAMILIAR = "strangeness", "familiar"
#: Input channels: red, green, blue, inverse depth.
CHANNELS = 4
#: Depths below this are invalid (m).
_MIN_DEPTH = 0.15
#: Images are padded to multiples of this (px), unless the network's metadata says more.
_MULTIPLE = 16
_MULTIPLES = ("8", "16", "32", "64")
#: An image whose brightest value or standard deviation is below these is blank (of 255).
_MIN_BRIGHTNESS, _MIN_CONTRAST = 12, 2.0
#: Largest plausible width bias (px).
_MAX_WIDTH_BIAS = 3.0
#: Errors of onnxruntime for a file that it cannot run; they have no common base class.
_LOAD_ERRORS = (
    ort.Fail,
    ort.InvalidArgument,
    ort.InvalidGraph,
    ort.InvalidProtobuf,
    ort.NotImplemented,
    ort.RuntimeException,
)


def network_input(color: NDArray[np.uint8], depth: NDArray[np.floating] | None) -> NDArray[np.float32]:
    """Input of the network (4×H×W), in training too: colours -1…1, and 0.2 m / depth, 0 without depth.

    Args:
        color: H×W×3, RGB.
        depth: H×W (m); None for a photograph without.
    """
    height, width = color.shape[:2]
    out = np.zeros((CHANNELS, height, width), np.float32)
    out[:3] = color.transpose(2, 0, 1)
    out[:3] *= np.float32(2.0 / 255.0)
    out[:3] -= np.float32(1.0)
    if depth is not None:
        np.divide(np.float32(0.2), depth, out=out[3], where=depth > _MIN_DEPTH, dtype=np.float32)
    return out


class NetworkSegmenter:
    """Runs an ONNX file: `image` 1×4×H×W (see `network_input`) to `classes` 1×H×W, uint8.

    Its metadata has `classes`, a JSON list equal to `WOOD_CLASSES`, and optionally `widening`, the width bias (px), and
    `multiple`, which image sides must be a multiple of (px). The output `confidence` is optional, and so is
    `strangeness` (1), with the metadata `familiar`: pictures above it are unlike those of the training.

    Attributes:
        familiar: Strangeness up to which a picture is familiar; None if the network does not tell it.
        strangeness: Of the last picture; None if the network does not tell it.
    """

    def __init__(self, path: Path, threads: int = 2) -> None:
        """Load and check a network.

        Args:
            path: ONNX file.
            threads: Threads to compute on.

        Raises:
            ConfigError: The file cannot be read, or its shapes or classes do not fit.
        """
        options = onnxruntime.SessionOptions()
        options.intra_op_num_threads = threads
        options.inter_op_num_threads = 1
        # Spinning threads would take processor time from the controller.
        options.add_session_config_entry("session.intra_op.allow_spinning", "0")
        # Errors only: of a network of 8 bits it warns of each number that merging its layers leaves over.
        options.log_severity_level = 3
        try:
            content = path.read_bytes()
            self._session = onnxruntime.InferenceSession(content, options, providers=["CPUExecutionProvider"])
        except (OSError, *_LOAD_ERRORS) as error:
            raise ConfigError(f"cannot load the network {path}: {error}") from error
        _check(self._session, path)
        # Between two pictures the network's work space is given back: 75 MiB, for 10 ms at each picture.
        self._run_options = onnxruntime.RunOptions()
        self._run_options.add_run_config_entry("memory.enable_memory_arena_shrinkage", "cpu:0")
        # Goes with every message of points: which network proposed them.
        self.name = f"network {path.name} {hashlib.sha256(content).hexdigest()[:12]}"
        self.width_bias = _width_bias(self._session, path)
        self._multiple = _multiple(self._session, path)
        self.familiar = _familiar(self._session, path)
        self.strangeness: float | None = None
        has = {output.name for output in self._session.get_outputs()}
        self._always = ["classes"] + [STRANGENESS] * (self.familiar is not None)
        self._outputs = [*self._always, *(["confidence"] if "confidence" in has else [])]

    @property
    def unfamiliar(self) -> Reason | None:
        """Why the last picture is unlike those of the training; None if it is not, or nobody knows."""
        if self.familiar is None or self.strangeness is None or self.strangeness <= self.familiar:
            return None
        return reasons.picture_unfamiliar(self.strangeness, self.familiar)

    def segment(self, view: View) -> Labels:
        """Classes by colour and depth.

        Raises:
            UnusablePictureError: The colour image is blank.
            CorruptFrameError: The colour image is corrupt.
        """
        return self.classify(view.color(), view.depth)

    def classify(self, color: NDArray[np.uint8], depth: NDArray[np.float32] | None) -> Labels:
        """H×W indices into `WOOD_CLASSES` of a colour image (H×W×3), with a depth image (H×W, m) if there is one.

        Raises:
            UnusablePictureError: The colour image is blank.
        """
        return self.classify_surely(color, depth, self._always)[0]

    def classify_surely(
        self, color: NDArray[np.uint8], depth: NDArray[np.float32] | None, outputs: list[str] | None = None
    ) -> tuple[Labels, NDArray[np.float32] | None]:
        """Classes as of `classify`, and the probability of each pixel's class (H×W), or None if the network has none.

        Raises:
            UnusablePictureError: The colour image is blank.
        """
        if int(color.max()) < _MIN_BRIGHTNESS or float(color[::4, ::4].std()) < _MIN_CONTRAST:
            raise UnusablePictureError(reasons.picture_blank(float(color.max())))
        height, width = color.shape[:2]
        image = network_input(color, depth)
        below, right = -height % self._multiple, -width % self._multiple
        if below or right:
            image = np.pad(image, ((0, 0), (0, below), (0, right)), mode="edge")
        names = outputs or self._outputs
        told = dict(zip(names, self._session.run(names, {"image": image[None]}, self._run_options), strict=True))
        self.strangeness = float(told[STRANGENESS][0]) if STRANGENESS in told else None
        classes: Labels = np.ascontiguousarray(told["classes"][0, :height, :width])
        if "confidence" not in told:
            return classes, None
        # One value for each block of pixels.
        blocks = told["confidence"][0].astype(np.float32) / np.float32(255.0)
        block = image.shape[1] // blocks.shape[0]
        return classes, blocks.repeat(block, axis=0).repeat(block, axis=1)[:height, :width]


class PhotographSegmenter:
    """Of several networks, uses for each picture the first to which it is familiar; else the last."""

    def __init__(self, *paths: Path) -> None:
        """Load and check the networks.

        Raises:
            ConfigError: As of `NetworkSegmenter`.
        """
        self._networks = [NetworkSegmenter(path) for path in paths]
        #: Used for the last picture.
        self.used = self._networks[0]

    def classify_surely(
        self, color: NDArray[np.uint8], depth: NDArray[np.float32] | None
    ) -> tuple[Labels, NDArray[np.float32] | None]:
        """As of the network that is used.

        Raises:
            UnusablePictureError: The colour image is blank.
        """
        for network in self._networks:
            self.used, told = network, network.classify_surely(color, depth)
            if network.unfamiliar is None:
                break
        return told


def _width_bias(session: onnxruntime.InferenceSession, path: Path) -> float:
    text = session.get_modelmeta().custom_metadata_map.get("widening", "0")
    try:
        value = float(text)
    except ValueError:
        value = float("nan")
    if not abs(value) <= _MAX_WIDTH_BIAS:
        raise ConfigError(f"{path}: metadata 'widening' is {text!r}; give a number of pixels up to {_MAX_WIDTH_BIAS:g}")
    return value


def _familiar(session: onnxruntime.InferenceSession, path: Path) -> float | None:
    text = session.get_modelmeta().custom_metadata_map.get(FAMILIAR)
    if text is None:
        return None
    try:
        limit = float(text)
    except ValueError:
        limit = 0.0
    has = any(output.name == STRANGENESS for output in session.get_outputs())
    if not (has and 0.0 < limit < 1e6):
        raise ConfigError(f"{path}: metadata {FAMILIAR!r} is {text!r}; a number above 0 and {STRANGENESS!r} are wanted")
    return limit


def _multiple(session: onnxruntime.InferenceSession, path: Path) -> int:
    text = session.get_modelmeta().custom_metadata_map.get("multiple", str(_MULTIPLE))
    if text not in _MULTIPLES:
        raise ConfigError(f"{path}: metadata 'multiple' is {text!r}; give one of {', '.join(_MULTIPLES)} pixels")
    return int(text)


def _check(session: onnxruntime.InferenceSession, path: Path) -> None:
    inputs, outputs = session.get_inputs(), {output.name: output for output in session.get_outputs()}
    if [i.name for i in inputs] != ["image"] or "classes" not in outputs:
        raise ConfigError(
            f"{path}: inputs {[i.name for i in inputs]}, outputs {list(outputs)}; "
            "perception wants the input 'image' and the output 'classes'"
        )
    shape = inputs[0].shape
    if len(shape) != 4 or shape[1] != CHANNELS or any(isinstance(size, int) for size in shape[2:]):
        raise ConfigError(
            f"{path}: 'image' has shape {shape}; perception wants 1×{CHANNELS}×H×W with free height and width"
        )
    kind = outputs["classes"].type
    if kind != "tensor(uint8)":
        raise ConfigError(f"{path}: 'classes' is a {kind}; perception wants tensor(uint8), one class index a pixel")
    text = session.get_modelmeta().custom_metadata_map.get("classes", "")
    try:
        classes = json.loads(text) if text else None
    except ValueError:
        classes = text
    if classes != list(WOOD_CLASSES):
        raise ConfigError(f"{path}: its classes are {classes}; perception wants {list(WOOD_CLASSES)} in its metadata")
