"""Whether a protective stop was a true one: what the simulated robot touched then, by the trace."""

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

from rolling_panda import messages as m

#: A stop comes this long after what it is for (s): the estimate is filtered, the message is on its way, a period ends.
_BEFORE_S, _AFTER_S = 0.2, 0.02
#: Forces below this are no touch (N).
TOUCH_N = 0.5


@dataclass(frozen=True)
class Stop:
    """A protective stop.

    Attributes:
        code: Of its reason.
        force: Largest sum of the forces between the robot and the row shortly before it (N): posts, trunks, cordons,
            wires, and canes where they are elastic.
        itself: Whether the robot touched itself then.
    """

    code: str
    force: float
    itself: bool

    @property
    def false(self) -> bool:
        """Whether the robot touched nothing."""
        return self.force < TOUCH_N and not self.itself


def protective(reason: m.Reason) -> bool:
    """Whether a line of the log tells of a protective stop."""
    return reason.code == "robot_halted" and dict(reason.values)["after"] == "PROTECTIVE_STOP"


def stops_of(events: Iterable[m.LogEvent], rows: Any) -> tuple[Stop, ...]:
    """The protective stops of a run, in order.

    Args:
        events: Lines of the log.
        rows: Of the trace.
    """
    return tuple(_stop(event, rows) for event in events if protective(event.reason))


def _stop(event: m.LogEvent, rows: Any) -> Stop:
    at, cause = event.header.stamp, dict(event.reason.values)["cause"]
    near = rows[(rows["clock"] >= at - _BEFORE_S) & (rows["clock"] <= at + _AFTER_S)]
    return Stop(
        cause.code if isinstance(cause, m.Reason) else "",
        float(near["touch"].max(initial=0.0)),
        bool(near["self_contacts"].any()),
    )
