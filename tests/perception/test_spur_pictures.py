"""Pictures on which a person decides about cuts."""

import io

import numpy as np
import pytest
from PIL import Image

from perception.plant.map import PlantMap
from perception.plant.model import Cane, Node, Plant, Spur
from perception.plant.numbering import SpurNumber
from perception.segmentation.frame import View
from perception.tracking.spur_pictures import SpurPictures
from rolling_panda.messages.perception import PICTURE_BYTES
from rolling_panda.messages.robot import Intrinsics
from tests.support.points import point

NUMBER = SpurNumber(1, 1)
K = Intrinsics(848, 480, 450.0, 450.0, 423.5, 239.5)
UP = (0.0, -1.0, 0.0)


def view(sequence, place=(0.0, 0.0, 0.9), *, noise=False, position=(0.0, 0.0, 0.0), jpeg=None):
    """A camera at `position` that looks along z at a white dot at `place`; y is down."""
    image = np.full((480, 848, 3), 60, np.uint8)
    if noise:
        image = np.random.default_rng(0).integers(0, 255, image.shape, np.uint8)
    x, y, z = np.array(place) - position
    u, v = round(450 * x / z + 423.5), round(450 * y / z + 239.5)
    image[max(v - 3, 0) : v + 4, max(u - 3, 0) : u + 4] = 255
    out = io.BytesIO()
    Image.fromarray(image).save(out, "JPEG", quality=95)
    nothing = np.zeros((480, 848), np.float32)
    return View(sequence, 0.0, K, nothing, None, jpeg or out.getvalue(), np.eye(3), np.array(position))


def cane(base, length=0.6, lean=0.0):
    """Upright in the picture, with a node every 8 cm."""
    arc = np.linspace(0.0, length, 61)
    axis = np.array(base) + arc[:, None] * np.array((lean, -1.0, 0.0))
    nodes = tuple(Node(at, 12) for at in np.arange(0.08, length, 0.08))
    return Cane(axis, arc, 0.004, nodes, (), "free", 0.0)


class Row:
    """A row of spurs with a cane each, and what perception would keep of it."""

    def __init__(self, **spurs):
        spurs = spurs or {"s1": (0.0, 0.1, 0.9)}
        self.plant = Plant(
            tuple(Spur(np.array(at), None, 0.0, (cane(at),)) for at in spurs.values()), np.zeros((0, 3)), ()
        )
        self.numbers = tuple(SpurNumber(1, k) for k, _ in enumerate(spurs, 1))
        self.map, self.pictures = PlantMap(), SpurPictures()

    def see(self, *views):
        for each in views:
            self.map.update(self.plant, self.numbers)
            self.pictures.add(each, self.plant, self.numbers)

    def shown(self, *points, sites=()):
        return self.pictures.update(points, sites, self.map)


def cut(name="p1", at=(0.0, -0.1, 0.9), spur=1, **changes):
    return point(name, at, UP, vine=1, spur=spur, **changes)


def pixels(picture):
    return np.asarray(Image.open(io.BytesIO(picture.jpeg)).convert("L"))


@pytest.mark.parametrize("at", [(0.0, -0.1, 0.9), (0.6, -0.2, 0.9), (-0.7, 0.2, 0.9)])
def test_the_cut_is_drawn_where_it_is_in_the_picture(at):
    row = Row(s1=(at[0], at[1] + 0.2, 0.9))
    row.see(view(5, at))
    (picture,) = row.shown(cut(at=at))
    drawing, (drawn,) = picture.drawing, picture.drawing.cuts
    grey = pixels(picture)
    assert grey.shape == drawing.size[::-1] and drawing.sequence == 5
    u, v = drawn.position
    assert grey[round(v - 0.5), round(u - 0.5)] > 200, "the white dot"
    # A tap there is a ray to it, also long after the frame.
    left, top, width, _ = drawing.window
    scale = drawing.size[0] / width
    ray = row.pictures.ray(5, (left + u / scale) / 848, (top + v / scale) / 480)
    off = np.array(at) - (ray.direction @ np.array(at)) * ray.direction
    assert np.linalg.norm(off) < 0.0005
    assert row.pictures.ray(6, 0.5, 0.5) is None


def test_what_stays_and_what_falls_is_told_by_the_arc_length_from_the_cut():
    row = Row()
    row.see(view(1))
    (picture,) = row.shown(cut(at=(0.0, -0.08, 0.9)))
    (drawn,) = picture.drawing.cuts
    arcs = [s for _, _, s in drawn.axis]
    assert arcs == sorted(arcs) and arcs[0] == pytest.approx(-0.18, abs=2e-3)
    assert arcs[-1] == pytest.approx(0.42, abs=2e-3)
    rows = [v for _, v, _ in drawn.axis]
    assert rows == sorted(rows, reverse=True), "the cane grows upwards in the picture"
    assert sum(s < 0 for *_, s in drawn.nodes) == 2 and len(drawn.nodes) == 7
    assert drawn.thickness == pytest.approx(
        2 * 0.004 * 450 / 0.9 * picture.drawing.size[0] / picture.drawing.window[2], abs=0.1
    )


