"""Time as a loop has lived it: the monotonic clock without the loop's own standstills."""


class LoopClock:
    """Tells how old things are to a loop that may itself have stood still.

    A process that gets no processor for a while, like everything on a machine that is suspended for a moment, finds
    every input as old as its own absence. That says nothing about the senders, whose messages wait to be read. So the
    time that a loop has missed beyond `longest_s` does not count. What the robot did meanwhile is for the bridge's
    watchdog to judge, on its own clock.
    """

    def __init__(self, now: float, longest_s: float) -> None:
        """Start.

        Args:
            now: Monotonic time (s).
            longest_s: The most that passes on this clock between two turns (s).
        """
        # One object, so that other threads always see two that belong together.
        self._turned = (now, now)
        self._longest = longest_s

    def turn(self, now: float) -> float:
        """Begin a turn of the loop at `now` (s, monotonic); returns the time on this clock (s)."""
        time = self.of(now)
        self._turned = (now, time)
        return time

    def of(self, at: float) -> float:
        """When something happened (s, monotonic), on this clock (s). Any thread may ask."""
        turned, time = self._turned
        return time + min(at - turned, self._longest)
