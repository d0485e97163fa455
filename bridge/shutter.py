"""When the camera takes a picture, and the posture that belongs to it."""

from bridge.picture import Picture
from rolling_panda import messages as m

# After motion or a cut the plant model wants some more pictures before the camera rests (s).
_AWAKE_S = 4.0


class Shutter:
    """Pictures at the moving rate while awake, at the resting rate otherwise; one at a time. Counts in ticks."""

    def __init__(self, moving_hz: float, resting_hz: float, tick_s: float) -> None:
        """Start awake, with the first picture due at once."""
        self._moving = round(1 / moving_hz / tick_s)
        self._resting = round(1 / resting_hz / tick_s)
        self._awake = round(_AWAKE_S / tick_s)
        self._awake_until = self._awake
        self._last = -self._resting
        self._waiting: tuple[m.Header, m.PlanarPose, m.Actuated] | None = None
        self._sequence = 0

    def wake(self, ticks: int) -> None:
        """Something moves or has changed."""
        self._awake_until = ticks + self._awake

    def due(self, ticks: int) -> bool:
        """Whether to expose now; never while a picture is on its way."""
        period = self._moving if ticks < self._awake_until else self._resting
        return self._waiting is None and ticks - self._last >= period

    def exposed(self, ticks: int, header: m.Header, base: m.PlanarPose, position: m.Actuated) -> None:
        """An exposure begins in this posture."""
        self._last = ticks
        self._waiting = (header, base, position)

    def frame(self, picture: Picture) -> m.CameraFrame | None:
        """The message for the picture of the last exposure; None for one that nobody asked for."""
        if self._waiting is None:
            return None
        header, base, position = self._waiting
        self._waiting = None
        self._sequence += 1
        return m.CameraFrame(
            header=header,
            sequence=self._sequence,
            intrinsics=picture.intrinsics,
            base=base,
            position=position,
            color_jpeg=picture.color_jpeg,
            depth_zlib=picture.depth_zlib,
            depth_unit=picture.depth_unit,
            labels_zlib=picture.labels_zlib,
        )
