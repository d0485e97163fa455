"""Pictures for a person who decides about cuts: of each spur a part of a camera image, with the cuts drawn on it.

The image of a spur changes when a clearly better view comes, when wood of the spur is severed, or when a cut lies
outside it. The drawing changes with the image and with the revisions of the spur's points, so that noise sends nothing.
"""

import dataclasses
import hashlib
import io
from collections.abc import Iterable, Mapping, Sequence
from itertools import islice

import numpy as np
from PIL import Image

from perception.arrays import Array, interpolate
from perception.plant.map import KnownSpur, PlantMap
from perception.plant.model import Cane, Plant
from perception.plant.numbering import SpurNumber
from perception.segmentation.frame import CorruptFrameError, View
from perception.tracking.camera_rays import Ray
from perception.tracking.old_canes import NO_OLD_CANES
from rolling_panda.messages.perception import (
    PICTURE_BYTES,
    AxisPixel,
    DrawnCut,
    Pixel,
    PruningPoint,
    SpurDrawing,
    SpurPicture,
)

#: Smallest and largest size of a picture (px), at the resolution of the camera image. Their ratio is 4:3.
_MIN_WIDTH, _MAX_WIDTH, _RATIO = 240, 640, 4 / 3
#: Length of cane from its base that the picture shows (m), and the margin around it (share of the width).
_SHOWN_LENGTH, _MARGIN = 0.22, 0.12
#: Length beyond a cut that is shown (m): of what falls.
_BEYOND = 0.06
_JPEG_QUALITIES = (92, 85, 70, 50)
#: A view replaces another one if its distance, with the offset from the centre, is smaller by this factor.
_BETTER = 0.8
#: Images encoded after one frame: at most 10 ms each.
_MAX_ENCODED = 3
#: Spurs with a picture: those of a row of 100 m.
_MAX_SPURS = 1000
#: Largest distance of a cut from the axis of its cane (m).
_ON_CANE = 0.015
#: Length of stub drawn on each side of a cut, and of a cane whose axis is unknown (m).
_STUB = 0.03
#: Spacing of the drawn axis (m).
_SPACING = 0.01
_NO_DEPTH = np.zeros((0, 0), np.float32)


@dataclasses.dataclass(frozen=True)
class _Window:
    """Part of a view: left, top, width and height (px of the camera image)."""

    left: int
    top: int
    width: int
    height: int

    def shows(self, pixels: Array) -> bool:
        """Whether all of some pixels (N×3, the third is the depth) lie in it."""
        if np.any(pixels[:, 2] <= 0.0):
            return False
        low, size = np.array((self.left, self.top)), np.array((self.width, self.height))
        return bool(np.all((pixels[:, :2] >= low) & (pixels[:, :2] <= low + size - 1)))


@dataclasses.dataclass(frozen=True)
class _Image:
    """An encoded part of a view; `scale` is its pixels per pixel of the camera image."""

    view: View
    window: _Window
    scale: float
    jpeg: bytes

    def pixels(self, points: Array) -> list[Pixel]:
        """Where points (N×3, m, odom) are in it, from its top left corner (px). Those behind the camera are omitted."""
        found = self.view.pixels(points)
        corner = np.array((self.window.left, self.window.top)) - 0.5
        at = (found[found[:, 2] > 0.0, :2] - corner) * self.scale
        return [(round(float(u), 1), round(float(v), 1)) for u, v in at]


@dataclasses.dataclass(frozen=True)
class _Wood:
    """The wood that a cut goes through: axis (N×3, m, odom), arc length from the cut (N, m), nodes by arc length."""

    axis: Array
    arc: Array
    nodes: tuple[float, ...] = ()
    also_falls: tuple[Array, ...] = ()


