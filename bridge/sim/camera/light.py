"""Light of a winter's day before the camera: a low sun with hard shadows, wet surfaces, glare and motion blur.

Brightness is linear here: 1 is a white surface in the usual light of a scene. Colours are its square root times 255: a
gamma of 2, which is near to that of sRGB. The sun is a point for shadows and a disc for the lens.
"""

import math
from dataclasses import replace

import cv2
import numpy as np
from numpy.typing import NDArray

from bridge.sim.camera.mesh import Floats, RodMesh
from bridge.sim.camera.palette import Appearance, Palette
from bridge.sim.world.config import WorldConfig

#: Elevation of the sun from mid-morning to mid-afternoon in January, at latitudes of 40° to 48° (rad).
_ELEVATION = (math.radians(8.0), math.radians(25.0))
#: Colours of the low sun and of the sky's light, after white balance: estimates.
_SUN_COLOR, _SKY_COLOR = np.array([1.10, 0.98, 0.80], np.float32), np.array([0.90, 1.00, 1.14], np.float32)
#: Radius of the sun's disc (rad) and its brightness, which always clips.
_DISC, _DAZZLING = math.radians(0.27), np.float32(1e3)
#: A clear sky is brighter at the horizon than at the zenith, by these factors of its mean: estimates.
_HORIZON, _ZENITH = 1.8, 0.8
#: The sky around the sun is so many times brighter than elsewhere, within this angle (rad): estimates.
_AUREOLE, _AUREOLE_ANGLE = 3.0, math.radians(12.0)
#: Stray light in the human eye: 10 E / θ² (CIE 135/1-1999), with the illuminance E and the angle θ in degrees. A
#: white surface has the brightness E / π.
_STRAY = 10.0 * math.pi
#: Mean of the picture that the automatic exposure sets (0…1).
_MEAN = 0.5
#: Points that a shadow ray starts beside its surface (m), and the farthest ground with shadows (m).
_BESIDE, _FARTHEST = np.float32(0.002), np.float32(10.0)
#: What a film of water leaves of the light that bark and soil scatter: Lekner and Dorf, Applied Optics 27 (1988) 1278,
#: for dry reflectances of 15 to 30 %.
_WET_SCATTERS = np.float32(0.57)
#: Reflectance of water at normal incidence, and sharpness of its highlights on bark (Blinn-Phong exponent, estimate).
_WATER, _SHARPNESS = np.float32(0.02), np.float32(60.0)
#: Longest blur that is drawn (px), and the shortest.
_LONGEST, _SHORTEST = 24.0, 0.1
Bools = NDArray[np.bool_]


