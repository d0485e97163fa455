"""Lines of the controller's log: recorded, and told to everybody after the step that they belong to."""

from controller.journal import Journal
from rolling_panda import messages as m


class Lines:
    """Collects what is said until it is taken. `now` is set by the step or the answer under way."""

    def __init__(self, journal: Journal) -> None:
        """Nothing is said yet; what will be goes into the journal too."""
        self._journal = journal
        self._events: list[m.LogEvent] = []
        self.now = 0.0

    def say(self, severity: m.Severity, text: str) -> None:
        """One line, of 500 characters at most."""
        event = m.LogEvent(header=m.Header(self.now), process="controller", severity=severity, text=text[:500])
        self._events.append(event)
        self._journal.add("event", "controller", event)

    def take(self) -> tuple[m.LogEvent, ...]:
        """What was said since the last time."""
        events, self._events = tuple(self._events), []
        return events
