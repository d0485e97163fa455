"""Watchdog: fades the last setpoint to zero when commands stop."""

#: Earliest start of fading (s): two control periods. Earlier, no setpoint would be followed.
_ALWAYS_S = 0.02


class Watchdog:
    """A setpoint is followed for `fade_s`, then fades linearly to zero at `deadline_s`, where the watchdog trips.

    Fading before the deadline lets a heavy base brake smoothly and in time. A gap shorter than `fade_s` changes
    nothing, unless braking from that setpoint takes longer than the time left to the deadline. Then fading begins
    earlier.
    """

    def __init__(self, fade_s: float, deadline_s: float) -> None:
        """Start tripped: nothing has been commanded yet."""
        self._fade, self._deadline = min(fade_s, deadline_s), deadline_s
        self._fed, self._begins = float("-inf"), self._fade

    def feed(self, now: float, braking_s: float = 0.0) -> None:
        """A valid setpoint came at `now` (s), from which coming to rest takes `braking_s`."""
        self._fed = max(self._fed, now)
        self._begins = min(self._fade, max(self._deadline - braking_s, _ALWAYS_S))

    def tripped(self, now: float) -> bool:
        """No valid setpoint for the deadline."""
        return now - self._fed >= self._deadline

    def trust(self, now: float) -> float:
        """Share of the last setpoint to follow, 1 to 0."""
        silence = now - self._fed
        if silence <= self._begins:
            return 1.0
        if silence >= self._deadline:
            return 0.0
        return (self._deadline - silence) / (self._deadline - self._begins)
