"""Pruning points of a single picture: the plant model and the rule without a robot, with depth or in pixels only."""

from dataclasses import dataclass

import msgspec
import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import distance_transform_edt
from skimage.morphology import skeletonize

from perception.config import PerceptionConfig
from perception.pipeline import perceive
from perception.rules.keep_out import in_view
from perception.rules.registry import apply_rule
from perception.rules.spur import Cut
from perception.segmentation.photograph import Photograph
from perception.skeleton.fragments import CANE, NODE

#: A common cane (m): the scale of a picture without depth.
_COMMON_DIAMETER = 0.008
#: Canes thinner than this are too thin to follow (px).
_THINNEST = 2.0
_LEAST_PIXELS = 40
#: A common cane is between 5 and 13 mm thick, so that without depth every length is known to this factor only.
_SCALE_DOUBT = 1.6


@dataclass(frozen=True)
class StillPoint:
    """A cut in a picture; pixels are those of the picture as it was worked on.

    Attributes:
        cut: As the rule says; its place is that of a level camera at the origin (x right, y forward, z up).
        pixel: Column and row.
        beyond: A little farther along the wood, column and row.
        spur: Number along the cordon, from 1.
    """

    cut: Cut
    pixel: tuple[float, float]
    beyond: tuple[float, float]
    spur: int


@dataclass(frozen=True)
class Still:
    """What one picture gives.

    Attributes:
        points: Cuts.
        abstained: What it was not sure of, with the reasons.
        spurs: Spurs seen.
        canes: Canes that could be followed to one.
        scale: Where lengths come from, in words.
    """

    points: tuple[StillPoint, ...]
    abstained: tuple[str, ...]
    spurs: int
    canes: int
    scale: str


def read_still(photograph: Photograph, labels: NDArray[np.uint8], config: PerceptionConfig) -> Still:
    """Find the cuts.

    Args:
        photograph: The picture.
        labels: Its classes.
        config: Section `[perception]`.
    """
    if photograph.depth is None:
        assumed = _assumed_depth(photograph, labels)
        if isinstance(assumed, str):
            return Still((), (assumed,), 0, 0, "none")
        depth = np.full(labels.shape, assumed, np.float32)
        config = _of_unknown_scale(config)
        scale = f"no depth: the median cane is taken to be {1000 * _COMMON_DIAMETER:.0f} mm thick"
    else:
        depth, scale = photograph.depth, "depth image"
        wood = (labels == CANE) | (labels == NODE)
        if np.count_nonzero(wood & (depth > 0.0)) < _LEAST_PIXELS:
            return Still((), ("no cane with depth was recognised: look again from 0.6 to 1 m",), 0, 0, scale)
    view = photograph.view(depth)
    plant = perceive(view, labels, config)
    points, abstained = [], []
    keep_out = in_view(view, labels, (), config.rule)
    for number, spur in enumerate(plant.spurs, 1):
        decision = apply_rule(spur, config.rule, plant.beside(spur), keep_out)
        abstained += [f"spur {number}: {reason}" for reason in decision.abstained]
        for cut in decision.cuts:
            u, v, _ = view.pixels(cut.position)[0]
            x, y, _ = view.pixels(cut.position + 0.02 * cut.tangent)[0]
            points.append(StillPoint(cut, (float(u), float(v)), (float(x), float(y)), number))
    if not plant.spurs:
        abstained.append("no spur was recognised: the cordon with its spurs must be in the picture")
    return Still(tuple(points), tuple(abstained), len(plant.spurs), sum(len(s.canes) for s in plant.spurs), scale)


def _of_unknown_scale(config: PerceptionConfig) -> PerceptionConfig:
    """What tells a wrong count by the distance of nodes must not take the scale for the vine."""
    rule = msgspec.structs.replace(
        config.rule,
        crowded=config.rule.crowded / _SCALE_DOUBT,
        shortest_internode=config.rule.shortest_internode / _SCALE_DOUBT,
        longest_internode=config.rule.longest_internode * _SCALE_DOUBT,
    )
    return msgspec.structs.replace(config, rule=rule)


def _assumed_depth(photograph: Photograph, labels: NDArray[np.uint8]) -> float | str:
    """Distance at which the canes seen would be commonly thick (m), or why there is none."""
    wood = (labels == CANE) | (labels == NODE)
    if np.count_nonzero(wood) < _LEAST_PIXELS:
        return "no cane was recognised in this picture"
    width = 2.0 * float(np.median(distance_transform_edt(wood)[skeletonize(wood)])) - 1.0
    if width < _THINNEST:
        return f"canes are {width:.1f} pixels wide; go nearer or give a larger picture, so that they have {_THINNEST:g}"
    return photograph.intrinsics.fx * _COMMON_DIAMETER / width
