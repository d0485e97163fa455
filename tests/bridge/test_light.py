"""The light of the rough world, seen in pictures: shadows, glare, wet bark and motion blur; depth and truth stay."""

import numpy as np
import pytest
from msgspec.structs import replace

from bridge.sim.camera.config import CameraConfig
from bridge.sim.camera.light import Light
from bridge.sim.camera.palette import draw_appearance
from bridge.sim.camera.renderer import Camera, RgbdImage
from bridge.sim.vineyard.config import VineyardConfig
from bridge.sim.vineyard.grow import grow
from bridge.sim.vineyard.row import Rod, Row
from bridge.sim.world.config import CALM, PRESETS, WorldConfig, only
from tests.support.cameras import looking_left

LENS = CameraConfig(width=424, height=240).ideal()
FOCAL = LENS.intrinsics().fx
SUNNY, STORM = only(("sunlight",), "storm"), PRESETS["storm"]
EYE = looking_left()


def post(x: float, y: float = 1.0, kind: str = "post") -> Rod:
    return Rod(kind, np.array([x, y, -0.1]), np.array([x, y, 3.0]), 0.05, 0.05)


def seen(
    row: Row, world: WorldConfig, seed: int, eye: np.ndarray = EYE, velocity: np.ndarray | None = None
) -> RgbdImage:
    return Camera(LENS, seed, world).render(row, eye, 0, velocity)


def grey(image: RgbdImage) -> np.ndarray:
    return image.color.astype(float).mean(axis=2)


def sun(seed: int) -> np.ndarray:
    return Light(SUNNY, draw_appearance(seed, 1.0), seed).sun.astype(float)


def with_sun(ahead: bool) -> int:
    """A seed whose sun is before the camera, within its picture, or behind it."""
    return next(seed for seed in range(100) if (sun(seed)[1] > 0.85 if ahead else sun(seed)[1] < -0.6))


def test_the_sun_is_low_and_everywhere_around() -> None:
    suns = np.array([sun(seed) for seed in range(200)])
    height = np.degrees(np.arcsin(suns[:, 2]))
    assert 8.0 <= height.min() < 10.0 and 23.0 < height.max() <= 25.0
    assert np.abs(suns[:, :2].mean(axis=0)).max() < 0.15


def test_a_low_sun_throws_shadows_on_ground_and_wood_and_the_calm_one_none() -> None:
    seed = with_sun(ahead=False)
    wood = post(0.0, 1.5, "trunk")
    # Above the camera and out of its picture, between the sun and the trunk at the camera's height.
    across = np.cross(sun(seed), [0.0, 0.0, 1.0])
    at = np.array([0.0, 1.5, 1.0]) + 1.2 / abs(sun(seed)[1]) * 1.2 * sun(seed)
    blind = Rod("post", at - 0.5 * across, at + 0.5 * across, 0.06, 0.06)
    shaded = []
    for world in (CALM, SUNNY):
        alone, below = seen(Row((wood,)), world, seed), seen(Row((wood, blind)), world, seed)
        assert np.array_equal(alone.rods, below.rods), "the blind is out of sight"
        exposure = np.median(grey(below)[alone.labels == 0] / grey(alone)[alone.labels == 0])
        darker = grey(below) < 0.85 * exposure * grey(alone)
        shaded.append((np.mean(darker[alone.rods == 0]), np.mean(darker[alone.labels == 1])))
    assert shaded[0] == (0.0, 0.0)
    assert 0.03 < shaded[1][0] < 0.5 and 0.001 < shaded[1][1] < 0.5


