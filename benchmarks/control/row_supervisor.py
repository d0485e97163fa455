"""A person who supervises the work in a row: looks at the robot where it has stopped, and lets it go on."""

from pathlib import Path
from typing import Literal

from bridge.sim.robot import trace
from rolling_panda import commands as intents
from tests.support.worlds.closed_loop import ClosedLoop

#: Who has control of the robot.
USER = "bench"
#: A person takes so long to come, to look and to press (s). Estimate.
LOOK_S = 20.0
#: After that a stop whose cause is not gone is given up (s).
GONE_S = 5.0
#: Times that a person lets one row go on.
_MOST = 4


class Supervisor:
    """Acknowledges protective stops, says how cuts of unknown outcome ended, and resumes; nothing is led by hand.

    Attributes:
        cleared: Stops and pauses after which the work went on.
        waited_s: Time in which the robot stood for the person (s, simulated).
    """

    def __init__(self, trace_path: Path) -> None:
        """Nothing has stopped yet.

        Args:
            trace_path: The simulator's record: what a person sees of a cut.
        """
        self._path = trace_path
        self.cleared = 0
        self.waited_s = 0.0

    def lets_go_on(self, loop: ClosedLoop) -> bool:
        """Whether the work goes on after the robot has left automatic work by itself."""
        if loop.controller.mode not in ("PROTECTIVE_STOP", "PAUSED") or self.cleared >= _MOST:
            return False
        begin = loop.now
        loop.run(LOOK_S)
        goes_on = self._press(loop)
        self.waited_s += loop.now - begin
        self.cleared += goes_on
        return goes_on

    def _press(self, loop: ClosedLoop) -> bool:
        if loop.controller.mode == "PROTECTIVE_STOP":
            loop.run_until(lambda: loop.command(intents.Acknowledge(user=USER)).ok, GONE_S)
            loop.run(0.1)
        for entry in loop.queue("UNKNOWN"):
            outcome = self._seen(entry.point_id)
            asked = intents.ResolvePoint(user=USER, point_id=entry.point_id, outcome=outcome, reason="looked at it")
            loop.command(asked)
        loop.run(0.1)
        return loop.command(intents.Continue(user=USER)).ok

    def _seen(self, point_id: str) -> Literal["DONE", "FAILED_NOT_CUT"]:
        """How the cut of a point ended, by the truth."""
        cuts = [event for event in trace.read(self._path).events if event["event"] == "cut"]
        off = any(cut["severed"] for cut in cuts if cut["point_id"] == point_id)
        return "DONE" if off else "FAILED_NOT_CUT"
