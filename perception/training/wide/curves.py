"""Curves of a drawn vine: trunk, arms, spurs, canes with laterals and tendrils, and what stands and hangs around."""

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from perception.segmentation.frame import BACKGROUND, CANE, CORDON, GROUND, HOSE, NODE, OLD_CUT, POST, SPUR, TRUNK, WIRE

Floats = NDArray[np.float64]

#: Kinds of surface; each has its own texture and shine.
BARK, SMOOTH, METAL, PLASTIC, LEAF = range(5)
#: Points of a cane are so far apart (m).
_STEP = 0.012


@dataclass
class Tubes:
    """Cones between neighbouring points of curves, in world coordinates: x along the row, y up, z away (m).

    Attributes:
        ends: First and last point and their radii of each cone (N×8).
        kind: Class of each (N).
        tube: Number of its curve (N).
        along: Length of the curve up to its first point (N, m).
        color: Of each curve (RGB, 0…255).
        surface: Of each curve.
        rough: Contrast of each curve's texture.
    """

    ends: list[Floats] = field(default_factory=list)
    kind: list[NDArray[np.int64]] = field(default_factory=list)
    tube: list[NDArray[np.int64]] = field(default_factory=list)
    along: list[Floats] = field(default_factory=list)
    color: list[Floats] = field(default_factory=list)
    surface: list[int] = field(default_factory=list)
    rough: list[float] = field(default_factory=list)

    def add(
        self,
        points: Floats,
        radii: Floats,
        kind: int | NDArray[np.int64],
        color: Floats,
        surface: int = SMOOTH,
        rough: float = 0.15,
    ) -> None:
        """Append a curve of N points (N×3), with a class for all or for each of its N-1 cones."""
        steps = np.linalg.norm(np.diff(points, axis=0), axis=1)
        count = len(steps)
        self.ends.append(np.column_stack([points[:-1], radii[:-1], points[1:], radii[1:]]))
        self.kind.append(np.full(count, kind) if isinstance(kind, int) else kind)
        self.tube.append(np.full(count, len(self.color)))
        self.along.append(np.concatenate([[0.0], np.cumsum(steps)[:-1]]))
        self.color.append(color)
        self.surface.append(surface)
        self.rough.append(rough)


@dataclass(frozen=True)
class Wood:
    """What all vines of a scene share.

    Attributes:
        bark: Mean colour of old wood.
        cane: Mean colour of one-year wood.
        spread: Of colours between canes (log).
        upright: 0 = sprawling in all directions … 1 = straight up.
        lean: Mean direction along the row.
        droop: Bending towards the ground (1/m).
        crooked: Angle at each node (rad).
        lateral: Laterals a node.
        tendril: Tendrils a node.
        length: Of canes (m).
        radius: Of canes at their base (m).
        internode: Distance of nodes (m).
        swelling: Radius at a node, of the cane's.
    """

    bark: Floats
    cane: Floats
    spread: float
    upright: float
    lean: float
    droop: float
    crooked: float
    lateral: float
    tendril: float
    length: float
    radius: float
    internode: float
    swelling: float


_BARKS = np.array([[92, 84, 78], [64, 52, 44], [122, 112, 100], [40, 36, 34], [104, 78, 58], [140, 134, 126]], float)
_CANES = np.array(
    [[164, 104, 62], [186, 148, 96], [140, 120, 100], [120, 76, 52], [96, 84, 74], [206, 178, 132], [150, 130, 80]],
    float,
)


def draw_wood(rng: np.random.Generator) -> Wood:
    """The wood of a scene."""
    share = rng.dirichlet(np.full(len(_CANES), 0.5))
    return Wood(
        bark=_BARKS[rng.integers(len(_BARKS))] * np.exp(rng.normal(0.0, [0.12, 0.06, 0.08])),
        cane=share @ _CANES * np.exp(rng.normal(0.0, 0.15)),
        spread=float(rng.uniform(0.05, 0.4)),
        upright=float(rng.choice([1.0, rng.uniform(0.0, 1.0)])),
        lean=float(rng.normal(0.0, rng.choice([0.5, 1.5], p=[0.7, 0.3]))),
        droop=float(rng.choice([rng.uniform(0.0, 0.3), rng.exponential(1.0)])),
        crooked=float(rng.uniform(0.0, 0.22)),
        lateral=float(rng.choice([0.0, rng.uniform(0.0, 0.3)])),
        tendril=float(rng.choice([0.0, rng.uniform(0.0, 0.25)])),
        length=float(rng.uniform(0.4, 1.6)),
        radius=float(rng.uniform(0.0028, 0.0060)),
        internode=float(rng.uniform(0.04, 0.12)),
        swelling=float(rng.uniform(1.1, 1.6)),
    )


