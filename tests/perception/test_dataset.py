"""`rolling-panda dataset`: import, check and export, and what is refused without a trace."""

import json
import shutil
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from perception.dataset.__main__ import main
from perception.dataset.dataset import FAR, UNLABELLED, Dataset, check, read_dataset
from perception.segmentation.frame import CANE, CORDON, TRUNK
from rolling_panda.errors import InputError

SIZE = (96, 64)


def picture(path, size=SIZE, seed=0, **options) -> None:
    color = np.random.default_rng(seed).integers(0, 255, (size[1], size[0], 3), dtype=np.uint8)
    path.parent.mkdir(parents=True, exist_ok=True)
    Image.fromarray(color).save(path, **options)


def shape(label="cane", left=20) -> dict:
    corners = [[left, 10], [left + 10, 10], [left + 10, 50], [left, 50]]
    return {"label": label, "points": corners, "shape_type": "polygon"}


def labelled(folder, name, shapes=None, size=SIZE) -> None:
    """A labelme file, and no picture."""
    document = {"imagePath": name, "imageData": None, "shapes": [shape()] if shapes is None else shapes}
    document |= {"imageWidth": size[0], "imageHeight": size[1]}
    (folder / f"{name.rpartition('.')[0]}.json").write_text(json.dumps(document), encoding="utf-8")


@pytest.fixture
def vines(tmp_path):
    """Six pictures with labels."""
    folder = tmp_path / "vines"
    for number in range(6):
        picture(folder / f"v{number}.jpg", seed=number)
        labelled(folder, f"v{number}.jpg")
    return folder


def take(source, out, *more) -> int:
    return main(
        ["import", str(source), str(out), "--source", "our own rows, 2026", "--licence", "own", *map(str, more)]
    )


def refused(capsys, source, *more) -> str:
    """Import, which must fail and leave nothing."""
    out = source.parent / "out"
    before = sorted(source.parent.rglob("*"))
    assert take(source, out, *more) == 1
    assert sorted(source.parent.rglob("*")) == before
    said = capsys.readouterr()
    assert said.out == "" and said.err.startswith("rolling-panda dataset import: ") and said.err.count("\n") == 1
    return said.err


def imported(source, out, *more) -> Dataset:
    assert take(source, out, *more) == 0
    return read_dataset(out)


def test_pictures_labels_source_licence_and_split_are_kept(vines, tmp_path, capsys):
    data = imported(vines, tmp_path / "out", "--held-out", "0.34")
    assert data.names("train") == ["v0.jpg", "v1.jpg", "v2.jpg", "v3.jpg"] and data.names("held-out") == [
        "v4.jpg",
        "v5.jpg",
    ]
    assert (data.manifest.source, data.manifest.licence) == ("our own rows, 2026", "own")
    color, labels = data.load("v3.jpg")
    np.testing.assert_array_equal(color, np.asarray(Image.open(vines / "v3.jpg")))
    expected = np.full((64, 96), FAR)
    expected[10:50, 20:30] = CANE
    np.testing.assert_array_equal(labels, expected)
    assert "4 pictures to train on, 2 held out" in capsys.readouterr().out
    assert main(["check", str(tmp_path / "out")]) == 0
    said = dict(line.split()[:2] for line in capsys.readouterr().out.splitlines()[1:])
    assert said == {"cane": "6.51", "far": "93.49"}


def test_a_dataset_that_is_exported_and_imported_is_the_same(vines, tmp_path):
    first = imported(vines, tmp_path / "first")
    for kind, labels in (("coco", "annotations.json"), ("cvat", "annotations.xml"), ("labelme", "")):
        assert main(["export", str(first.folder), str(tmp_path / kind), "--format", kind]) == 0
        folder = tmp_path / kind
        more = [] if kind == "labelme" else ["--pictures", folder / "pictures"]
        second = imported(folder / labels, tmp_path / f"{kind}2", *more)
        names = [entry.name for entry in second.manifest.pictures]
        assert [name.removeprefix("pictures_") for name in names] == [e.name for e in first.manifest.pictures]
        for name in names:
            for mine, theirs in zip(second.load(name), first.load(name.removeprefix("pictures_")), strict=True):
                np.testing.assert_array_equal(mine, theirs)


def test_labels_are_mapped_and_what_is_not_labelled_may_stay_unknown(vines, tmp_path, capsys):
    labelled(vines, "v0.jpg", [shape("Main_Cordon"), shape("Trieb", 50)])
    assert "'Trieb'" in (said := refused(capsys, vines)) and "'Main_Cordon'" in said and "--map LABEL=CLASS" in said
    assert "--map x=leaf" in refused(capsys, vines, "--map", "x=leaf")
    data = imported(vines, tmp_path / "out", "--names", "piacenza", "--map", "trieb=cane", "--rest", "unlabelled")
    _, labels = data.load("v0.jpg")
    assert (labels[30, 25], labels[30, 55], labels[5, 5]) == (CORDON, CANE, UNLABELLED)


