"""Pictures that go with points."""

import io

import numpy as np
import pytest
from PIL import Image

from perception.plant.model import Plant, Spur
from perception.plant.numbering import SpurNumber
from perception.segmentation.frame import View
from perception.tracking.crop_cache import CropCache
from rolling_panda.messages.perception import CROP_BYTES
from rolling_panda.messages.robot import Intrinsics

NUMBER = SpurNumber(1, 1)
K = Intrinsics(640, 480, 400.0, 400.0, 320.0, 240.0)


def view(sequence, place, noise=0):
    """A camera at the origin that looks along z at a white dot at `place`."""
    image = np.full((480, 640, 3), 60, np.uint8)
    if noise:
        image = np.random.default_rng(0).integers(0, 255, image.shape, np.uint8)
    x, y, z = place
    u, v = round(400 * x / z + 320), round(400 * y / z + 240)
    image[max(v - 4, 0) : v + 5, max(u - 4, 0) : u + 5] = 255
    out = io.BytesIO()
    Image.fromarray(image).save(out, "JPEG", quality=95)
    nothing = np.zeros((480, 640), np.float32)
    return View(sequence, 0.0, K, nothing, None, out.getvalue(), np.eye(3), np.zeros(3))


def plant(place):
    return Plant((Spur(np.array(place), None, 0.0, ()),), np.zeros((0, 3)), ())


def picture(crop):
    return np.asarray(Image.open(io.BytesIO(crop.jpeg)).convert("L"))


@pytest.mark.parametrize("place", [(0.0, 0.0, 1.0), (0.3, -0.2, 1.0), (0.75, 0.55, 1.0)])
def test_the_cut_is_in_the_middle_even_at_the_edge_of_the_image(place):
    album = CropCache()
    album.add(view(5, place), plant(place), (NUMBER,))
    crop = album.crop(NUMBER, np.array(place))
    seen = picture(crop)
    height, width = seen.shape
    assert crop.sequence == 5 and (width, height) == (240, 180)
    assert seen[height // 2 - 2 : height // 2 + 3, width // 2 - 2 : width // 2 + 3].min() > 200
    assert seen[: height // 4].max() < 150


def test_the_image_that_shows_the_spur_best_is_kept():
    album = CropCache()
    for sequence, place in ((1, (0.5, 0.0, 1.0)), (2, (0.05, 0.0, 1.0)), (3, (0.6, 0.0, 1.0))):
        album.add(view(sequence, place), plant(place), (NUMBER,))
    assert album.crop(NUMBER, np.array((0.05, 0.0, 1.0))).sequence == 2


def test_a_place_that_no_image_shows_has_no_picture():
    album = CropCache()
    album.add(view(1, (0.0, 0.0, 1.0)), plant((0.0, 0.0, 1.0)), (NUMBER,))
    assert album.crop(NUMBER, np.array((3.0, 0.0, 1.0))) is None
    assert album.crop(NUMBER, np.array((0.0, 0.0, -1.0))) is None
    assert album.crop(SpurNumber(1, 2), np.array((0.0, 0.0, 1.0))) is None


def test_a_noisy_image_still_fits_the_message():
    album, place = CropCache(), (0.0, 0.0, 1.0)
    album.add(view(1, place, noise=1), plant(place), (NUMBER,))
    crop = album.crop(NUMBER, np.array(place))
    assert crop is None or len(crop.jpeg) <= CROP_BYTES
