"""What a task of the null space is."""

from typing import Protocol

from controller.whole_body.task import Demand
from rolling_panda.differential_drive import Array


class SecondaryTask(Protocol):
    """A velocity that some part of the robot should have, as far as the tool's task leaves it free.

    Attributes:
        name: Of the task.
        rows: Number of its rows.
    """

    name: str
    rows: int

    def begin(self, jacobian: Array) -> None:
        """Write what is the same in every period. Called once, with all zeros."""
        ...

    def write(self, demand: Demand, jacobian: Array, target: Array) -> None:
        """Write √weight · J (rows×9, over ν) and √weight · target (rows).

        `jacobian` and `target` are the task's own places in the stack of all tasks, kept from period to period: what a
        task never writes stays zero.
        """
        ...
