"""A dataset on disk: `dataset.json`, `pictures/`, and in `masks/` a PNG of the same stem for each picture."""

import hashlib
import shutil
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import msgspec
import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageOps

from perception.arrays import Labels
from perception.segmentation.frame import CANE, NODE, SPUR
from rolling_panda.errors import InputError
from rolling_panda.messages.types import WOOD_CLASSES
from rolling_panda.runtime.state_folder import replace_durably

#: Values of a mask besides the classes: background or ground, and what nobody has labelled.
FAR, UNLABELLED = len(WOOD_CLASSES), 255
#: Value of each name in a mask.
VALUES: dict[str, int] = {name: value for value, name in enumerate((*WOOD_CLASSES, "far"))} | {"unlabelled": UNLABELLED}
Split = Literal["train", "held-out"]
MANIFEST, PICTURES, MASKS = "dataset.json", "pictures", "masks"
PICTURE_SUFFIXES = (".jpg", ".jpeg", ".png", ".tif", ".tiff", ".webp", ".bmp")
#: Least side (px) and greatest number of pixels of a picture.
_MIN_SIDE, _MAX_PIXELS = 64, 64_000_000
_CANE = (CANE, NODE, SPUR)
_READ_ERRORS = (OSError, SyntaxError, ValueError, Image.DecompressionBombError, Image.DecompressionBombWarning)
_ORIENTATION = 0x0112


