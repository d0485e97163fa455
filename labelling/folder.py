"""What `rolling-panda dataset label` opens: a dataset, or a folder of pictures, which becomes one."""

import shutil
import tempfile
from pathlib import Path

import numpy as np

from perception.dataset.dataset import (
    MANIFEST,
    MASKS,
    PICTURE_SUFFIXES,
    PICTURES,
    UNLABELLED,
    Dataset,
    Entry,
    Manifest,
    add_picture,
    load_picture,
    new_folder,
    read_dataset,
    write_manifest,
)
from rolling_panda.errors import InputError

#: Share of the pictures of a new dataset that are held out: the last in order of name.
_HELD_OUT = 0.2


def open_folder(folder: Path, out: Path | None = None, source: str = "", licence: str = "own") -> tuple[Dataset, int]:
    """The dataset of a folder, and how many pictures were copied into it.

    A folder of pictures stays as it is: its pictures are copied, unlabelled, to the dataset `out`. Pictures that are
    there already keep their labels.

    Args:
        folder: Dataset, or folder of pictures.
        out: Dataset of a folder of pictures; `FOLDER-labelled` by default.
        source: Of a new dataset.
        licence: Of a new dataset.

    Raises:
        InputError: It holds no picture, or one that cannot be used. Nothing is written then.
    """
    if (folder / MANIFEST).exists():
        if out is not None and out.resolve() != folder.resolve():
            raise InputError(f"{folder} is a dataset, which is labelled in place; leave --out away")
        return read_dataset(folder), 0
    if not folder.is_dir():
        raise InputError(f"{folder} is no folder; give a dataset or a folder of pictures")
    pictures = sorted(path for path in folder.iterdir() if path.suffix.lower() in PICTURE_SUFFIXES and path.is_file())
    if not pictures:
        raise InputError(f"{folder} holds no {MANIFEST} and no picture; give a dataset or a folder of pictures")
    stems: dict[str, Path] = {}
    for path in pictures:
        other = stems.setdefault(path.stem.lower(), path)
        if other is not path:
            raise InputError(f"{other} and {path} differ in their suffix only; rename one")
    target = out or folder.with_name(f"{folder.resolve().name}-labelled")
    if not target.exists():
        return _new(pictures, target, Manifest(source or f"pictures of {folder.resolve().name}", licence, ()))
    dataset = read_dataset(target)
    known = {Path(entry.name).stem.lower() for entry in dataset.manifest.pictures}
    return _extended(dataset, [path for path in pictures if path.stem.lower() not in known])


def _new(pictures: list[Path], target: Path, manifest: Manifest) -> tuple[Dataset, int]:
    first_held_out = len(pictures) - max(round(_HELD_OUT * len(pictures)), int(len(pictures) > 1))
    with new_folder(target) as half:
        names = [_add(half, path) for path in pictures]
        entries = [Entry(name, "train" if at < first_held_out else "held-out") for at, name in enumerate(names)]
        write_manifest(half, Manifest(manifest.source, manifest.licence, tuple(entries)))
    return read_dataset(target), len(pictures)


def _extended(dataset: Dataset, pictures: list[Path]) -> tuple[Dataset, int]:
    if not pictures:
        return dataset, 0
    old = dataset.manifest
    # All are read before one is written, and the manifest, which names them, is written last.
    with tempfile.TemporaryDirectory(dir=dataset.folder) as half:
        added = [Entry(_add(Path(half), path), "train") for path in pictures]
        for each in (PICTURES, MASKS):
            for path in (Path(half) / each).iterdir():
                shutil.copyfile(path, dataset.folder / each / path.name)
    write_manifest(dataset.folder, Manifest(old.source, old.licence, (*old.pictures, *added)))
    return read_dataset(dataset.folder), len(added)


def _add(folder: Path, path: Path) -> str:
    labels = np.full(load_picture(path).shape[:2], UNLABELLED, np.uint8)
    return add_picture(folder, path.name, path, labels)
