"""`rolling-panda perceive IMAGE`: classes and pruning points of one photograph.

Writes classes.png (indices as in `WOOD_CLASSES`, with a palette), overlay.png and points.json. With a depth image the
points have positions in the camera's frame; without one they are pixels, scaled by the thickness of a common cane.
"""

import argparse
import json
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any, Literal

import numpy as np
from msgspec.structs import replace
from PIL import Image, ImageDraw

from perception.arrays import Labels
from perception.config import PerceptionConfig, RuleConfig
from perception.pipeline import with_width_bias
from perception.segmentation.network_segmenter import PhotographSegmenter
from perception.segmentation.segmenter import PHOTOGRAPHS, SHIPPED
from perception.single_image import (
    R_LEVEL,
    ImageCut,
    ImageResult,
    Photograph,
    Undecided,
    find_cuts,
    load_photograph,
    segment_photograph,
)
from rolling_panda.errors import InputError, RollingPandaError
from rolling_panda.messages.types import WOOD_CLASSES
from rolling_panda.reasons import text_of
from rolling_panda.resources import resource

#: Colour of each class in the palette of classes.png and overlay.png.
COLORS = (
    (30, 30, 34),
    (110, 120, 70),
    (170, 140, 110),
    (120, 70, 40),
    (160, 60, 160),
    (240, 140, 30),
    (80, 200, 90),
    (240, 220, 60),
    (90, 190, 240),
    (40, 80, 160),
    (230, 60, 60),
)
#: Opacity of the classes in the overlay, and half the length of a cut's mark (px).
_OPACITY, _MARK = 0.45, 12


def main(argv: Sequence[str] | None = None) -> int:
    """Run the command; returns the exit code."""
    parser = argparse.ArgumentParser(prog="rolling-panda perceive", description=__doc__)
    parser.add_argument("image", type=Path, metavar="IMAGE", help="photograph of a vine in winter")
    parser.add_argument("--out", type=Path, required=True, metavar="DIR", help="folder for the three files")
    parser.add_argument("--depth", type=Path, metavar="FILE", help="16-bit PNG or .npy, as large as the image")
    parser.add_argument("--depth-unit", type=float, default=0.001, metavar="M", help="metres a count (default: 0.001)")
    parser.add_argument("--intrinsics", type=Path, metavar="FILE", help="JSON: width, height, fx, fy, cx, cy")
    parser.add_argument(
        "--weights",
        type=Path,
        metavar="FILE",
        help="network (default: the shipped one that the picture is familiar to)",
    )
    parser.add_argument("--system", choices=("spur", "guyot"), default="spur", help="how the vine is trained")
    parser.add_argument("--nodes-kept", type=int, default=2, help="count nodes that stay on a spur (default: 2)")
    parser.add_argument("--offset", type=float, default=0.020, help="cut so far past the last one (m, default: 0.02)")
    arguments = parser.parse_args(argv)
    try:
        rule = _rule(arguments.system, arguments.nodes_kept, arguments.offset)
        if not arguments.depth_unit > 0.0:
            raise InputError(f"--depth-unit {arguments.depth_unit}: give the metres a count, more than 0")
        whole = load_photograph(arguments.image, arguments.depth, arguments.intrinsics, arguments.depth_unit)
        paths = [arguments.weights] if arguments.weights else [resource(SHIPPED), resource(PHOTOGRAPHS)]
        networks = PhotographSegmenter(*paths)
        photograph, (labels, _) = segment_photograph(whole, networks)
        segmenter = networks.used
        config = with_width_bias(replace(PerceptionConfig(), rule=rule), segmenter.width_bias)
        result = find_cuts(photograph, labels, config)
        if segmenter.unfamiliar is not None:
            result = ImageResult((), (Undecided(segmenter.unfamiliar),), result.spurs, result.canes, result.scale)
        arguments.out.mkdir(parents=True, exist_ok=True)
        _write(arguments.out, arguments.image, photograph, labels, result, segmenter.name)
        scale = photograph.size[0] / labels.shape[1]
    except (RollingPandaError, OSError) as error:
        print(f"rolling-panda perceive: {error}", file=sys.stderr)
        return 1
    print(f"{len(result.cuts)} points on {result.spurs} spurs; scale: {result.scale}")
    for each in result.undecided:
        pixel = _full(each.pixel, scale)
        print(f"undecided{f' at {pixel[0]:.0f}, {pixel[1]:.0f}' if pixel else ''}: {text_of(each.reason)}")
    return 0


