"""The row that the simulation grows."""

import tomllib
from pathlib import Path

import msgspec
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from bridge.sim.build import simulated_robot
from bridge.sim.vineyard.config import PRESETS, VineyardConfig, load_vineyard
from bridge.sim.vineyard.grow import grow
from bridge.sim.vineyard.row import Rod, Row
from bridge.sim.vineyard.truth import judge, judge_guyot
from rolling_panda.config import load_section
from rolling_panda.errors import ConfigError
from rolling_panda.resources import resource

CONFIG = VineyardConfig()
seeds = st.integers(0, 2**31)
some = settings(max_examples=12, deadline=None)
Chain = list[tuple[int, Rod]]


def ends(row: Row) -> list[tuple[str, list[float], list[float]]]:
    return [(rod.kind, rod.start.tolist(), rod.end.tolist()) for _, rod in row.standing()]


def canes(row: Row) -> dict[tuple[int, int, int], Chain]:
    found: dict[tuple[int, int, int], Chain] = {}
    for index, rod in row.standing():
        if rod.cane >= 0:
            found.setdefault((rod.vine, rod.spur, rod.cane), []).append((index, rod))
    return found


def test_the_same_seed_gives_the_same_row_and_another_seed_another():
    assert ends(grow(CONFIG, 7)) == ends(grow(CONFIG, 7))
    assert ends(grow(CONFIG, 7)) != ends(grow(CONFIG, 8))


def test_a_longer_row_begins_like_a_shorter_one():
    short, long = grow(msgspec.structs.replace(CONFIG, vines=1), 3), grow(CONFIG, 3)
    first = [rod.end.tolist() for _, rod in long.standing() if rod.vine == 0]
    assert first == [rod.end.tolist() for _, rod in short.standing() if rod.vine == 0]


def test_the_shipped_configuration_grows_a_row_of_everything():
    config = load_section(Path(resource("assets/config/sim.toml")), "vineyard", VineyardConfig)
    row = grow(config, 0)
    wood = {"trunk", "cordon", "spur", "cane", "node", "old cut"}
    assert {rod.kind for _, rod in row.standing()} == wood | {"post", "wire", "hose"}
    assert len(row.rods) < 5000


@given(seeds)
@some
def test_every_rod_hangs_on_its_parent_which_comes_first(seed):
    row = grow(CONFIG, seed)
    for index, rod in row.standing():
        assert rod.parent < index
        if rod.parent < 0:
            assert rod.kind in ("post", "wire", "trunk", "hose")
            continue
        parent = row.rods[rod.parent]
        assert parent is not None
        axis = parent.end - parent.start
        fraction = float((rod.start - parent.start) @ axis / (axis @ axis))
        assert -1e-6 <= fraction <= 1.0 + 1e-6
        assert np.linalg.norm(parent.start + fraction * axis - rod.start) < 1e-6


@given(seeds)
@some
def test_canes_are_chains_with_the_published_numbers(seed):
    row = grow(CONFIG, seed)
    for chain in canes(row).values():
        for (before, _), (_, rod) in zip(chain, chain[1:], strict=False):
            assert rod.parent == before
        stub = row.rods[chain[0][1].parent]
        assert stub is not None and stub.kind == "spur"
        lengths = np.array([np.linalg.norm(rod.end - rod.start) for _, rod in chain])
        starts = np.concatenate([[0.0], np.cumsum(lengths)])
        nodes = [k for k, (_, rod) in enumerate(chain) if rod.kind == "node"]
        middles = np.array([starts[k] + lengths[k] / 2 for k in nodes])
        assert np.all((np.diff(middles) >= 0.0599) & (np.diff(middles) <= 0.1001))
        # The basal bud is measured from the bark of the stub; the cane's axis starts inside of it.
        assert 0.0099 <= middles[0] <= 0.04 + 0.009 / np.sin(0.6) + 1e-6
        assert 0.9 <= starts[-1] <= 1.5 + 0.02
        assert 0.0025 <= chain[0][1].start_radius <= 0.0065
        for k in nodes:
            assert 1.34 <= chain[k][1].start_radius / chain[k - 1][1].end_radius <= 1.51
            assert 0.0099 <= lengths[k] <= 0.0141
        assert chain[-1][1].end[2] - chain[0][1].start[2] > 0.7, "canes are mostly upright"