def path(
    rng: np.random.Generator,
    start: Floats,
    toward: Floats,
    length: float,
    droop: float,
    wander: float,
    step: float = _STEP,
) -> Floats:
    """Points of a curve that begins in one direction, bends downwards and wanders."""
    count = max(3, int(length / step) + 1)
    turn = np.cumsum(rng.normal(0.0, wander * np.sqrt(step), (count, 3)), axis=0)
    directions = toward + turn
    directions[:, 1] -= droop * step * np.arange(count)
    directions /= np.linalg.norm(directions, axis=1, keepdims=True) + 1e-9
    out: Floats = start + np.concatenate([np.zeros((1, 3)), np.cumsum(directions[:-1] * step, axis=0)])
    return out


def _tinted(rng: np.random.Generator, color: Floats, spread: float) -> Floats:
    out: Floats = color * np.exp(rng.normal(0.0, spread) + rng.normal(0.0, 0.25 * spread, 3))
    return out


def grow_cane(
    rng: np.random.Generator, tubes: Tubes, wood: Wood, start: Floats, toward: Floats, own: bool, scale: float = 1.0
) -> None:
    """Append a cane with its nodes, laterals and tendrils; those of rows behind are background."""
    length = wood.length * scale * float(rng.lognormal(0.0, 0.35))
    radius = wood.radius * (0.55 + 0.45 * scale) * float(rng.lognormal(0.0, 0.22))
    pruned = rng.random() < 0.08
    if pruned:
        length = min(length, float(rng.uniform(0.04, 0.3)))
    points = path(rng, start, toward, length, wood.droop * float(rng.lognormal(0.0, 0.6)), float(rng.uniform(0.1, 0.7)))
    along = _STEP * np.arange(len(points))
    gaps = wood.internode * rng.lognormal(0.0, 0.25, int(length / wood.internode) + 4)
    gaps[0] *= 0.35
    nodes = np.cumsum(gaps)
    nodes = nodes[nodes < along[-1]]
    if len(nodes):
        # The cane changes its direction at each node, to one side and to the other.
        aside = np.cross(toward, rng.normal(size=3))
        aside /= np.linalg.norm(aside) + 1e-9
        number = np.searchsorted(nodes, along)
        zigzag = np.interp(along, np.concatenate([[0.0], nodes]), 0.5 - (np.arange(len(nodes) + 1) % 2))
        points = points + (wood.crooked * wood.internode * zigzag * (number < len(nodes)))[:, None] * aside
    radii = radius * np.interp(
        along / max(length, 1e-6), [0.0, 0.8, 1.0], [1.0, rng.uniform(0.5, 0.9), rng.uniform(0.2, 0.7)]
    )
    if len(nodes):
        after = np.searchsorted(nodes, along)
        near = np.minimum(
            np.abs(along - nodes[np.maximum(after - 1, 0)]), np.abs(along - nodes[np.minimum(after, len(nodes) - 1)])
        )
    else:
        near = np.ones(len(points))
    radii = radii * (1.0 + (wood.swelling - 1.0) * np.exp(-((near / 0.006) ** 2)))
    middle = (near[:-1] + near[1:]) / 2.0
    kind = np.where(middle < 0.007, NODE, CANE) if own else np.full(len(points) - 1, BACKGROUND)
    if pruned and own:
        kind[-1:] = OLD_CUT
    color = _tinted(rng, wood.cane, wood.spread)
    tubes.add(points, radii, kind, color, SMOOTH, float(rng.uniform(0.05, 0.3)))
    for at in nodes:
        here = points[min(int(at / _STEP), len(points) - 1)]
        if scale == 1.0 and rng.random() < wood.lateral:
            grow_cane(rng, tubes, wood, here, toward + rng.normal(0.0, 0.7, 3), own, 0.3)
        elif rng.random() < wood.tendril:
            curl = path(
                rng, here, rng.normal(size=3), float(rng.uniform(0.03, 0.2)), 0.0, float(rng.uniform(2.0, 9.0)), 0.008
            )
            tubes.add(curl, np.linspace(0.0009, 0.0005, len(curl)), BACKGROUND, color * 0.8)
        elif rng.random() < 0.3 * wood.swelling - 0.25:
            bud = here + rng.normal(0.0, 0.007, 3)
            tubes.add(np.stack([here, bud]), np.array([0.003, 0.0015]), NODE if own else BACKGROUND, color * 0.7)


