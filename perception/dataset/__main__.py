"""Labelled pictures of a vineyard, from and for other labelling programs.

import  reads COCO, CVAT for images, labelme, VGG Image Annotator, masks or episodes, and writes a dataset
export  writes a dataset for COCO, CVAT or labelme, or as episodes
check   loads every picture and mask of a dataset, and tells what it holds
"""

import argparse
import shutil
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from perception.dataset.annotations import (
    WRITERS,
    Annotated,
    find_picture,
    paint,
    read_annotations,
)
from perception.dataset.dataset import (
    PICTURES,
    VALUES,
    Dataset,
    Entry,
    Manifest,
    Split,
    Summary,
    add_picture,
    check,
    load_picture,
    new_folder,
    read_dataset,
    stored_size,
    write_manifest,
)
from perception.dataset.episodes import is_episodes, read_episodes, write_episodes
from rolling_panda.errors import InputError, RollingPandaError

_WRITERS = WRITERS | {"episodes": write_episodes}
#: Default share of pictures that are held out, to compare models on.
_HELD_OUT = 0.2


@dataclass(frozen=True)
class Vocabulary:
    """Labels of a published dataset, and the value of what it leaves unlabelled."""

    names: dict[str, str]
    rest: str


#: Not verified: the files were not at hand. The labels of Extremadura are from its paper.
VOCABULARIES = {
    # Gentilhomme and others, "Towards smart pruning: ViNet", 2023.
    "3d2cut": Vocabulary(
        {"main trunk": "trunk", "trunk": "trunk", "courson": "spur", "cane": "cordon", "shoot": "cane",
         "lateral shoot": "cane"},
        "far",
    ),
    # Fernandes and others, "Grapevine winter pruning automation", 2021; Zenodo 5501784.
    "piacenza": Vocabulary(
        {"main cordon": "cordon", "maincordon": "cordon", "arm": "cordon", "spur": "spur", "cane": "cane",
         "node": "node"},
        "far",
    ),
    # Pacioni and others, "Towards intelligent pruning of vineyards", 2025: of a shoot only the beginning is labelled.
    "extremadura": Vocabulary({"shoot": "cane", "pruned shoot": "cane", "trunk": "trunk"}, "unlabelled"),
}  # fmt: skip


def main(argv: Sequence[str] | None = None) -> int:
    """Run the command; returns the exit code."""
    arguments = dataset_parser(__doc__ or "")[0].parse_args(argv)
    try:
        arguments.run(arguments)
    except (RollingPandaError, OSError) as error:
        print(f"rolling-panda dataset {arguments.command}: {error}", file=sys.stderr)
        return 1
    return 0


