"""The controller's memory of software stops: latched until the bridge shows that it has released them."""

from rolling_panda import intents
from rolling_panda import messages as m

#: How long the bridge may take to show that it has released a stop, before it may be asked again (s).
_RELEASE_S = 1.0


class StopLatch:
    """Takes stop requests and the bridge's latch together; asks the bridge for release; forgets nothing by itself.

    The bridge keeps the first of several stops, so that its latch, not this one, says which id is to be released.
    """

    def __init__(self) -> None:
        """Start unlatched."""
        self._pending: set[str] = set()
        self._over: set[str] = set()
        self._asked: intents.Reset | None = None
        self._asked_at = 0.0
        self._due: m.ReleaseStop | None = None

    @property
    def reset_reason(self) -> str:
        """Why the last stop was reset, in words."""
        return f"reset by {self._asked.user}: {self._asked.reason}" if self._asked is not None else "reset"

    def take(self, stops: tuple[m.StopRequest, ...], bridge: m.BridgeState | None) -> str:
        """Latch what is new; returns why the robot is stopped, empty when nothing new was latched.

        A request is sent several times with one id: once released, its echoes latch nothing. What the bridge holds
        latched always counts.
        """
        latched = ""
        for stop in stops:
            if stop.stop_id not in self._pending and stop.stop_id not in self._over:
                self._latch(stop.stop_id)
                latched = f"software stop by {stop.user or stop.source}: {stop.reason}"
        if bridge is not None and bridge.stop_id and bridge.stop_id not in self._pending:
            self._latch(bridge.stop_id)
            latched = latched or f"software stop: {bridge.stopped_by}"
        return latched

    def ask_release(self, intent: intents.Reset, bridge: m.BridgeState | None, now: float) -> str:
        """An operator resets; returns why not. The release goes to the bridge, and only its state ends the latch."""
        if self._asked is not None and now - self._asked_at < _RELEASE_S:
            return "the reset is under way"
        self._asked, self._asked_at = intent, now
        if bridge is not None and bridge.stop_id:
            self._due = m.ReleaseStop(stop_id=bridge.stop_id, user=intent.user, reason=intent.reason)
        return ""

    def release_due(self) -> m.ReleaseStop | None:
        """The release to send now, once."""
        due, self._due = self._due, None
        return due

    def released(self, bridge: m.BridgeState | None) -> bool:
        """True once, when a reset was asked for and the bridge shows no latch."""
        if self._asked is None or not self._pending or self._due is not None:
            return False
        if bridge is not None and bridge.stop_id:
            return False
        self._over |= self._pending
        self._pending = set()
        return True

    def _latch(self, stop_id: str) -> None:
        self._pending.add(stop_id)
        self._asked = self._due = None
