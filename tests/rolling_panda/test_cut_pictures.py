"""Which close-up shows which cut, and the folder of the pictures."""

import io
import shutil
from types import SimpleNamespace

import numpy as np
import pinocchio as pin
import pytest
from PIL import Image

from rolling_panda import cut_pictures
from rolling_panda import messages as m
from rolling_panda.cut_pictures import CloseUps, CutCloseUp, PictureFolder, box_of, cropped
from rolling_panda.messages.robot import Intrinsics
from rolling_panda.model.map_frame import MapFrame
from rolling_panda.model.robot import RobotModel, configuration
from rolling_panda.model.wire_values import vector3
from tests.support.fake_wire import ARM
from tests.support.fake_wire import HEADER as HEAD

PLACE = (1.0, 0.8, 0.9)


def jpeg(size=(848, 480), mark=None):
    """A grey image, red around `mark` (px)."""
    image = Image.new("RGB", size, (90, 90, 90))
    if mark is not None:
        image.paste((250, 10, 10), (mark[0] - 6, mark[1] - 6, mark[0] + 6, mark[1] + 6))
    out = io.BytesIO()
    image.save(out, "JPEG", quality=95)
    return out.getvalue()


def close_up(point_id, sequence, image=b""):
    k = Intrinsics(width=848, height=480, fx=447.0, fy=447.0, cx=423.5, cy=239.5)
    return m.CameraFrame(
        header=HEAD, sequence=sequence, intrinsics=k, base=m.PlanarPose(), position=(0.0, 0.0, *ARM), color_jpeg=image,
        depth_zlib=b"", depth_unit=1e-3, point_id=point_id, number=sequence,
    )  # fmt: skip


def entry(point_id, state, cut_id="", position=PLACE):
    return m.QueueEntry(point_id, state, cut_id=cut_id, accepted_position=position)


def told(close_ups):
    return [(each.cut_id, each.moment, each.frame.sequence) for each in close_ups if each is not None]


def test_the_last_close_up_before_the_order_to_cut_is_before_it_and_those_after_it_are_after():
    seen = CloseUps()
    assert told(seen.update((entry("a", "ACCEPTED"),))) == []
    assert told([seen.add(close_up("a", 1)), seen.add(close_up("a", 2)), seen.add(close_up("b", 3))]) == []
    assert told(seen.update((entry("a", "CUTTING", "c1"), entry("b", "ACCEPTED")))) == [("c1", "before", 2)]
    assert told(seen.update((entry("a", "CUTTING", "c1"),))) == [], "once"
    assert told([seen.add(close_up("a", 4)), seen.add(close_up("b", 5))]) == [("c1", "after", 4)]
    # The outcome may be known before the picture has come in here.
    seen.update((entry("a", "DONE", "c1"),))
    assert told([seen.add(close_up("a", 6))]) == [("c1", "after", 6)]


def test_a_point_that_is_cut_once_more_gets_pictures_of_its_second_cut():
    seen = CloseUps()
    seen.add(close_up("a", 1))
    assert told(seen.update((entry("a", "CUTTING", "c1"),))) == [("c1", "before", 1)]
    seen.add(close_up("a", 2))
    # It keeps the name of its last cut until the next.
    seen.update((entry("a", "ACCEPTED", "c1"),))
    assert told([seen.add(close_up("a", 3))]) == []
    assert told(seen.update((entry("a", "CUTTING", "c2"),))) == [("c2", "before", 3)]
    assert told([seen.add(close_up("a", 4))]) == [("c2", "after", 4)]


def test_after_a_restart_an_earlier_cut_does_not_get_a_later_close_up():
    seen = CloseUps()
    seen.add(close_up("a", 1))
    assert told(seen.update((entry("a", "ACCEPTED", "c-earlier"),))) == []
    assert told(seen.update((entry("a", "CUTTING", "c-now"),))) == [("c-now", "before", 1)]


def test_the_cut_is_in_the_middle_of_its_picture():
    model = RobotModel()
    camera = model.pose(configuration(m.PlanarPose(), (0.0, 0.0, *ARM)), model.camera_id)
    place = tuple(camera.translation + camera.rotation @ np.array([0.1, -0.05, 0.4]))
    u, v = round(447.0 * 0.1 / 0.4 + 423.5), round(447.0 * -0.05 / 0.4 + 239.5)
    frame = close_up("a", 1, jpeg(mark=(u, v)))
    box = box_of(CutCloseUp("c1", "before", frame, place), model)
    assert box is not None and box[2] - box[0] == round(447.0 * 0.24 / 0.4)
    with Image.open(io.BytesIO(cropped(frame.color_jpeg, box))) as picture:
        red = np.argwhere(np.asarray(picture)[:, :, 0] > 200).mean(axis=0)
        assert np.allclose(red, (picture.height / 2, picture.width / 2), atol=1.5)
    drift = pin.SE3(pin.exp3(np.array([0.0, 0.0, 0.2])), np.array([1.0, 0.2, 0.0]))
    in_map = vector3(drift.act(np.array(place)))
    assert box_of(CutCloseUp("c1", "before", frame, in_map, MapFrame(drift)), model) == box
    behind = tuple(camera.translation - camera.rotation @ np.array([0.0, 0.0, 0.4]))
    aside = tuple(camera.translation + camera.rotation @ np.array([2.0, 0.0, 0.4]))
    for hidden in (behind, aside):
        assert box_of(CutCloseUp("c1", "before", frame, hidden), model) is None


def test_pictures_are_found_by_their_cut_after_a_restart(tmp_path):
    picture = jpeg((320, 240))
    PictureFolder(tmp_path / "pictures" / "rp1", 10).keep("c1", "before", picture)
    again = PictureFolder(tmp_path / "pictures" / "rp1", 10)
    assert again.read("c1", "before") == picture
    assert again.read("c1", "after") is None and again.read("c2", "before") is None
    assert PictureFolder(tmp_path / "nothing", 10).read("c1", "before") is None


def test_the_oldest_pictures_give_way(tmp_path):
    folder = PictureFolder(tmp_path, 3)
    for number in range(5):
        folder.keep(f"c{number}", "after", jpeg((32, 24)))
    assert sorted(each.name for each in tmp_path.iterdir()) == [f"c{number}.after.jpg" for number in (2, 3, 4)]


@pytest.mark.parametrize(
    "damage", [lambda data: data[: len(data) // 2], lambda data: b"", lambda data: b"not a picture"]
)
def test_a_damaged_picture_is_an_error(tmp_path, damage):
    folder = PictureFolder(tmp_path, 3)
    folder.keep("c1", "after", jpeg())
    file = tmp_path / "c1.after.jpg"
    file.write_bytes(damage(file.read_bytes()))
    with pytest.raises(OSError):
        folder.read("c1", "after")


def test_the_last_space_of_the_disk_is_left_to_the_ledger(tmp_path, monkeypatch):
    monkeypatch.setattr(shutil, "disk_usage", lambda path: SimpleNamespace(free=100 << 20))
    with pytest.raises(OSError, match="100 MB are free"):
        PictureFolder(tmp_path, 3).keep("c1", "after", jpeg((32, 24)))
    assert list(tmp_path.iterdir()) == []
    assert cut_pictures.shutil is shutil
