"""Model cards, and which network a robot's perception uses: `model.json` in its state folder."""

import hashlib
from dataclasses import dataclass
from pathlib import Path

import msgspec

from perception.models.judge import Figures
from perception.segmentation.segmenter import PHOTOGRAPHS, SHIPPED
from rolling_panda.errors import ConfigError, InputError
from rolling_panda.resources import resource
from rolling_panda.runtime.state_folder import open_state_folder, read_kept, replace_durably

#: In the state folder: which network is used, and the folder of networks that were taken into use.
CHOICE, KEPT = "model.json", "models"


class Data(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Pictures that a network was trained on."""

    source: str
    licence: str
    pictures: int


class Card(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """The JSON file beside a network.

    Attributes:
        sha256: Of the ONNX file.
        data: What it was trained on.
        command: That trained it.
        begun_from: SHA-256 of the network that it was fine-tuned from; empty if none.
        figures: By name of the set of pictures.
    """

    sha256: str
    data: tuple[Data, ...]
    command: str
    begun_from: str = ""
    figures: dict[str, Figures] = {}


@dataclass(frozen=True)
class Model:
    """A network's file, its SHA-256, and its card if it has one."""

    path: Path
    sha256: str
    card: Card | None

    @property
    def title(self) -> str:
        """Name of the file and beginning of the hash."""
        return f"{self.path.name} {self.sha256[:12]}"


class _Choice(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    sha256: str = ""


def read_model(path: Path) -> Model:
    """A network's file with its card; the network itself is not loaded.

    Raises:
        ConfigError: It cannot be read, or its card is damaged or of another file.
    """
    try:
        digest = hashlib.sha256(path.read_bytes()).hexdigest()
    except OSError as error:
        raise ConfigError(f"cannot read the network {path}: {error.strerror}") from error
    beside = path.with_suffix(".json")
    if not beside.exists():
        return Model(path, digest, None)
    try:
        card = msgspec.json.decode(beside.read_bytes(), type=Card)
    except (OSError, msgspec.MsgspecError) as error:
        raise ConfigError(f"cannot read the model card {beside}: {error}; move it away or repair it") from error
    if card.sha256 != digest:
        raise ConfigError(
            f"{beside} is the card of another network: it says {card.sha256[:12]}, and {path.name} has {digest[:12]}. "
            "Bring back the network or its card"
        )
    return Model(path, digest, card)


def write_card(path: Path, card: Card) -> None:
    """Write a card beside its network."""
    replace_durably(path.with_suffix(".json"), msgspec.json.format(msgspec.json.encode(card), indent=1) + b"\n")


def shipped() -> Model:
    """The network that comes with the program.

    Raises:
        ModelError: It is missing.
    """
    return read_model(resource(SHIPPED))


def photographs() -> Model:
    """The other network that comes with the program, of drawn photographs.

    Raises:
        ModelError: It is missing.
    """
    return read_model(resource(PHOTOGRAPHS))


def chosen(state: Path) -> Model | None:
    """The network that perception uses by the last `rolling-panda models use`; None for the shipped one.

    Raises:
        InputError: The choice cannot be read.
        ConfigError: The network is missing or has been changed since.
    """
    remedy = "`rolling-panda models use shipped` goes back to the shipped network"
    choice = read_kept(state / CHOICE, _Choice, _Choice(), "the chosen network", remedy)
    if not choice.sha256:
        return None
    model = read_model(state / KEPT / f"{choice.sha256[:12]}.onnx")
    if model.sha256 != choice.sha256:
        raise ConfigError(f"{model.path} was changed since it was chosen; {remedy}")
    return model


def kept(state: Path) -> list[Model]:
    """All networks that were taken into use."""
    return [read_model(path) for path in sorted((state / KEPT).glob("*.onnx"))]


def choose(state: Path, model: Model, figures: dict[str, Figures]) -> None:
    """Copy a network and its card to the state folder; perception uses it from its next start.

    Raises:
        InputError: The folder cannot be written.
    """
    folder = open_state_folder(open_state_folder(state) / KEPT)
    card = model.card or Card(model.sha256, (), "unknown")
    card = msgspec.structs.replace(card, figures={**card.figures, **figures})
    path = folder / f"{model.sha256[:12]}.onnx"
    try:
        replace_durably(path, model.path.read_bytes())
        write_card(path, card)
        replace_durably(state / CHOICE, msgspec.json.encode(_Choice(model.sha256)))
    except OSError as error:
        raise InputError(f"cannot write {folder}: {error.strerror}; nothing is changed") from error


def choose_shipped(state: Path) -> None:
    """Perception uses the shipped network from its next start."""
    (state / CHOICE).unlink(missing_ok=True)
