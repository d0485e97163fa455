"""What other labelling programs write, on small samples made up after their documents."""

import base64
import io
import json

import numpy as np
import pytest
from PIL import Image

from perception.dataset.annotations import WRITERS, find_picture, paint, read_annotations
from perception.dataset.dataset import FAR
from perception.segmentation.frame import CANE, CORDON, NODE, TRUNK
from rolling_panda.errors import InputError

SIZE = (80, 64)
VALUES = {"cane": CANE, "trunk": TRUNK, "node": NODE, "cordon": CORDON}
#: Corners of columns 20 to 29 and rows 10 to 49.
SQUARE = [20.0, 10.0, 30.0, 10.0, 30.0, 50.0, 20.0, 50.0]


def truth() -> np.ndarray:
    out = np.full(SIZE[::-1], FAR, np.uint8)
    out[10:50, 20:30] = CANE
    return out


def written(folder, name, document) -> list:
    path = folder / name
    path.write_text(document if isinstance(document, str) else json.dumps(document), encoding="utf-8")
    return read_annotations(path)


def coco(segmentation, **image) -> dict:
    return {
        "images": [{"id": 7, "file_name": "a.jpg", "width": 80, "height": 64, **image}],
        "categories": [{"id": 3, "name": "cane"}],
        "annotations": [{"id": 1, "image_id": 7, "category_id": 3, "segmentation": segmentation}],
    }


def labelme(**shape) -> dict:
    corners = np.reshape(SQUARE, (-1, 2)).tolist()
    shapes = [{"label": "cane", "points": corners, "shape_type": "polygon", **shape}]
    return {"imagePath": "a.jpg", "imageHeight": 64, "imageWidth": 80, "imageData": None, "shapes": shapes}


def cvat(shape: str) -> str:
    image = f'<image id="0" name="a.jpg" width="80" height="64">{shape}</image>'
    return f"<annotations><version>1.1</version><meta/>{image}</annotations>"


def via(shape=None, told=None) -> dict:
    form = shape or {"name": "polygon", "all_points_x": SQUARE[::2], "all_points_y": SQUARE[1::2]}
    region = {"shape_attributes": form, "region_attributes": told or {"class": "cane"}}
    return {"a.jpg123": {"filename": "a.jpg", "size": 123, "regions": [region], "file_attributes": {}}}


def png(mask: np.ndarray) -> str:
    data = io.BytesIO()
    Image.fromarray(mask).save(data, format="PNG")
    return base64.b64encode(data.getvalue()).decode()


CVAT_POLYGON = '<polygon label="cane" points="20,10;30,10;30,50;20,50" z_order="0"/>'
CVAT_MASK = f'<mask label="cane" rle="0, {400}" left="20" top="10" width="10" height="40" z_order="0"/>'
#: 10 rows of pixels before the first run of 40 in a column of 64, after 20 columns; then 24 between.
RUNS = [20 * 64 + 10, *([40, 24] * 9), 40, 14 + 50 * 64]


@pytest.mark.parametrize(
    ("name", "document"),
    [
        ("a.json", coco([SQUARE])),
        ("a.json", coco({"size": [64, 80], "counts": RUNS})),
        ("a.xml", cvat(CVAT_POLYGON)),
        ("a.xml", cvat(CVAT_MASK)),
        ("a.json", labelme()),
        ("a.json", labelme(shape_type="mask", points=[[20, 10], [29, 49]], mask=png(np.ones((40, 10), bool)))),
        ("a.json", via()),
        ("a.json", {"_via_settings": {}, "_via_img_metadata": via()}),
        ("a.json", via(told={"occluded": "no", "type": "cane"})),
    ],
)
def test_each_format_gives_the_same_pixels(tmp_path, name, document):
    (read,) = written(tmp_path, name, document)
    assert read.name == "a.jpg" and read.size in (None, SIZE)
    np.testing.assert_array_equal(paint(read, VALUES, FAR, SIZE), truth())


def test_a_compressed_rle_is_read_as_pycocotools_wrote_it(tmp_path):
    mask = np.zeros((7, 9), bool)
    mask[1:6, 2:4], mask[3:5, 3:8], mask[0, 8] = True, True, True
    (read,) = written(tmp_path, "a.json", coco({"size": [7, 9], "counts": "?5202M100000MO4"}, width=9, height=7))
    np.testing.assert_array_equal(paint(read, VALUES, 0, (9, 7)) == CANE, mask)


def test_later_shapes_lie_above_and_cvat_has_its_own_order(tmp_path):
    low = CVAT_POLYGON.replace("cane", "trunk").replace('z_order="0"', 'z_order="-1"')
    (read,) = written(tmp_path, "a.xml", cvat(CVAT_POLYGON + low))
    np.testing.assert_array_equal(paint(read, VALUES, FAR, SIZE), truth())
    (read,) = written(tmp_path, "a.xml", cvat(CVAT_POLYGON + CVAT_POLYGON.replace("cane", "trunk")))
    assert (paint(read, VALUES, FAR, SIZE)[truth() == CANE] == TRUNK).all()


