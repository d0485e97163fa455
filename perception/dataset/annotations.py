"""Files of other labelling programs, read and written: COCO, CVAT for images, labelme, VGG Image Annotator, masks.

Coordinates are in pixels from the picture's upper left corner, so that the first pixel's centre is at (0.5, 0.5).
"""

import base64
import binascii
import io
import itertools
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import msgspec
import numpy as np
from numpy.typing import NDArray
from PIL import Image
from skimage.draw import polygon as fill

from perception.arrays import Labels, Mask
from perception.dataset.dataset import PICTURE_SUFFIXES, VALUES, Split, load_values
from rolling_panda.errors import InputError

#: A polygon may leave its picture by this share of a side, as when a hand slips; what is outside is cut off.
_SLIP = 0.03
_BY_KEY = ("class", "label", "name", "type")


@dataclass(frozen=True)
class Shape:
    """A labelled part of a picture: polygons (N×2 each, px), or the true pixels of a mask whose corner is at `at`."""

    label: str
    polygons: tuple[NDArray[np.float64], ...] = ()
    mask: Mask | None = None
    at: tuple[int, int] = (0, 0)


@dataclass(frozen=True)
class Annotated:
    """A picture as another program labelled it.

    Attributes:
        name: Path of the picture, relative to the folder of pictures.
        size: Width and height that the file tells (px); None where it tells none.
        shapes: In the order of drawing: later ones lie above.
        file: Where this is written, for messages.
        split: What the picture is for, if the file tells.
    """

    name: str
    size: tuple[int, int] | None
    shapes: tuple[Shape, ...]
    file: Path
    split: Split | None = None


def read_annotations(path: Path, classes: Sequence[str] = ()) -> list[Annotated]:
    """Read any of the known formats; which one it is follows from the content.

    Args:
        path: A COCO or VIA JSON file, a CVAT XML file, a labelme JSON file or a folder of them, or a folder of masks.
        classes: Names of the values of masks, from 0.

    Raises:
        InputError: It cannot be read, or is of no known format.
    """
    if path.is_dir():
        documents = sorted(path.glob("*.json"))
        if documents:
            return [each for document in documents for each in _read_file(document)]
        masks = sorted(path.glob("*.png"))
        if masks and classes:
            return [_of_mask(mask, classes) for mask in masks]
        wanted = "--classes with the names of their values" if masks else "labelme files (*.json) or masks (*.png)"
        raise InputError(f"{path}: cannot tell what is labelled; {wanted} is needed")
    return _read_file(path)


def paint(annotated: Annotated, values: dict[str, int], rest: int, size: tuple[int, int]) -> Labels:
    """Mask values (H×W) of a picture.

    Args:
        annotated: What was labelled.
        values: Of each label.
        rest: Value of pixels that no shape covers.
        size: Width and height of the picture (px).

    Raises:
        InputError: A shape has no area or is not on the picture.
    """
    out = np.full((size[1], size[0]), rest, np.uint8)
    for shape in annotated.shapes:
        out[_pixels(annotated, shape, size)] = values[shape.label]
    return out


def _pixels(annotated: Annotated, shape: Shape, size: tuple[int, int]) -> Mask:
    out = np.zeros((size[1], size[0]), bool)
    where = f"{annotated.file}: {shape.label!r} on {annotated.name}"
    if shape.mask is not None:
        (x, y), (height, width) = shape.at, shape.mask.shape
        if min(x, y) < 0 or x + width > size[0] or y + height > size[1]:
            raise InputError(
                f"{where} covers {width}×{height} pixels from ({x}, {y}); the picture has {size[0]}×{size[1]}"
            )
        out[y : y + height, x : x + width] = shape.mask
        return out
    for corners in shape.polygons:
        if len(corners) < 3 or not np.isfinite(corners).all():
            raise InputError(f"{where} has {len(corners)} corners or one that is no number; give three or more")
        slip = _SLIP * np.array(size)
        if (corners < -slip).any() or (corners > size + slip).any():
            low, high = corners.min(axis=0), corners.max(axis=0)
            raise InputError(
                f"{where} reaches from ({low[0]:.0f}, {low[1]:.0f}) to ({high[0]:.0f}, {high[1]:.0f}); the picture has "
                f"{size[0]}×{size[1]} pixels. Was it scaled or turned after it was labelled?"
            )
        out[fill(corners[:, 1] - 0.5, corners[:, 0] - 0.5, out.shape)] = True
    return out


class _CocoImage(msgspec.Struct):
    id: int
    file_name: str
    width: int
    height: int


