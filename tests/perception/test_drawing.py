"""Drawn pictures: what is labelled is what was drawn."""

import numpy as np
import pytest
from PIL import Image

from perception.segmentation.frame import BACKGROUND, CANE, CORDON, GROUND, HOSE, NODE, TRUNK, WIRE
from perception.training.wide.backgrounds import load_backgrounds
from perception.training.wide.curves import Tubes, add_brush, add_trellis, draw_wood, grow_vine
from perception.training.wide.drawing import FAR, Artist, Lens, trace
from perception.training.wide.raster import draw_cones
from rolling_panda.errors import InputError

WOOD = range(TRUNK, NODE + 1)


@pytest.fixture(scope="module")
def artist():
    return Artist(96)


@pytest.fixture(scope="module")
def scenes(artist):
    return [artist.scene(3, number) for number in range(40)]


def drawn(cones, size=40):
    depth, index = np.full((size, size), np.inf, np.float32), np.full((size, size), -1, np.int32)
    across, along = np.zeros((size, size), np.float32), np.zeros((size, size), np.float32)
    draw_cones(np.array(cones, float), depth, index, across, along)
    return depth, index, across, along


def upright(column, metres, radius=4.0):
    """A cone from row 5 to row 35: columns and rows, depth, radius (px), radius (m)."""
    return [column, 5.0, metres, radius, 0.01, column, 35.0, metres, radius, 0.01]


@pytest.mark.long
def test_a_cone_covers_what_is_within_its_radius_and_stands_out_by_it():
    depth, index, across, along = drawn([upright(20, 1.0)])
    assert np.flatnonzero(index[20] == 0).tolist() == list(range(16, 25))
    assert depth[20, 20] == pytest.approx(0.99) and depth[20, 24] == pytest.approx(1.0)
    # One side is the other's opposite, and the middle is neither.
    assert across[20, 16] == -across[20, 24] and abs(across[20, 24]) == 1.0 and across[20, 20] == 0.0
    assert along[5, 20] == 0.0 and along[20, 20] == pytest.approx(0.5) and along[35, 20] == 1.0


@pytest.mark.parametrize("order", [[0, 1], [1, 0]])
def test_the_nearer_of_two_hides_the_other_whichever_is_drawn_first(order):
    cones = [upright(20, 1.0), upright(22, 2.0)]
    _, index, _, _ = drawn([cones[k] for k in order])
    assert index[20, 22] == order.index(0) and index[20, 26] == order.index(1)


def test_what_is_thinner_than_a_pixel_is_still_a_line_and_what_is_outside_harms_nothing():
    _, index, _, _ = drawn([upright(20, 1.0, 0.01), upright(900, 1.0), upright(-3, 1.0, 5.0)])
    assert (index[6:34, 20] == 0).all() and (index[:, 30:] == -1).all() and (index[20, :3] == 2).all()


def test_vines_of_rows_behind_are_background_and_the_own_ones_have_every_kind_of_wood():
    for own, wanted in ((True, {TRUNK, CORDON, CANE, NODE}), (False, {BACKGROUND})):
        tubes, rng = Tubes(), np.random.default_rng(4)
        for _ in range(6):
            grow_vine(rng, tubes, draw_wood(rng), 0.0, 1.0, 0.9, own)
        kinds = set(np.concatenate(tubes.kind).tolist())
        assert wanted <= kinds if own else kinds == wanted
    tubes, rng = Tubes(), np.random.default_rng(4)
    for _ in range(5):
        add_trellis(rng, tubes, 1.0, 0.9, 2.0, False)
    add_brush(rng, tubes, draw_wood(rng), 5.0, 0.9, 2.0)
    assert set(np.concatenate(tubes.kind).tolist()) == {BACKGROUND}


def test_a_curve_has_a_class_a_colour_and_a_length_for_each_of_its_cones():
    tubes = Tubes()
    points = np.array([[0.0, 0, 1], [0, 0.3, 1], [0, 0.7, 1]])
    tubes.add(points, np.array([0.01, 0.02, 0.03]), np.array([CANE, NODE]), np.array([1.0, 2, 3]))
    tubes.add(points, np.full(3, 0.01), WIRE, np.array([4.0, 5, 6]))
    assert np.concatenate(tubes.kind).tolist() == [CANE, NODE, WIRE, WIRE]
    assert np.concatenate(tubes.tube).tolist() == [0, 0, 1, 1] and len(tubes.color) == 2
    assert np.concatenate(tubes.along) == pytest.approx([0.0, 0.3, 0.0, 0.3])
    assert tubes.ends[0][0] == pytest.approx([0, 0, 1, 0.01, 0, 0.3, 1, 0.02])


