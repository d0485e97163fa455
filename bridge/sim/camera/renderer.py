"""The simulated eye-in-hand camera: colour, depth and class labels of a row by ray casting."""

from dataclasses import dataclass

import numpy as np

from bridge.core.picture import Picture, encode_picture
from bridge.sim.camera.board import StandingBoard
from bridge.sim.camera.config import CameraConfig
from bridge.sim.camera.light import Light, blurred
from bridge.sim.camera.mesh import Floats, Indices, RodMesh
from bridge.sim.camera.palette import Bytes, Palette
from bridge.sim.camera.sensors import color_sensor, depth_sensor, miscalibration
from bridge.sim.vineyard.row import Array, Row
from bridge.sim.world.config import CALM, WorldConfig
from bridge.sim.world.errors import draw_errors
from bridge.sim.world.wind import Wind
from rolling_panda.messages.types import WOOD_CLASSES

_GROUND = WOOD_CLASSES.index("ground")
#: A film of water does not darken these.
_TIGHT = [WOOD_CLASSES.index("wire"), WOOD_CLASSES.index("hose")]


@dataclass(frozen=True)
class RgbdImage:
    """One frame; all three images are aligned.

    Attributes:
        color: H×W×3, RGB.
        depth: H×W, measured along the optical axis (m); 0 = invalid.
        labels: H×W, true class, index in `WOOD_CLASSES`; the rows behind and wood on the ground are background.
        rods: H×W, index in `Row.rods`, -1 elsewhere; ground truth for benchmarks.
    """

    color: Bytes
    depth: Floats
    labels: Bytes
    rods: Indices


