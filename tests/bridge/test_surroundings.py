"""What stands in a row beside the wood of the year."""

import msgspec
import numpy as np

from bridge.sim.camera.config import CameraConfig
from bridge.sim.camera.renderer import Camera
from bridge.sim.vineyard.config import VineyardConfig
from bridge.sim.vineyard.grow import grow
from rolling_panda.messages.types import WOOD_CLASSES
from tests.support.cameras import looking_left

CONFIG = VineyardConfig()
BARE = msgspec.structs.replace(CONFIG, hose_height=0.0, rows_behind=0, ties_a_vine=(0, 0), old_cuts_a_vine=(0, 0))


def test_the_wood_of_the_year_does_not_depend_on_what_stands_beside_it():
    kinds = {"trunk", "cordon", "spur", "cane", "node"}
    full, bare = (
        [(rod.kind, rod.end.tolist()) for _, rod in grow(config, 5).standing() if rod.kind in kinds]
        for config in (CONFIG, BARE)
    )
    assert full == bare


def test_every_stub_ends_in_an_old_cut_and_more_are_on_trunk_and_arms():
    row = grow(CONFIG, 2)
    stubs = [index for index, rod in row.standing() if rod.kind == "spur"]
    wounds = [rod for _, rod in row.standing() if rod.kind == "old cut"]
    assert sorted(rod.parent for rod in wounds if rod.spur >= 0) == stubs
    assert {row.rods[rod.parent].kind for rod in wounds if rod.spur < 0} <= {"trunk", "cordon"}
    assert 2 * CONFIG.vines <= sum(rod.spur < 0 for rod in wounds) <= 6 * CONFIG.vines


def test_the_rows_behind_are_seen_as_background_and_cannot_be_cut():
    row = grow(CONFIG, 2)
    image = Camera(CameraConfig(max_range=10.0), 1).render(row, looking_left(0.5, 0.0, 1.0))
    behind = (image.depth > CONFIG.row_distance + CONFIG.row_spacing - 0.2) & (image.depth < 3.6)
    seen = behind & (image.labels != WOOD_CLASSES.index("ground"))
    assert seen.sum() > 500
    assert np.all(image.labels[seen] == WOOD_CLASSES.index("background"))
    assert np.all(image.rods[seen] == -1)
    assert row.sever(row.rods.index(next(r for r in row.rods if r.kind == "cane")), 0.5).backdrop == row.backdrop


def test_the_hose_hangs_where_it_is_configured():
    hoses = [
        rod for _, rod in grow(msgspec.structs.replace(CONFIG, hose_height=0.62), 0).standing() if rod.kind == "hose"
    ]
    assert [rod.start[2] for rod in hoses] == [0.62]
    assert not [rod for _, rod in grow(BARE, 0).standing() if rod.kind == "hose"]
