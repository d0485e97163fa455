"""Numbers of the simulated eye-in-hand camera, after the RealSense D435i."""

import math
from typing import Annotated

from msgspec import Meta, Struct

from rolling_panda.config import Positive
from rolling_panda.messages import Intrinsics

Pixels = Annotated[int, Meta(ge=16, le=4096)]


class CameraConfig(Struct, frozen=True, forbid_unknown_fields=True):
    """Image size, lens and depth error.

    Attributes:
        width: Image width (px).
        height: Image height (px).
        horizontal_fov_deg: Full horizontal field of view (degrees).
        min_range: Nothing nearer has a depth (m).
        max_range: Nothing farther has a depth (m).
        depth_unit: Depth is a multiple of this (m).
        baseline: Between the two infrared imagers (m).
        disparity_noise: Standard deviation of the matched disparity (px); 0 switches the noise off.
    """

    width: Pixels = 848
    height: Pixels = 480
    horizontal_fov_deg: Annotated[float, Meta(ge=10.0, le=150.0)] = 87.0
    min_range: Positive = 0.18
    max_range: Positive = 4.0
    depth_unit: Annotated[float, Meta(ge=0.0001, le=0.01)] = 0.001
    baseline: Positive = 0.05
    disparity_noise: Annotated[float, Meta(ge=0.0, le=10.0)] = 0.08

    def intrinsics(self) -> Intrinsics:
        """Square pixels, principal point in the middle; pixel centres have whole coordinates."""
        focal = self.width / 2 / math.tan(math.radians(self.horizontal_fov_deg) / 2)
        return Intrinsics(self.width, self.height, focal, focal, (self.width - 1) / 2, (self.height - 1) / 2)
