"""Latch of software stops. A stop stays latched until the bridge shows its release."""

from rolling_panda import commands as intents
from rolling_panda import messages as m
from rolling_panda import reasons
from rolling_panda.messages.supervision import StopRecord, StopState

#: Time limit for the bridge to show a release before it is requested again (s).
_RELEASE_S = 1.0
#: Number of latched stops in the message, newest first.
_MOST = 50


class LatchedStops:
    """Latches stop requests together with the bridge's latch, and requests the bridge's release after a reset.

    The id to release is that of the newest stop that the bridge has latched.
    """

    def __init__(self, stops: tuple[StopRecord, ...] = ()) -> None:
        """Start with the stored stops, newest first."""
        self._pending: dict[str, StopRecord] = {stop.stop_id: stop for stop in reversed(stops)}
        self._over: set[str] = set()
        self._asked: intents.Reset | None = None
        self._asked_at = 0.0
        self._due: m.ReleaseStop | None = None
        self._released_by: m.Reason | None = None
        self._told: tuple[str, ...] | None = None

    @property
    def reset_reason(self) -> m.Reason:
        """Reason of the last reset."""
        return reasons.stop_reset(*(("", "") if self._asked is None else (self._asked.user, self._asked.reason)))

    @property
    def latched(self) -> m.Reason | None:
        """Reason of the latched stop; None without one."""
        return _reason(next(reversed(self._pending.values()))) if self._pending else None

    @property
    def changed(self) -> bool:
        """Whether there is something that `message` has not told yet."""
        return self._told != tuple(self._pending)

    def message(self) -> StopState:
        """The latched stops, for the wire and for the next start."""
        self._told = tuple(self._pending)
        stops = tuple(reversed(self._pending.values()))[:_MOST]
        return StopState(process="controller", stops=stops, released_by=self._released_by)

    def update(
        self, stops: tuple[m.StopRequest, ...], bridge: m.BridgeState | None, wall_time: float = 0.0
    ) -> m.Reason | None:
        """Latch new stops. Returns the reason of a new stop; None without one.

        A request is sent several times with one id. After its release later copies do not latch. What the bridge has
        latched always counts.
        """
        latched = None
        for stop in stops:
            if stop.stop_id not in self._pending and stop.stop_id not in self._over:
                record = StopRecord(stop.stop_id, stop.source, stop.user, stop.reason, max(0.0, wall_time))
                self._latch(record)
                latched = _reason(record)
        if bridge is not None and bridge.stop_id and bridge.stop_id not in self._pending:
            record = StopRecord(
                bridge.stop_id, "bridge", "", bridge.stopped_by or reasons.stop_latched(), max(0.0, wall_time)
            )
            self._latch(record)
            latched = latched or _reason(record)
        return latched

    def reset_refused(self, bridge: m.BridgeState | None, now: float) -> m.Reason | None:
        """Reason why no stop can be reset; None if one can."""
        if bridge is None:
            return reasons.stop_unknown()
        if self._asked is not None and now - self._asked_at < _RELEASE_S:
            return reasons.reset_under_way()
        return None

    def ask_release(self, intent: intents.Reset, bridge: m.BridgeState | None, now: float) -> m.Reason | None:
        """A supervisor resets, where `reset_refused` has no reason; returns why not.

        The release goes to the bridge, and only its state ends the latch.
        """
        held = "" if bridge is None else bridge.stop_id
        newest = held or next(reversed(self._pending), "")
        if intent.stop_id and intent.stop_id != newest:
            return reasons.stop_newer()
        self._asked, self._asked_at = intent, now
        if held:
            self._due = m.ReleaseStop(stop_id=held, user=intent.user, reason=intent.reason)
        return None

    def release_due(self) -> m.ReleaseStop | None:
        """The release to send now, once."""
        due, self._due = self._due, None
        return due

    def released(self, bridge: m.BridgeState | None) -> bool:
        """True once, when a reset was asked for and the bridge shows no latch."""
        if self._asked is None or not self._pending or self._due is not None:
            return False
        if bridge is None or bridge.stop_id:
            return False
        self._over |= set(self._pending)
        self._pending = {}
        self._released_by = self.reset_reason
        return True

    def _latch(self, record: StopRecord) -> None:
        self._pending[record.stop_id] = record
        self._asked = self._due = None


def _reason(stop: StopRecord) -> m.Reason:
    if stop.source == "bridge":
        # The bridge tells who stopped in its reason.
        return stop.reason
    if stop.source == "hardware":
        return reasons.emergency_stop(stop.reason)
    return reasons.software_stop(stop.user or stop.source, stop.reason)
