"""Configuration of the simulated eye-in-hand camera, after the RealSense D435i."""

import math
from typing import Annotated

from msgspec import Meta, Struct
from msgspec.structs import replace

from rolling_panda.config import Positive
from rolling_panda.messages.robot import Intrinsics

Share = Annotated[float, Meta(ge=0.0, le=1.0)]
Pixels = Annotated[int, Meta(ge=16, le=4096)]


class CameraConfig(Struct, frozen=True, forbid_unknown_fields=True):
    """Image size, lens and errors of the sensors.

    Attributes:
        width: Image width (px).
        height: Image height (px).
        horizontal_fov_deg: Full horizontal field of view (degrees).
        min_range: Smallest valid depth (m).
        max_range: Largest valid depth (m).
        depth_unit: Depth is a multiple of this (m).
        baseline: Between the two infrared imagers (m).
        disparity_noise: Standard deviation of the matched disparity (px); 0 switches the noise off.
        edge_bleed: Fraction of the pixels along depth steps that get the foreground depth, a mixture, or none.
        thin_width: Objects narrower than this lose depth in patches, in proportion (px).
        calibration_angle: Standard deviation of the hand-eye calibration error (rad).
        color_noise: Standard deviation of the colour sensor's noise (of 255).
        color_blur: Standard deviation of its blur (px).
        board: Whether the calibration's board stands before the camera where the robot starts.
        appearance: Variation of bark, light and exposure between seeds: 0 for none, 1 for one winter.
    """

    width: Pixels = 848
    height: Pixels = 480
    horizontal_fov_deg: Annotated[float, Meta(ge=10.0, le=150.0)] = 87.0
    min_range: Positive = 0.18
    max_range: Positive = 4.0
    depth_unit: Annotated[float, Meta(ge=0.0001, le=0.01)] = 0.001
    baseline: Positive = 0.05
    disparity_noise: Annotated[float, Meta(ge=0.0, le=10.0)] = 0.08
    edge_bleed: Share = 0.3
    thin_width: Annotated[float, Meta(ge=0.0, le=100.0)] = 3.0
    calibration_angle: Annotated[float, Meta(ge=0.0, le=0.1)] = 0.001
    color_noise: Annotated[float, Meta(ge=0.0, le=100.0)] = 3.0
    color_blur: Annotated[float, Meta(ge=0.0, le=10.0)] = 0.5
    board: bool = False
    appearance: Annotated[float, Meta(ge=0.0, le=3.0)] = 1.0

    def ideal(self) -> "CameraConfig":
        """The same lens without errors, for benchmarks."""
        return replace(
            self,
            disparity_noise=0.0,
            edge_bleed=0.0,
            thin_width=0.0,
            calibration_angle=0.0,
            color_noise=0.0,
            color_blur=0.0,
        )

    def intrinsics(self) -> Intrinsics:
        """Square pixels, principal point in the middle; pixel centres have whole coordinates."""
        focal = self.width / 2 / math.tan(math.radians(self.horizontal_fov_deg) / 2)
        return Intrinsics(self.width, self.height, focal, focal, (self.width - 1) / 2, (self.height - 1) / 2)
