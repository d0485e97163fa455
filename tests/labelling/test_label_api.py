"""What the labelling page's server accepts and saves, and what it refuses without a change."""

import zlib
from pathlib import Path

import httpx
import numpy as np
import pytest
from PIL import Image

from labelling.__main__ import main
from labelling.folder import open_folder
from perception.dataset.dataset import UNLABELLED, read_dataset
from perception.segmentation.frame import CANE
from rolling_panda.errors import InputError
from tests.support.labelling_page import SIZE, labelling_page, vines

COUNT = SIZE[0] * SIZE[1]


@pytest.fixture
def dataset(tmp_path):
    return vines(tmp_path / "vines")


@pytest.fixture
def client(dataset):
    """Signed in, and from the page's own origin."""
    with labelling_page(dataset) as link:
        address, _, token = link.partition("/sign-in?token=")
        with httpx.Client(base_url=address, headers={"Origin": address}) as client:
            assert client.post("/api/sign-in", json={"token": token}).status_code == 200
            yield client


def files(folder: Path) -> dict[str, bytes]:
    return {str(path.relative_to(folder)): path.read_bytes() for path in folder.rglob("*") if path.is_file()}


def values(of: int = CANE) -> bytes:
    return zlib.compress(bytes([of]) * COUNT)


def put(client, name="v1.jpg", content=None, revision=None):
    if revision is None:
        revision = client.get(f"/api/pictures/{name}/mask").headers["Revision"]
    content = values() if content is None else content
    return client.put(f"/api/pictures/{name}/mask", content=content, headers={"Revision": revision})


def test_a_saved_mask_is_the_datasets_and_the_next_save_follows_it(client, dataset):
    first = put(client)
    assert first.status_code == 200 and first.json()["row"]["labelled"] == 1.0
    assert (read_dataset(dataset).load("v1.jpg")[1] == CANE).all()
    assert put(client, content=values(UNLABELLED), revision=first.json()["revision"]).json()["row"]["labelled"] == 0.0
    assert (read_dataset(dataset).load("v1.jpg")[1] == UNLABELLED).all()
    mask = client.get("/api/pictures/v1.jpg/mask")
    assert mask.content == bytes([UNLABELLED]) * COUNT and mask.headers["Picture-Size"] == "96x64"


def test_a_mask_that_another_window_has_changed_is_not_overwritten(client, dataset):
    old = client.get("/api/pictures/v1.jpg/mask").headers["Revision"]
    assert put(client).status_code == 200
    before = files(dataset)
    refused = put(client, content=values(UNLABELLED), revision=old)
    assert refused.status_code == 409 and refused.json()["code"] == "mask_changed"
    assert files(dataset) == before


@pytest.mark.parametrize(
    "content",
    [
        b"",
        b"no compressed bytes",
        zlib.compress(bytes(COUNT - 1)),
        zlib.compress(bytes(COUNT + 1)),
        zlib.compress(bytes([77]) * COUNT),
        # A bomb: it would unpack to 200 MB.
        zlib.compress(bytes(200_000_000), 1),
        values()[:-4],
    ],
)
def test_what_is_no_mask_of_the_picture_changes_nothing(client, dataset, content):
    before = files(dataset)
    answer = put(client, content=content)
    assert answer.status_code == 422 and answer.json()["code"] == "label_file_unusable"
    assert files(dataset) == before


@pytest.mark.parametrize("name", ["v9.jpg", "..%2Fdataset.json", "%2e%2e", "v1.png", "%00"])
def test_only_pictures_of_the_dataset_are_served(client, name):
    for path in ("", "/mask", "/small", "/proposal"):
        answer = client.get(f"/api/pictures/{name}{path}")
        assert answer.status_code in (404, 422) and answer.json()["ok"] is False


def test_nobody_without_the_link_and_no_other_page_may_read_or_change(client, dataset):
    before = files(dataset)
    stranger = httpx.Client(base_url=client.base_url, headers=client.headers)
    with stranger:
        for path in ("/api/pictures", "/api/pictures/v1.jpg", "/api/pictures/v1.jpg/mask"):
            assert stranger.get(path).status_code == 401
        assert stranger.put("/api/pictures/v1.jpg/mask", content=values()).status_code == 401
        assert stranger.post("/api/sign-in", json={"token": "x" * 43}).status_code == 401
    for origin in ("http://evil.example", "null", str(client.base_url).replace("127.0.0.1", "127.0.0.2")):
        answer = client.put("/api/pictures/v1.jpg/mask", content=values(), headers={"Origin": origin})
        assert answer.status_code == 403
    answer = client.get("/")
    assert "frame-ancestors 'none'" in answer.headers["Content-Security-Policy"]
    assert files(dataset) == before


def test_a_picture_moves_between_training_and_held_out(client, dataset):
    assert read_dataset(dataset).names("held-out") == ["v2.jpg"]
    answer = client.post("/api/pictures/v0.jpg/split", json={"split": "held-out"})
    assert answer.json()["row"]["split"] == "held-out"
    assert read_dataset(dataset).names("held-out") == ["v0.jpg", "v2.jpg"]
    assert client.post("/api/pictures/v0.jpg/split", json={"split": "exam"}).status_code == 422


def test_a_damaged_mask_is_named_and_stays_as_it_is(client, dataset):
    (dataset / "masks" / "v1.png").write_bytes(b"half a picture")
    rows = {row["name"]: row for row in client.get("/api/pictures").json()["pictures"]}
    assert "v1.png" in rows["v1.jpg"]["problem"] and not rows["v0.jpg"]["problem"]
    assert "v1.png" in client.get("/api/pictures/v1.jpg/mask").json()["reason"]
    assert (dataset / "masks" / "v1.png").read_bytes() == b"half a picture"


def test_a_folder_is_taken_up_again_with_new_pictures_and_its_labels_stay(tmp_path):
    dataset = vines(tmp_path / "vines")
    Image.fromarray(np.full(SIZE[::-1], CANE, np.uint8)).save(dataset / "masks" / "v0.png")
    vines(tmp_path / "vines", 4)
    assert [entry.name for entry in read_dataset(dataset).manifest.pictures] == ["v0.jpg", "v1.jpg", "v2.jpg", "v3.jpg"]
    assert (read_dataset(dataset).load("v0.jpg")[1] == CANE).all()
    assert (read_dataset(dataset).load("v3.jpg")[1] == UNLABELLED).all()
    assert open_folder(dataset)[1] == 0


def test_what_cannot_be_labelled_is_refused_with_one_line_and_nothing_is_written(tmp_path, capsys):
    folder = tmp_path / "vines"
    folder.mkdir()
    with pytest.raises(InputError, match="no picture"):
        open_folder(folder)
    Image.new("L", SIZE).save(folder / "grey.png")
    before = sorted(tmp_path.rglob("*"))
    assert main(["label", str(folder), "--port", "0"]) == 1
    said = capsys.readouterr()
    assert said.err.count("\n") == 1 and "grey.png" in said.err
    assert main(["label", str(tmp_path / "nothing"), "--port", "0"]) == 1
    assert main(["label", str(folder), "--port", "0", "--model", "no.onnx"]) == 1
    assert sorted(tmp_path.rglob("*")) == before
