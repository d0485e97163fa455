"""The disturbances of the simulated world: each has an effect that can be measured, from the seed, none when calm."""

from pathlib import Path

import numpy as np
import pytest
from msgspec.structs import asdict, replace

from bridge.config import BridgeConfig
from bridge.core.interface import Setpoint
from bridge.sim.build import simulated_bridge
from bridge.sim.camera.config import CameraConfig
from bridge.sim.camera.renderer import Camera, InlineRenderer
from bridge.sim.robot.robot import SimulatedRobot
from bridge.sim.vineyard.config import VineyardConfig
from bridge.sim.vineyard.grow import grow
from bridge.sim.vineyard.row import Rod, Row
from bridge.sim.world.config import CALM, PRESETS, WorldConfig, load_world, only
from bridge.sim.world.errors import draw_errors
from bridge.sim.world.ground import Ground
from bridge.sim.world.slip import Slip
from bridge.sim.world.wind import Wind
from bridge.sim.world.wood import Wood
from rolling_panda import reasons
from rolling_panda.config import load_section
from rolling_panda.errors import ConfigError
from rolling_panda.model.robot import RobotModel
from rolling_panda.resources import resource
from tests.support.cameras import Blind, looking_left

CONFIG = load_section(resource("assets/config/sim.toml"), "bridge", BridgeConfig)
DRIVE = RobotModel().drive
STORM = PRESETS["storm"]
LENS = CameraConfig(width=212, height=120).ideal()


def robot(world: WorldConfig, row: Row | None = None, seed: int = 2) -> SimulatedRobot:
    return SimulatedRobot(CONFIG, row or Row(()), Blind(), None, world, seed)


def drive(sim: SimulatedRobot, seconds: float, v: float = 0.25) -> np.ndarray:
    """Drive straight on; the pose by the wheels' encoders."""
    pose, last = np.zeros(3), sim.read().position[:2].copy()
    for _ in range(round(seconds * 1000)):
        sim.write(Setpoint(np.array([*DRIVE.wheels(v, 0.0), *[0.0] * 7]), True, 1, 1, 0.0))
        wheels = sim.read().position[:2].copy()
        pose, last = DRIVE.integrate(pose, *(wheels - last)), wheels
    return pose


def written(folder: Path, text: str) -> Path:
    path = folder / "sim.toml"
    path.write_text(text)
    return path


def test_a_preset_gives_all_values_and_a_key_replaces_its_own(tmp_path: Path) -> None:
    assert load_world(written(tmp_path, "")) == CALM == load_world(resource("assets/config/sim.toml"))
    got = load_world(written(tmp_path, '[world]\npreset = "storm"\nslip = 0.0\nbumps = 0.001\n'))
    assert got == replace(STORM, slip=0.0, bumps=0.001)
    assert load_world(written(tmp_path, "[world]\nsway = 0.01\n")) == replace(CALM, sway=0.01)


@pytest.mark.parametrize(
    ("text", "parts"),
    [
        ('preset = "gale"', ["[world]", "preset"]),
        ("slipp = 0.1", ["'slipp'", "did you mean 'slip'"]),
        ("slip = 0.4", ["slip", "0.4", "at most 0.3"]),
        ("hand_eye_angle = -0.01", ["hand_eye_angle", "-0.01", "at least 0"]),
        ("sway = nan", ["sway"]),
        ('bumps = "high"', ["bumps"]),
    ],
)
def test_a_wrong_key_or_value_is_refused_with_what_is_allowed(tmp_path: Path, text: str, parts: list[str]) -> None:
    with pytest.raises(ConfigError) as refused:
        load_world(written(tmp_path, f"[world]\n{text}\n"))
    assert all(part in str(refused.value) for part in parts), refused.value


def test_storm_is_worse_than_field_and_field_than_calm_in_everything() -> None:
    for key in WorldConfig.__struct_fields__[1:]:
        calm, field, storm = (getattr(world, key) for world in PRESETS.values())
        assert 0.0 == calm < field < storm, key


def test_errors_come_from_the_seed_and_one_does_not_depend_on_another() -> None:
    first, again, other = draw_errors(STORM, 3), draw_errors(STORM, 3), draw_errors(STORM, 4)
    assert np.array_equal(first.joint_offset, again.joint_offset) and np.array_equal(first.hand_eye, again.hand_eye)
    assert not np.array_equal(first.joint_offset, other.joint_offset)
    alone = draw_errors(only(("joint_offset",), "storm"), 3)
    assert np.array_equal(alone.joint_offset, first.joint_offset)
    assert np.array_equal(alone.hand_eye, np.eye(3)) and alone.focal == alone.track == 1.0


