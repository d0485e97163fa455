"""How often pages are told where the robot is. Whoever may only look on does not need every state."""

from rolling_panda.messages.page import PageState


class PagePace:
    """Of one page: which states it is told."""

    def __init__(self, page_rate_hz: float, onlooker_rate_hz: float) -> None:
        """States are made at the first rate; a page that may only look on is told them at the second."""
        self._every = max(1, round(page_rate_hz / onlooker_rate_hz))
        self._told: PageState | None = None

    def due(self, state: PageState, may_operate: bool) -> bool:
        """Whether to send this state, which then counts as sent. Another mode, stop or lost process is due at once."""
        before = self._told
        if state is before:
            return False
        if before is not None and not may_operate and _same(before, state) and state.number % self._every:
            return False
        self._told = state
        return True


def _same(before: PageState, state: PageState) -> bool:
    return (
        _mode(before) == _mode(state)
        and before.stops == state.stops
        and [row.present for row in before.processes] == [row.present for row in state.processes]
    )


def _mode(state: PageState) -> str:
    return "" if state.controller is None else state.controller.mode