class SpurPictures:
    """At most one picture for each spur."""

    def __init__(self) -> None:
        """Start without pictures."""
        self._views: dict[SpurNumber, tuple[float, View]] = {}
        self._images: dict[SpurNumber, _Image] = {}
        self._drawn: dict[SpurNumber, tuple[object, SpurPicture]] = {}

    def add(self, view: View, plant: Plant, numbers: tuple[SpurNumber, ...]) -> None:
        """Keep the image for those spurs that it shows clearly better than the image so far.

        Args:
            view: The frame.
            plant: Plant of the frame.
            numbers: Of its spurs, in their order.
        """
        image = dataclasses.replace(view, depth=_NO_DEPTH, labels=None)
        k = view.intrinsics
        for spur, number in zip(plant.spurs, numbers, strict=True):
            u, v, z = view.pixels(spur.position)[0]
            score = float(z * (1.0 + np.hypot(u - k.width / 2, v - k.height / 2) / (k.width / 2)))
            known = self._views.get(number)
            if z > 0.0 and (known is None or score < _BETTER * known[0]):
                self._views[number] = (score, image)
        for number in list(islice(self._views, max(0, len(self._views) - _MAX_SPURS))):
            self.forget(number)

    def forget(self, number: SpurNumber) -> None:
        """Take the next image of a spur, since its wood has changed. Its picture stays until then."""
        self._views.pop(number, None)

    def update(
        self,
        points: Sequence[PruningPoint],
        sites: Iterable[SpurNumber],
        plant_map: PlantMap,
        old_canes: Mapping[SpurNumber, Cane] = NO_OLD_CANES,
    ) -> tuple[SpurPicture, ...]:
        """The pictures of all spurs with a point and of all undecided ones, those seen so far.

        Args:
            points: All points.
            sites: Undecided spurs.
            plant_map: The vines.
            old_canes: Last year's canes by the spur beside them.
        """
        cuts: dict[SpurNumber, list[PruningPoint]] = {number: [] for number in sites}
        for point in points:
            cuts.setdefault(SpurNumber(point.vine, point.spur), []).append(point)
        spurs = {spur.number: spur for spur in plant_map.spurs if spur.number in cuts}
        encoded = 0
        for number, spur in spurs.items():
            image = self._images.get(number)
            view = self._views[number][1] if number in self._views else image.view if image else None
            if view is None:
                continue
            here = [point for point in cuts[number] if _in_view(view, point)]
            if (image is None or image.view is not view or not _shows(image, here)) and encoded < _MAX_ENCODED:
                encoded += 1
                try:
                    image = self._images[number] = _encode(view, _window(view, spur, here))
                except CorruptFrameError:
                    self.forget(number)
            if image is None:
                continue
            key = (image.jpeg, len(spur.canes), tuple((point.point_id, point.revision) for point in here))
            if number not in self._drawn or self._drawn[number][0] != key:
                self._drawn[number] = (
                    key,
                    SpurPicture(drawing=_draw(image, spur, here, old_canes.get(number)), jpeg=image.jpeg),
                )
        self._drawn = {number: drawn for number, drawn in self._drawn.items() if number in cuts}
        return tuple(picture for _, picture in self._drawn.values())

    def ray(self, sequence: int, u: float, v: float) -> Ray | None:
        """The ray through a place in the camera image of a picture; arguments as of `CameraRays.ray`."""
        for image in self._images.values():
            if image.view.sequence == sequence:
                k = image.view.intrinsics
                along = image.view.points([v * k.height - 0.5], [u * k.width - 0.5], [1.0])[0] - image.view.t
                return Ray(image.view.t, along / np.linalg.norm(along))
        return None


def _in_view(view: View, point: PruningPoint) -> bool:
    k = view.intrinsics
    return _Window(0, 0, k.width, k.height).shows(view.pixels(np.array(point.position)))


def _shows(image: _Image, points: Sequence[PruningPoint]) -> bool:
    return all(image.window.shows(image.view.pixels(np.array(point.position))) for point in points)


def _window(view: View, spur: KnownSpur, points: Sequence[PruningPoint]) -> _Window:
    """The part of a view that shows a spur, the beginning of its canes and its cuts."""
    beyond = [np.array(point.position) + _BEYOND * np.array(point.tangent) for point in points]
    content = [
        spur.position.mean[None],
        *(np.array([point.position]) for point in points),
        *(at[None] for at in beyond),
    ]
    if spur.best.axis is not None:
        content.append(spur.best.axis)
    content += [cane.best.axis[cane.best.arc <= _SHOWN_LENGTH] for cane in spur.canes]
    pixels = view.pixels(np.concatenate(content))
    pixels = pixels[pixels[:, 2] > 0.0, :2]
    low, high = pixels.min(axis=0), pixels.max(axis=0)
    k = view.intrinsics
    largest = min(k.width, k.height * _RATIO)
    margins = 1.0 + 2.0 * _MARGIN
    width = float(np.clip(margins * max(high[0] - low[0], (high[1] - low[1]) * _RATIO), _MIN_WIDTH, largest))
    size = round(min(width, largest)), round(min(width, largest) / _RATIO)
    corner = np.clip((low + high) / 2 - np.array(size) / 2, 0.0, np.array((k.width, k.height)) - size)
    return _Window(int(corner[0]), int(corner[1]), *size)


def _encode(view: View, window: _Window) -> _Image:
    box = window.left, window.top, window.left + window.width, window.top + window.height
    part = Image.fromarray(view.color()).crop(box)
    scale = min(1.0, _MAX_WIDTH / window.width)
    while True:
        size = round(window.width * scale), round(window.height * scale)
        scaled = part if size == part.size else part.resize(size, Image.Resampling.LANCZOS)
        for quality in _JPEG_QUALITIES:
            out = io.BytesIO()
            scaled.save(out, "JPEG", quality=quality)
            if out.tell() <= PICTURE_BYTES:
                return _Image(view, window, size[0] / window.width, out.getvalue())
        scale /= 2.0


