"""History of the pruning rules, with the acceptances that each change made void."""

from dataclasses import dataclass, field
from typing import Generic, TypeVar

from rolling_panda import reasons
from rolling_panda.messages.perception import PruningRule
from rolling_panda.messages.types import Reason

Acceptance = TypeVar("Acceptance")
#: Number of changes that can be undone, the last one first.
_MOST = 20


@dataclass(eq=False)
class Change(Generic[Acceptance]):
    """A change of the rule, with the acceptances that it made void by point."""

    former: PruningRule
    rule: PruningRule
    voided: dict[str, Acceptance] = field(default_factory=dict)


class RuleHistory(Generic[Acceptance]):
    """The newest changes. Perception's report of a rule and a person's undo can arrive in either order."""

    def __init__(self) -> None:
        """Nothing has changed yet."""
        self._changes: list[Change[Acceptance]] = []
        #: Undo that waits for perception's report; None without one.
        self._coming: Change[Acceptance] | None = None

    def changed(
        self, former: PruningRule, rule: PruningRule, voided: dict[str, Acceptance]
    ) -> dict[str, Acceptance] | None:
        """Perception prunes by another rule; returns the acceptances to be restored with it, None where it is new."""
        coming, self._coming = self._coming, None
        if coming is not None and (coming.rule, coming.former) == (former, rule):
            self._changes.remove(coming)
            return coming.voided
        self._changes = [*self._changes, Change(former, rule, voided)][-_MOST:]
        return None

    def undo_refused(self, now: PruningRule | None) -> Reason | None:
        """Reason why no change can be undone while `now` is in force; None if one can."""
        return None if self._changes and self._changes[-1].rule == now else reasons.nothing_to_restore()

    def undo(self, rule: PruningRule, now: PruningRule | None) -> dict[str, Acceptance] | None | Reason:
        """Undo the change to `rule` while `now` is in force.

        Returns:
            The acceptances to restore at once; None if perception has not yet reported the former
            rule; or the reason why there is nothing to undo.
        """
        if (refused := self.undo_refused(now)) is not None:
            return refused
        changes = self._changes
        if changes[-1].rule == rule:
            self._coming = changes[-1]
            return None
        if len(changes) > 1 and changes[-2].former == now and changes[-2].rule == rule:
            # Perception's report came first; it looked like another change.
            voided = changes[-2].voided
            self._changes = changes[:-2]
            return voided
        return reasons.nothing_to_restore()