@given(seeds)
@some
def test_spurs_stand_along_the_cordon_at_their_spacing(seed):
    row = grow(CONFIG, seed)
    places = list(canes(row))
    for vine in range(CONFIG.vines):
        trunk = CONFIG.first_vine_x + vine * CONFIG.vine_spacing
        spurs = [rod for _, rod in row.standing() if rod.kind == "spur" and rod.vine == vine]
        x = np.array([rod.start[0] for rod in spurs])
        assert [rod.spur for rod in spurs] == list(range(len(spurs)))
        for arm in (x[x < trunk], x[x > trunk]):
            # Measured along the arm, which is not quite straight.
            assert 5 <= len(arm) <= 7
            assert np.all((np.diff(arm) >= 0.0895) & (np.diff(arm) <= 0.1505))
        for rod in spurs:
            assert abs(rod.start[2] - 0.9) < 0.07 and abs(rod.start[1] - CONFIG.row_distance) < 0.04
            assert rod.end[2] > rod.start[2]
            assert 1 <= sum(place[:2] == (vine, rod.spur) for place in places) <= 3


def test_most_spurs_have_two_canes_of_about_eight_millimetres():
    counts, radii = [], []
    for seed in range(8):
        found = canes(grow(CONFIG, seed))
        spurs = [(vine, spur) for vine, spur, _ in found]
        counts += [spurs.count(place) for place in set(spurs)]
        radii += [chain[0][1].start_radius for chain in found.values()]
    assert 0.6 < np.mean(np.array(counts) == 2) < 0.8
    assert abs(2 * np.mean(radii) - 0.008) < 0.0003


@given(seeds, st.integers(0, 10**6), st.floats(0.0, 0.99))
@some
def test_a_cut_takes_off_what_is_beyond_it_and_nothing_else(seed, pick, fraction):
    row = grow(CONFIG, seed)
    chains = list(canes(row).values())
    chain = chains[pick % len(chains)]
    k = pick % len(chain)
    index = chain[k][0]
    after = row.sever(index, fraction)
    assert {i for i, _ in row.standing()} - {i for i, _ in after.standing()} == {i for i, _ in chain[k + 1 :]}
    shorter = after.rods[index]
    assert shorter is not None
    assert np.allclose(shorter.end, chain[k][1].at(fraction)[0])
    assert after.revision == row.revision + 1


def test_a_cut_near_the_tip_of_the_stub_takes_off_the_last_cane_only():
    row = grow(CONFIG, 0)
    place = next((v, s) for v, s, cane in canes(row) if cane == 1)
    chains = {key[2]: chain for key, chain in canes(row).items() if key[:2] == place}
    after = row.sever(chains[0][0][1].parent, 0.98)
    left = {rod.cane for _, rod in after.standing() if (rod.vine, rod.spur) == place and rod.cane >= 0}
    assert left == set(chains) - {max(chains)}


@pytest.mark.parametrize(
    ("change", "says"),
    [
        ({"internode": (0.1, 0.06)}, "backwards"),
        ({"cane_shares": (0.5, 0.5, 0.5)}, "add up"),
        ({"basal": (0.001, 0.04)}, "overlap"),
    ],
)
def test_a_row_that_no_vine_could_be_is_refused(change, says):
    with pytest.raises(ConfigError, match=says):
        grow(msgspec.structs.replace(CONFIG, **change), 0)


# --- presets ----------------------------------------------------------------------------------------------------------


def written(folder: Path, text: str) -> Path:
    path = folder / "sim.toml"
    path.write_text(text)
    return path


def test_the_standard_preset_is_the_row_without_a_preset(tmp_path):
    shipped = resource("assets/config/sim.toml")
    assert load_vineyard(written(tmp_path, "")) == PRESETS["standard"] == VineyardConfig()
    assert load_vineyard(shipped) == load_section(shipped, "vineyard", VineyardConfig)


def test_a_preset_gives_all_values_and_a_key_replaces_its_own(tmp_path):
    got = load_vineyard(written(tmp_path, '[vineyard]\npreset = "vigorous"\nvines = 1\ncane_droop = [0.0, 0.15]\n'))
    assert got == msgspec.structs.replace(PRESETS["vigorous"], vines=1, cane_droop=(0.0, 0.15))
    assert got.internode == (0.08, 0.14)


def test_an_unknown_preset_is_refused_with_those_that_there_are(tmp_path):
    with pytest.raises(ConfigError, match="preset is 'oak'; known are standard, short_internodes, vigorous, drooping"):
        load_vineyard(written(tmp_path, '[vineyard]\npreset = "oak"\n'))