def test_glare_veils_wood_and_clips_around_the_sun_before_the_camera_alone() -> None:
    seed = with_sun(ahead=True)
    row = Row(tuple(post(x) for x in (-0.8, 0.8)))
    clear, veiled = SUNNY, replace(SUNNY, glare=STORM.glare)

    def contrast(world: WorldConfig) -> float:
        image = seen(row, world, seed)
        wood, ground = (np.median(grey(image)[image.labels == label]) for label in (2, 1))
        return float(abs(ground - wood) / (ground + wood))

    def clipped(world: WorldConfig) -> float:
        return float(np.mean(seen(row, world, seed).color.min(axis=2) == 255))

    assert contrast(veiled) < 0.7 * contrast(clear)
    assert clipped(clear) < 0.002 and clipped(veiled) > 0.03
    away = looking_left()
    away[:3, :2] *= [[-1.0, 1.0]] * 3
    away[:3, 2] *= -1.0
    assert np.array_equal(seen(row, veiled, seed, away).color, seen(row, clear, seed, away).color)


def test_wood_before_the_sun_takes_the_glare_away() -> None:
    seed = with_sun(ahead=True)
    at = EYE[:3, 3] + 0.4 * sun(seed)
    hiding = Row((Rod("trunk", at - [0.0, 0.0, 0.3], at + [0.0, 0.0, 0.3], 0.03, 0.03),))
    lit, veiled = seen(hiding, SUNNY, seed), seen(hiding, replace(SUNNY, glare=STORM.glare), seed)
    assert np.array_equal(lit.color, veiled.color)


def test_wet_bark_is_darker_and_shines_and_wires_only_shine() -> None:
    row = Row((post(-0.3, kind="trunk"), post(0.3, kind="wire")))
    wet = only(("wet",), "storm")
    for seed in range(4):
        dry, damp = seen(row, CALM, seed), seen(row, wet, seed)
        bark, wire = dry.rods == 0, dry.rods == 1
        ratio = grey(damp) / np.maximum(grey(dry), 1.0)
        assert np.median(ratio[bark]) < 0.9 and ratio[bark].max() > 1.02
        assert ratio[wire].min() > 0.98 and ratio[wire].max() > 1.02
        assert np.array_equal(damp.color[dry.labels == 0], dry.color[dry.labels == 0])
    patches = grey(seen(row, only(("wet",), "field"), 1)) < 0.95 * grey(seen(row, CALM, 1))
    assert 0.1 < patches[seen(row, CALM, 1).rods == 0].mean() < 0.4, "in a light shower a part of it is wet"


@pytest.mark.parametrize(
    ("velocity", "width"),
    [
        ([0.5, 0, 0, 0, 0, 0], 0.5 * STORM.exposure * FOCAL / 1.95),
        ([0, 0, 0, 0, 0, 0.5], 0.5 * STORM.exposure * FOCAL),
        ([0, 0, 0.5, 0, 0, 0], 0.0),
        ([0.0] * 6, 0.0),
    ],
)
def test_edges_are_blurred_by_the_path_of_the_camera_in_the_exposure(velocity: list[float], width: float) -> None:
    """Upright edges at 1.95 m: by motion and turning across, not by motion along them."""
    row = Row((post(0.0, 2.0),))
    still = seen(row, CALM, 1)
    moved = seen(row, replace(CALM, exposure=4 * STORM.exposure), 1, EYE, np.array(velocity))
    # The sky beside the post takes on its colour, over half of the path on either side.
    beside = still.labels[10:40] == 0
    assert np.sum(np.abs(grey(moved) - grey(still))[10:40][beside] > 3.0) / 30 == pytest.approx(4 * width, abs=1.2)


def test_light_changes_the_colours_alone_and_comes_from_the_seed() -> None:
    row = grow(VineyardConfig(vines=1), 3)
    light = only(("sunlight", "glare", "wet", "exposure"), "storm")
    speed = np.array([0.25, 0, 0, 0, 0, 0])
    calm, lit = seen(row, CALM, 3, looking_left(0.5), speed), seen(row, light, 3, looking_left(0.5), speed)
    for name in ("depth", "labels", "rods"):
        assert np.array_equal(getattr(calm, name), getattr(lit, name)), name
    assert np.mean(calm.color != lit.color) > 0.9
    assert np.array_equal(seen(row, light, 3, looking_left(0.5), speed).color, lit.color)
    assert np.array_equal(seen(row, CALM, 3, looking_left(0.5)).color, calm.color)
