"""A monotonic clock for a loop that leaves out the loop's own stalls."""

#: Largest time that is left out at once (s), and the fraction of the elapsed time that it recovers by.
_BUDGET_S, _RECOVERY = 1.0, 0.25


class LoopClock:
    """Measures ages for a loop that may itself stall.

    After a stall, for instance without processor time or on a suspended machine, every input seems as old as the stall,
    although its sender is alive and newer messages wait to be read. So the time of a period beyond `longest_s` does not
    count. The bridge's watchdog judges the robot's motion meanwhile, on its own clock.

    At most a second is left out at once, and a quarter of the time in the long run: a loop that is always slow, or has
    stalled for long, must not take stale inputs for fresh ones.
    """

    def __init__(self, now: float, longest_s: float) -> None:
        """Start.

        Args:
            now: Monotonic time (s).
            longest_s: Longest period that is no stall (s).
        """
        # One tuple, so that other threads read consistent values: the last period's start on the machine's clock and on
        # this one, and the remaining budget.
        self._turned = (now, now, _BUDGET_S)
        self._longest = longest_s

    def turn(self, now: float) -> float:
        """Start a period of the loop at `now` (s, monotonic); returns the time on this clock (s)."""
        turned, time, budget = self._turned
        passed, counted = now - turned, self.of(now) - time
        self._turned = (now, time + counted, min(_BUDGET_S, budget - (passed - counted) + _RECOVERY * passed))
        return time + counted

    def of(self, at: float) -> float:
        """Convert a monotonic time (s) to this clock (s). Thread-safe."""
        turned, time, budget = self._turned
        passed = at - turned
        return time + passed - min(max(passed - self._longest, 0.0), budget)