class Entry(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """A picture of the manifest: its file's name, and what it is for."""

    name: str
    split: Split


class Manifest(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """`dataset.json`.

    Attributes:
        source: Where the pictures come from.
        licence: Of pictures and masks.
        pictures: All of them.
        classes: Value of each class in the masks.
        format: Version of this format.
    """

    source: str
    licence: str
    pictures: tuple[Entry, ...]
    classes: dict[str, int] = msgspec.field(default_factory=VALUES.copy)
    format: Literal[1] = 1


@dataclass(frozen=True)
class Dataset:
    """A dataset that was read; its pictures are loaded on demand."""

    folder: Path
    manifest: Manifest

    def names(self, split: Split) -> list[str]:
        """Pictures of one split, in order."""
        return [entry.name for entry in self.manifest.pictures if entry.split == split]

    def load(self, name: str) -> tuple[NDArray[np.uint8], Labels]:
        """Colours (H×W×3) and mask values (H×W) of one picture.

        Raises:
            InputError: A file is missing, damaged or not as it has to be.
        """
        color = load_picture(self.folder / PICTURES / name)
        mask = self.folder / MASKS / f"{Path(name).stem}.png"
        labels = load_values(mask)
        if labels.shape != color.shape[:2]:
            raise InputError(f"{mask} has {_size(labels)} pixels; its picture {name} has {_size(color)}")
        wrong = sorted(set(np.unique(labels).tolist()) - set(VALUES.values()))
        if wrong:
            raise InputError(f"{mask} holds the value {wrong[0]}; allowed are 0 to {FAR} and {UNLABELLED}")
        return color, labels.astype(np.uint8)


def read_dataset(folder: Path) -> Dataset:
    """Read a dataset's manifest.

    Raises:
        InputError: It is missing, damaged, or names a picture wrongly or twice.
    """
    path = folder / MANIFEST
    try:
        manifest = msgspec.json.decode(path.read_bytes(), type=Manifest)
    except OSError as error:
        raise InputError(
            f"cannot read {path}: {error.strerror}; give a folder that `rolling-panda dataset import` has written"
        ) from error
    except (msgspec.MsgspecError, UnicodeDecodeError) as error:
        raise InputError(f"{path} is no manifest of a dataset: {error}") from error
    if manifest.classes != VALUES:
        raise InputError(f"{path} has the classes {manifest.classes}; this version has {VALUES}. Import it again")
    stems: set[str] = set()
    for entry in manifest.pictures:
        if Path(entry.name).name != entry.name or entry.name in ("", ".", ".."):
            raise InputError(
                f"{path} names the picture {entry.name!r}; give a file's name in {PICTURES}/ without folder"
            )
        stem = Path(entry.name).stem.lower()
        if stem in stems:
            raise InputError(f"{path} names the picture {entry.name!r} twice, or two that differ in their suffix only")
        stems.add(stem)
    return Dataset(folder, manifest)


@dataclass(frozen=True)
class Summary:
    """What a dataset holds: number of pictures of each split, and pixels of each name in `VALUES`."""

    pictures: dict[Split, int]
    pixels: dict[str, int]


def check(dataset: Dataset) -> Summary:
    """Load every picture and mask.

    Raises:
        InputError: One of them is not as it has to be, a split shows no cane, or one picture is in both splits.
    """
    counts = {split: np.zeros(256, np.int64) for split in ("train", "held-out")}
    seen: dict[str, Entry] = {}
    for entry in dataset.manifest.pictures:
        _, labels = dataset.load(entry.name)
        counts[entry.split] += np.bincount(labels.reshape(-1), minlength=256)
        digest = hashlib.sha256((dataset.folder / PICTURES / entry.name).read_bytes()).hexdigest()
        other = seen.setdefault(digest, entry)
        if other.split != entry.split:
            raise InputError(
                f"{other.name} and {entry.name} are the same picture, one to train on and one held "
                "out; leave one of them out"
            )
    if not seen:
        raise InputError(f"{dataset.folder} holds no picture; give at least one with its mask")
    for split, count in counts.items():
        if count.any() and not count[list(_CANE)].sum():
            found = ", ".join(name for name, value in VALUES.items() if count[value])
            raise InputError(
                f"no picture of the split {split} shows a cane, node or spur, only {found}. "
                "Is a class mapped wrongly (--map NAME=CLASS)?"
            )
    total = np.sum(list(counts.values()), axis=0)
    return Summary(
        {"train": len(dataset.names("train")), "held-out": len(dataset.names("held-out"))},
        {name: int(total[value]) for name, value in VALUES.items()},
    )


@contextmanager
def new_folder(path: Path) -> Iterator[Path]:
    """An empty folder that becomes `path` when the block ends without an error, and is removed otherwise.

    Raises:
        InputError: `path` exists, or cannot be written.
    """
    if path.exists():
        raise InputError(f"{path} exists already; give a new folder, or remove that one")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        half = Path(tempfile.mkdtemp(prefix=f".{path.name}.", dir=path.parent))
    except OSError as error:
        raise InputError(f"cannot write {path}: {error.strerror}") from error
    try:
        yield half
        half.chmod(0o755)
        half.rename(path)
    except OSError as error:
        raise InputError(f"cannot write {path}: {error}") from error
    finally:
        shutil.rmtree(half, ignore_errors=True)


def add_picture(folder: Path, name: str, source: Path, labels: Labels) -> str:
    """Add a picture, upright, and its mask to a new dataset; returns its file's name there.

    Args:
        folder: Of the dataset.
        name: Wanted name of the file.
        source: The picture.
        labels: H×W mask values.
    """
    for each in (PICTURES, MASKS):
        (folder / each).mkdir(exist_ok=True)
    with Image.open(source) as image:
        plain = image.format in ("JPEG", "PNG") and image.mode == "RGB" and _turn(image) == 1
        if plain:
            shutil.copyfile(source, folder / PICTURES / name)
        else:
            name = f"{Path(name).stem}.png"
            Image.fromarray(load_picture(source)).save(folder / PICTURES / name)
    Image.fromarray(labels).save(folder / MASKS / f"{Path(name).stem}.png")
    return name


def write_manifest(folder: Path, manifest: Manifest) -> None:
    """Write `dataset.json`; an interruption leaves the old one or the new."""
    replace_durably(folder / MANIFEST, msgspec.json.format(msgspec.json.encode(manifest), indent=1) + b"\n")


def load_picture(path: Path) -> NDArray[np.uint8]:
    """Colours (H×W×3) of a picture, turned upright as its EXIF data says.

    Raises:
        InputError: It cannot be read, is too small or too large, or has not three channels of 8 bits.
    """
    try:
        with Image.open(path) as image:
            width, height = image.size
            if min(width, height) < _MIN_SIDE or width * height > _MAX_PIXELS:
                raise InputError(
                    f"{path} has {width}×{height} pixels; allowed are {_MIN_SIDE} a side to {_MAX_PIXELS // 10**6} "
                    "million in all. Scale it, and label it anew"
                )
            if image.mode not in ("RGB", "RGBA", "P"):
                raise InputError(
                    f"{path} has the colour mode {image.mode}; allowed is RGB with 8 bits a channel. "
                    "Convert it, for instance with `magick IN -colorspace sRGB -depth 8 OUT.png`"
                )
            return np.asarray(ImageOps.exif_transpose(image).convert("RGB"), dtype=np.uint8)
    except _READ_ERRORS as error:
        raise InputError(
            f"cannot read the picture {path}: {error}; give a whole JPEG, PNG, TIFF or WebP file"
        ) from error


def stored_size(path: Path) -> tuple[int, int]:
    """Width and height of a picture as it is stored, before it is turned upright."""
    with Image.open(path) as image:
        return image.size


def load_values(path: Path) -> NDArray[np.int64]:
    """Values of a mask (H×W): one channel, or indices of a palette.

    Raises:
        InputError: It cannot be read, is too large, or is in colour.
    """
    try:
        with Image.open(path) as image:
            if image.width * image.height > _MAX_PIXELS:
                raise InputError(f"{path} has {image.width}×{image.height} pixels; allowed are {_MAX_PIXELS} in all")
            if image.mode not in ("1", "L", "P", "I", "I;16"):
                raise InputError(f"{path} has mode {image.mode}; give class indices in one channel or with a palette")
            return np.asarray(image).astype(np.int64)
    except _READ_ERRORS as error:
        raise InputError(f"cannot read the mask {path}: {error}") from error


def _turn(image: Image.Image) -> int:
    return int(image.getexif().get(_ORIENTATION, 1))


def _size(values: NDArray[np.generic]) -> str:
    return f"{values.shape[1]}×{values.shape[0]}"
