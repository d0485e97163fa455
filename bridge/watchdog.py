"""Silence means stop: how much of the last setpoint still counts, from how long ago it came."""


class Watchdog:
    """A setpoint is followed for `fade_s`, then fades linearly to nothing at `deadline_s`, where the watchdog trips.

    Fading before the deadline lets a heavy base come to rest softly and still in time; a gap shorter than `fade_s`
    changes nothing.
    """

    def __init__(self, fade_s: float, deadline_s: float) -> None:
        """Start tripped: nothing has been commanded yet."""
        self._fade, self._deadline = min(fade_s, deadline_s), deadline_s
        self._fed = float("-inf")

    def feed(self, now: float) -> None:
        """A valid setpoint came at `now` (s)."""
        self._fed = max(self._fed, now)

    def tripped(self, now: float) -> bool:
        """No valid setpoint for the deadline."""
        return now - self._fed >= self._deadline

    def trust(self, now: float) -> float:
        """Share of the last setpoint to follow, 1 to 0."""
        silence = now - self._fed
        if silence <= self._fade:
            return 1.0
        if silence >= self._deadline:
            return 0.0
        return (self._deadline - silence) / (self._deadline - self._fade)