class Light:
    """Light of one scene."""

    def __init__(self, world: WorldConfig, look: Appearance, seed: int) -> None:
        """Draw where the sun is.

        Args:
            world: Sunlight, glare and wet surfaces.
            look: Appearance without them.
            seed: Not negative.
        """
        rng = np.random.default_rng([seed, 0x5017])
        azimuth, height = rng.uniform(0.0, math.tau), rng.uniform(*_ELEVATION)
        self.low = world.sunlight > 0.0
        self.wet = world.wet
        self._glare = world.glare
        self._mean = _MEAN * float(look.exposure.mean())
        if self.low:
            level = math.cos(height)
            sun = [level * math.cos(azimuth), level * math.sin(azimuth), math.sin(height)]
            self.sun = np.array(sun, np.float32)
            # A surface that half faces the sun has the usual light.
            sky = 1.0 / (1.0 + world.sunlight / 2.0)
            self._sky, self._direct = sky * _SKY_COLOR, world.sunlight * sky * _SUN_COLOR
            horizon, zenith = (np.sqrt(factor * self._sky) for factor in (_HORIZON, _ZENITH))
            self.look = replace(look, horizon=look.horizon * horizon, zenith=look.zenith * zenith)
        else:
            self.sun, self.look = look.sun, look
            self._sky, self._direct = np.full((2, 3), [[look.ambient], [look.diffuse]], np.float32)

    def sunlit(self, mesh: RodMesh, points: Floats, normal: Floats) -> Floats:
        """Cosine of the sun's incidence (N), 0 in shadow; without a low sun nothing casts one.

        Args:
            mesh: What casts shadows.
            points: On surfaces (N×3, m).
            normal: Their outward unit normals (N×3).
        """
        cosine: Floats = np.maximum(normal @ self.sun, np.float32(0.0)).astype(np.float32)
        if self.low:
            facing = np.flatnonzero(cosine > 0.0)
            start = points[facing] + _BESIDE * (normal[facing] + self.sun)
            cosine[facing[mesh.occluded(start, self.sun)]] = 0.0
        return cosine

    def sunlit_ground(self, mesh: RodMesh, points: Floats, distance: Floats) -> Floats:
        """The same for points on the ground (N×3, m) at a distance from the camera (N, m)."""
        cosine = np.full(len(points), self.sun[2])
        if self.low:
            near = np.flatnonzero(distance < _FARTHEST)
            cosine[near[mesh.occluded(points[near], self.sun)]] = 0.0
        return cosine

    def factor(self, cosine: Floats) -> Floats:
        """Factors of colours (N×3) in sky and low sun, for a cosine of the sun's incidence (N)."""
        lit: Floats = np.sqrt(self._sky + cosine[:, None] * self._direct)
        return lit

    def watered(self, color: Floats, wet: Bools, porous: Bools, cosine: Floats, normal: Floats, view: Floats) -> None:
        """Darken wet wood and add its highlights, in place.

        Args:
            color: Of points on rods (N×3).
            wet: Which are wet (N).
            porous: Which darken (N).
            cosine: As of `sunlit` (N).
            normal: Outward unit normals (N×3).
            view: Unit vectors towards the camera (N×3).
        """
        index = np.flatnonzero(wet)
        normal, view = normal[index], view[index]
        halfway = self.sun + view
        halfway /= np.maximum(np.linalg.norm(halfway, axis=1, keepdims=True), np.float32(1e-6))
        # Normalised Blinn-Phong with Schlick's approximation of Fresnel's reflectance.
        shine = np.maximum(np.einsum("ij,ij->i", normal, halfway), np.float32(0.0)) ** _SHARPNESS
        shine *= _reflectance(np.einsum("ij,ij->i", halfway, view)) * (_SHARPNESS + 8.0) / 8.0 * cosine[index]
        facing = np.maximum(np.einsum("ij,ij->i", normal, view), np.float32(0.0))
        # Where the mirrored ray goes up, the sky is seen in the water.
        skyward = 2.0 * facing * normal[:, 2] - view[:, 2] > 0.0
        mirrored = 0.5 * np.where(skyward, _reflectance(facing), np.float32(0.0))
        scattered = (color[index] / 255.0) ** 2
        scattered *= np.where(porous[index], _WET_SCATTERS, np.float32(1.0))[:, None]
        color[index] = 255.0 * np.sqrt(scattered + shine[:, None] * self._direct + mirrored[:, None] * self._sky)

    def sky(self, palette: Palette, rays: Floats) -> Floats:
        """Colours (N×3) of a clear sky with the sun in it, along unit vectors (N×3)."""
        angle = self._from_sun(rays)
        around = 1.0 + np.float32(_AUREOLE) * np.exp(-angle / np.float32(_AUREOLE_ANGLE))
        color: Floats = palette.sky(rays[:, 2]) * np.sqrt(around)[:, None]
        color[angle < _DISC] = 255.0 * np.sqrt(_DAZZLING)
        return color

    def through_lens(self, bright: Floats, rays: Floats, axis: Floats, origin: Floats, mesh: RodMesh) -> None:
        """Add stray light, and set the exposure by the mean of the picture, in place.

        Args:
            bright: Brightness of each pixel (N×3).
            rays: Unit vector along each pixel's ray (N×3).
            axis: Unit vector along the optical axis (3).
            origin: Of the rays (3, m).
            mesh: What hides the sun.
        """
        falls = max(float(axis @ self.sun), 0.0)
        if self._glare > 0.0 and falls > 0.0:
            falls *= self._seen(origin, mesh)
            angle = np.degrees(np.maximum(self._from_sun(rays), np.float32(_DISC)))
            bright += (np.float32(self._glare * _STRAY * falls) / angle**2)[:, None] * self._direct
        few = bright[::7]
        gain = 1.0
        for _ in range(6):
            # Clipped highlights do not grow brighter.
            gain *= (self._mean / float(np.sqrt(np.minimum(gain * few, 1.0)).mean())) ** 2
        bright *= np.float32(gain)

    def _seen(self, origin: Floats, mesh: RodMesh) -> float:
        """Share of the sun's disc that the lens sees."""
        across = np.cross(self.sun, [0.0, 0.0, 1.0])
        across /= np.linalg.norm(across)
        above = np.cross(across, self.sun)
        angle, radius = 2.4 * np.arange(24), _DISC * np.sqrt((np.arange(24) + 0.5) / 24)
        disc = self.sun + (radius * np.cos(angle))[:, None] * across + (radius * np.sin(angle))[:, None] * above
        free = ~mesh.occluded(np.repeat(origin[None], 24, axis=0), disc.astype(np.float32))
        return float(free.mean())

    def _from_sun(self, rays: Floats) -> Floats:
        angle: Floats = np.arccos(np.clip(rays @ self.sun, -1.0, 1.0))
        return angle