def test_errors_have_the_size_that_is_configured() -> None:
    drawn = [draw_errors(STORM, seed) for seed in range(300)]
    offsets = np.concatenate([each.joint_offset for each in drawn])
    assert np.std(offsets) == pytest.approx(STORM.joint_offset, rel=0.1)
    angles = np.array([np.arccos(np.clip((np.trace(each.hand_eye) - 1) / 2, -1, 1)) for each in drawn])
    assert np.sqrt(np.mean(angles**2) / 3) == pytest.approx(STORM.hand_eye_angle, rel=0.1)
    factors = np.array([each.focal for each in drawn]) - 1.0
    assert 0.9 * STORM.focal_error < np.abs(factors).max() <= STORM.focal_error
    wheels = np.array([each.wheels for each in drawn])
    assert np.abs(wheels[:, 0] - wheels[:, 1]).max() <= 0.1 * STORM.wheel_error + 1e-12


def test_the_arm_is_elsewhere_than_the_encoders_tell() -> None:
    sim = robot(only(("joint_offset",), "storm"))
    assert sim.read().position[2:] == pytest.approx(CONFIG.start_arm, abs=1e-6)
    model = RobotModel()
    q = np.concatenate([sim.true_base().pose, sim.read().position])
    off = np.linalg.norm(model.pose(q, model.tool_id).translation - sim.true_tool()[:3, 3])
    assert 0.0005 < off < 0.01


def test_the_arm_stands_on_the_base_elsewhere_than_the_model_has_it() -> None:
    calm, moved = robot(CALM), robot(only(("mount_angle", "mount_shift"), "storm"))
    assert np.linalg.norm(calm.true_tool()[:3, 3] - moved.true_tool()[:3, 3]) > 0.002


def test_odometry_drifts_with_worn_wheels_and_slip_and_not_without() -> None:
    def drift(world: WorldConfig) -> float:
        sim = robot(world)
        return float(np.linalg.norm(drive(sim, 2.0)[:2] - sim.true_base().pose[:2]))

    assert drift(CALM) < 0.002
    assert drift(only(("wheel_error",), "storm")) > 0.004
    assert drift(only(("slip",), "storm")) > 0.004


def test_slip_has_its_deviation_and_keeps_over_half_a_metre() -> None:
    slips, steps = Slip(0.08, 0.134, 5), 40000
    seen = np.empty((steps, 2))
    for k in range(steps):
        slips.roll(np.full(2, 0.05 / 0.134))
        seen[k] = slips.factor - 1.0
    assert seen.std() == pytest.approx(0.08, rel=0.15)
    after = 10
    assert np.corrcoef(seen[:-after, 0], seen[after:, 0])[0, 1] == pytest.approx(np.exp(-1.0), abs=0.1)
    still = Slip(0.08, 0.134, 5)
    before = still.factor
    still.roll(np.zeros(2))
    assert np.array_equal(still.factor, before) and np.array_equal(still.encoders, np.zeros(2))


def test_the_base_pitches_and_rolls_over_bumps_and_leans_on_a_slope_across() -> None:
    ground = Ground(STORM, 0.0, 3)
    places = np.random.default_rng(0).uniform(0.0, 30.0, (2000, 2))
    height, normal = ground.at(places)
    assert 2.0 * height.std() == pytest.approx(STORM.bumps, rel=0.3)
    step = 1e-5
    along = (ground.at(places + [step, 0.0])[0] - height) / step
    assert -normal[:, 0] / normal[:, 2] == pytest.approx(along, abs=1e-3)
    sim, level = robot(only(("bumps",), "storm")), robot(CALM)
    uprights = []
    for _ in range(8):
        drive(sim, 0.5)
        uprights.append(float(np.degrees(np.arccos(min(1.0, sim.true_base_rotation()[2, 2])))))
    assert max(uprights) > 0.5 and max(uprights) - min(uprights) > 0.3
    drive(level, 0.5)
    assert level.true_base_rotation()[2, 2] == pytest.approx(1.0, abs=1e-6)
    across = robot(only(("slope_across",), "storm"))
    roll = np.arctan2(across.true_base_rotation()[2, 1], across.true_base_rotation()[2, 2])
    assert roll == pytest.approx(draw_errors(STORM, 2).slope[1], abs=2e-3)


