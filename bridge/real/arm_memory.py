"""Memory that two processes share: one writes numbers and a line of text, the other reads the newest; nobody waits."""

from dataclasses import dataclass
from multiprocessing.context import SpawnContext
from typing import Any

import numpy as np

from rolling_panda.model.differential_drive import Array

_TEXT = 400
_TRIES = 100


@dataclass(frozen=True)
class Note:
    """One write: how many there have been, the numbers, the text."""

    number: int
    values: Array
    text: str


class Memory:
    """Holds the newest note of one writer; can be handed to a process that is being started."""

    def __init__(self, context: SpawnContext, size: int) -> None:
        """Room for `size` numbers, all zero."""
        # Two counters stand before the numbers: writes begun and writes ended. They differ while a write is going on.
        self._numbers: Any = context.RawArray("d", size + 2)
        self._text: Any = context.RawArray("c", _TEXT)

    def write(self, values: Array, text: str = "") -> None:
        """Replace what is held; one writer only."""
        numbers = np.frombuffer(self._numbers)
        numbers[0] += 1
        numbers[2:] = values
        self._text.raw = text.encode()[:_TEXT].decode(errors="ignore").encode().ljust(_TEXT, b"\0")
        numbers[1] = numbers[0]

    def read(self) -> Note:
        """The newest note; number 0 before the first."""
        numbers = np.frombuffer(self._numbers)
        for _ in range(_TRIES):
            ended = numbers[1]
            values, text = numbers[2:].copy(), self._text.raw
            if numbers[0] == ended:
                break
        # A writer that died half way leaves a torn note: its age tells.
        return Note(int(ended), values, text.rstrip(b"\0").decode(errors="replace"))
