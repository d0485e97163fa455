import io
import zlib

import numpy as np
from PIL import Image

from bridge.core.picture import encode_picture
from rolling_panda.messages.robot import Intrinsics

INTRINSICS = Intrinsics(6, 4, 5.0, 5.0, 2.5, 1.5)


def test_depth_comes_back_to_half_a_count_and_what_is_no_depth_is_zero() -> None:
    depth = np.linspace(0.2, 4.0, 24, dtype=np.float32).reshape(4, 6)
    depth[0, :4] = [np.nan, np.inf, -1.0, 100.0]
    color = np.full((4, 6, 3), 120, np.uint8)
    labels = np.arange(24, dtype=np.uint8).reshape(4, 6) % 9
    picture = encode_picture(INTRINSICS, color, depth, labels)
    counts = np.frombuffer(zlib.decompress(picture.depth_zlib), "<u2").reshape(4, 6)
    assert picture.intrinsics == INTRINSICS
    none, seen = np.ravel(counts)[:4], np.ravel(counts)[4:]
    assert np.all(none == 0)
    assert np.abs(seen * picture.depth_unit - np.ravel(depth)[4:]).max() <= picture.depth_unit / 2 + 1e-6
    assert np.array_equal(np.frombuffer(zlib.decompress(picture.labels_zlib), np.uint8).reshape(4, 6), labels)
    assert np.abs(np.asarray(Image.open(io.BytesIO(picture.color_jpeg))).astype(int) - 120).max() < 4


def test_without_a_label_camera_there_are_no_labels() -> None:
    color = np.zeros((4, 6, 3), np.uint8)
    assert encode_picture(INTRINSICS, color, np.ones((4, 6), np.float32), None).labels_zlib == b""