def test_a_renewal_cut_takes_the_canes_beyond_it_and_leaves_those_below():
    at = np.array((0.0, 0.1, 0.9))
    canes = (cane(at + (0.03, 0.02, 0.0), lean=0.2), cane(at + (0.0, -0.05, 0.0)))
    row = Row()
    row.plant = Plant((Spur(at, np.stack([at, at + (0.0, -0.05, 0.0)]), 0.008, canes),), np.zeros((0, 3)), ())
    row.see(view(1))
    (picture,) = row.shown(cut(at=(0.0, 0.075, 0.9), kind="renewal cut"))
    (drawn,) = picture.drawing.cuts
    assert len(drawn.falls) == 1
    start = drawn.falls[0][0]
    assert start[1] < drawn.position[1] and start[0] == pytest.approx(drawn.position[0], abs=1)
    assert [s for *_, s in drawn.axis] == pytest.approx([-0.03, 0.0, 0.025], abs=1e-3)
    assert len(picture.drawing.canes) == 2


def test_the_picture_shows_the_spur_and_the_beginning_of_its_canes():
    row = Row()
    row.see(view(1))
    (picture,) = row.shown(cut())
    left, top, width, height = picture.drawing.window
    assert width >= 240 and width / height == pytest.approx(4 / 3, abs=0.02)
    for y in (0.1, -0.1):
        u, v, _ = view(1).pixels(np.array((0.0, y, 0.9)))[0]
        assert left < u < left + width and top < v < top + height
    near = Row(s1=(0.0, 0.03, 0.2))
    near.see(view(2, position=(0.0, 0.0, 0.0)))
    (picture,) = near.shown(cut(at=(0.0, -0.05, 0.2)))
    assert picture.drawing.size == (640, 480), "a near view has more pixels than are sent"


def test_a_cut_outside_the_picture_makes_it_larger():
    row = Row()
    row.see(view(1))
    (before,) = row.shown(cut())
    (after,) = row.shown(cut(at=(0.0, -0.35, 0.9), revision=2))
    assert after.drawing.window[1] < before.drawing.window[1] and after.drawing.cuts
    assert row.shown(cut(at=(0.0, -0.6, 0.9), revision=3))[0].drawing.cuts == (), "beyond the image"


def test_another_view_replaces_the_picture_only_if_it_is_clearly_better():
    row = Row()
    row.see(view(1, position=(-0.6, 0.0, 0.0)))
    (first,) = row.shown(cut())
    row.see(view(2, position=(-0.5, 0.0, 0.0)))
    assert row.shown(cut())[0] is first, "nothing is sent again"
    row.see(view(3, position=(0.0, 0.0, 0.0)))
    (better,) = row.shown(cut())
    assert better.drawing.sequence == 3
    row.see(view(4, position=(0.2, 0.0, 0.0)))
    assert row.shown(cut())[0] is better
    # Wood was cut: the next picture shows the spur without it, until then the last one stays.
    row.pictures.forget(NUMBER)
    assert row.shown(cut())[0] is better
    row.see(view(5, position=(0.3, 0.0, 0.0)))
    assert row.shown(cut())[0].drawing.sequence == 5


def test_a_new_revision_is_drawn_anew_on_the_same_image():
    row = Row()
    row.see(view(1))
    (before,) = row.shown(cut())
    (after,) = row.shown(cut(at=(0.0, -0.12, 0.9), revision=2))
    assert after.jpeg is before.jpeg and after.drawing.image == before.drawing.image
    assert after.drawing.cuts[0].revision == 2
    assert after.drawing.cuts[0].position[1] < before.drawing.cuts[0].position[1]


def test_an_undecided_spur_has_a_picture_with_its_canes_and_one_that_was_not_seen_has_none():
    row = Row()
    row.see(view(1))
    (picture,) = row.shown(sites=(NUMBER, SpurNumber(2, 7)))
    assert (picture.drawing.vine, picture.drawing.spur, picture.drawing.cuts) == (1, 1, ())
    assert len(picture.drawing.canes) == 1
    assert row.shown() == ()


def test_few_images_are_encoded_after_one_frame_and_all_after_some():
    row = Row(**{f"s{k}": (0.2 * k - 0.8, 0.1, 0.9) for k in range(8)})
    row.see(view(1))
    points = [cut(f"p{k}", at=(0.2 * k - 0.8, -0.05, 0.9), spur=k + 1) for k in range(8)]
    counts = [len(row.shown(*points)) for _ in range(3)]
    assert counts[0] < 8 and counts[-1] == 8


def test_a_noisy_image_still_fits_the_message():
    row = Row(s1=(0.0, 0.05, 0.2))
    row.see(view(1, noise=True))
    (picture,) = row.shown(cut(at=(0.0, -0.05, 0.2)))
    assert len(picture.jpeg) <= PICTURE_BYTES and pixels(picture).shape == picture.drawing.size[::-1]


def test_a_camera_image_that_is_none_costs_the_picture_and_nothing_else():
    row = Row()
    row.see(view(1, jpeg=b"not a picture"))
    assert row.shown(cut()) == ()
    row.see(view(2))
    assert row.shown(cut())[0].drawing.sequence == 2


def test_the_number_of_pictures_is_bounded(monkeypatch):
    monkeypatch.setattr("perception.tracking.spur_pictures._MAX_SPURS", 3)
    row = Row(**{f"s{k}": (0.2 * k - 0.8, 0.1, 0.9) for k in range(5)})
    row.see(view(1))
    points = [cut(f"p{k}", at=(0.2 * k - 0.8, -0.05, 0.9), spur=k + 1) for k in range(5)]
    for _ in range(3):
        shown = row.shown(*points)
    assert {picture.drawing.spur for picture in shown} == {3, 4, 5}