@pytest.mark.parametrize(
    ("names", "label", "value", "rest"),
    [
        ("3d2cut", "Main Trunk", TRUNK, FAR),
        ("3d2cut", "Lateral Shoot", CANE, FAR),
        ("piacenza", "arm", CORDON, FAR),
        ("extremadura", "pruned shoot", CANE, UNLABELLED),
    ],
)
def test_labels_of_published_datasets_are_known(vines, tmp_path, names, label, value, rest):
    labelled(vines, "v0.jpg", [shape(label)])
    _, labels = imported(vines, tmp_path / "out", "--names", names, "--map", "cane=cane").load("v0.jpg")
    assert (labels[30, 25], labels[5, 5]) == (value, rest)


def test_a_picture_is_turned_upright_as_it_was_labelled(vines, tmp_path, capsys):
    exif = Image.Exif()
    exif[0x0112] = 6
    picture(vines / "v0.jpg", exif=exif)
    assert "EXIF" in (said := refused(capsys, vines)) and "64×96" in said and "v0.jpg" in said
    labelled(vines, "v0.jpg", size=(64, 96))
    data = imported(vines, tmp_path / "out")
    color, labels = data.load("v0.png")
    assert color.shape == (96, 64, 3) and labels.shape == (96, 64)
    np.testing.assert_array_equal(color, np.rot90(np.asarray(Image.open(vines / "v0.jpg")), -1))


def test_pictures_of_subfolders_do_not_hide_each_other(vines, tmp_path, capsys):
    shutil.copy(vines / "v0.jpg", vines / "v0.png")
    labelled(vines, "a.jpg")
    shutil.copy(vines / "v1.jpg", vines / "v1_.jpg")
    document = json.loads((vines / "a.json").read_text(encoding="utf-8"))
    (vines / "a.json").write_text(json.dumps(document | {"imagePath": "v0.png"}), encoding="utf-8")
    assert "v0" in (said := refused(capsys, vines)) and "suffix" in said
    (vines / "sub").mkdir()
    picture(vines / "sub" / "v0.png", seed=77)
    (vines / "a.json").write_text(json.dumps(document | {"imagePath": "sub/v0.png"}), encoding="utf-8")
    data = imported(vines, tmp_path / "out")
    np.testing.assert_array_equal(data.load("sub_v0.png")[0], np.asarray(Image.open(vines / "sub" / "v0.png")))


def save(path, values, mode=None) -> None:
    image = Image.fromarray(values)
    (image.convert(mode) if mode else image).save(path)


@pytest.mark.parametrize(
    ("spoil", "says"),
    [
        (lambda path: path.write_bytes(path.read_bytes()[:300]), "give a whole JPEG"),
        (lambda path: path.write_bytes(b"vine"), "give a whole JPEG"),
        (lambda path: path.unlink(), "missing"),
        (lambda path: picture(path, (40, 64)), "allowed are 64 a side"),
        (lambda path: save(path, np.zeros((64, 96, 3), np.uint8), "CMYK"), "mode CMYK"),
        (lambda path: save(path, np.zeros((64, 96), np.uint8)), "mode L"),
        (lambda path: Image.new("L", (9000, 8000)).save(path), "64 million"),
        (lambda path: Image.fromarray(np.zeros((64, 96), np.uint16)).save(path, format="PNG"), "mode I;16"),
        (lambda path: picture(path, (97, 64)), "97×64"),
    ],
)
def test_a_picture_that_cannot_be_used_is_named_and_nothing_is_written(vines, capsys, spoil, says):
    spoil(vines / "v3.jpg")
    said = refused(capsys, vines)
    assert "v3.jpg" in said and says in said


def test_other_mistakes_are_named_and_nothing_is_written(vines, tmp_path, capsys):
    assert "exists already" in refused_at(capsys, vines, vines)
    assert "--held-out 1.5" in refused(capsys, vines, "--held-out", "1.5")
    shutil.copy(vines / "v0.jpg", vines / "v5.jpg")
    assert "same picture" in (said := refused(capsys, vines)) and "v0.jpg" in said and "v5.jpg" in said
    picture(vines / "v5.jpg", seed=5)
    labelled(vines, "v5.jpg", [shape("trunk")])
    assert "held-out" in (said := refused(capsys, vines)) and "v5.jpg" not in said
    for number in range(6):
        labelled(vines, f"v{number}.jpg", [shape("trunk")])
    assert "cane" in (said := refused(capsys, vines)) and "only trunk, far" in said
    (tmp_path / "empty").mkdir()
    assert "cannot tell" in refused(capsys, tmp_path / "empty")
    assert "nowhere.json" in refused(capsys, tmp_path / "nowhere.json")


def refused_at(capsys, source, out) -> str:
    before = sorted(source.parent.rglob("*"))
    assert take(source, out) == 1
    assert sorted(source.parent.rglob("*")) == before
    return capsys.readouterr().err