def dataset_parser(
    description: str,
) -> tuple[argparse.ArgumentParser, "argparse._SubParsersAction[argparse.ArgumentParser]"]:
    """The parser of the command, and its commands, to which others can be added."""
    parser = argparse.ArgumentParser(
        prog="rolling-panda dataset", description=description, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    commands = parser.add_subparsers(dest="command", metavar="COMMAND", required=True)
    take = commands.add_parser("import", help="write a dataset from labels of another program")
    take.set_defaults(run=_import)
    take.add_argument("labels", type=Path, metavar="LABELS", help="file, or folder of labelme files or masks")
    take.add_argument("out", type=Path, metavar="DIR", help="new folder for the dataset")
    take.add_argument("--pictures", type=Path, metavar="DIR", help="folder of the pictures (default: that of LABELS)")
    take.add_argument("--source", required=True, metavar="TEXT", help="where the pictures come from, with the year")
    take.add_argument("--licence", required=True, metavar="TEXT", help="of pictures and labels, or 'own'")
    take.add_argument("--names", choices=sorted(VOCABULARIES), help="labels of a published dataset")
    take.add_argument(
        "--map", action="append", default=[], metavar="LABEL=CLASS", help=f"CLASS is one of {', '.join(VALUES)}"
    )
    take.add_argument("--rest", choices=("far", "unlabelled"), help="what no label covers (default: far)")
    take.add_argument(
        "--classes", default="", metavar="NAMES", help="of masks: names of the values from 0, with commas"
    )
    take.add_argument(
        "--held-out",
        type=float,
        default=_HELD_OUT,
        metavar="SHARE",
        help="of the pictures, the last in order of name; 0 to train on all, 1 to train on none (default: %(default)s)",
    )
    give = commands.add_parser("export", help="write a dataset for another program")
    give.set_defaults(run=_export)
    give.add_argument("dataset", type=Path, metavar="DIR")
    give.add_argument("out", type=Path, metavar="OUT", help="new folder: pictures and labels")
    give.add_argument("--format", choices=sorted(_WRITERS), required=True)
    look = commands.add_parser("check", help="load every picture and mask")
    look.set_defaults(run=_check)
    look.add_argument("dataset", type=Path, metavar="DIR")
    return parser, commands


def _import(arguments: argparse.Namespace) -> None:
    if not 0.0 <= arguments.held_out <= 1.0:
        raise InputError(f"--held-out {arguments.held_out}: give a share from 0 to 1")
    classes = [name.strip() for name in arguments.classes.split(",")] if arguments.classes else []
    episodes = is_episodes(arguments.labels)
    read = read_episodes(arguments.labels) if episodes else read_annotations(arguments.labels, classes)
    annotated = sorted(read, key=lambda each: each.name)
    vocabulary = VOCABULARIES.get(arguments.names, Vocabulary({}, "far"))
    values = _values(annotated, vocabulary, arguments.map)
    rest = VALUES[arguments.rest or vocabulary.rest]
    pictures = arguments.pictures or (arguments.labels if arguments.labels.is_dir() else arguments.labels.parent)
    first_held_out = len(annotated) - round(arguments.held_out * len(annotated))
    entries: list[Entry] = []
    with new_folder(arguments.out) as folder:
        for number, each in enumerate(annotated):
            source = find_picture(pictures, each.name)
            size = load_picture(source).shape[1::-1]
            if each.size not in (None, size):
                turned = ", which its EXIF data turns upright" if stored_size(source) == each.size else ""
                raise InputError(
                    f"{each.file}: {each.name} was labelled with {each.size[0]}×{each.size[1]} pixels{turned}, and "
                    f"{source} has {size[0]}×{size[1]}. Label the picture as it is now"
                )
            labels = paint(each, values, rest, size)
            split: Split = each.split or ("train" if number < first_held_out else "held-out")
            name = add_picture(folder, "_".join(source.relative_to(pictures).parts), source, labels)
            entries.append(Entry(name, split))
        write_manifest(folder, Manifest(arguments.source, arguments.licence, tuple(entries)))
        summary = check(read_dataset(folder))
    _tell(arguments.out, summary)


def _values(annotated: Sequence[Annotated], vocabulary: Vocabulary, options: Sequence[str]) -> dict[str, int]:
    """The value of each label that occurs."""
    given = dict(vocabulary.names)
    for option in options:
        label, _, name = option.rpartition("=")
        if not label or name not in VALUES:
            raise InputError(f"--map {option}: give LABEL=CLASS with a CLASS of {', '.join(VALUES)}")
        given[_plain(label)] = name
    out, unknown = {}, set()
    for label in {shape.label for each in annotated for shape in each.shapes}:
        name = given.get(_plain(label), _plain(label))
        if name in VALUES:
            out[label] = VALUES[name]
        else:
            unknown.add(label)
    if unknown:
        files = sorted({str(each.file) for each in annotated if any(shape.label in unknown for shape in each.shapes)})
        raise InputError(
            f"{files[0]}: unknown labels {', '.join(map(repr, sorted(unknown)))}; give --map LABEL=CLASS for each, "
            f"with a CLASS of {', '.join(VALUES)}"
        )
    return out


def _plain(label: str) -> str:
    return " ".join(label.lower().replace("_", " ").replace("-", " ").split())


def _export(arguments: argparse.Namespace) -> None:
    dataset = read_dataset(arguments.dataset)
    check(dataset)
    with new_folder(arguments.out) as folder:
        shutil.copytree(dataset.folder / PICTURES, folder / PICTURES)
        entries = dataset.manifest.pictures
        write = _WRITERS[arguments.format]
        write(folder, [(entry.name, dataset.load(entry.name)[1], entry.split) for entry in entries])
    print(f"{len(entries)} pictures for {arguments.format} in {arguments.out}")


def _check(arguments: argparse.Namespace) -> None:
    dataset: Dataset = read_dataset(arguments.dataset)
    _tell(arguments.dataset, check(dataset))


def _tell(folder: Path, summary: Summary) -> None:
    pictures = summary.pictures
    print(f"{folder}: {pictures['train']} pictures to train on, {pictures['held-out']} held out")
    total = sum(summary.pixels.values())
    for name, count in summary.pixels.items():
        if count:
            print(f"{name:12} {100.0 * count / total:6.2f} % of the pixels")


if __name__ == "__main__":
    sys.exit(main())
