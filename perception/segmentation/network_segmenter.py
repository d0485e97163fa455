"""Which pixel shows what, by the trained network."""

import json
from pathlib import Path

import numpy as np
import onnxruntime
from numpy.typing import NDArray
from onnxruntime.capi import onnxruntime_pybind11_state as ort

from perception.segmentation.frame import View
from perception.segmentation.network_input import CHANNELS, network_input
from rolling_panda.errors import ConfigError, InputError
from rolling_panda.messages.types import WOOD_CLASSES

#: Images are padded to multiples of this (px).
_MULTIPLE = 16
#: An image darker than this at its brightest, or as even as this, shows nothing (of 255).
_DARK, _EVEN = 12, 2.0
#: Nothing draws canes this much too wide (px).
_WIDEST = 3.0
#: What onnxruntime raises over a file that it cannot run; they share no root of their own.
_REFUSALS = (
    ort.Fail,
    ort.InvalidArgument,
    ort.InvalidGraph,
    ort.InvalidProtobuf,
    ort.NotImplemented,
    ort.RuntimeException,
)


class NetworkSegmenter:
    """Runs an ONNX file: `image` 1×4×H×W (see `network_input`) to `classes` 1×H×W, uint8.

    The file says which classes it knows, in its metadata under `classes`: a JSON list, equal to `WOOD_CLASSES`. Under
    `widening` it may say by how many pixels it draws canes too wide.
    """

    def __init__(self, path: Path, threads: int = 2) -> None:
        """Load and check a network.

        Args:
            path: ONNX file.
            threads: To compute on.

        Raises:
            ConfigError: It cannot be read, or shapes or classes are not those that perception works with.
        """
        options = onnxruntime.SessionOptions()
        options.intra_op_num_threads = threads
        options.inter_op_num_threads = 1
        # Threads that wait in a spin would take the processor from whoever controls the robot.
        options.add_session_config_entry("session.intra_op.allow_spinning", "0")
        try:
            self._session = onnxruntime.InferenceSession(path.read_bytes(), options, providers=["CPUExecutionProvider"])
        except (OSError, *_REFUSALS) as error:
            raise ConfigError(f"cannot load the network {path}: {error}") from error
        _check(self._session, path)
        self._name = f"network {path.name}"
        self._widening = _widening(self._session, path)

    @property
    def name(self) -> str:
        """The file's name."""
        return self._name

    @property
    def widening(self) -> float:
        """As measured when it was trained."""
        return self._widening

    def segment(self, view: View) -> NDArray[np.uint8]:
        """Classes by colour and depth.

        Raises:
            InputError: The colour image shows nothing.
            MessageError: It is no image.
        """
        return self.classify(view.color(), view.depth)

    def classify(self, color: NDArray[np.uint8], depth: NDArray[np.float32] | None) -> NDArray[np.uint8]:
        """H×W indices into `WOOD_CLASSES` of a colour image (H×W×3), with a depth image of its size if there is one.

        Raises:
            InputError: The colour image shows nothing.
        """
        if int(color.max()) < _DARK or float(color[::4, ::4].std()) < _EVEN:
            raise InputError(
                f"the colour image shows nothing (brightest {color.max()} of 255): "
                "is the lens covered, or the exposure wrong?"
            )
        height, width = color.shape[:2]
        image = network_input(color, depth)
        below, right = -height % _MULTIPLE, -width % _MULTIPLE
        if below or right:
            image = np.pad(image, ((0, 0), (0, below), (0, right)), mode="edge")
        said: NDArray[np.uint8] = self._session.run(["classes"], {"image": image[None]})[0]
        return np.ascontiguousarray(said[0, :height, :width])


class NoSegmenter:
    """Stands where no weights are: every frame is declined with the reason."""

    def __init__(self, reason: str) -> None:
        """Remember why."""
        self._reason = reason

    @property
    def name(self) -> str:
        """It says that there is none."""
        return "none"

    @property
    def widening(self) -> float:
        """Nothing is drawn."""
        return 0.0

    def segment(self, view: View) -> NDArray[np.uint8]:
        """Never returns.

        Raises:
            InputError: Always.
        """
        raise InputError(self._reason)


def _widening(session: onnxruntime.InferenceSession, path: Path) -> float:
    text = session.get_modelmeta().custom_metadata_map.get("widening", "0")
    try:
        value = float(text)
    except ValueError:
        value = float("nan")
    if not abs(value) <= _WIDEST:
        raise ConfigError(f"{path}: its widening is {text!r}; give the pixels by which it draws canes too wide")
    return value


def _check(session: onnxruntime.InferenceSession, path: Path) -> None:
    inputs, outputs = session.get_inputs(), session.get_outputs()
    if [i.name for i in inputs] != ["image"] or "classes" not in [o.name for o in outputs]:
        raise ConfigError(
            f"{path}: inputs {[i.name for i in inputs]}, outputs {[o.name for o in outputs]}; "
            "perception wants the input 'image' and the output 'classes'"
        )
    shape = inputs[0].shape
    fixed = [size for size in shape[2:] if isinstance(size, int)] if len(shape) == 4 else [0]
    if len(shape) != 4 or shape[1] != CHANNELS or fixed:
        raise ConfigError(
            f"{path}: 'image' has shape {shape}; perception wants 1×{CHANNELS}×H×W with free height and width"
        )
    kind = next(o.type for o in outputs if o.name == "classes")
    if kind != "tensor(uint8)":
        raise ConfigError(f"{path}: 'classes' is a {kind}; perception wants tensor(uint8), one class index a pixel")
    text = session.get_modelmeta().custom_metadata_map.get("classes", "")
    try:
        classes = json.loads(text) if text else None
    except ValueError:
        classes = text
    if classes != list(WOOD_CLASSES):
        raise ConfigError(f"{path}: its classes are {classes}; perception wants {list(WOOD_CLASSES)} in its metadata")
