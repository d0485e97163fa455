"""Time as a loop has lived it: the monotonic clock without the loop's own standstills."""

#: What may be left out at once (s), and how fast that comes back (share of the time that passes).
_MOST_S, _BACK = 1.0, 0.25


class LoopClock:
    """Tells how old things are to a loop that may itself have stood still.

    A process that gets no processor for a while, like everything on a machine that is suspended for a moment, finds
    every input as old as its own absence. That says nothing about the senders, whose messages wait to be read. So the
    time that a loop has missed beyond `longest_s` does not count. What the robot did meanwhile is for the bridge's
    watchdog to judge, on its own clock.

    No more than a second is left out at once and a quarter of the time in the long run: a loop that is always slow, or
    was away for long, must not take old things for fresh.
    """

    def __init__(self, now: float, longest_s: float) -> None:
        """Start.

        Args:
            now: Monotonic time (s).
            longest_s: Time between two turns that is no standstill (s).
        """
        # One object, so that other threads always see three that belong together: the last turn on the machine's clock
        # and on this one, and what may still be left out.
        self._turned = (now, now, _MOST_S)
        self._longest = longest_s

    def turn(self, now: float) -> float:
        """Begin a turn of the loop at `now` (s, monotonic); returns the time on this clock (s)."""
        turned, time, budget = self._turned
        passed, counted = now - turned, self.of(now) - time
        self._turned = (now, time + counted, min(_MOST_S, budget - (passed - counted) + _BACK * passed))
        return time + counted

    def of(self, at: float) -> float:
        """When something happened (s, monotonic), on this clock (s). Any thread may ask."""
        turned, time, budget = self._turned
        passed = at - turned
        return time + passed - min(max(passed - self._longest, 0.0), budget)