def blurred(bright: Floats, depth: Floats, focal: tuple[float, float], rays: Floats, moved: Floats) -> Floats:
    """A picture that is exposed while the camera moves.

    Args:
        bright: Brightness (H×W×3).
        depth: Along the optical axis (H×W, m), infinite for the sky.
        focal: Focal lengths (px).
        rays: Of the pixels, of length 1 along the optical axis (H×W×3, camera).
        moved: Translation (m) and rotation (rad) of the camera during the exposure (6, camera).
    """
    x, y = rays[..., 0], rays[..., 1]
    (tx, ty, tz), (rx, ry, rz) = moved[:3], moved[3:]

    def flow(near: Floats) -> Floats:
        """Path of each pixel's point in the picture (2×H×W, px) for inverse depths (H×W, 1/m)."""
        towards = -tz * near - (rx * y - ry * x)
        across = -tx * near - (ry - rz * y) - x * towards
        along = -ty * near - (rz * x - rx) - y * towards
        return np.stack([focal[0] * across, focal[1] * along])

    near = (1.0 / np.maximum(depth, np.float32(0.05))).astype(np.float32)
    longest = float(np.abs(flow(near)).max())
    if longest < _SHORTEST:
        return bright
    # Wood smears over what is behind it: beside its edge the path is that of the nearer.
    reach = 2 * math.ceil(min(longest, _LONGEST) / 2) + 1
    nearer = np.asarray(cv2.dilate(near, np.ones((reach, reach), np.uint8)), np.float32)
    path = np.clip(flow(nearer), -_LONGEST, _LONGEST)
    v, u = np.indices(depth.shape, np.float32)
    looks = math.ceil(min(longest, _LONGEST)) + 1
    total: Floats = np.zeros_like(bright)
    for share in (np.arange(looks) + 0.5) / looks - 0.5:
        at = np.float32(share)
        total += cv2.remap(bright, u + at * path[0], v + at * path[1], cv2.INTER_LINEAR, None, cv2.BORDER_REPLICATE)
    total /= np.float32(looks)
    return total


def _reflectance(cosine: Floats) -> Floats:
    """Of water, for the cosine of the incidence."""
    share: Floats = _WATER + (1.0 - _WATER) * np.clip(1.0 - cosine, 0.0, 1.0) ** 5
    return share
