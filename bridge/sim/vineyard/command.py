"""`rolling-panda vineyard`: grow a row from a seed, write it with its truth as one file, and picture it."""

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path

import msgspec
import numpy as np
from PIL import Image, ImageDraw

from bridge.sim.camera.config import CameraConfig
from bridge.sim.camera.renderer import Camera
from bridge.sim.vineyard.config import PRESETS, load_vineyard
from bridge.sim.vineyard.file import Vineyard, cut_positions, save
from bridge.sim.vineyard.grow import grow
from bridge.sim.vineyard.row import Array
from bridge.sim.world.config import CALM
from bridge.sim.world.growth import overgrown
from rolling_panda.errors import RollingPandaError

#: Width of the picture at the row, and distance of the camera (m); radius of a ring (px).
_ACROSS, _AWAY = 2.4, 1.4
_MARK = 5


def picture(vineyard: Vineyard, vine: int = 0) -> Image.Image:
    """A vine from the front with its lateral shoots, and a red ring at every right cut.

    Args:
        vineyard: The row.
        vine: In the middle of the picture.
    """
    config = vineyard.config
    camera = Camera(CameraConfig(width=1280, height=960, horizontal_fov_deg=_angle()), vineyard.seed)
    place = np.eye(4)
    place[:3, :3] = np.column_stack([[1, 0, 0], [0, 0, -1], [0, 1, 0]])
    place[:3, 3] = [config.first_vine_x + vine * config.vine_spacing, config.row_distance - _AWAY, 1.1]
    row = overgrown(vineyard.row, CALM, vineyard.seed, config.laterals)
    image = Image.fromarray(camera.render(row, place).color)
    draw = ImageDraw.Draw(image)
    for u, v in _pixels(camera, place, cut_positions(vineyard)):
        draw.ellipse((u - _MARK, v - _MARK, u + _MARK, v + _MARK), outline=(230, 30, 30), width=2)
    return image


def _angle() -> float:
    return float(np.degrees(2 * np.arctan2(_ACROSS / 2, _AWAY)))


def _pixels(camera: Camera, place: Array, points: Array) -> list[tuple[float, float]]:
    k = camera.intrinsics
    x, y, z = ((points - place[:3, 3]) @ place[:3, :3]).T
    return [(float(u), float(v)) for u, v in zip(k.cx + k.fx * x / z, k.cy + k.fy * y / z, strict=True)]


def main(argv: Sequence[str] | None = None) -> int:
    """Run the command; returns the exit code."""
    parser = argparse.ArgumentParser(prog="rolling-panda vineyard", description=__doc__)
    parser.add_argument("--seed", type=int, default=0, help="not negative; the same seed gives the same row")
    parser.add_argument("--out", type=Path, required=True, metavar="FILE", help="JSON file; a PNG is written beside it")
    parser.add_argument("--vines", type=int, help="how many (default: as configured)")
    parser.add_argument("--training", choices=("cordon", "guyot"), help="training system")
    parser.add_argument("--preset", choices=tuple(PRESETS), help="how the vines grow (default: as configured)")
    parser.add_argument("--config", type=Path, metavar="FILE", help="TOML file with a section [vineyard]")
    arguments = parser.parse_args(argv)
    try:
        if arguments.seed < 0:
            parser.error(f"--seed {arguments.seed} is negative; give 0 or more")
        if arguments.preset is not None and arguments.config is not None:
            parser.error("--preset and --config: give one; the file's [vineyard] preset does the same")
        name = arguments.preset or "standard"
        config = PRESETS[name] if arguments.config is None else load_vineyard(arguments.config)
        if arguments.training is not None:
            config = msgspec.structs.replace(config, training=arguments.training)
        if arguments.vines is not None:
            if not 1 <= arguments.vines <= 100:
                parser.error(f"--vines {arguments.vines}: give 1 to 100")
            config = msgspec.structs.replace(config, vines=arguments.vines)
        vineyard = Vineyard(arguments.seed, config, grow(config, arguments.seed))
        save(arguments.out, vineyard)
        picture(vineyard).save(arguments.out.with_suffix(".png"))
    except RollingPandaError as error:
        print(f"rolling-panda vineyard: {error}", file=sys.stderr)
        return 1
    print(
        f"{config.vines} vines ({config.training}), {len(vineyard.row.rods)} rods, {len(cut_positions(vineyard))} cuts"
    )
    print(f"{arguments.out}\n{arguments.out.with_suffix('.png')}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
