"""The latched stops. Every stop is kept, and all hold until the newest is released by its id."""

from rolling_panda import reasons
from rolling_panda.messages.robot import ReleaseStop, StopRequest
from rolling_panda.messages.supervision import StopRecord
from rolling_panda.messages.types import Reason

#: Number of latched stops in the message, newest first, and of remembered released ids.
_MOST, _OVER = 50, 1000


class StopLatch:
    """Latches stops. Late repetitions of a released stop do not latch again.

    A release names the newest stop. So a stop that the releasing person has not seen stays latched.
    """

    def __init__(
        self, stops: tuple[StopRecord, ...] = (), released: tuple[str, ...] = (), released_by: Reason | None = None
    ) -> None:
        """Start with the stored stops.

        Args:
            stops: Latched stops, newest first.
            released: Ids that do not latch any more.
            released_by: Who made the last release and why; None before the first.
        """
        self.stops = stops
        self.released_by = released_by
        self._over = dict.fromkeys(released)
        #: Whether the hardware stop is pressed. Nothing is released while it is.
        self.hardware = False

    @property
    def stop_id(self) -> str:
        """Id of the newest latched stop; empty without one."""
        return self.stops[0].stop_id if self.stops else ""

    @property
    def stopped_by(self) -> Reason | None:
        """Who made the newest stop and why; None without one."""
        return told(self.stops[0]) if self.stops else None

    @property
    def over(self) -> tuple[str, ...]:
        """Ids of released stops."""
        return tuple(self._over)

    def stop(self, request: StopRequest, wall_time: float = 0.0) -> bool:
        """Latch; True when this request had not been latched before.

        Args:
            request: As decoded.
            wall_time: Now (s since 1970), for people.
        """
        if request.stop_id in self._over or any(stop.stop_id == request.stop_id for stop in self.stops):
            return False
        record = StopRecord(request.stop_id, request.source, request.user, request.reason, max(0.0, wall_time))
        # Beyond the limit the first stops are kept beside the newest: they show the cause.
        self.stops = (record, *(self.stops if len(self.stops) < _MOST else (*self.stops[: _MOST - 2], self.stops[-1])))
        return True

    def release(self, request: ReleaseStop) -> Reason | None:
        """Release all; returns the reason why not, None if done."""
        if not self.stops:
            return reasons.no_stop_latched()
        if self.hardware:
            return reasons.emergency_button_pressed()
        if request.stop_id != self.stop_id:
            return reasons.another_stop_latched(self.stop_id, request.stop_id)
        for stop in self.stops:
            self._over[stop.stop_id] = None
        while len(self._over) > _OVER:
            self._over.pop(next(iter(self._over)))
        self.stops = ()
        self.released_by = reasons.stop_reset(request.user, request.reason)
        return None


def told(stop: StopRecord | StopRequest) -> Reason:
    """Who stopped and why."""
    if stop.source == "hardware":
        return reasons.emergency_stop(stop.reason)
    return reasons.software_stop(stop.user or stop.source, stop.reason)