def _draw(image: _Image, spur: KnownSpur, points: Sequence[PruningPoint], old_cane: Cane | None) -> SpurDrawing:
    k, window = image.view.intrinsics, image.window
    return SpurDrawing(
        vine=spur.number.vine,
        spur=spur.number.spur,
        image=hashlib.sha256(image.jpeg).hexdigest()[:32],
        sequence=image.view.sequence,
        frame=(k.width, k.height),
        window=(window.left, window.top, window.width, window.height),
        size=(round(window.width * image.scale), round(window.height * image.scale)),
        canes=tuple(tuple(image.pixels(_sampled(cane.as_cane())[0])) for cane in spur.canes),
        cuts=tuple(_draw_cut(image, spur, point, old_cane) for point in points),
    )


def _draw_cut(image: _Image, spur: KnownSpur, point: PruningPoint, old_cane: Cane | None) -> DrawnCut:
    position = np.array(point.position)
    wood = _wood(spur, point, old_cane)
    _, _, z = image.view.pixels(position)[0]
    focal = image.view.intrinsics.fx
    # The axis goes through the cut, which is a mean over the frames while the axis is of one.
    shift = position - interpolate(np.zeros(1), wood.arc, wood.axis)[0]
    nodes = interpolate(np.array(wood.nodes), wood.arc, wood.axis) + shift if wood.nodes else np.zeros((0, 3))
    return DrawnCut(
        point_id=point.point_id,
        revision=point.revision,
        position=image.pixels(position)[0],
        axis=_with_arc(image, wood.axis + shift, wood.arc),
        nodes=_with_arc(image, nodes, np.array(wood.nodes)),
        falls=tuple(tuple(image.pixels(axis)) for axis in wood.also_falls),
        thickness=round(2.0 * point.radius * focal * image.scale / float(z), 1),
    )


def _with_arc(image: _Image, points: Array, arc: Array) -> tuple[AxisPixel, ...]:
    seen = image.view.pixels(points)[:, 2] > 0.0 if len(points) else np.zeros(0, bool)
    at = zip(image.pixels(points), arc[seen].tolist(), strict=True) if len(points) else ()
    return tuple((u, v, round(s, 4)) for (u, v), s in at)


def _wood(spur: KnownSpur, point: PruningPoint, old_cane: Cane | None) -> _Wood:
    position, tangent = np.array(point.position), np.array(point.tangent)
    if point.kind == "renewal cut":
        # The point's tangent is a mean over the frames; the stub's axis in a single one may be far off.
        canes = [cane.as_cane() for cane in spur.canes]
        beyond = {float((cane.base - position) @ tangent): cane for cane in canes}
        falling = {at: _sampled(cane)[0] for at, cane in beyond.items() if at > 0.0}
        ends = np.array([-_STUB, 0.0, max(falling, default=_STUB)])
        return _Wood(position + ends[:, None] * tangent, ends, also_falls=tuple(falling.values()))
    own = [known.as_cane() for known in spur.canes]
    if point.kind == "removal":
        own = [] if old_cane is None else [old_cane]
    near = [(_nearest(each, position), each) for each in own]
    (gap, arc), cane = min(near, key=lambda each: each[0][0], default=((np.inf, 0.0), None))
    if cane is None or gap > _ON_CANE:
        ends = np.array([-_STUB, _STUB])
        return _Wood(position + ends[:, None] * tangent, ends)
    axis, arcs = _sampled(cane)
    return _Wood(axis, arcs - arc, tuple(node.arc - arc for node in cane.nodes))


def _nearest(cane: Cane, position: Array) -> tuple[float, float]:
    """Distance of a cane's axis from a position (3, m, odom), and arc length there (m)."""
    arcs = np.arange(float(cane.arc[0]), cane.length, 0.001)
    if len(arcs) == 0:
        return float("inf"), 0.0
    distances = np.linalg.norm(interpolate(arcs, cane.arc, cane.axis) - position, axis=1)
    k = int(np.argmin(distances))
    return float(distances[k]), float(arcs[k])


def _sampled(cane: Cane) -> tuple[Array, Array]:
    """A cane's axis (K×3, m, odom) with its arc lengths (K, m)."""
    start = float(cane.arc[0])
    arcs = np.linspace(start, cane.length, max(2, round((cane.length - start) / _SPACING) + 1))
    return interpolate(arcs, cane.arc, cane.axis), arcs