def test_a_folder_of_masks_is_read_by_the_names_of_its_values(tmp_path):
    Image.fromarray(np.where(truth() == CANE, 2, 0).astype(np.uint8)).save(tmp_path / "a.png")
    (read,) = read_annotations(tmp_path, ["background", "trunk", "cane"])
    assert (read.name, read.size) == ("a", SIZE)
    np.testing.assert_array_equal(paint(read, VALUES | {"background": FAR}, 0, SIZE), truth())
    with pytest.raises(InputError, match="--classes"):
        read_annotations(tmp_path)
    with pytest.raises(InputError, match="a.png holds the value 2"):
        read_annotations(tmp_path, ["background", "trunk"])


@pytest.mark.parametrize("kind", sorted(WRITERS))
def test_what_is_exported_is_read_back_pixel_by_pixel(tmp_path, kind):
    rng = np.random.default_rng(4)
    labels = np.full((64, 80), FAR, np.uint8)
    labels[8:60, 3:70] = rng.choice([FAR, CANE, TRUNK, NODE], (52, 67))
    labels[0, 0] = labels[-1, -1] = CORDON
    empty = np.full((70, 65), FAR, np.uint8)
    WRITERS[kind](tmp_path, [("a.jpg", labels, "train"), ("b.png", empty, "held-out")])
    (single,) = [path for path in tmp_path.iterdir()] if kind != "labelme" else [tmp_path]
    read = read_annotations(single)
    assert [each.size for each in read] == [(80, 64), (65, 70)]
    assert [each.name.removeprefix("pictures/") for each in read] == ["a.jpg", "b.png"]
    np.testing.assert_array_equal(paint(read[0], VALUES, FAR, (80, 64)), labels)
    np.testing.assert_array_equal(paint(read[1], VALUES, FAR, (65, 70)), empty)


@pytest.mark.parametrize(
    ("name", "document", "says"),
    [
        ("a.json", "{", "a.json"),
        ("a.json", "[]", "no known format"),
        ("a.json", {"a": 1}, "no known format"),
        ("a.xml", "<annotations>", "a.xml"),
        ("a.xml", "<annotations/>", "CVAT for images"),
        ("a.json", coco([]), "box only"),
        ("a.json", coco([["x"]]), r"segmentation"),
        ("a.json", coco({"size": [64, 80], "counts": [3, 4]}), "do not add up"),
        ("a.json", coco({"size": [64, 80], "counts": [-5, 5125]}), "do not add up"),
        ("a.json", coco([SQUARE]) | {"categories": []}, "category 3"),
        ("a.xml", cvat('<box label="cane" xtl="1" ytl="1" xbr="5" ybr="5"/>'), "is a box; give polygons"),
        ("a.xml", cvat('<polygon label="cane" points="1,2;x"/>'), "x,y pairs"),
        ("a.xml", cvat('<polygon label="cane" points="1,2" z_order="top"/>'), "z_order='top'"),
        ("a.xml", cvat('<mask label="cane" rle="5" left="0" top="0" width="9" height="9"/>'), "do not add up"),
        ("a.xml", cvat('<mask label="cane" rle="five" left="0" top="0" width="1" height="5"/>'), "whole numbers"),
        ("a.json", labelme(shape_type="linestrip"), "linestrip; give polygons"),
        ("a.json", labelme(points=[[1, 2, 3]]), "points"),
        ("a.json", labelme(shape_type="mask", points=[[0, 0], [1, 1]], mask="AAAA"), "damaged mask"),
        ("a.json", via(told={"colour": "red", "age": "2"}), "name no class"),
        ("a.json", via({"name": "circle", "cx": 1, "cy": 2, "r": 3}), "circle; give polygons"),
    ],
)
def test_a_file_that_cannot_be_read_is_named_with_what_is_wrong(tmp_path, name, document, says):
    with pytest.raises(InputError, match=says) as raised:
        written(tmp_path, name, document)
    assert str(tmp_path / name) in str(raised.value)


@pytest.mark.parametrize(
    ("document", "says"),
    [
        (coco([[20.0, 10.0, 300.0, 10.0, 30.0, 50.0]]), "80×64"),
        (coco([[-20.0, 10.0, 30.0, 10.0, 30.0, 50.0]]), "80×64"),
        (coco([[1.0, 2.0, 3.0, 4.0]]), "2 corners"),
        (labelme(shape_type="mask", points=[[75, 10], [84, 49]], mask=png(np.ones((40, 10), bool))), "80×64"),
    ],
)
def test_a_shape_that_is_not_on_the_picture_is_named(tmp_path, document, says):
    (read,) = written(tmp_path, "a.json", document)
    with pytest.raises(InputError, match=says) as raised:
        paint(read, VALUES, FAR, SIZE)
    assert "a.json" in str(raised.value) and "a.jpg" in str(raised.value)


def test_a_polygon_may_reach_over_the_border_a_little(tmp_path):
    (read,) = written(tmp_path, "a.json", coco([[-1.0, -1.0, 10.0, -1.0, 10.0, 10.0, -1.0, 10.0]]))
    assert int((paint(read, VALUES, FAR, SIZE) == CANE).sum()) == 100


def test_pictures_are_found_without_suffix_but_never_outside_their_folder(tmp_path):
    (tmp_path / "in").mkdir()
    (tmp_path / "in" / "a.v2.jpg").touch()
    (tmp_path / "secret.png").touch()
    assert find_picture(tmp_path / "in", "a.v2").name == "a.v2.jpg"
    with pytest.raises(InputError, match="outside"):
        find_picture(tmp_path / "in", "../secret.png")
    with pytest.raises(InputError, match="missing"):
        find_picture(tmp_path / "in", "b.jpg")
