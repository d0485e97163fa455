"""Drawn pictures of vines with their true classes and depth: far wider in what they show than any vineyard.

Curves in space are projected and drawn as shaded cones with a depth buffer, at twice the size of the picture.
Everything of a picture follows from its number.
"""

import io
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image
from scipy.ndimage import gaussian_filter, uniform_filter, zoom

from perception.segmentation.frame import BACKGROUND, GROUND, NODE, TRUNK
from perception.training.wide.curves import (
    BARK,
    LEAF,
    METAL,
    PLASTIC,
    Tubes,
    Wood,
    add_brush,
    add_clutter,
    add_trellis,
    draw_wood,
    grow_vine,
)
from perception.training.wide.raster import draw_cones
from rolling_panda.messages.types import WOOD_CLASSES

Floats = NDArray[np.float32]

#: A pixel that is background or ground, and nobody knows which: behind the vine stands a photograph.
FAR = len(WOOD_CLASSES)
#: Pictures are drawn so much larger and then shrunk.
_OVER = 2
_TEXTURE = 512
#: Nearest depth that is drawn (m).
_NEAR = 0.12


@dataclass(frozen=True)
class Drawing:
    """One picture.

    Attributes:
        color: H×W×3, RGB.
        depth: H×W (m), 0 = invalid; None when the camera measures none.
        labels: H×W, indices in `WOOD_CLASSES`, or `FAR`.
    """

    color: NDArray[np.uint8]
    depth: Floats | None
    labels: NDArray[np.uint8]


@dataclass(frozen=True)
class Scene:
    """A picture before lens, sensor and file.

    Attributes:
        color: H×W×3, as light falls in (0…255 and above).
        depth: H×W (m), infinite in the sky.
        labels: As of `Drawing`.
    """

    color: Floats
    depth: Floats
    labels: NDArray[np.uint8]

    def photograph(self, rng: np.random.Generator) -> Drawing:
        """One of the many pictures that cameras make of it."""
        return Drawing(_photographed(rng, self.color), _measured(rng, self.depth), self.labels)