class _CocoCategory(msgspec.Struct):
    id: int
    name: str


class _Rle(msgspec.Struct):
    size: tuple[int, int]
    counts: str | list[int]


class _CocoAnnotation(msgspec.Struct):
    image_id: int
    category_id: int
    segmentation: _Rle | list[list[float]] | None = None


class _Coco(msgspec.Struct):
    images: list[_CocoImage]
    categories: list[_CocoCategory]
    annotations: list[_CocoAnnotation]


class _LabelmeShape(msgspec.Struct):
    label: str
    points: list[tuple[float, float]]
    shape_type: str = "polygon"
    mask: str | None = None


class _Labelme(msgspec.Struct):
    shapes: list[_LabelmeShape]
    image_path: str = msgspec.field(name="imagePath")
    height: int | None = msgspec.field(name="imageHeight", default=None)
    width: int | None = msgspec.field(name="imageWidth", default=None)


class _ViaRegion(msgspec.Struct):
    shape_attributes: dict[str, Any]
    region_attributes: dict[str, Any]


class _ViaImage(msgspec.Struct):
    filename: str
    regions: list[_ViaRegion] | dict[str, _ViaRegion]


def _read_file(path: Path) -> list[Annotated]:
    try:
        data = path.read_bytes()
        if path.suffix.lower() == ".xml":
            return _cvat(path, ElementTree.fromstring(data))
        document = msgspec.json.decode(data)
        if not isinstance(document, dict):
            raise InputError(f"{path} is of no known format: it holds no JSON object")
        if "images" in document:
            return _coco(path, msgspec.convert(document, _Coco))
        if "shapes" in document:
            return [_labelme(path, msgspec.convert(document, _Labelme))]
        images = document.get("_via_img_metadata", document)
        if images and all(isinstance(each, dict) and "regions" in each for each in images.values()):
            return [_via(path, each) for each in msgspec.convert(images, dict[str, _ViaImage]).values()]
    except (OSError, msgspec.MsgspecError, UnicodeDecodeError, ElementTree.ParseError) as error:
        raise InputError(f"cannot read {path}: {error}") from error
    raise InputError(f"{path} is of no known format; known are COCO, CVAT for images, labelme and VIA")