@pytest.mark.parametrize(("preset", "seed"), [("field", 5), ("field", 2604), ("storm", 3), ("storm", 11)])
def test_bumps_rock_the_base_and_do_not_strike_it(preset: str, seed: int) -> None:
    """The arm takes it for touch when its foot accelerates: nothing may touch it within hundredths of a second."""
    sim, felt = robot(PRESETS[preset], seed=seed), []
    drive(sim, 0.8)
    for _ in range(1500):
        drive(sim, 0.001)
        torque = sim.read().external_torque
        assert torque is not None
        felt.append(torque)
    jumps = np.abs(np.array(felt)[20:] - np.array(felt)[:-20])
    assert jumps[:, :4].max() < 2.0 and jumps[:, 4:].max() < 0.5


def test_on_a_slope_the_base_stands_still() -> None:
    sim = robot(only(("slope_along",), "storm"))
    drive(sim, 1.0, 0.0)
    before = sim.true_base().pose.copy()
    drive(sim, 1.0, 0.0)
    assert np.abs(sim.true_base().pose - before).max() < 5e-4


@pytest.mark.parametrize("seed", [*range(8), 26, 33, 102])
def test_in_a_storm_the_robot_begins_at_rest_on_the_ground(seed: int) -> None:
    # With the last three it once began with a wheel up to 37 mm below the ground, which threw it into the air.
    sim = robot(STORM, seed=seed)
    before = sim.true_base().pose
    for _ in range(500):
        sim.write(Setpoint(np.zeros(9), True, 1, 1, 0.0))
    assert np.abs(sim.true_base().pose - before).max() < 0.002
    assert np.degrees(np.arccos(sim.true_base_rotation()[2, 2])) < 12.0


def test_a_turned_shifted_camera_with_another_lens_shows_the_row_elsewhere() -> None:
    row = grow(VineyardConfig(vines=1), 3)
    calm = Camera(LENS, 3).render(row, looking_left(0.5)).labels
    assert np.array_equal(Camera(LENS, 3, CALM).render(row, looking_left(0.5)).labels, calm)
    for knobs in (("hand_eye_angle",), ("hand_eye_shift",), ("focal_error",)):
        storm = Camera(LENS, 3, only(knobs, "storm")).render(row, looking_left(0.5)).labels
        assert np.mean(storm != calm) > 0.01, knobs


def test_sun_takes_the_depth_of_thin_wood_alone() -> None:
    row = Row((_upright("cane", 0.0, 0.004), _upright("trunk", 0.2, 0.03)))
    calm, sunny = (
        Camera(LENS, 1, world).render(row, looking_left()) for world in (CALM, only(("depth_lost",), "storm"))
    )
    for rod, lost in ((0, STORM.depth_lost), (1, 0.0)):
        wood = calm.rods == rod
        assert np.all(calm.depth[wood] > 0.0)
        assert np.mean(sunny.depth[wood] == 0.0) == pytest.approx(lost, abs=0.15 if lost else 0.0)


def test_wind_bends_canes_from_their_base_and_nothing_else_and_they_swing_back() -> None:
    row = grow(VineyardConfig(vines=1), 4)
    wind = Wind(row, 0.02, 4)
    moved = [
        np.array([[r.start - s.start, r.end - s.end] for (_, r), (_, s) in zip(blown, row.standing(), strict=True)])
        for blown in (wind.blown(row, t).standing() for t in np.arange(0.0, 4.0, 0.1))
    ]
    way = np.linalg.norm(np.array(moved), axis=3)
    fixed = np.array([rod.cane < 0 for _, rod in row.standing()])
    assert way[:, fixed].max() == 0.0 and 0.02 < way.max() <= 0.04
    assert np.abs(np.array(moved).mean(axis=0)).max() < 0.02, "it sways about where it stands"
    bases = [k for k, (_, rod) in enumerate(row.standing()) if rod.cane >= 0 and row.rods[rod.parent].cane < 0]
    assert way[:, bases, 0].max() == 0.0