def test_a_class_lies_where_its_curve_is_projected_and_the_nearer_curve_hides_the_further():
    tubes = Tubes()
    gray = np.full(3, 99.0)
    behind_the_camera = np.array([[0.0, 0.5, -1], [0.0, 1.5, -1]])
    tubes.add(behind_the_camera, np.full(2, 0.5), TRUNK, gray)
    tubes.add(
        np.array([[0.0, 0.2, 1.0], [0.0, 0.8, 1.0], [0.0, 1.8, 1.0]]), np.full(3, 0.02), np.array([CANE, NODE]), gray
    )
    tubes.add(np.array([[-1.0, 1.2, 2.0], [1.0, 1.2, 2.0]]), np.full(2, 0.04), HOSE, gray)
    # At 1 m a pixel is 10 mm, and rows grow downwards from y = 1 m at row 50.
    traced = trace(tubes, Lens(np.eye(3), np.array([0.0, 1.0, 0.0]), 100.0, 50.0, 50.0), 100)
    assert set(np.unique(traced.kind)) == {BACKGROUND, CANE, NODE, HOSE}
    assert np.flatnonzero(traced.kind[20]).tolist() == [48, 49, 50, 51, 52] and traced.kind[20, 50] == NODE
    assert traced.kind[90, 50] == CANE and traced.depth[90, 50] == pytest.approx(0.98)
    # The hose is 0.2 m higher and twice as far: 10 pixels up, behind the cane.
    assert np.flatnonzero(traced.kind[:, 10]).tolist() == [38, 39, 40, 41, 42] and traced.kind[40, 10] == HOSE
    assert traced.kind[40, 50] == NODE and traced.kind[40, 60] == HOSE
    assert traced.cone[40, 60] == 3 and traced.cone[90, 50] == 1 and traced.cone[0, 0] == -1
    assert traced.run[3] == pytest.approx([100.0, 0.0]) and traced.run[1] == pytest.approx([0.0, -60.0])
    turned = np.array([[0.0, -1, 0], [1, 0, 0], [0, 0, 1]])
    on_its_side = trace(tubes, Lens(turned, np.array([0.0, 1.0, 0.0]), 100.0, 50.0, 50.0), 100)
    assert (on_its_side.kind[50] != BACKGROUND).sum() > 90 and on_its_side.kind[10, 40] != on_its_side.kind[10, 50]


@pytest.mark.long
def test_a_seed_is_a_picture_and_another_seed_another(artist):
    one, same, other = artist.draw(1, 7), artist.draw(1, 7), artist.draw(1, 8)
    assert np.array_equal(one.color, same.color) and np.array_equal(one.labels, same.labels)
    assert (one.depth is None) == (same.depth is None)
    assert not np.array_equal(one.color, other.color)


@pytest.mark.long
def test_classes_depth_and_colour_agree(scenes):
    for scene in scenes:
        assert scene.labels.max() < FAR and np.isfinite(scene.color).all()
        # Only what is background is endlessly far away; wood is within the reach of a survey.
        assert set(np.unique(scene.labels[~np.isfinite(scene.depth)])) <= {BACKGROUND}
        wood = np.isin(scene.labels, WOOD)
        assert (scene.depth[wood] < 6.0).mean() > 0.99 if wood.any() else True


def test_where_nothing_stands_nothing_is_traced():
    traced = trace(Tubes(), Lens(np.eye(3), np.zeros(3), 80.0, 40.0, 40.0), 80)
    assert (traced.kind == BACKGROUND).all() and np.isinf(traced.depth).all()


@pytest.mark.long
def test_the_pictures_are_as_varied_as_they_are_meant_to_be(scenes):
    shares = np.array([[(scene.labels == k).mean() for k in range(FAR)] for scene in scenes])
    # A third of the width of the training pictures, of which five in six show wood.
    assert (shares[:, list(WOOD)].sum(axis=1) > 0.005).mean() > 0.4
    assert all((shares[:, k] > 0.0).any() for k in range(FAR))
    drawings = [scene.photograph(np.random.default_rng(number)) for number, scene in enumerate(scenes)]
    assert np.ptp([each.color.mean() for each in drawings]) > 100.0
    assert 8 <= sum(each.depth is None for each in drawings) <= 30


@pytest.mark.long
def test_wood_differs_from_what_is_around_it(scenes):
    """Labels that lay beside what was drawn would see the same colours inside and outside."""
    contrasts = []
    for scene in scenes:
        wood = np.isin(scene.labels, WOOD)
        beside = np.roll(wood, 12, axis=1) & ~wood
        if wood.sum() > 300 and beside.sum() > 300:
            contrasts.append(np.abs(scene.color[wood].mean(axis=0) - scene.color[beside].mean(axis=0)).max())
    assert len(contrasts) > 15 and np.median(contrasts) > 20.0


@pytest.mark.long
def test_before_a_real_picture_nobody_knows_what_is_ground(artist):
    real = np.full((300, 400, 3), (10, 200, 30), np.uint8)
    before = Artist(96, (real,))
    found = [before.scene(3, number).labels for number in range(20)]
    far = [labels for labels in found if (labels == FAR).any()]
    assert 2 <= len(far) <= 14
    assert all(not np.isin(labels, (GROUND,)).mean() > 0.2 for labels in far)


def test_backgrounds_are_read_by_name_and_a_bad_one_is_named(tmp_path):
    assert load_backgrounds(None) == ()
    with pytest.raises(InputError, match=tmp_path.name):
        load_backgrounds(tmp_path)
    Image.new("RGB", (2000, 1000), (1, 2, 3)).save(tmp_path / "b.png")
    Image.new("CMYK", (90, 80)).save(tmp_path / "a.jpg")
    (tmp_path / "LICENCES.txt").write_text("a.jpg: Anna, CC0\n", encoding="utf-8")
    with pytest.raises(InputError, match="b.png"):
        load_backgrounds(tmp_path)
    (tmp_path / "LICENCES.txt").write_text("a.jpg: Anna, CC0\n\nb.png: Bo: GPL-2+\nc.png: C, CC0\n", encoding="utf-8")
    found = load_backgrounds(tmp_path)
    assert [(each.name, each.credit) for each in found] == [("a.jpg", "Anna, CC0"), ("b.png", "Bo: GPL-2+")]
    assert [each.picture.shape for each in found] == [(80, 90, 3), (640, 1280, 3)]
    (tmp_path / "c.png").write_bytes(b"no picture")
    with pytest.raises(InputError, match="c.png"):
        load_backgrounds(tmp_path)