@dataclass(frozen=True)
class Lens:
    """A pinhole camera.

    Attributes:
        R: Rotation from world to camera (3×3): x right, y up, z ahead.
        t: Position (3, m).
        focal: Focal length (px).
        cx: Column of the principal point.
        cy: Row of it.
    """

    R: NDArray[np.float64]
    t: NDArray[np.float64]
    focal: float
    cx: float
    cy: float

    def project(self, points: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Camera coordinates (N×3), and columns and rows (N×2)."""
        camera = (points - self.t) @ self.R.T
        z = np.maximum(camera[:, 2], 1e-3)
        return camera, np.column_stack(
            [self.cx + self.focal * camera[:, 0] / z, self.cy - self.focal * camera[:, 1] / z]
        )


@dataclass(frozen=True)
class Traced:
    """What a camera sees of some tubes.

    Attributes:
        depth: H×W (m), infinite where there is none of them.
        cone: H×W, number of the cone, -1 where there is none.
        kind: H×W, its class; background where there is none.
        across: H×W, -1…1 from one side of the cone to the other.
        along: H×W, 0…1 from its first end to its last.
        run: From the first end to the last of each cone in the image (N×2, px).
    """

    depth: Floats
    cone: NDArray[np.int64]
    kind: NDArray[np.uint8]
    across: Floats
    along: Floats
    run: NDArray[np.float64]


def trace(tubes: Tubes, lens: Lens, size: int) -> Traced:
    """Draw tubes into a square image; those behind or at the camera are left out."""
    # There may be none at all: a picture of the background alone.
    ends = np.concatenate([np.empty((0, 8)), *tubes.ends])
    a, uv_a = lens.project(ends[:, :3])
    b, uv_b = lens.project(ends[:, 4:7])
    kept = np.flatnonzero((a[:, 2] > _NEAR) & (b[:, 2] > _NEAR))
    za, zb, ra, rb = a[kept, 2], b[kept, 2], ends[kept, 3], ends[kept, 7]
    cones = np.column_stack([uv_a[kept], za, lens.focal * ra / za, ra, uv_b[kept], zb, lens.focal * rb / zb, rb])
    depth, index = np.full((size, size), np.inf, np.float32), np.full((size, size), -1, np.int32)
    across, along = np.zeros((size, size), np.float32), np.zeros((size, size), np.float32)
    draw_cones(cones, depth, index, across, along)
    # An index of -1 is the last entry of each.
    cone = np.append(kept, -1)[index]
    kind = np.concatenate([*tubes.kind, [BACKGROUND]])[cone].astype(np.uint8)
    return Traced(depth, cone, kind, across, along, uv_b - uv_a)


class Artist:
    """Draws pictures; holds textures and real pictures to stand behind."""

    def __init__(self, size: int = 320, backgrounds: tuple[NDArray[np.uint8], ...] = ()) -> None:
        """Prepare textures.

        Args:
            size: Side of the pictures (px).
            backgrounds: Pictures without vines, each at least as large; none is fine.
        """
        self.size = size
        self._backgrounds = backgrounds
        rng = np.random.default_rng(1)
        self._noise = np.stack([_noise(rng, cells) for cells in ((1, 4, 16), (2, 8, 32, 128), (8, 40), (1, 2))])
        self._bark = _noise(rng, (1, 3, 10), stretch=6.0)
        self._stones, self._stone_light = _stones(rng)

    def draw(self, *seed: int) -> Drawing:
        """The picture of a seed."""
        return self.scene(*seed).photograph(np.random.default_rng([*seed, 1]))

    def scene(self, *seed: int) -> Scene:
        """What stands before the camera for a seed."""
        rng = np.random.default_rng([*seed])
        wood = draw_wood(rng)
        height = float(
            rng.choice([rng.uniform(0.35, 0.7), rng.uniform(0.7, 1.1), rng.uniform(1.1, 1.7)], p=[0.25, 0.55, 0.2])
        )
        # Near enough that a cane can be measured; some are seen from very near, some from across the row.
        away = float(np.exp(rng.uniform(np.log(0.35), np.log(2.0))))
        lens = self._lens(rng, height, away)
        tubes = Tubes()
        self._plant(rng, tubes, wood, height, away)
        traced = trace(tubes, lens, self.size * _OVER)
        sun = rng.normal(0.0, 1.0, 3) + [0.0, 1.2, -0.8]
        sun = (sun / np.linalg.norm(sun)) @ lens.R.T
        overcast = float(rng.uniform(0.0, 1.0))
        # What is far is drawn at the picture's own size.
        far, floor, kinds = self._behind(rng, lens, wood, overcast)
        color: Floats = far.repeat(_OVER, axis=0).repeat(_OVER, axis=1)
        labels = kinds.repeat(_OVER, axis=0).repeat(_OVER, axis=1)
        # The depth of the ground stands where nothing was drawn.
        depth = np.where(np.isfinite(traced.depth), traced.depth, floor.repeat(_OVER, axis=0).repeat(_OVER, axis=1))
        hit = traced.cone >= 0
        labels[hit] = traced.kind[hit]
        self._shade(rng, tubes, traced, sun, overcast, color)
        _haze(rng, color, depth)
        small = uniform_filter(color, (_OVER, _OVER, 1))[_OVER // 2 :: _OVER, _OVER // 2 :: _OVER]
        labels, metres = _shrunk(labels, depth)
        return Scene(small, metres, labels)

    def _lens(self, rng: np.random.Generator, height: float, away: float) -> Lens:
        yaw, pitch, roll = rng.normal(0.0, [0.25, 0.15, 0.05])
        if rng.random() < 0.06:
            roll += float(rng.choice([-1.0, 1.0])) * np.pi / 2
        pitch -= float(rng.choice([0.0, 0.25], p=[0.8, 0.2]))
        cy, sy, cp, sp, cr, sr = np.cos(yaw), np.sin(yaw), np.cos(pitch), np.sin(pitch), np.cos(roll), np.sin(roll)
        turn = np.array([[cy, 0, -sy], [0, 1, 0], [sy, 0, cy]])
        tip = np.array([[1, 0, 0], [0, cp, -sp], [0, sp, cp]])
        tilt = np.array([[cr, sr, 0], [-sr, cr, 0], [0, 0, 1]])
        R = tilt @ tip @ turn
        big = self.size * _OVER
        focal = float(np.exp(rng.uniform(np.log(420.0), np.log(760.0)))) * _OVER
        # The picture is a part of a larger one, anywhere in it; its middle looks at the vine.
        off = rng.uniform(-0.5, 0.5, 2) * [528 * _OVER, 160 * _OVER]
        # Most pictures show spurs and canes, some the trunk.
        level = float(rng.choice([height + rng.normal(0.15, 0.22), height * rng.uniform(0.5, 1.0)], p=[0.8, 0.2]))
        t = np.array([rng.uniform(-0.9, 0.9), max(0.15, level), 0.0])
        middle = np.array([t[0] + np.tan(yaw) * away, t[1], away])
        focused = (middle - t) @ R.T
        place = focal * focused[:2] / max(focused[2], 0.1)
        keep = 0.3 * big
        shift = np.clip(off, -keep, keep)
        return Lens(R, t, focal, big / 2 - place[0] * 0.5 + shift[0] * 0.5, big / 2 + place[1] * 0.5 + shift[1])

    def _plant(self, rng: np.random.Generator, tubes: Tubes, wood: Wood, height: float, away: float) -> None:
        if rng.random() < 0.97:
            for x in (-1.0, 0.0, 1.0):
                grow_vine(rng, tubes, wood, x * rng.uniform(0.8, 1.5) + rng.normal(0.0, 0.3), away, height, True)
        if rng.random() < 0.85:
            add_trellis(rng, tubes, away, height, 2.5, True)
        add_clutter(rng, tubes, away, wood)
        rows = int(rng.choice([0, 1, 2, 4, 7], p=[0.2, 0.2, 0.25, 0.2, 0.15]))
        spacing = float(rng.uniform(1.2, 3.0))
        for row in range(1, rows + 1):
            z = away + row * spacing
            other = draw_wood(rng) if rng.random() < 0.3 else wood
            reach = z * 0.9 + 0.5
            for _ in range(min(3 + row, 6)):
                grow_vine(rng, tubes, other, float(rng.uniform(-reach, reach)), z, height, False)
            if row > 1:
                add_brush(rng, tubes, other, z, height, reach)
            if rng.random() < 0.8:
                add_trellis(rng, tubes, z, height, reach + 1.0, False)

    def _behind(
        self, rng: np.random.Generator, lens: Lens, wood: Wood, overcast: float
    ) -> tuple[Floats, Floats, NDArray[np.uint8]]:
        """Colours, depth and classes of sky, hills and ground, or of a real picture."""
        big = self.size
        places = np.arange(big) * _OVER + _OVER / 2 - 0.5
        u, v = np.meshgrid((places - lens.cx) / lens.focal, -(places - lens.cy) / lens.focal)
        rays = np.stack([u, v, np.ones_like(u)], -1) @ lens.R
        down = -lens.t[1] / np.minimum(rays[..., 1], -1e-4)
        if self._backgrounds and rng.random() < 0.3:
            picture = self._backgrounds[int(rng.integers(len(self._backgrounds)))]
            side = int(rng.integers(min(picture.shape[:2]) // 3, min(picture.shape[:2])))
            y, x = (int(rng.integers(0, n - side + 1)) for n in picture.shape[:2])
            part = Image.fromarray(picture[y : y + side, x : x + side]).resize((big, big), Image.Resampling.BILINEAR)
            color = np.asarray(part, np.float32)
            if rng.random() < 0.5:
                color = color[:, ::-1]
            blur = float(rng.choice([0.0, rng.uniform(0.0, 1.5)]))
            return (
                gaussian_filter(color, (blur, blur, 0)),
                np.full((big, big), np.inf, np.float32),
                np.full((big, big), FAR, np.uint8),
            )
        size = _TEXTURE
        zenith = np.array([90.0, 140.0, 215.0]) * np.exp(rng.normal(0.0, [0.3, 0.2, 0.15]))
        horizon = np.array([215.0, 222.0, 226.0]) * rng.uniform(0.6, 1.15)
        gray = np.full(3, rng.choice([rng.uniform(20, 120), rng.uniform(120, 255)], p=[0.2, 0.8]))
        lift = np.sqrt(np.clip(rays[..., 1:2] / np.linalg.norm(rays, axis=-1, keepdims=True), 0.0, 1.0))
        clouds = self._noise[1][
            _wrap(rays[..., 1] * 300 + rng.integers(size)), _wrap(rays[..., 0] * 120 + rng.integers(size))
        ]
        cover = np.clip(0.5 + clouds * 0.8 + (overcast - 0.5) * 3.0, 0.0, 1.0)[..., None]
        color = (
            (horizon * (1 - lift) + zenith * lift) * (1 - cover) + cover * (gray + 14.0 * clouds[..., None])
        ).astype(np.float32)
        labels = np.full((big, big), BACKGROUND, np.uint8)
        for _ in range(int(rng.integers(0, 4))):
            skyline = gaussian_filter(rng.normal(0.0, 1.0, 400), float(rng.uniform(1.0, 25.0)), mode="wrap")
            skyline *= rng.uniform(0.0, 0.12) / skyline.std()
            ridge = rng.uniform(0.0, 0.3) + np.interp(rays[..., 0], np.linspace(-2.5, 2.5, 400), skyline)
            near = (rays[..., 1] < ridge) & (rays[..., 1] > -0.6)
            tone = np.array(
                [[70, 84, 62], [104, 100, 92], [80, 92, 120], [120, 104, 76], [50, 56, 46]][int(rng.integers(5))],
                np.float32,
            )
            grain = self._noise[int(rng.integers(4))][
                _wrap(rays[..., 1] * rng.uniform(150, 900)), _wrap(rays[..., 0] * rng.uniform(150, 900))
            ]
            color[near] = (tone * rng.uniform(0.6, 1.5) * (1.0 + rng.uniform(0.05, 0.5) * grain[..., None]))[near]
        on_ground = (rays[..., 1] < -0.004) & (down < 60.0)
        self._ground(rng, rays, down, lens, wood, on_ground, color)
        labels[on_ground] = GROUND
        return color, np.where(on_ground, down, np.inf).astype(np.float32), labels

    def _ground(
        self,
        rng: np.random.Generator,
        rays: NDArray[np.float64],
        down: NDArray[np.float64],
        lens: Lens,
        wood: Wood,
        where: NDArray[np.bool_],
        color: Floats,
    ) -> None:
        if not where.any():
            return
        x, z = lens.t[0] + rays[..., 0][where] * down[where], rays[..., 2][where] * down[where]
        soils = np.array(
            [[112, 88, 66], [150, 118, 84], [96, 92, 88], [134, 92, 62], [176, 160, 134], [70, 60, 52], [160, 130, 88]],
            float,
        )
        greens = np.array([[98, 112, 56], [74, 92, 44], [150, 140, 92], [126, 132, 80], [236, 238, 242]], float)
        soil = soils[rng.integers(len(soils))] * np.exp(rng.normal(0.0, 0.07, 3) + rng.normal(0.0, 0.2))
        green = greens[rng.integers(len(greens))] * np.exp(rng.normal(0.0, 0.12, 3))
        scale = float(np.exp(rng.uniform(np.log(60.0), np.log(400.0))))
        far = np.clip(1.0 - down[where] / 15.0, 0.1, 1.0)
        fine = self._noise[0][_wrap(x * scale), _wrap(z * scale)] * far
        broad = self._noise[1][_wrap(x * 30.0 + 99), _wrap(z * 30.0)]
        grassy = np.clip((broad - rng.uniform(-2.0, 2.5)) * 3.0, 0.0, 1.0)[:, None]
        out = soil * (1 - grassy) + green * grassy
        out *= 1.0 + (rng.uniform(0.1, 0.4) * fine + 0.15 * broad)[:, None]
        if rng.random() < 0.5:
            scale = float(np.exp(rng.uniform(np.log(120.0), np.log(700.0))))
            a, b = _wrap(x * scale), _wrap(z * scale)
            stony = (self._stones[a, b] > rng.uniform(0.0, 0.8)) & (grassy[:, 0] < 0.5)
            pale = (soil * 0.4 + 0.6 * soil.mean()) * rng.uniform(0.7, 1.9)
            out[stony] = (pale * (0.55 + 0.65 * self._stones[a, b] * self._stone_light[a, b])[:, None])[stony]
        # Shadows of what stands beside: streaks along one direction.
        if rng.random() < 0.6:
            angle = rng.uniform(0.0, np.pi)
            lines = self._bark[
                _wrap((x * np.cos(angle) + z * np.sin(angle)) * 90.0),
                _wrap((z * np.cos(angle) - x * np.sin(angle)) * 90.0),
            ]
            out *= np.where(lines > rng.uniform(0.4, 1.8), rng.uniform(0.25, 0.7), 1.0)[:, None]
        color[where] = np.clip(out, 0.0, 400.0)

    def _shade(
        self,
        rng: np.random.Generator,
        tubes: Tubes,
        traced: Traced,
        sun: NDArray[np.float64],
        overcast: float,
        color: Floats,
    ) -> None:
        hit = traced.cone >= 0
        n = traced.cone[hit]
        if not len(n):
            return
        ends = np.concatenate(tubes.ends)
        tube, begin = np.concatenate(tubes.tube), np.concatenate(tubes.along)
        long = np.linalg.norm(ends[:, 4:7] - ends[:, :3], axis=1)
        base = np.array(tubes.color)
        surface, rough = np.array(tubes.surface), np.array(tubes.rough)
        s, t = traced.across[hit].astype(float), traced.along[hit]
        of = tube[n]
        dx, dy = traced.run[n].T
        size = np.hypot(dx, dy) + 1e-9
        facing = np.sqrt(np.clip(1.0 - s * s, 0.0, 1.0))
        # In the picture's plane, x to the right and y up, towards the viewer is -z.
        normal_x, normal_y = -s * dy / size, -s * dx / size
        lit = np.maximum(normal_x * sun[0] + normal_y * sun[1] - facing * sun[2], 0.0)
        ambient = 0.35 + 0.4 * overcast + 0.15 * normal_y
        light = ambient + 0.95 * (1.0 - 0.85 * overcast) * lit
        metres = begin[n] + t * long[n]
        place = metres * 900.0
        grain = self._noise[0][_wrap(place + 37.0 * of), _wrap(s * 20.0 + 61.0 * of)]
        strips = self._bark[_wrap(s * 40.0 + 17.0 * of), _wrap(place * 0.5)]
        # Across and along what is thicker than long are rings around its end; the picture's own plane has none.
        y, x = np.nonzero(hit)
        across, down = (x * dy - y * dx) / size, (x * dx + y * dy) / size
        stubby = long[n] < 2.0 * ends[n, 3]
        strips = np.where(stubby, self._bark[_wrap(across * 1.3 + 17.0 * of), _wrap(down * 0.2)], strips)
        grain = np.where(stubby, self._noise[0][_wrap(x + 37.0 * of), _wrap(y * 1.0)], grain)
        wooden = surface[of] == BARK
        texture = np.where(wooden, 0.7 * strips + 0.5 * grain, grain)
        bright = light * np.exp(rough[of] * np.clip(texture, -2.5, 2.5))
        patches = self._noise[1][_wrap(np.where(stubby, x * 0.5, place * 0.25) + 211.0 * of), _wrap(of * 7.0)]
        # Shadows of other canes cross; bark peels and lichen grows in patches.
        shadow = rng.uniform(0.0, 1.0) < 0.6
        if shadow:
            bright = np.where(patches > rng.uniform(0.4, 1.6), bright * rng.uniform(0.3, 0.7), bright)
        tint = np.ones((len(n), 3))
        if rng.random() < 0.5:
            tint += 0.25 * np.clip(patches, -1.5, 1.5)[:, None] * rng.normal(0.0, 0.3, 3)
        out = base[of] * bright[:, None] * np.clip(tint, 0.3, 1.7)
        shiny = np.isin(surface[of], (METAL, PLASTIC, LEAF)).astype(float) + 0.35 * (surface[of] == 1) * rng.uniform(
            0.0, 1.0
        )
        gloss = shiny * np.clip(lit, 0.0, 1.0) ** 12 * (1.0 - 0.7 * overcast) * rng.uniform(0.3, 1.2)
        out += 140.0 * gloss[:, None]
        color[hit] = out


def _wrap(values: NDArray[np.floating]) -> NDArray[np.int64]:
    out: NDArray[np.int64] = np.floor(values).astype(np.int64) % _TEXTURE
    return out


def _noise(rng: np.random.Generator, cells: tuple[int, ...], stretch: float = 1.0) -> Floats:
    out = np.zeros((_TEXTURE, _TEXTURE), np.float32)
    for cell in cells:
        smooth = gaussian_filter(rng.standard_normal(out.shape), (cell / 2, cell * stretch / 2), mode="wrap")
        out += (smooth / smooth.std()).astype(np.float32)
    clipped: Floats = np.clip(out / out.std(), -2.5, 2.5)
    return clipped


def _stones(rng: np.random.Generator) -> tuple[Floats, Floats]:
    """Height of stones that lie beside and over each other (0 where none lies), and the tone of each."""
    high, tone = np.zeros((_TEXTURE, _TEXTURE), np.float32), np.ones((_TEXTURE, _TEXTURE), np.float32)
    y, x = np.mgrid[-24:25, -24:25]
    for _ in range(900):
        a, b, angle = rng.uniform(3.0, 22.0), rng.uniform(0.5, 1.0), rng.uniform(0.0, np.pi)
        p, q = x * np.cos(angle) + y * np.sin(angle), y * np.cos(angle) - x * np.sin(angle)
        dome = 1.0 - (np.abs(p) / a) ** 2.5 - (np.abs(q) / (a * b)) ** 2.5
        rows, cols = (y + rng.integers(_TEXTURE)) % _TEXTURE, (x + rng.integers(_TEXTURE)) % _TEXTURE
        over = dome > 0.0
        high[rows[over], cols[over]] = np.sqrt(dome[over])
        tone[rows[over], cols[over]] = rng.uniform(0.5, 1.4) * (1.0 + 0.35 * (p[over] + q[over]) / a)
    return high, tone


def _shrunk(labels: NDArray[np.uint8], depth: Floats) -> tuple[NDArray[np.uint8], Floats]:
    """The most frequent class of each block, wood before others, and the least depth of what has this class."""
    height, width = labels.shape

    def corners(image: NDArray[Any]) -> NDArray[Any]:
        blocks = image.reshape(height // _OVER, _OVER, width // _OVER, _OVER).transpose(1, 3, 0, 2)
        return blocks.reshape(_OVER**2, height // _OVER, -1)

    kinds = corners(labels)
    votes = np.stack([(kinds == each).sum(axis=0) for each in kinds]) * 2 + ((kinds >= TRUNK) & (kinds <= NODE))
    most: NDArray[np.uint8] = np.take_along_axis(kinds, votes.argmax(axis=0)[None], axis=0)[0]
    return most, np.where(kinds == most, corners(depth), np.float32(np.inf)).min(axis=0)


def _haze(rng: np.random.Generator, color: Floats, depth: Floats) -> None:
    if rng.random() < 0.5:
        return
    share = 1.0 - np.exp(-np.minimum(depth, 40.0) / rng.uniform(6.0, 60.0))
    share[~np.isfinite(depth)] = 0.0
    color += share[..., None] * (np.float32(rng.uniform(120.0, 240.0)) - color)


def _photographed(rng: np.random.Generator, color: Floats) -> NDArray[np.uint8]:
    """What lens, sensor and file make of a picture."""
    size = color.shape[0]
    out = color * np.exp(rng.normal(0.0, 0.25) + rng.normal(0.0, 0.06, 3)).astype(np.float32)
    if rng.random() < 0.4:
        # Bright sky washes over thin things before it.
        glow = gaussian_filter(np.maximum(out - 170.0, 0.0), (rng.uniform(1.0, 8.0),) * 2 + (0,))
        out += glow * rng.uniform(0.1, 0.7)
    grey = out.mean(axis=2, keepdims=True)
    out = grey + rng.uniform(0.2, 1.4) * (out - grey)
    out = (out - 110.0) * rng.uniform(0.65, 1.25) + 110.0 + rng.normal(0.0, 10.0)
    out = 255.0 * np.clip(out / 255.0, 0.0, 1.0) ** rng.uniform(0.7, 1.4)
    if rng.random() < 0.3:
        y, x = np.mgrid[-1 : 1 : size * 1j, -1 : 1 : size * 1j]
        out *= (1.0 - rng.uniform(0.0, 0.4) * ((x - rng.normal()) ** 2 + (y - rng.normal()) ** 2) / 3.0).clip(0.3)[
            ..., None
        ]
    blur = float(rng.choice([0.0, rng.uniform(0.3, 0.9), rng.uniform(0.9, 1.6)], p=[0.35, 0.45, 0.2]))
    if blur:
        out = gaussian_filter(out, (blur, blur * rng.uniform(0.7, 1.4), 0))
    if rng.random() < 0.4:
        out += rng.uniform(0.2, 1.2) * (out - gaussian_filter(out, (1.2, 1.2, 0)))
    if rng.random() < 0.25:
        # Fine colour is lost, as in compressed films.
        cells = zoom(out[::2, ::2] - out[::2, ::2].mean(axis=2, keepdims=True), (2, 2, 1), order=1)[:size, :size]
        out = out.mean(axis=2, keepdims=True) + cells
    out += rng.normal(0.0, 1.0, out.shape) * rng.choice([0.0, rng.uniform(0.0, 10.0)])
    image = np.clip(out, 0.0, 255.0).astype(np.uint8)
    if rng.random() < 0.7:
        data = io.BytesIO()
        Image.fromarray(image).save(data, "JPEG", quality=int(rng.integers(45, 97)))
        image = np.asarray(Image.open(data), dtype=np.uint8)
    out_8: NDArray[np.uint8] = image
    return out_8


def _measured(rng: np.random.Generator, depth: Floats) -> Floats | None:
    """What a depth camera makes of it: none in nearly half of the pictures, holes, noise, or nonsense."""
    how = rng.choice(["none", "good", "holes", "wrong"], p=[0.45, 0.30, 0.20, 0.05])
    if how == "none":
        return None
    out = np.where(np.isfinite(depth) & (depth < 20.0), depth, 0.0).astype(np.float32)
    out += (
        out**2
        * np.float32(rng.uniform(0.0005, 0.006))
        * gaussian_filter(rng.standard_normal(depth.shape), 1.0).astype(np.float32)
    )
    if rng.random() < 0.6:
        # Depth of an edge is anywhere between its two sides' pixels.
        shift = rng.integers(-2, 3, (2, *depth.shape)) * (rng.random(depth.shape) < rng.uniform(0.0, 0.5))
        rows, cols = np.indices(depth.shape)
        out = out[(rows + shift[0]) % len(depth), (cols + shift[1]) % len(depth)]
    if how == "holes":
        out[gaussian_filter(rng.standard_normal(depth.shape), rng.uniform(1.0, 12.0)) > 0.0] = 0.0
    elif how == "wrong":
        out = np.roll(out, tuple(rng.integers(-60, 60, 2)), (0, 1)) * np.float32(rng.uniform(0.5, 2.0))
    out[rng.random(depth.shape) < rng.uniform(0.0, 0.08)] = 0.0
    return out
