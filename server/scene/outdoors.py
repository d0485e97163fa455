"""What lies around robot and row: daylight, sky, soil, the robot's shadow on it, and the numbers of the vines."""

from collections.abc import Iterable

import numpy as np
import viser
from numpy.typing import NDArray

from rolling_panda.messages.page import PagePoint

_SKY_TOP, _SKY_HORIZON = np.array([112.0, 158.0, 206.0]), np.array([223.0, 231.0, 234.0])
#: Of bare soil, and of the grass that grows on it in patches.
_SOIL, _GRASS = np.array([136.0, 117.0, 94.0]), np.array([116.0, 120.0, 78.0])
#: Size of the soil with texture (m), pixels of a metre, and width of its edge, where it fades into plain soil (m).
_LENGTH, _WIDTH, _RESOLUTION, _EDGE = 48.0, 24.0, 24, 5.0
#: Length and width of the robot's shadow (m), and its pixels each way.
_SHADOW, _SHADOW_PX = (1.35, 1.05), 64
#: Height of a vine's number above the ground, and its distance from the row towards the robot (m).
_NUMBER_HEIGHT, _NUMBER_ASIDE = 0.12, 0.25


def draw_outdoors(scene: viser.SceneApi) -> None:
    """Draw light, sky and ground."""
    scene.world_axes.visible = False
    sky = _SKY_TOP + np.linspace(0.0, 1.0, 64)[:, None, None] ** 0.7 * (_SKY_HORIZON - _SKY_TOP)
    scene.set_background_image(np.repeat(sky, 4, axis=1).astype(np.uint8), format="png")
    # A hemisphere light: an environment map would cost twice as much to draw.
    scene.configure_environment_map(None)
    scene.configure_default_lights(enabled=False)
    scene.add_light_hemisphere("/light/sky", intensity=1.9, sky_color=(222, 232, 246), ground_color=(132, 120, 100))
    scene.add_light_directional("/light/sun", intensity=2.8, color=(255, 242, 222), position=(-3.0, -4.0, 6.0))
    # Far soil is the plane of the grid: one draw call instead of two that fill the screen.
    plain = tuple(int(value) for value in _SOIL)
    scene.add_grid(
        "/ground",
        width=160.0,
        height=160.0,
        position=(0.0, 0.0, -0.012),
        plane_color=plain,
        plane_opacity=1.0,
        cell_color=plain,
        section_color=plain,
        cell_size=20.0,
        section_size=20.0,
        cell_thickness=0.0,
        section_thickness=0.0,
        fade_distance=80.0,
        fade_strength=0.25,
        shadow_opacity=0.0,
    )
    scene.add_image(
        "/ground/soil", _soil(), _LENGTH, _WIDTH, format="jpeg", cast_shadow=False, receive_shadow=False,
        position=(0.3 * _LENGTH, 0.0, 0.006),
    )  # fmt: skip


def draw_shadow(scene: viser.SceneApi, parent: str) -> None:
    """Draw the shadow of the robot's base on the ground under the node `parent`."""
    across = np.linspace(-1.0, 1.0, _SHADOW_PX)
    away = (np.abs(across[:, None]) ** 4 + np.abs(across[None, :]) ** 4) ** 0.25
    image = np.zeros((_SHADOW_PX, _SHADOW_PX, 4), np.uint8)
    image[..., 3] = (150.0 * np.clip((1.0 - away) / 0.45, 0.0, 1.0)).astype(np.uint8)
    scene.add_image(
        f"{parent}/shadow", image, *_SHADOW, format="png", cast_shadow=False, receive_shadow=False,
        position=(0.0, 0.0, 0.004),
    )  # fmt: skip


class VineNumbers:
    """The number of each vine at its foot."""

    def __init__(self, scene: viser.SceneApi) -> None:
        """No vine has a number yet."""
        self._scene = scene
        self._drawn: dict[int, viser.LabelHandle] = {}
        self._places: dict[int, tuple[float, float]] = {}

    def show(self, points: Iterable[PagePoint], words: str = "{number}") -> None:
        """Number the vines that have points, in the middle of these; where it moves little it stays."""
        rows: dict[int, list[tuple[float, float]]] = {}
        for row in points:
            rows.setdefault(row.point.vine, []).append(row.point.position[:2])
        for number, places in rows.items():
            x, y = (float(value) for value in np.median(np.array(places), axis=0))
            at = self._places.get(number)
            if at is not None and abs(at[0] - x) < 0.1:
                continue
            self._places[number] = x, y
            position = (x, y - _NUMBER_ASIDE, _NUMBER_HEIGHT)
            if at is None:
                self._drawn[number] = self._scene.add_label(
                    f"/vines/{number}",
                    words.format(number=number),
                    position=position,
                    anchor="center-center",
                    font_screen_scale=1.4,
                )
            else:
                self._drawn[number].position = position
        for number in [each for each in self._drawn if each not in rows]:
            self._drawn.pop(number).remove()
            del self._places[number]


def _soil() -> NDArray[np.uint8]:
    """Colours of the soil (H×W×3): clods and stones of several sizes, patches of grass, a soft edge."""
    rng = np.random.default_rng(7)
    shape = round(_WIDTH * _RESOLUTION), round(_LENGTH * _RESOLUTION)
    frequency = np.hypot(np.fft.fftfreq(shape[0])[:, None], np.fft.rfftfreq(shape[1]))

    def patches(size: float) -> NDArray[np.float64]:
        # Gaussian blur by FFT: the server does without SciPy, which takes tens of megabytes.
        blur = np.exp(-2.0 * (np.pi * size * frequency) ** 2)
        rough = np.fft.irfft2(np.fft.rfft2(rng.standard_normal(shape)) * blur, shape)
        out: NDArray[np.float64] = rough / rough.std()
        return out

    grass = np.clip(0.5 + 0.6 * patches(22.0) + 0.25 * patches(3.0), 0.0, 1.0)[..., None]
    light = 1.0 + 0.045 * patches(0.7) + 0.05 * patches(2.5) + 0.04 * patches(12.0)
    colors = (_SOIL + 0.55 * grass * (_GRASS - _SOIL)) * light[..., None]
    # A see-through edge would show the sky.
    fade = [np.clip(np.minimum(np.arange(n), np.arange(n)[::-1]) / (_EDGE * _RESOLUTION), 0.0, 1.0) for n in shape]
    colors = _SOIL + np.minimum.outer(*fade)[..., None] * (colors - _SOIL)
    out: NDArray[np.uint8] = np.clip(colors, 0.0, 255.0).astype(np.uint8)
    return out
