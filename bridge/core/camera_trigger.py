"""Trigger of the camera, and the posture at each exposure."""

from collections import deque
from typing import NamedTuple

from bridge.core.picture import Picture
from rolling_panda import messages as m
from rolling_panda.messages.perception import CloseUpRequest
from rolling_panda.messages.robot import CameraFrame

# Time at the moving rate after motion or a cut, for the plant model (s).
_AWAKE_S = 4.0
# Length of the stored postures (s); an older picture gets the oldest one.
_REMEMBERED_S = 2.0


class Posture(NamedTuple):
    """Posture of the robot at one time of the machine's clock (s), as a camera frame reports it."""

    clock: float
    header: m.Header
    base: m.PlanarPose
    position: m.Actuated
    wheels: tuple[float, float, float] | None = None
    joint_offsets: m.JointOffsets = m.NO_OFFSETS
    velocity: m.ActuatedVelocity | None = None
    attitude: m.BaseAttitude | None = None


class CameraTrigger:
    """Triggers frames, one at a time: at the moving rate while awake, else at the resting rate. Counts in ticks."""

    def __init__(self, moving_hz: float, resting_hz: float, tick_s: float) -> None:
        """Start awake, with the first picture due at once.

        Args:
            moving_hz: Rate while awake.
            resting_hz: Rate otherwise.
            tick_s: Length of a tick (s).
        """
        self._moving = round(1 / moving_hz / tick_s)
        self._resting = round(1 / resting_hz / tick_s)
        self._awake = round(_AWAKE_S / tick_s)
        self._awake_until = self._awake
        self._last = -self._resting
        self._waiting: tuple[Posture, CloseUpRequest | None] | None = None
        self._postures: deque[Posture] = deque()
        self._wanted: CloseUpRequest | None = None
        self._taken = (-1, -1)
        self._sequence = 0

    def wake(self, ticks: int) -> None:
        """Something moves or has changed."""
        self._awake_until = ticks + self._awake

    def want(self, request: CloseUpRequest) -> None:
        """A picture is wanted as soon as the camera is free; a request that was done or overtaken changes nothing."""
        if (request.epoch, request.number) > self._taken:
            self._wanted, self._taken = request, (request.epoch, request.number)

    def due(self, ticks: int) -> bool:
        """Whether to expose now; never while a picture is on its way."""
        period = self._moving if ticks < self._awake_until else self._resting
        return self._waiting is None and (self._wanted is not None or ticks - self._last >= period)

    def follow(self, posture: Posture) -> None:
        """Store the current posture. A free-running camera reports the time of its exposure later."""
        self._postures.append(posture)
        while posture.clock - self._postures[0].clock > _REMEMBERED_S:
            self._postures.popleft()

    def exposed(self, ticks: int, posture: Posture) -> None:
        """An exposure is asked for in this posture."""
        self._last = ticks
        self._waiting = (posture, self._wanted)
        self._wanted = None

    def frame(self, picture: Picture, delay: float = 0.0) -> CameraFrame | None:
        """The message for the picture of the last exposure; None for an exposure without a request.

        Args:
            picture: As the camera gave it.
            delay: By how much it was exposed later than its time tells (s).
        """
        if self._waiting is None:
            return None
        posture, wanted = self._waiting
        self._waiting = None
        taken_at = picture.taken_at
        if taken_at is not None and self._postures:
            posture = min(self._postures, key=lambda known: abs(known.clock - taken_at))
        if delay != 0.0 and self._postures:
            true = posture.header.stamp + delay
            posture = min(self._postures, key=lambda known: abs(known.header.stamp - true))
        self._sequence += 1
        return CameraFrame(
            header=posture.header,
            sequence=self._sequence,
            intrinsics=picture.intrinsics,
            base=posture.base,
            position=posture.position,
            color_jpeg=picture.color_jpeg,
            depth_zlib=picture.depth_zlib,
            depth_unit=picture.depth_unit,
            labels_zlib=picture.labels_zlib,
            point_id="" if wanted is None else wanted.point_id,
            number=0 if wanted is None else wanted.number,
            wheels=posture.wheels,
            joint_offsets=posture.joint_offsets,
            velocity=posture.velocity,
            attitude=posture.attitude,
            delay=delay,
        )