def _coco(path: Path, document: _Coco) -> list[Annotated]:
    names = {each.id: each.name for each in document.categories}
    images = {each.id: each for each in document.images}
    shapes: dict[int, list[Shape]] = {number: [] for number in images}
    for each in document.annotations:
        if each.image_id not in images or each.category_id not in names:
            raise InputError(
                f"{path}: an annotation names image {each.image_id} and category {each.category_id}; one is not listed"
            )
        label, outline = names[each.category_id], each.segmentation
        name = images[each.image_id].file_name
        if not outline:
            raise InputError(f"{path}: {label!r} on {name} has a box only; give polygons or RLE")
        if isinstance(outline, _Rle):
            shapes[each.image_id].append(Shape(label, mask=_coco_mask(f"{path}: {label!r} on {name}", outline)))
        else:
            polygons = tuple(np.array(flat[: len(flat) // 2 * 2], float).reshape(-1, 2) for flat in outline)
            shapes[each.image_id].append(Shape(label, polygons))
    return [
        Annotated(image.file_name, (image.width, image.height), tuple(shapes[number]), path)
        for number, image in images.items()
    ]


def _coco_mask(where: str, rle: _Rle) -> Mask:
    """Runs go down the columns. Compressed they have 5 bits a character; from the fourth on, less the last but one."""
    counts = rle.counts
    if isinstance(counts, str):
        text, counts, at = counts, [], 0
        while at < len(text):
            value, shift, more = 0, 0, True
            while more and at < len(text):
                code = ord(text[at]) - 48
                value |= (code & 0x1F) << shift
                more, shift, at = bool(code & 0x20), shift + 5, at + 1
                if not more and code & 0x10:
                    value -= 1 << shift
            counts.append(value + (counts[-2] if len(counts) > 2 else 0))
    return _runs(where, counts, rle.size[1], rle.size[0]).T


def _runs(where: str, counts: Sequence[int], rows: int, columns: int) -> Mask:
    """A mask (rows × columns) from lengths of runs, of pixels outside first."""
    if min(counts, default=-1) < 0 or min(rows, columns) < 0 or sum(counts) != rows * columns:
        raise InputError(f"{where} has a damaged RLE: its runs do not add up to {columns}×{rows} pixels")
    return np.repeat(np.arange(len(counts)) % 2 == 1, counts).reshape(rows, columns)


def _cvat(path: Path, root: ElementTree.Element) -> list[Annotated]:
    out = []
    for image in root.iter("image"):
        name, size = image.get("name", ""), (_whole(path, image, "width"), _whole(path, image, "height"))
        shapes = []
        for each in sorted(image, key=lambda element: _whole(path, element, "z_order")):
            label = each.get("label", "")
            where = f"{path}: {label!r} on {name}"
            if each.tag == "polygon":
                try:
                    corners = [[float(v) for v in pair.split(",")] for pair in each.get("points", "").split(";")]
                    shapes.append(Shape(label, (np.array(corners).reshape(-1, 2),)))
                except ValueError as error:
                    raise InputError(f"{where}: its points are no list of x,y pairs: {error}") from error
            elif each.tag == "mask":
                left, top, width, height = (_whole(path, each, key) for key in ("left", "top", "width", "height"))
                try:
                    counts = [int(run) for run in each.get("rle", "").split(",")]
                except ValueError as error:
                    raise InputError(f"{where}: its RLE is no list of whole numbers: {error}") from error
                shapes.append(Shape(label, mask=_runs(where, counts, height, width), at=(left, top)))
            elif each.tag != "tag":
                raise InputError(f"{where} is a {each.tag}; give polygons or masks")
        out.append(Annotated(name, size, tuple(shapes), path))
    if not out:
        raise InputError(f"{path} holds no image; export from CVAT as 'CVAT for images 1.1'")
    return out


def _whole(path: Path, element: ElementTree.Element, key: str) -> int:
    text = element.get(key, "0")
    try:
        return int(text)
    except ValueError as error:
        raise InputError(f"{path}: {element.tag} has {key}={text!r}; give a whole number") from error


def _labelme(path: Path, document: _Labelme) -> Annotated:
    shapes = []
    for each in document.shapes:
        where = f"{path}: {each.label!r}"
        corners = np.array(each.points, float).reshape(-1, 2)
        if each.shape_type == "polygon":
            shapes.append(Shape(each.label, (corners,)))
        elif each.shape_type == "mask" and each.mask is not None and len(corners) == 2:
            try:
                with Image.open(io.BytesIO(base64.b64decode(each.mask, validate=True))) as image:
                    mask = np.asarray(image) > 0
            except (OSError, SyntaxError, ValueError, binascii.Error) as error:
                raise InputError(f"{where} has a damaged mask: {error}") from error
            x, y = np.floor(corners[0]).astype(int)
            shapes.append(Shape(each.label, mask=mask, at=(int(x), int(y))))
        else:
            raise InputError(f"{where} is a {each.shape_type}; give polygons or masks")
    size = (document.width, document.height) if document.width and document.height else None
    return Annotated(document.image_path.replace("\\", "/"), size, tuple(shapes), path)


def _via(path: Path, image: _ViaImage) -> Annotated:
    regions = image.regions.values() if isinstance(image.regions, dict) else image.regions
    shapes = []
    for region in regions:
        form, told = region.shape_attributes, region.region_attributes
        keys = [key for key in told if key in _BY_KEY] or list(told)
        label = told[keys[0]] if len(keys) == 1 else None
        where = f"{path}: {label!r} on {image.filename}"
        if not isinstance(label, str):
            raise InputError(f"{where}: its attributes {told} name no class; give one attribute with its name")
        xs, ys = form.get("all_points_x"), form.get("all_points_y")
        if form.get("name") != "polygon" or not isinstance(xs, list) or not isinstance(ys, list) or len(xs) != len(ys):
            raise InputError(f"{where} is a {form.get('name')}; give polygons")
        corners = np.array(msgspec.convert([xs, ys], list[list[float]])).T
        shapes.append(Shape(label, (corners,)))
    return Annotated(image.filename, None, tuple(shapes), path)


def _of_mask(path: Path, classes: Sequence[str]) -> Annotated:
    values = load_values(path)
    if values.max(initial=0) >= len(classes):
        raise InputError(f"{path} holds the value {values.max()}; --classes names {len(classes)}: {', '.join(classes)}")
    shapes = tuple(Shape(name, mask=values == value) for value, name in enumerate(classes) if (values == value).any())
    return Annotated(path.stem, (values.shape[1], values.shape[0]), shapes, path)


def find_picture(folder: Path, name: str) -> Path:
    """The file of a picture.

    Args:
        folder: Of the pictures.
        name: Relative to it; the suffix may be missing.

    Raises:
        InputError: There is none, or it is outside the folder.
    """
    path = folder / name
    if not path.resolve().is_relative_to(folder.resolve()):
        raise InputError(f"the picture {name!r} is outside {folder}; name pictures relative to that folder")
    candidates = [path, *(path.with_name(path.name + suffix) for suffix in PICTURE_SUFFIXES)]
    for candidate in candidates:
        if candidate.is_file():
            return candidate
    raise InputError(f"{path} is missing; give the folder of the pictures with --pictures")


#: A picture to export: its file's name, its mask values, and what it is for.
Exported = tuple[str, Labels, Split]


def parts(labels: Labels) -> Iterator[tuple[str, Mask]]:
    """The classes of a mask that other programs are told; far and unlabelled pixels are what remains."""
    for name, value in VALUES.items():
        if name not in ("far", "unlabelled") and (labels == value).any():
            yield name, labels == value


def write_coco(folder: Path, pictures: Sequence[Exported]) -> None:
    """`annotations.json`, with an uncompressed RLE for each class of a picture."""
    numbers = {name: value + 1 for name, value in VALUES.items() if name not in ("far", "unlabelled")}
    images: list[dict[str, Any]] = []
    annotations: list[dict[str, Any]] = []
    for number, (name, labels, _) in enumerate(pictures, 1):
        height, width = labels.shape
        images.append({"id": number, "file_name": name, "width": width, "height": height})
        for label, mask in parts(labels):
            rows, columns = np.flatnonzero(mask.any(axis=1)), np.flatnonzero(mask.any(axis=0))
            box = [int(v) for v in (columns[0], rows[0], columns[-1] - columns[0] + 1, rows[-1] - rows[0] + 1)]
            annotations.append(
                {
                    "id": len(annotations) + 1,
                    "image_id": number,
                    "category_id": numbers[label],
                    "segmentation": {"size": [height, width], "counts": run_lengths(mask.T)},
                    "area": int(mask.sum()),
                    "bbox": box,
                    "iscrowd": 1,
                }
            )
    categories = [{"id": number, "name": name} for name, number in numbers.items()]
    document = {"images": images, "categories": categories, "annotations": annotations}
    (folder / "annotations.json").write_bytes(msgspec.json.encode(document))


def write_cvat(folder: Path, pictures: Sequence[Exported]) -> None:
    """`annotations.xml`, CVAT for images 1.1, with a mask for each class of a picture."""
    root = ElementTree.Element("annotations")
    ElementTree.SubElement(root, "version").text = "1.1"
    for number, (name, labels, _) in enumerate(pictures):
        height, width = labels.shape
        size = {"width": str(width), "height": str(height)}
        image = ElementTree.SubElement(root, "image", {"id": str(number), "name": name, **size})
        for label, mask in parts(labels):
            runs = ", ".join(str(run) for run in run_lengths(mask))
            corner = {"left": "0", "top": "0", "z_order": "0", "occluded": "0", "source": "manual"}
            ElementTree.SubElement(image, "mask", {"label": label, "rle": runs, **corner, **size})
    ElementTree.ElementTree(root).write(folder / "annotations.xml", encoding="utf-8", xml_declaration=True)


def write_labelme(folder: Path, pictures: Sequence[Exported]) -> None:
    """A JSON file for each picture, with a mask for each class; for labelme 5.3 or later."""
    for name, labels, _ in pictures:
        height, width = labels.shape
        shapes: list[dict[str, Any]] = []
        for label, mask in parts(labels):
            data = io.BytesIO()
            Image.fromarray(mask).save(data, format="PNG")
            shapes.append(
                {
                    "label": label,
                    "points": [[0, 0], [width - 1, height - 1]],
                    "group_id": None,
                    "description": "",
                    "shape_type": "mask",
                    "flags": {},
                    "mask": base64.b64encode(data.getvalue()).decode(),
                }
            )
        document = {
            "version": "5.3.0",
            "flags": {},
            "shapes": shapes,
            "imagePath": f"pictures/{name}",
            "imageData": None,
            "imageHeight": height,
            "imageWidth": width,
        }
        (folder / f"{Path(name).stem}.json").write_bytes(msgspec.json.encode(document))


WRITERS: dict[str, Callable[[Path, Sequence[Exported]], None]] = {
    "coco": write_coco,
    "cvat": write_cvat,
    "labelme": write_labelme,
}


def run_lengths(mask: Mask) -> list[int]:
    """Lengths of the runs of a mask along its rows, of pixels outside first."""
    lengths = [(bool(value), sum(1 for _ in run)) for value, run in itertools.groupby(mask.reshape(-1).tolist())]
    return ([0] if lengths and lengths[0][0] else []) + [length for _, length in lengths]