def _rough(rng: np.random.Generator, radius: Floats, amount: float) -> Floats:
    out: Floats = radius * np.exp(amount * np.convolve(rng.normal(0.0, 1.0, len(radius) + 2), [0.5, 1.0, 0.5], "valid"))
    return out


def _add_old_wood(
    rng: np.random.Generator, tubes: Tubes, axis: Floats, radii: Floats, kind: int, bark: Floats, rough: float
) -> None:
    """Append a trunk: round, or of strands that wind around each other, as where bark splits and peels."""
    tubes.add(axis, radii, kind, bark, BARK, rough)
    count = int(rng.choice([0, int(rng.integers(4, 10))]))
    twist = rng.normal(0.0, 4.0)
    length = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(axis, axis=0), axis=1))])
    for strand in range(count):
        angle = 2 * np.pi * strand / count + twist * length + np.cumsum(rng.normal(0.0, 0.12, len(axis)))
        out = radii * rng.uniform(0.6, 0.95)
        curve = axis + np.column_stack([np.cos(angle) * out, np.zeros(len(axis)), np.sin(angle) * out])
        first = int(rng.integers(0, max(1, len(axis) // 3)))
        last = max(first + 2, len(axis) - int(rng.integers(0, max(1, len(axis) // 3))))
        width = _rough(rng, radii * rng.uniform(0.2, 0.5), 0.15)
        tubes.add(curve[first:last], width[first:last], kind, _tinted(rng, bark, 0.35), BARK, rough)


def grow_vine(rng: np.random.Generator, tubes: Tubes, wood: Wood, x: float, z: float, height: float, own: bool) -> None:
    """Append one vine, trained in one of several ways.

    Args:
        rng: Random generator.
        tubes: Appended to.
        wood: Of the scene.
        x: Along the row (m).
        z: Away from the camera (m).
        height: Of the head above the ground (m); the ground is at y = 0.
        own: False for a vine of a row behind, which is background.
    """

    def kind(of: int) -> int:
        return of if own else BACKGROUND

    def direction() -> Floats:
        free = 1.0 - wood.upright
        out: Floats = np.array(
            [
                wood.lean * free + rng.normal(0.0, 0.15 + 0.9 * free),
                1.0 - 0.6 * free * rng.random(),
                rng.normal(0.0, 0.15 + 0.4 * free),
            ]
        )
        return out / np.linalg.norm(out)

    thick = float(rng.choice([rng.uniform(0.012, 0.04), rng.uniform(0.03, 0.065)], p=[0.6, 0.4]))
    base = np.array([x + rng.normal(0.0, rng.choice([0.08, 0.3], p=[0.7, 0.3])), -0.02, z + rng.normal(0.0, 0.05)])
    head = np.array([x, height - rng.uniform(0.02, 0.12), z])
    t = np.linspace(0.0, 1.0, max(5, int(height / 0.03)))[:, None]
    trunk = base + (head - base) * t + np.cumsum(rng.normal(0.0, 0.006, (len(t), 3)), axis=0) * (1.0 - t)
    bark = _tinted(rng, wood.bark, 0.15)
    rough = float(rng.uniform(0.2, 0.9))
    radii = _rough(
        rng, thick * np.interp(t[:, 0], [0.0, 0.15, 0.85, 1.0], [1.3, 1.0, 0.9, rng.uniform(0.9, 1.6)]), 0.10
    )
    _add_old_wood(rng, tubes, trunk, radii, kind(TRUNK), bark, rough)
    # Old heads are lumps of many years' cuts.
    for _ in range(int(rng.integers(0, 8))):
        lump = trunk[-1] + rng.normal(0.0, 0.6 * thick, (2, 3))
        tubes.add(lump, thick * rng.uniform(0.5, 1.3, 2), kind(TRUNK), _tinted(rng, bark, 0.25), BARK, rough)
    system = rng.choice(["cordon", "guyot", "head"], p=[0.65, 0.2, 0.15])
    for side in (-1.0, 1.0) if rng.random() < 0.7 else (float(rng.choice([-1.0, 1.0])),):
        if system == "head":
            for _ in range(int(rng.integers(1, 4))):
                arm = path(
                    rng,
                    trunk[-1],
                    np.array([side * rng.uniform(0.3, 1.5), 1.0, rng.normal(0.0, 0.5)]),
                    rng.uniform(0.05, 0.3),
                    0.0,
                    2.0,
                )
                tubes.add(arm, _rough(rng, np.linspace(0.016, 0.009, len(arm)), 0.08), kind(CORDON), bark, BARK, rough)
                for _ in range(int(rng.integers(1, 4))):
                    grow_cane(rng, tubes, wood, arm[-1], direction(), own)
            continue
        length = float(rng.uniform(0.4, 1.2))
        arm = path(
            rng, trunk[-1], np.array([side * rng.uniform(0.5, 2.0), rng.uniform(0.3, 1.5), 0.0]), length, 0.0, 1.2
        )
        level = height + float(rng.uniform(-0.02, 0.05))
        settle = np.clip(np.abs(arm[:, 0] - x) / rng.uniform(0.08, 0.25), 0.0, 1.0)
        arm[:, 1] += (level - arm[:, 1]) * settle
        arm[:, 1] += np.interp(
            np.arange(len(arm)),
            np.arange(0, len(arm) + 12, 12),
            rng.normal(0.0, 0.012, len(np.arange(0, len(arm) + 12, 12))),
        )
        arm[:, 0] = x + side * np.maximum.accumulate(np.abs(arm[:, 0] - x))
        guyot = system == "guyot"
        girth = wood.radius * 1.15 if guyot else float(rng.uniform(0.008, 0.020))
        radii = np.linspace(girth * (1.0 if guyot else 1.2), girth * 0.7, len(arm))
        color = _tinted(rng, wood.cane if guyot else bark, 0.1)
        tubes.add(
            arm,
            _rough(rng, radii, 0.03 if guyot else 0.07),
            kind(CORDON),
            color,
            SMOOTH if guyot else BARK,
            rough * (0.5 if guyot else 1.0),
        )
        spacing = float(rng.uniform(0.07, 0.2))
        for at in np.arange(0.06, length, spacing):
            here = arm[min(int((at + rng.normal(0.0, 0.02)) / _STEP), len(arm) - 1)]
            up = direction()
            if guyot:
                if rng.random() < 0.85:
                    grow_cane(rng, tubes, wood, here, up, own)
                continue
            if rng.random() < 0.12:
                knob = here + np.array([0.0, rng.uniform(0.008, 0.03), rng.normal(0.0, 0.01)])
                tubes.add(
                    np.stack([here, knob]),
                    np.array([0.010, 0.008]),
                    kind(OLD_CUT),
                    bark * rng.uniform(0.6, 1.4),
                    BARK,
                    rough,
                )
                continue
            stub = path(rng, here, up + rng.normal(0.0, 0.3, 3), rng.uniform(0.02, 0.08), 0.0, 1.5, 0.008)
            girth_2 = float(rng.uniform(0.0045, 0.010))
            tubes.add(
                stub,
                _rough(rng, np.full(len(stub), girth_2), 0.08),
                kind(SPUR),
                _tinted(rng, (bark + wood.cane) / 2.0, 0.2),
                BARK,
                rough,
            )
            for _ in range(int(rng.choice([0, 1, 2, 3], p=[0.06, 0.4, 0.4, 0.14]))):
                from_ = stub[int(rng.integers(len(stub) // 2, len(stub)))]
                grow_cane(rng, tubes, wood, from_, up + rng.normal(0.0, 0.35, 3), own)


def add_brush(rng: np.random.Generator, tubes: Tubes, wood: Wood, z: float, height: float, wide: float) -> None:
    """Append the canes of a far row without its vines, as background: they are drawn with few, long steps."""
    for _ in range(int(rng.integers(20, 120))):
        start = np.array([rng.uniform(-wide, wide), height + rng.normal(0.0, 0.05), z + rng.normal(0.0, 0.1)])
        toward = np.array([wood.lean + rng.normal(0.0, 0.6), 1.0, rng.normal(0.0, 0.3)])
        toward /= np.linalg.norm(toward)
        cane = path(rng, start, toward, wood.length * rng.uniform(0.5, 1.2), wood.droop, 0.6, 0.1)
        radii = np.linspace(wood.radius, wood.radius / 2.0, len(cane))
        tubes.add(cane, radii, BACKGROUND, _tinted(rng, wood.cane, 0.2))


def add_trellis(rng: np.random.Generator, tubes: Tubes, z: float, height: float, wide: float, own: bool) -> None:
    """Append posts, wires, hose, ties and stakes of a row."""

    def kind(of: int) -> int:
        return of if own else BACKGROUND

    metal = np.array([150.0, 160.0, 172.0]) * rng.uniform(0.5, 1.2)
    for level in np.cumsum(rng.uniform(0.1, 0.45, int(rng.integers(0, 6)))) + height - rng.uniform(0.0, 0.1):
        x = np.linspace(-wide, wide, 40)
        sag = rng.uniform(0.0, 0.02) * np.cos(x * rng.uniform(1.0, 3.0)) + rng.normal(0.0, 0.02) * x
        wire = np.column_stack([x, level + sag, np.full(40, z + rng.normal(0.0, 0.02))])
        tubes.add(wire, np.full(40, rng.uniform(0.0008, 0.002)), kind(WIRE), _tinted(rng, metal, 0.4), METAL, 0.1)
    if rng.random() < 0.6:
        x = np.linspace(-wide, wide, 60)
        hang = rng.uniform(0.0, 0.04) * np.abs(np.sin(x * rng.uniform(1.0, 4.0)))
        up = height + rng.choice([rng.uniform(-0.5, -0.05), rng.normal(0.0, 0.02)])
        hose = np.column_stack([x, up - hang, np.full(60, z + rng.normal(0.0, 0.03))])
        gray = np.full(3, rng.choice([25.0, 35.0, 60.0, 110.0])) * np.exp(rng.normal(0.0, 0.1, 3))
        tubes.add(hose, np.full(60, rng.uniform(0.006, 0.011)), kind(HOSE), gray, PLASTIC, 0.05)
        for _ in range(int(rng.integers(0, 5))):
            at = hose[int(rng.integers(59))]
            tubes.add(
                np.stack([at, at + [rng.normal(0, 0.03), rng.uniform(-0.03, 0.03), 0.0]]),
                np.full(2, 0.01),
                kind(HOSE),
                gray,
                PLASTIC,
            )
    for _ in range(int(rng.choice(5, p=[0.25, 0.3, 0.2, 0.15, 0.1]))):
        at_x = float(rng.uniform(-wide, wide) * 0.35)
        style = rng.choice(["steel", "wood", "stake", "concrete"], p=[0.35, 0.3, 0.25, 0.1])
        radius = {
            "steel": rng.uniform(0.015, 0.04),
            "wood": rng.uniform(0.03, 0.06),
            "stake": rng.uniform(0.004, 0.012),
            "concrete": 0.05,
        }[style]
        color = {
            "steel": metal,
            "wood": np.array([130.0, 112.0, 90.0]) * rng.uniform(0.4, 1.4),
            "stake": np.array(rng.choice([[110, 70, 50], [60, 60, 62], [170, 150, 110], [60, 90, 60]], axis=0), float),
            "concrete": np.array([170.0, 166.0, 158.0]),
        }[style]
        # Some stand between the camera and the vines.
        at_z = z * float(rng.choice([1.0, rng.uniform(0.6, 1.0)])) + rng.normal(0.0, 0.06)
        top = np.array([at_x + rng.normal(0.0, 0.15), rng.uniform(0.5, 2.3), at_z + rng.normal(0.0, 0.1)])
        foot = np.array([at_x, -0.1, at_z])
        points = foot + (top - foot) * np.linspace(0.0, 1.0, 30)[:, None]
        surface = {"steel": METAL, "wood": BARK, "stake": SMOOTH, "concrete": SMOOTH}[style]
        rough = float(rng.uniform(0.02, 0.12) if style == "steel" else rng.uniform(0.05, 0.4))
        tubes.add(points, np.full(30, radius), kind(POST), color, surface, rough)
    for _ in range(int(rng.integers(0, 6))):
        at = np.array([rng.uniform(-wide, wide) * 0.7, height + rng.normal(0.0, 0.3), z])
        ring = at + np.column_stack(
            [0.015 * np.cos(np.linspace(0, 6, 8)), 0.012 * np.sin(np.linspace(0, 6, 8)), np.full(8, -0.012)]
        )
        color = np.array(
            rng.choice([[60, 120, 70], [210, 210, 200], [40, 40, 40], [190, 150, 90], [70, 90, 170]], axis=0), float
        )
        tubes.add(ring, np.full(8, rng.uniform(0.0008, 0.002)), kind(WIRE), color, PLASTIC)


def add_clutter(rng: np.random.Generator, tubes: Tubes, z: float, wood: Wood) -> None:
    """Append dead leaves and grapes, grass, and cut canes on the ground."""
    for _ in range(int(rng.choice([0, int(rng.integers(0, 25))]))):
        at = np.array([rng.uniform(-1.2, 1.2), rng.uniform(0.0, 1.6), z + rng.normal(0.0, 0.15)])
        color = np.array([110.0, 70.0, 42.0]) * np.exp(rng.normal(0.0, [0.35, 0.3, 0.3]))
        size, aside = rng.uniform(0.006, 0.03), rng.normal(size=3)
        leaf = at + np.linspace(-1.0, 1.0, 5)[:, None] * aside / np.linalg.norm(aside) * size * 1.3
        tubes.add(
            leaf, size * np.array([0.2, 0.8, 1.0, 0.7, 0.1]) * rng.uniform(0.3, 1.0), BACKGROUND, color, LEAF, 0.4
        )
    if rng.random() < 0.4:
        green = np.array([90.0, 120.0, 50.0]) * np.exp(rng.normal(0.0, [0.3, 0.2, 0.3]))
        for _ in range(int(rng.integers(10, 120))):
            at = np.array([rng.uniform(-1.3, 1.3), 0.0, z + rng.uniform(-0.6, 1.5)])
            blade = path(
                rng,
                at,
                np.array([rng.normal(0, 0.4), 1.0, rng.normal(0, 0.4)]),
                rng.uniform(0.03, 0.25),
                3.0,
                1.0,
                0.025,
            )
            tubes.add(blade, np.linspace(0.0025, 0.0008, len(blade)), GROUND, _tinted(rng, green, 0.2), LEAF)
    for _ in range(int(rng.choice([0, int(rng.integers(0, 30))]))):
        at = np.array([rng.uniform(-1.5, 1.5), rng.uniform(0.005, 0.02), z + rng.uniform(-0.7, 2.5)])
        aside = np.array([rng.normal(), 0.02, rng.normal()])
        twig = path(rng, at, aside / np.linalg.norm(aside), rng.uniform(0.1, 0.8), 0.0, 0.4, 0.03)
        twig[:, 1] = np.abs(twig[:, 1])
        tubes.add(twig, np.linspace(wood.radius, wood.radius / 2, len(twig)), GROUND, _tinted(rng, wood.cane, 0.3))