def test_a_damaged_dataset_is_named(vines, tmp_path, capsys):
    data = imported(vines, tmp_path / "out")
    mask, manifest = data.folder / "masks" / "v2.png", data.folder / "dataset.json"

    def spoiled(path, content, says) -> None:
        whole = path.read_bytes()
        path.write_bytes(content(whole))
        with pytest.raises(InputError, match=says) as raised:
            check(read_dataset(data.folder))
        assert path.name in str(raised.value)
        path.write_bytes(whole)

    def values(size, value):
        save(tmp_path / "m.png", np.full(size, value, np.uint8))
        return lambda _: (tmp_path / "m.png").read_bytes()

    spoiled(mask, lambda whole: whole[:60], "cannot read the mask")
    spoiled(mask, values((64, 95), CANE), "95×64")
    spoiled(mask, values((64, 96), 12), "value 12")
    spoiled(manifest, lambda whole: whole[:-30], "no manifest")
    spoiled(manifest, lambda whole: whole.replace(b'"own"', b"3"), "licence")
    spoiled(manifest, lambda whole: whole.replace(b"v2.jpg", b"../v2.jpg"), "without folder")
    spoiled(manifest, lambda whole: whole.replace(b"v2.jpg", b"V1.png"), "twice")
    spoiled(manifest, lambda whole: whole.replace(b'"node": 7', b'"leaf": 7'), "Import it again")
    assert main(["check", str(tmp_path)]) == 1
    assert "dataset.json" in capsys.readouterr().err
    assert main(["export", str(tmp_path), str(tmp_path / "no"), "--format", "coco"]) == 1
    assert not (tmp_path / "no").exists()


def exported(vines, tmp_path) -> tuple[Dataset, Path]:
    """A dataset with unlabelled pixels, and the same as episodes."""
    first = imported(vines, tmp_path / "first", "--held-out", "0.34", "--rest", "unlabelled")
    out = tmp_path / "episodes"
    assert main(["export", str(first.folder), str(out), "--format", "episodes"]) == 0
    return first, out


def test_episodes_keep_pictures_masks_and_split(vines, tmp_path):
    first, out = exported(vines, tmp_path)
    second = imported(out, tmp_path / "second")
    for split, count in (("train", 4), ("held-out", 2)):
        before, after = first.names(split), second.names(split)
        assert len(before) == count and [name.removeprefix("pictures_") for name in after] == before
        for one, other in zip(before, after, strict=True):
            for kept, came in zip(first.load(one), second.load(other), strict=True):
                np.testing.assert_array_equal(kept, came)
    assert (second.load(second.names("train")[0])[1] == UNLABELLED).any()


def test_the_episodes_have_the_files_and_the_counts_of_lerobot(vines, tmp_path):
    _, out = exported(vines, tmp_path)
    info = json.loads((out / "meta" / "info.json").read_text())
    assert (info["total_episodes"], info["total_frames"]) == (2, 6)
    assert info["splits"] == {"train": "0:1", "held-out": "1:2"}
    assert info["features"]["observation.images.camera"]["shape"] == [64, 96, 3]
    lengths = [json.loads(line)["length"] for line in (out / "meta" / "episodes.jsonl").read_text().splitlines()]
    frames = [
        [
            json.loads(line)
            for line in (out / info["data_path"].format(episode_chunk=0, episode_index=k)).read_text().splitlines()
        ]
        for k in range(2)
    ]
    assert lengths == [len(each) for each in frames] == [4, 2]
    assert [frame["index"] for each in frames for frame in each] == list(range(6))
    assert all((out / frame["observation.images.labels"]).is_file() for each in frames for frame in each)


@pytest.mark.parametrize(
    ("spoil", "says"),
    [
        (lambda out: _rewrite(out / "meta/info.json", ".jsonl", ".parquet"), "not Parquet and video"),
        (lambda out: _rewrite(out / "meta/info.json", '"total_frames": 6', '"total_frames": 7'), "has 6 frames"),
        (lambda out: (out / "data/chunk-000/episode_000001.jsonl").unlink(), "episode_000001.jsonl"),
        (lambda out: (out / "masks/v0.png").unlink(), "v0.png is missing"),
        (lambda out: (out / "pictures/v0.jpg").unlink(), "v0.jpg is missing"),
        (lambda out: _rewrite(out / "data/chunk-000/episode_000000.jsonl", "masks/v0", "../v0"), "is outside"),
        (lambda out: _rewrite(out / "meta/info.json", '"cane": 6', '"cane": 60'), "holds the value 6"),
    ],
)
def test_damaged_episodes_are_refused(vines, tmp_path, capsys, spoil, says):
    _, out = exported(vines, tmp_path)
    capsys.readouterr()
    spoil(out)
    assert says in refused(capsys, out)


def test_pictures_of_several_sizes_are_no_episodes(vines, tmp_path, capsys):
    picture(vines / "v9.jpg", (128, 96))
    labelled(vines, "v9.jpg", size=(128, 96))
    data = imported(vines, tmp_path / "first")
    assert main(["export", str(data.folder), str(tmp_path / "no"), "--format", "episodes"]) == 1
    assert "128×96" in capsys.readouterr().err and not (tmp_path / "no").exists()


def _rewrite(path: Path, old: str, new: str) -> None:
    text = path.read_text()
    assert old in text
    path.write_text(text.replace(old, new))