def test_every_preset_has_its_name_and_differs_from_the_standard_one():
    for name, config in PRESETS.items():
        assert config.preset == name
        assert name == "standard" or config != msgspec.structs.replace(CONFIG, preset=name)


def test_the_shipped_configuration_sets_nothing_that_a_preset_sets():
    sections = tomllib.loads(resource("assets/config/sim.toml").read_text(encoding="utf-8"))
    for config in PRESETS.values():
        assert all(getattr(config, key) == getattr(CONFIG, key) for key in sections["vineyard"])


def measured(config: VineyardConfig) -> dict[str, float]:
    """Means over some vines: canes a metre, length, diameter and internodes of a cane (m), lean of its tip (rad)."""
    found: list[Chain] = []
    for seed in range(8):
        found += canes(grow(msgspec.structs.replace(config, vines=1), seed)).values()
    gaps, leans = [], []
    for chain in found:
        middles = [rod.at(0.5)[0] for _, rod in chain if rod.kind == "node"]
        gaps += [float(np.linalg.norm(b - a)) for a, b in zip(middles, middles[1:], strict=False)]
        last = chain[-1][1]
        leans.append(float(np.arccos((last.end - last.start)[2] / np.linalg.norm(last.end - last.start))))
    return {
        "canes": len(found) / 8 / config.vine_spacing,
        "length": float(np.mean([sum(np.linalg.norm(rod.end - rod.start) for _, rod in chain) for chain in found])),
        "diameter": float(np.mean([2 * chain[0][1].start_radius for chain in found])),
        "internode": float(np.mean(gaps)),
        "lean": float(np.mean(leans)),
    }


def test_short_internodes_have_the_published_means_of_cabernet_sauvignon():
    got = measured(PRESETS["short_internodes"])
    assert got["internode"] == pytest.approx(0.053, abs=0.001) and got["length"] == pytest.approx(1.30, abs=0.03)
    assert got["canes"] == pytest.approx(14.0, abs=1.0) and got["diameter"] == pytest.approx(0.009, abs=0.0003)


@pytest.mark.long
def test_vigorous_vines_have_more_thicker_and_longer_canes_and_drooping_ones_lean_most():
    got = {name: measured(config) for name, config in PRESETS.items()}
    usual, vigorous, drooping = got["standard"], got["vigorous"], got["drooping"]
    assert vigorous["canes"] > 1.1 * usual["canes"] and vigorous["diameter"] > 1.15 * usual["diameter"]
    assert vigorous["internode"] > 1.3 * usual["internode"] and vigorous["length"] > 1.2 * usual["length"]
    assert drooping["lean"] > 2.0 * max(usual["lean"], vigorous["lean"])
    assert {key: drooping[key] for key in ("canes", "diameter")} == {key: usual[key] for key in ("canes", "diameter")}


@pytest.mark.parametrize("preset", PRESETS)
def test_right_cuts_of_every_preset_leave_the_basal_bud_and_two_nodes(preset):
    row = grow(msgspec.structs.replace(PRESETS[preset], vines=1), 8200)
    spurs = [each for each in judge(row) if each.cut is not None]
    assert len(spurs) >= 10
    for each in spurs:
        assert each.cut is not None
        chain = canes(row)[each.vine, each.spur, each.keeper]
        assert sum(rod.kind == "node" and index < each.cut.rod for index, rod in chain) == 3


@pytest.mark.parametrize("preset", PRESETS)
def test_every_preset_grows_as_guyot_too(preset):
    (vine,) = judge_guyot(grow(msgspec.structs.replace(PRESETS[preset], vines=1, training="guyot"), 8200))
    assert vine.spur_cut is not None and vine.cane_cut is not None and vine.removal is not None


def test_laterals_of_a_preset_grow_beside_the_simulated_robot_in_a_calm_world(tmp_path):
    robot = simulated_robot(written(tmp_path, '[vineyard]\nvines = 1\npreset = "vigorous"\n'), 5, None, "inline")
    try:
        organs = {(rod.spur, rod.cane, rod.organ) for _, rod in robot.row.standing() if rod.organ >= 0}
    finally:
        robot.close()
    nodes = sum(
        rod.kind == "node" for _, rod in grow(msgspec.structs.replace(PRESETS["vigorous"], vines=1), 5).standing()
    )
    assert 0.08 < len(organs) / nodes < 0.20
