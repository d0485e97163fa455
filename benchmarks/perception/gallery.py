"""Pictures of wrong points: what the camera saw there, what the classes were taken for, where the right cut is."""

from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw

from benchmarks.perception.judge import JudgedPoint
from bridge.sim.camera.renderer import Camera
from bridge.sim.vineyard.row import Array, Row
from bridge.sim.vineyard.truth import judge
from perception.perceive import COLORS
from rolling_panda import messages as m

#: Side of what is shown of the image, and how much larger it is drawn (px).
_SIDE, _SCALE = 140, 3


def save_failure(
    folder: Path,
    judged: JudgedPoint,
    point: m.PruningPoint,
    row: Row,
    camera: Camera,
    T_world_camera: Array,
    classes: NDArray[np.uint8],
    color: NDArray[np.uint8],
) -> Path:
    """Write one picture: colours left, classes right; the point is crossed, the right cut ringed.

    Args:
        folder: Where.
        judged: The judge's opinion.
        point: The point.
        row: The true row.
        camera: Whose image it is.
        T_world_camera: Where it stood (4×4).
        classes: What the segmenter said (H×W).
        color: The image (H×W×3).
    """
    truth = next(t for t in judge(row) if (t.vine, t.spur) == (judged.vine, judged.spur))
    cut = truth.renewal if judged.kind == "renewal cut" else truth.cut
    u, v = _pixel(camera, T_world_camera, np.array(point.position))
    left, top = round(u) - _SIDE // 2, round(v) - _SIDE // 2
    tiles = []
    for picture in (Image.fromarray(color), Image.fromarray(np.array(COLORS, np.uint8)[classes])):
        tile = picture.crop((left, top, left + _SIDE, top + _SIDE)).resize(
            (_SIDE * _SCALE,) * 2, Image.Resampling.NEAREST
        )
        draw = ImageDraw.Draw(tile)
        x, y = (u - left + 0.5) * _SCALE, (v - top + 0.5) * _SCALE
        draw.line((x - 9, y - 9, x + 9, y + 9), fill=(255, 255, 255), width=2)
        draw.line((x - 9, y + 9, x + 9, y - 9), fill=(255, 255, 255), width=2)
        if cut is not None:
            a, b = _pixel(camera, T_world_camera, cut.best)
            x, y = (a - left + 0.5) * _SCALE, (b - top + 0.5) * _SCALE
            draw.ellipse((x - 10, y - 10, x + 10, y + 10), outline=(255, 255, 255), width=2)
        tiles.append(np.asarray(tile))
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / f"{judged.seed}_{judged.point_id}.png"
    Image.fromarray(np.concatenate(tiles, axis=1)).save(path)
    return path


def _pixel(camera: Camera, T_world_camera: Array, point: Array) -> tuple[float, float]:
    k = camera.intrinsics
    x, y, z = (point - T_world_camera[:3, 3]) @ T_world_camera[:3, :3]
    return k.cx + k.fx * x / z, k.cy + k.fy * y / z