def test_a_frame_is_exposed_later_than_its_joint_state_where_the_camera_has_no_trigger() -> None:
    class Noting(Blind):
        at: list[float] = []

        def expose(self, row: Row, T_world_camera: np.ndarray, at: float, velocity: np.ndarray) -> bool:
            self.at.append(at)
            return True

    delays = []
    for world in (CALM, only(("frame_delay", "frame_jitter"), "storm")):
        camera = Noting()
        camera.at = []
        sim = SimulatedRobot(CONFIG, Row(()), camera, None, world, 1)
        for _ in range(20):
            begin = sim.time
            sim.capture(True)
            drive(sim, 0.12, 0.0)
            delays.append(camera.at[-1] - begin)
    assert max(delays[:20]) == 0.0
    assert np.mean(delays[20:]) == pytest.approx(STORM.frame_delay, abs=0.012) and np.std(delays[20:]) > 0.005


def test_each_exposure_has_the_true_speed_of_the_camera() -> None:
    class Noting(Blind):
        velocity = np.zeros(6)

        def expose(self, row: Row, T_world_camera: np.ndarray, at: float, velocity: np.ndarray) -> bool:
            self.velocity = velocity
            return True

    camera = Noting()
    sim = SimulatedRobot(CONFIG, Row(()), camera, None, CALM, 1)
    turning = Setpoint(np.array([*DRIVE.wheels(0.25, 0.2), 0.3, *[0.0] * 6]), True, 1, 1, 0.0)
    for _ in range(600):
        before = sim.true_camera()
        sim.write(turning)
    sim.capture(True)
    after = sim.true_camera()
    linear = 1000 * (after[:3, 3] - before[:3, 3])
    twist = 1000 * (after[:3, :3] @ before[:3, :3].T)
    angular = [twist[2, 1], twist[0, 2], twist[1, 0]]
    assert np.linalg.norm(linear) > 0.2 and angular[2] > 0.4
    assert camera.velocity == pytest.approx([*linear, *angular], abs=0.01)


def _upright(kind: str, x: float, radius: float, **numbers: int) -> Rod:
    return Rod(kind, np.array([x, 0.75, 0.6]), np.array([x, 0.75, 1.4]), radius, radius, **numbers)


def bitten(world: WorldConfig, seed: int) -> tuple[SimulatedRobot, str]:
    """A robot that has closed its blades on a cane of 8 mm."""
    tool = robot(CALM).true_tool()
    at, across = tool[:3, 3], tool[:3, 1]
    cane = Rod("cane", at - 0.1 * across, at + 0.4 * across, 0.004, 0.004, vine=1, spur=2, cane=0)
    beyond = Rod("cane", at + 0.4 * across, at + 0.6 * across, 0.004, 0.004, 0, 1, 2, 0)
    sim = robot(world, Row((cane, beyond)), seed)
    sim.cut("c1", "p1")
    drive(sim, 0.7, 0.0)
    return sim, sim.read().outcome


def test_blades_sometimes_jam_or_leave_the_cane_on_its_bark_and_say_what_they_felt() -> None:
    failing = replace(CALM, blade_failures=1.0)
    fates = {seed: (wood.fails(0.008), wood.jams()) for seed in range(40) if (wood := Wood(failing, seed))}
    for jams, outcome, felt in ((False, "DONE", "blades_met"), (True, "FAILED_NOT_CUT", "blades_jammed")):
        seed = next(seed for seed, fate in fates.items() if fate == (True, jams))
        sim, told = bitten(failing, seed)
        assert (told, sim.read().detail.code) == (outcome, felt)
        assert sim.row.revision == 0 and sim.row.rods[0].end == pytest.approx(sim.row.rods[1].start)
    sim, outcome = bitten(CALM, 0)
    assert outcome == "DONE" and sim.row.revision == 1 and sim.read().detail == reasons.wood_severed("cane")


def test_blades_fail_more_often_at_thick_wood() -> None:
    def share(diameter: float) -> float:
        wood = Wood(STORM, 1)
        return float(np.mean([wood.fails(diameter) for _ in range(4000)]))

    assert share(0.008) == pytest.approx(STORM.blade_failures, abs=0.02)
    assert share(0.004) == pytest.approx(STORM.blade_failures / 4, abs=0.02)
    assert share(0.016) == pytest.approx(4 * STORM.blade_failures, abs=0.03)


