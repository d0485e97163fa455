"""When the camera takes a picture, and the posture that belongs to it."""

from bridge.picture import Picture
from rolling_panda import messages as m
from rolling_panda.camera_messages import CameraFrame
from rolling_panda.look_messages import PictureRequest

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
        self._waiting: tuple[m.Header, m.PlanarPose, m.Actuated, PictureRequest | None] | None = None
        self._wanted: PictureRequest | None = None
        self._taken = (-1, -1)
        self._sequence = 0

    def wake(self, ticks: int) -> None:
        """Something moves or has changed."""
        self._awake_until = ticks + self._awake

    def want(self, request: PictureRequest) -> None:
        """A picture is wanted as soon as the camera is free; a request that was done or overtaken changes nothing."""
        if (request.epoch, request.number) > self._taken:
            self._wanted, self._taken = request, (request.epoch, request.number)

    def due(self, ticks: int) -> bool:
        """Whether to expose now; never while a picture is on its way."""
        period = self._moving if ticks < self._awake_until else self._resting
        return self._waiting is None and (self._wanted is not None or ticks - self._last >= period)

    def exposed(self, ticks: int, header: m.Header, base: m.PlanarPose, position: m.Actuated) -> None:
        """An exposure begins in this posture."""
        self._last = ticks
        self._waiting = (header, base, position, self._wanted)
        self._wanted = None

    def frame(self, picture: Picture) -> CameraFrame | None:
        """The message for the picture of the last exposure; None for one that nobody asked for."""
        if self._waiting is None:
            return None
        header, base, position, wanted = self._waiting
        self._waiting = None
        self._sequence += 1
        return CameraFrame(
            header=header,
            sequence=self._sequence,
            intrinsics=picture.intrinsics,
            base=base,
            position=position,
            color_jpeg=picture.color_jpeg,
            depth_zlib=picture.depth_zlib,
            depth_unit=picture.depth_unit,
            labels_zlib=picture.labels_zlib,
            point_id="" if wanted is None else wanted.point_id,
            number=0 if wanted is None else wanted.number,
        )