class Camera:
    """Renders a row from a camera pose. Caches the mesh of the last row; not thread-safe."""

    def __init__(self, config: CameraConfig | None = None, seed: int = 0, world: WorldConfig = CALM) -> None:
        """Prepare the rays.

        Args:
            config: Image size, lens and noise.
            seed: Of noise and colours; not negative.
            world: Disturbances: where the camera is on the tool, its lens, and light.
        """
        self.config = config or CameraConfig()
        self.intrinsics = self.config.intrinsics()
        self._seed = seed
        self._palette = Palette(seed, self.config.appearance, clear=world.sunlight > 0.0)
        shown = world.sunlight > 0.0 or world.wet > 0.0
        self._light = Light(world, self._palette.look, seed) if shown else None
        if self._light is not None:
            self._palette.look = self._light.look
        self._exposure = world.exposure
        errors = draw_errors(world, seed)
        self._turn = (errors.hand_eye @ miscalibration(self.config.calibration_angle, seed)).astype(np.float32)
        self._shift, self._thin_lost = errors.hand_eye_shift, world.depth_lost
        k = self.intrinsics
        fx, fy = self._focal = k.fx * errors.focal, k.fy * errors.focal
        u, v = np.meshgrid((np.arange(k.width) - k.cx) / fx, (np.arange(k.height) - k.cy) / fy)
        # Rays have length 1 along the optical axis, so that their distances are depths.
        self._rays = np.stack([u, v, np.ones_like(u)], -1).reshape(-1, 3).astype(np.float32)
        self._lengths = np.linalg.norm(self._rays, axis=1)
        self._board = StandingBoard(seed) if self.config.board else None
        self._row: Row | None = None
        self._mesh = RodMesh(Row(()))

    def render(self, row: Row, T_world_camera: Array, frame: int = 0, velocity: Array | None = None) -> RgbdImage:
        """Colour, depth and labels of `row` and of the ground z = 0.

        Args:
            row: The row.
            T_world_camera: Homogeneous pose (4×4) of the optical frame: z forward, x right, y down.
            frame: Number of the frame; the same number gives the same noise.
            velocity: Of the camera, linear (m/s) and angular (rad/s) in the world's axes (6); None at rest.
        """
        if row is not self._row:
            self._mesh, self._row = RodMesh(row), row
        origin = (T_world_camera[:3, 3] + T_world_camera[:3, :3] @ self._shift).astype(np.float32)
        turn: Floats = T_world_camera[:3, :3].astype(np.float32) @ self._turn
        rays: Floats = self._rays @ turn.T
        hits = self._mesh.first_hits(np.broadcast_to(origin, rays.shape).copy(), rays)
        depth = hits.distance
        down = rays[:, 2] < -1e-6
        floor = np.where(down, -origin[2] / np.where(down, rays[:, 2], np.float32(-1.0)), np.float32(np.inf))
        on_ground = floor < depth
        depth = np.where(on_ground, floor, depth).astype(np.float32)
        on_rod = (hits.rod >= 0) & ~on_ground
        labels = np.zeros(len(rays), np.uint8)
        labels[on_ground] = _GROUND
        own = on_rod & (hits.rod < self._mesh.reachable)
        labels[own] = self._mesh.kind[hits.rod[own]]
        color = np.empty((len(rays), 3), np.float32)
        color[on_ground] = self._ground_color(origin, rays[on_ground], depth[on_ground])
        rods = hits.rod[on_rod]
        points = origin + rays[on_rod] * depth[on_rod, None]
        color[on_rod] = self._rod_color(rods, points, origin)
        sky = ~on_ground & ~on_rod
        color[sky] = self._sky_color(rays[sky], self._lengths[sky])
        if self._board is not None:
            on_board = self._board.draw(origin, rays, self.intrinsics.width, depth, color)
            labels[on_board], own[on_board], on_rod[on_board] = 0, False, False
        color = self._exposed(color, depth, origin, rays, turn, velocity)
        shape = (self.intrinsics.height, self.intrinsics.width)
        rng = np.random.default_rng([self._seed, frame])
        pixel_width = np.full(len(rays), np.inf, np.float32)
        rods = hits.rod[on_rod]
        pixel_width[on_rod] = self._mesh.width[rods] * np.float32(self.intrinsics.fx) / depth[on_rod]
        return RgbdImage(
            color_sensor(self.config, color.reshape(*shape, 3), rng.spawn(1)[0]),
            depth_sensor(
                self.config,
                self.intrinsics.fx,
                depth.reshape(shape),
                pixel_width.reshape(shape),
                rng,
                self._thin_lost,
            ),
            labels.reshape(shape),
            np.where(own, hits.rod, np.int32(-1)).reshape(shape),
        )

    def _ground_color(self, origin: Floats, rays: Floats, depth: Floats) -> Floats:
        x, y = origin[0] + rays[:, 0] * depth, origin[1] + rays[:, 1] * depth
        if self._light is None or not self._light.low:
            return self._palette.ground(x, y, depth)
        points = np.stack([x, y, np.zeros_like(x)], 1)
        cosine = self._light.sunlit_ground(self._mesh, points, depth)
        return self._palette.ground(x, y, depth, self._light.factor(cosine))

    def _sky_color(self, rays: Floats, lengths: Floats) -> Floats:
        if self._light is None or not self._light.low:
            return self._palette.sky(rays[:, 2] / lengths)
        return self._light.sky(self._palette, rays / lengths[:, None])

    def _exposed(
        self, color: Floats, depth: Floats, origin: Floats, rays: Floats, turn: Floats, velocity: Array | None
    ) -> Floats:
        """What motion and lens make of true colours (N×3)."""
        moves = velocity is not None and self._exposure > 0.0
        low = self._light is not None and self._light.low
        if not moves and not low:
            return color
        bright = (color / np.float32(255.0)) ** 2
        if velocity is not None and moves:
            shape = (self.intrinsics.height, self.intrinsics.width)
            moved = (self._exposure * velocity.reshape(2, 3)).astype(np.float32) @ turn
            across = self._rays.reshape(*shape, 3)
            smeared = blurred(bright.reshape(*shape, 3), depth.reshape(shape), self._focal, across, moved.ravel())
            bright = smeared.reshape(-1, 3)
        if self._light is not None and low:
            self._light.through_lens(bright, rays / self._lengths[:, None], turn[:, 2], origin, self._mesh)
        shown: Floats = 255.0 * np.sqrt(bright)
        return shown

    def _rod_color(self, rods: "np.ndarray[tuple[int], np.dtype[np.int32]]", points: Floats, origin: Floats) -> Floats:
        mesh = self._mesh
        offset, axis = points - mesh.start[rods], mesh.axis[rods]
        along = np.einsum("ij,ij->i", offset, axis)
        normal = offset - along[:, None] * axis
        normal /= np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-9)
        kind, light = mesh.kind[rods], self._light
        if light is None:
            return self._palette.wood(rods, kind, along, normal)
        cosine = light.sunlit(mesh, points, normal)
        color = self._palette.wood(rods, kind, along, normal, light.factor(cosine) if light.low else None)
        if light.wet > 0.0:
            view = origin - points
            view /= np.linalg.norm(view, axis=1, keepdims=True)
            wet = self._palette.wet(light.wet, rods, along)
            light.watered(color, wet, ~np.isin(kind, _TIGHT), cosine, normal, view)
        return color


class InlineRenderer:
    """Renders inside `expose`, so that the same calls give the same pictures."""

    def __init__(self, config: CameraConfig, seed: int, world: WorldConfig = CALM) -> None:
        """Prepare the camera."""
        self._camera = Camera(config, seed, world)
        self._sway, self._seed = world.sway, seed
        self._wind: Wind | None = None
        self._frame = 0
        self._picture: Picture | None = None

    def expose(self, row: Row, T_world_camera: Array, at: float, velocity: Array) -> bool:
        """Render and encode now."""
        if self._sway > 0.0:
            # The first row that is seen is not cut yet.
            self._wind = self._wind or Wind(row, self._sway, self._seed)
            row = self._wind.blown(row, at)
        image = self._camera.render(row, T_world_camera, self._frame, velocity)
        self._frame += 1
        self._picture = encode_picture(self._camera.intrinsics, image.color, image.depth, image.labels)
        return True

    def ready(self) -> Picture | None:
        """The rendered picture, once."""
        picture, self._picture = self._picture, None
        return picture

    def close(self) -> None:
        """Nothing to close."""