def test_a_severed_cane_that_hangs_stays_beside_where_it_stood_and_the_stub_ends_at_the_cut() -> None:
    sim, outcome = bitten(replace(CALM, hanging=1.0), 3)
    stub, tip, rest = sim.row.rods
    assert outcome == "DONE" and stub is not None and tip is not None and rest is not None
    whole, _ = bitten(replace(CALM, blade_failures=1.0), 3)
    away = rest.start - stub.end
    assert 0.01 < np.linalg.norm(away) < 0.07 and away[2] < 0.0
    assert rest.end == pytest.approx(tip.start)
    assert np.linalg.norm(tip.start - whole.row.rods[1].start) == pytest.approx(np.linalg.norm(away))
    fallen, _ = bitten(CALM, 3)
    assert fallen.row.rods[1] is None and len(fallen.row.rods) == 2


def test_a_severed_cane_that_falls_lies_on_the_ground_as_the_seed_has_it() -> None:
    sim, _ = bitten(CALM, 3)
    whole, _ = bitten(replace(CALM, blade_failures=1.0), 3)
    cut, tip = sim.row.lying
    (stub, _), (long, beyond) = sim.row.rods, whole.row.rods
    assert stub is not None and long is not None and beyond is not None

    def length(rod: Rod) -> float:
        return float(np.linalg.norm(rod.end - rod.start))

    assert length(cut) == pytest.approx(length(long) - length(stub)) and length(tip) == pytest.approx(length(beyond))
    assert cut.end == pytest.approx(tip.start)
    assert [rod.start[2] for rod in sim.row.lying] == pytest.approx([rod.start_radius for rod in sim.row.lying])
    fell = np.mean([stub.end, beyond.end], axis=0) - np.mean([cut.start, tip.end], axis=0)
    assert np.abs(fell[:2]).max() < 1e-9 + 0.1 and fell[2] > 0.5
    lengthwise = (tip.end - cut.start)[:2]
    azimuth = Wood(CALM, 3).lies()
    assert np.arctan2(*lengthwise[::-1]) % (2 * np.pi) == pytest.approx(azimuth)
    shown = sim.scenery()[1]
    assert [each.start for each in shown[-2:]] == [tuple(rod.start) for rod in sim.row.lying]
    assert bitten(replace(CALM, hanging=1.0), 3)[0].row.lying == ()


def test_wood_on_the_ground_is_in_the_picture_as_background_and_the_wind_does_not_move_it() -> None:
    row = grow(VineyardConfig(vines=1), 4)
    first = next(index for index, rod in row.standing() if rod.cane >= 0)
    gone, lies = row.sever(first, 0.5), row.sever(first, 0.5, lies=0.7)
    assert [rod is None for rod in lies.rods] == [rod is None for rod in gone.rods] and len(lies.lying) > 10
    assert Wind(row, 0.02, 4).blown(lies, 1.0).lying == lies.lying
    T = looking_left(0.3, 0.0, 1.0)
    T[:3, :3] = T[:3, :3] @ [[1.0, 0.0, 0.0], [0.0, 0.6, 0.8], [0.0, -0.8, 0.6]]
    camera = Camera(LENS)
    before, after = camera.render(gone, T), camera.render(lies, T)
    wood = np.any(before.color != after.color, axis=2)
    assert wood.sum() > 40
    assert set(after.labels[wood]) == {0} and (after.rods[wood] == -1).all()
    assert np.array_equal(before.labels[~wood], after.labels[~wood])


@pytest.mark.long
def test_the_same_seed_gives_the_same_bytes_in_a_storm_and_another_seed_others(tmp_path: Path) -> None:
    text = resource("assets/config/sim.toml").read_text().replace("width = 848", "width = 64")
    config = written(tmp_path, text.replace("height = 480", "height = 48").replace('"calm"', '"storm"'))

    def run(seed: int, name: str) -> tuple[bytes, list[bytes]]:
        core, pictures = simulated_bridge(config, seed, tmp_path / name), []
        for tick in range(800):
            out = core.step(tick * 1e-3)
            pictures += [] if out.frame is None else [out.frame.color_jpeg + out.frame.depth_zlib]
        core.robot.close()
        return (tmp_path / name).read_bytes(), pictures

    first = run(7, "a")
    assert len(first[1]) >= 2 and run(7, "b") == first
    assert run(8, "c")[1] != first[1]


def test_all_values_of_calm_are_zero_so_that_nothing_is_drawn() -> None:
    assert {value for key, value in asdict(CALM).items() if key != "preset"} == {0.0}
    assert isinstance(InlineRenderer(LENS, 1, CALM), InlineRenderer)
