"""Training pictures: rendered rows with more variety than any one vineyard, and their true classes."""

import io
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

#: Seeds of training rows begin here, those of validation rows at the second number: far from any that people use.
TRAINING_SEED, VALIDATION_SEED = 7_000_000, 8_000_000
#: Pictures of each row.
VIEWS = 3
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
    row = grow(config, seed)
    camera = Camera(_camera(rng), seed)
    out = []
    for view in range(VIEWS):
        # Survey views from an arm's length, and close-ups; cameras are not exactly level.
        away = rng.uniform(0.55, 1.1) if view else rng.uniform(0.3, 0.6)
        place = np.eye(4)
        tilt = rng.normal(0.0, np.radians([5.0, 6.0, 3.0]))
        place[:3, :3] = _LOOKING_LEFT @ Rotation.from_rotvec(tilt).as_matrix()
        across = (config.vines - 1) * config.vine_spacing
        place[:3, 3] = [
            config.first_vine_x + rng.uniform(-0.8, across + 0.8),
            config.row_distance - away,
            config.cordon_height + rng.normal(0.1, 0.12),
        ]
        image = camera.render(row, place, view)
        out.append((_sent(image.color, rng), image.depth.astype(np.float16), image.labels))
    return out


def _sent(color: NDArray[np.uint8], rng: np.random.Generator) -> NDArray[np.uint8]:
    """A picture mostly comes over a wire, and a JPEG blurs the colours of thin things."""
    if rng.random() < 0.2:
        return color
    data = io.BytesIO()
    Image.fromarray(color).save(data, "JPEG", quality=int(rng.integers(70, 96)))
    return np.asarray(Image.open(data), dtype=np.uint8)


def _vineyard(rng: np.random.Generator) -> VineyardConfig:
    stub = float(rng.uniform(0.02, 0.05))
    return VineyardConfig(
        training="guyot" if rng.random() < 0.2 else "cordon",
        vines=2,
        vine_spacing=float(rng.uniform(1.2, 2.2)),
        cordon_height=float(rng.uniform(0.8, 1.1)),
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
