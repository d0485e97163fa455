"""Training pictures: rendered rows with more variety than any one vineyard, and their true classes.

Half of the rows stand in the weather, with lateral organs and drooping canes, from calm up to the preset `storm`.
"""

import io
from collections.abc import Sequence
from dataclasses import dataclass

import msgspec
import numpy as np
from numpy.typing import NDArray
from PIL import Image
from scipy.spatial.transform import Rotation

from bridge.sim.camera.config import CameraConfig
from bridge.sim.camera.renderer import Camera
from bridge.sim.vineyard.config import VineyardConfig
from bridge.sim.vineyard.grow import grow
from bridge.sim.world.config import CALM, PRESETS, WorldConfig
from bridge.sim.world.growth import overgrown

#: Seeds of training rows begin here, those of validation rows at the second number: far from any that people use.
TRAINING_SEED, VALIDATION_SEED = 7_000_000, 8_000_000
#: Pictures of each row: a close-up, one as of the last way to a cut, two as of a survey.
VIEWS = 4
#: Of them, those from near, and those as of a survey.
NEAR_VIEWS, SURVEY_VIEWS = (0, 1), (2, 3)
#: Of each of them: distance from the plane of the vines (m), SD of the turn about the camera's x, y and z axes (rad).
_VIEWS = (
    ((0.3, 0.6), np.radians([8.0, 12.0, 20.0])),
    ((0.12, 0.4), np.radians([15.0, 20.0, 40.0])),
    ((0.55, 1.1), np.radians([5.0, 6.0, 3.0])),
    ((0.55, 1.1), np.radians([8.0, 15.0, 10.0])),
)
#: What disturbs the pictures, each by itself: from nothing to as much as in `storm`.
_LIGHT, _DEPTH, _GROWTH = (
    ("sunlight", "glare", "wet", "exposure"),
    ("depth_lost",),
    ("laterals", "tendrils", "leaves", "drooping"),
)
#: SD of the camera's speed on each axis (m/s, rad/s), which blurs its pictures.
_SPEED = np.array([0.1, 0.1, 0.1, 0.15, 0.15, 0.15])
_LOOKING_LEFT = np.column_stack([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]])


@dataclass(frozen=True)
class Scenes:
    """Pictures of one size.

    Attributes:
        color: N×H×W×3, RGB.
        depth: N×H×W (m), 0 = invalid.
        labels: N×H×W, indices in `WOOD_CLASSES`.
    """

    color: NDArray[np.uint8]
    depth: NDArray[np.float16]
    labels: NDArray[np.uint8]

    def of_views(self, views: Sequence[int]) -> "Scenes":
        """The pictures of some of the views of each row."""
        chosen = np.isin(np.arange(len(self.color)) % VIEWS, views)
        return Scenes(self.color[chosen], self.depth[chosen], self.labels[chosen])


def render_scenes(first_seed: int, rows: int) -> Scenes:
    """Pictures of `rows` rows, `VIEWS` each.

    Args:
        first_seed: Of the first row; the others follow it.
        rows: At least 1.
    """
    images = [image for seed in range(first_seed, first_seed + rows) for image in _row(seed)]
    return Scenes(
        np.stack([image[0] for image in images]),
        np.stack([image[1] for image in images]),
        np.stack([image[2] for image in images]),
    )


def _row(seed: int) -> list[tuple[NDArray[np.uint8], NDArray[np.float16], NDArray[np.uint8]]]:
    rng = np.random.default_rng([seed, 21])
    config = _vineyard(rng)
    world = _weather(rng)
    row = overgrown(grow(config, seed), world, seed)
    camera = Camera(_camera(rng), seed, world)
    out = []
    for view, (distance, turn) in enumerate(_VIEWS):
        place = np.eye(4)
        place[:3, :3] = _LOOKING_LEFT @ Rotation.from_rotvec(rng.normal(0.0, turn)).as_matrix()
        across = (config.vines - 1) * config.vine_spacing
        place[:3, 3] = [
            config.first_vine_x + rng.uniform(-0.8, across + 0.8),
            config.row_distance - rng.uniform(*distance),
            config.fruiting_wire + rng.normal(0.1, 0.12),
        ]
        image = camera.render(row, place, view, rng.normal(0.0, _SPEED))
        out.append((_sent(image.color, rng), image.depth.astype(np.float16), image.labels))
    return out


def _sent(color: NDArray[np.uint8], rng: np.random.Generator) -> NDArray[np.uint8]:
    """A picture mostly comes over a wire, and a JPEG blurs the colours of thin things."""
    if rng.random() < 0.2:
        return color
    data = io.BytesIO()
    Image.fromarray(color).save(data, "JPEG", quality=int(rng.integers(70, 96)))
    return np.asarray(Image.open(data), dtype=np.uint8)


def _weather(rng: np.random.Generator) -> WorldConfig:
    if rng.random() < 0.5:
        return CALM
    storm = PRESETS["storm"]
    # Light, lost depth and growth are each absent from a quarter of these rows.
    shares = {knob: float(rng.uniform()) for knobs in (_LIGHT, _DEPTH, _GROWTH) for knob in knobs}
    for knobs in (_LIGHT, _DEPTH, _GROWTH):
        if rng.random() < 0.25:
            shares |= dict.fromkeys(knobs, 0.0)
    return msgspec.structs.replace(CALM, **{knob: share * getattr(storm, knob) for knob, share in shares.items()})


def _vineyard(rng: np.random.Generator) -> VineyardConfig:
    stub = float(rng.uniform(0.02, 0.05))
    guyot = rng.random() < 0.2
    spacing, wire = float(rng.uniform(1.2, 2.2)), float(rng.uniform(0.8, 1.1))
    return VineyardConfig(
        training="guyot" if guyot else "cordon",
        vines=2,
        vine_spacing=spacing,
        cordon_height=wire,
        guyot_wire=wire,
        cordon_radius=(float(rng.uniform(0.010, 0.014)), float(rng.uniform(0.016, 0.024))),
        stub_length=(stub, stub + 0.05),
        stub_radius=(0.0055, 0.010),
        cane_radius_mean=float(rng.uniform(0.0032, 0.0048)),
        cane_tilt=float(rng.uniform(0.08, 0.2)),
        cane_droop=(0.0, 0.3),
        node_swelling=(1.25, 1.55),
        wire_radius=float(rng.uniform(0.001, 0.002)),
        hose_height=float(rng.choice([0.0, 0.5, 0.6, 0.7])),
        ties_a_vine=(0, 6),
        old_cuts_a_vine=(3, 14),
        rows_behind=int(rng.integers(0, 3)),
        row_spacing=float(rng.uniform(2.0, 3.0)),
        post_radius=float(rng.uniform(0.025, 0.05)),
    )


def _camera(rng: np.random.Generator) -> CameraConfig:
    return msgspec.structs.replace(
        CameraConfig(),
        disparity_noise=float(rng.uniform(0.04, 0.2)),
        edge_bleed=float(rng.uniform(0.0, 0.6)),
        thin_width=float(rng.uniform(0.0, 6.0)),
        color_noise=float(rng.uniform(0.0, 8.0)),
        color_blur=float(rng.uniform(0.0, 1.0)),
        appearance=1.6,
    )