def _rule(system: Literal["spur", "guyot"], nodes_kept: int, offset: float) -> RuleConfig:
    if not 1 <= nodes_kept <= 5:
        raise InputError(f"--nodes-kept {nodes_kept}: 1 to 5 count nodes can stay")
    if not 0.005 <= offset <= 0.05:
        raise InputError(f"--offset {offset}: give 0.005 to 0.05 m")
    return replace(RuleConfig(), system=system, nodes_kept=nodes_kept, offset=offset)


def _write(out: Path, image: Path, photograph: Photograph, labels: Labels, result: ImageResult, segmenter: str) -> None:
    mask = Image.fromarray(labels, mode="P")
    mask.putpalette([value for color in COLORS for value in color])
    scale = photograph.size[0] / labels.shape[1]
    mask.resize(photograph.size, Image.Resampling.NEAREST).save(out / "classes.png")
    tint = np.array(COLORS, np.float32)[labels]
    shown = np.where(labels[..., None] > 1, (1 - _OPACITY) * photograph.color + _OPACITY * tint, photograph.color)
    overlay = Image.fromarray(shown.astype(np.uint8)).resize(photograph.size, Image.Resampling.BILINEAR)
    draw = ImageDraw.Draw(overlay)
    for number, cut in enumerate(result.cuts, 1):
        _mark(draw, cut, number, scale)
    for each in result.undecided:
        if each.pixel is not None:
            u, v = (np.array(each.pixel) + 0.5) * scale
            draw.ellipse((u - _MARK, v - _MARK, u + _MARK, v + _MARK), outline=(255, 255, 255), width=2)
    overlay.save(out / "overlay.png")
    document = {
        "image": image.name,
        "size": list(photograph.size),
        "segmenter": segmenter,
        "classes": list(WOOD_CLASSES),
        "scale": result.scale,
        "intrinsics": "assumed" if photograph.assumed else "given",
        "spurs": result.spurs,
        "canes": result.canes,
        "points": [_point(cut, photograph, scale) for cut in result.cuts],
        "undecided": [{"reason": text_of(each.reason), "pixel": _full(each.pixel, scale)} for each in result.undecided],
    }
    (out / "points.json").write_text(json.dumps(document, indent=1) + "\n", encoding="utf-8")


def _mark(draw: ImageDraw.ImageDraw, point: ImageCut, number: int, scale: float) -> None:
    (u, v), (x, y) = ((np.array(p) + 0.5) * scale for p in (point.pixel, point.beyond))
    length = max(float(np.hypot(x - u, y - v)), 1e-6)
    # Square to the wood.
    half = _MARK * max(scale, 1.0) / length
    du, dv = -(y - v) * half, (x - u) * half
    draw.line((u - du, v - dv, u + du, v + dv), fill=(230, 30, 30), width=max(2, round(2 * scale)))
    draw.text((u + abs(du) + 3, v - 6), str(number), fill=(230, 30, 30))


def _full(pixel: tuple[float, float] | None, scale: float) -> list[float] | None:
    """A pixel of the scaled image in the photograph itself."""
    return None if pixel is None else [round((value + 0.5) * scale - 0.5, 1) for value in pixel]


def _point(point: ImageCut, photograph: Photograph, scale: float) -> dict[str, Any]:
    cut = point.cut
    metric = photograph.depth is not None
    along = np.array(point.beyond) - np.array(point.pixel)
    return {
        "kind": cut.kind,
        "spur": point.spur,
        "pixel": _full(point.pixel, scale),
        "direction": [round(float(value), 4) for value in along / max(float(np.linalg.norm(along)), 1e-9)],
        "position": [round(float(value), 5) for value in cut.position @ R_LEVEL] if metric else None,
        "tangent": [round(float(value), 5) for value in cut.tangent @ R_LEVEL] if metric else None,
        "radius": round(cut.radius, 5) if metric else None,
        "confidence": round(cut.confidence, 3),
        "nodes_seen": cut.nodes_seen,
        "nodes_kept": cut.nodes_kept,
        "reason": text_of(cut.reason),
    }


if __name__ == "__main__":
    sys.exit(main())
