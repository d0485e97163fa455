"""Pictures of a dataset and their masks, as the labelling page reads and saves them."""

import hashlib
import io
import threading
import zlib
from dataclasses import dataclass
from pathlib import Path

import msgspec
import numpy as np
from PIL import Image

from perception.arrays import Labels
from perception.dataset.dataset import (
    FAR,
    MANIFEST,
    MASKS,
    PICTURES,
    UNLABELLED,
    VALUES,
    Dataset,
    Entry,
    Manifest,
    Split,
    load_picture,
    load_values,
    read_dataset,
    write_manifest,
)
from rolling_panda.errors import InputError
from rolling_panda.runtime.state_folder import replace_durably

#: Width and height into which small pictures fit (px).
_SMALL = (160, 120)


class ChangedMaskError(InputError):
    """A mask on disk is another one than the page has begun from."""


@dataclass(frozen=True)
class Mask:
    """Values of a picture's pixels (H×W), and the revision of their file: empty where there is none."""

    labels: Labels
    revision: str


class Row(msgspec.Struct, frozen=True):
    """A picture of the list: its share of labelled pixels, or what is wrong with it."""

    name: str
    split: Split
    labelled: float
    problem: str


class Pictures:
    """The pictures of one dataset. Any thread may use it."""

    def __init__(self, folder: Path) -> None:
        """Nothing is read."""
        self.folder = folder
        self._lock = threading.Lock()
        self._shares: dict[str, tuple[tuple[int, int], float]] = {}

    def rows(self) -> tuple[Manifest, list[Row]]:
        """The manifest and the list.

        Raises:
            InputError: The manifest cannot be read.
        """
        manifest = self._dataset().manifest
        return manifest, [self.row(entry) for entry in manifest.pictures]

    def row(self, entry: Entry) -> Row:
        """One picture of the list."""
        try:
            return Row(entry.name, entry.split, self._share(entry.name), "")
        except InputError as error:
            return Row(entry.name, entry.split, 0.0, str(error))

    def picture(self, name: str) -> tuple[bytes, str]:
        """A picture, upright, and its media type.

        Raises:
            InputError: It cannot be read.
        """
        path = self._picture(name)
        if path.suffix.lower() in (".jpg", ".jpeg", ".png"):
            # The page turns it upright as this program does, by the EXIF data.
            load_picture(path)
            return path.read_bytes(), "image/png" if path.suffix.lower() == ".png" else "image/jpeg"
        content = io.BytesIO()
        Image.fromarray(load_picture(path)).save(content, "PNG", compress_level=1)
        return content.getvalue(), "image/png"

    def small(self, name: str) -> bytes:
        """A picture in small, as JPEG.

        Raises:
            InputError: It cannot be read.
        """
        image = Image.fromarray(load_picture(self._picture(name)))
        image.thumbnail(_SMALL)
        content = io.BytesIO()
        image.save(content, "JPEG", quality=80)
        return content.getvalue()

    def mask(self, name: str) -> Mask:
        """The mask of a picture; all unlabelled where there is no file.

        Raises:
            InputError: The picture or its mask cannot be read, or they are of different sizes.
        """
        path = self._mask(name)
        if not path.exists():
            return Mask(np.full(load_picture(self._picture(name)).shape[:2], UNLABELLED, np.uint8), "")
        return Mask(self._dataset().load(name)[1], _revision(path))

    def save(self, name: str, packed: bytes, was: str) -> tuple[Row, str]:
        """Replace the mask of a picture, atomically and durably; returns its row and the new revision.

        Args:
            name: Of the picture.
            packed: Its H·W values in rows, compressed by zlib or gzip.
            was: Revision that the page has begun from.

        Raises:
            ChangedMaskError: The file has another revision.
            InputError: These are no values of this picture, or the file cannot be written.
        """
        path = self._mask(name)
        height, width = load_picture(self._picture(name)).shape[:2]
        labels = _unpacked(packed, height * width).reshape(height, width)
        content = io.BytesIO()
        Image.fromarray(labels).save(content, "PNG")
        with self._lock:
            if (_revision(path) if path.exists() else "") != was:
                raise ChangedMaskError(f"{path} has been changed by another window or program")
            try:
                path.parent.mkdir(exist_ok=True)
                replace_durably(path, content.getvalue())
            except OSError as error:
                raise InputError(f"cannot write {path}: {error.strerror}") from error
        return self.row(self._entry(name)), _digest(content.getvalue())

    def assign(self, name: str, split: Split) -> Row:
        """Move a picture to a split.

        Raises:
            InputError: There is no such picture, or the manifest cannot be written.
        """
        with self._lock:
            manifest = self._dataset().manifest
            self._entry(name)
            entries = tuple(Entry(each.name, split if each.name == name else each.split) for each in manifest.pictures)
            new = msgspec.structs.replace(manifest, pictures=entries)
            try:
                write_manifest(self.folder, new)
            except OSError as error:
                raise InputError(f"cannot write {self.folder / MANIFEST}: {error.strerror}") from error
        return self.row(self._entry(name))

    def path(self, name: str) -> Path:
        """Of a picture's file.

        Raises:
            InputError: The dataset has no such picture.
        """
        return self._picture(name)

    def _dataset(self) -> Dataset:
        return read_dataset(self.folder)

    def _entry(self, name: str) -> Entry:
        for entry in self._dataset().manifest.pictures:
            if entry.name == name:
                return entry
        raise InputError(f"{self.folder} has no picture {name!r}")

    def _picture(self, name: str) -> Path:
        return self.folder / PICTURES / self._entry(name).name

    def _mask(self, name: str) -> Path:
        return self.folder / MASKS / f"{Path(self._entry(name).name).stem}.png"

    def _share(self, name: str) -> float:
        """Share of labelled pixels; files that have not changed are not read again."""
        path = self._mask(name)
        try:
            status = path.stat()
        except FileNotFoundError:
            return 0.0
        except OSError as error:
            raise InputError(f"cannot read {path}: {error.strerror}") from error
        mark = status.st_mtime_ns, status.st_size
        known = self._shares.get(name)
        if known is None or known[0] != mark:
            known = mark, float(np.mean(load_values(path) != UNLABELLED))
            self._shares[name] = known
        return known[1]


def packed(labels: Labels) -> bytes:
    """Values of a mask (H×W) in rows, compressed by zlib, which HTTP calls `deflate`."""
    return zlib.compress(np.ascontiguousarray(labels).tobytes(), 1)


def _unpacked(content: bytes, count: int) -> Labels:
    # 47: the header says whether it is zlib or gzip. One byte more than asked tells of too many.
    reader = zlib.decompressobj(47)
    try:
        values = reader.decompress(content, count + 1)
    except zlib.error as error:
        raise InputError(f"the mask cannot be unpacked: {error}") from error
    if len(values) != count or not reader.eof:
        raise InputError(f"the mask has not the {count} pixels of its picture")
    labels = np.frombuffer(values, np.uint8)
    allowed = np.zeros(256, bool)
    allowed[list(VALUES.values())] = True
    if not allowed[labels].all():
        raise InputError(f"the mask holds values that are no class; allowed are 0 to {FAR} and {UNLABELLED}")
    return labels


def _revision(path: Path) -> str:
    try:
        return _digest(path.read_bytes())
    except OSError as error:
        raise InputError(f"cannot read {path}: {error.strerror}") from error


def _digest(content: bytes) -> str:
    return hashlib.sha256(content).hexdigest()[:32]
