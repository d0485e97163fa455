"""Messages between bridge and arm process through shared memory."""

from dataclasses import dataclass
from multiprocessing.context import SpawnContext
from typing import Any

import numpy as np

from rolling_panda.model.differential_drive import Array

_TEXT = 400
_TRIES = 100


@dataclass(frozen=True)
class ArmTarget:
    """Bridge → arm.

    Attributes:
        number: Increases with each write.
        at: Time of the write (s, monotonic).
        velocity: Target velocities of the joints (7, rad/s).
        releases: Number of releases by people. When it increases, the arm may recover from its fault.
        closing: True when the bridge ends.
    """

    number: int
    at: float
    velocity: Array
    releases: int
    closing: bool


@dataclass(frozen=True)
class ArmState:
    """Arm → bridge.

    Attributes:
        at: Time of the write (s, monotonic).
        position: Joint angles (7, rad).
        velocity: Their velocities (7, rad/s).
        fault: Reason why the arm does not follow; empty without a fault.
        severe: Whether a person has to release the fault.
        success_rate: Fraction of the last 100 commands that arrived in time.
        commands: Number of commands since the start.
    """

    at: float
    position: Array
    velocity: Array
    fault: str
    severe: bool
    success_rate: float
    commands: int


@dataclass(frozen=True)
class Note:
    """One write: how many there have been, the numbers, the text."""

    number: int
    values: Array
    text: str


class SharedNote:
    """Holds the newest note of one writer, and nobody waits; can be handed to a process that is being started."""

    def __init__(self, context: SpawnContext, size: int) -> None:
        """Room for `size` numbers, all zero."""
        # Two counters precede the numbers: writes begun and writes ended. They differ during a write.
        self._numbers: Any = context.RawArray("d", size + 2)
        self._text: Any = context.RawArray("c", _TEXT)

    def write(self, values: Array, text: str = "") -> None:
        """Replace the content; one writer only."""
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
        # A writer that died during a write leaves an inconsistent note, which its age reveals.
        return Note(int(ended), values, text.rstrip(b"\0").decode(errors="replace"))


class ArmLink:
    """Both directions of the link; passed to the arm's process at its start."""

    def __init__(self, context: SpawnContext) -> None:
        """Empty."""
        self._down = SharedNote(context, 10)
        self._up = SharedNote(context, 18)

    def command(self, at: float, velocity: Array, releases: int, closing: bool) -> None:
        """The bridge's side: replace the target."""
        self._down.write(np.concatenate([[at], velocity, [releases, closing]]))

    def target(self) -> ArmTarget:
        """The arm's side: the newest target."""
        note = self._down.read()
        v = note.values
        return ArmTarget(note.number, float(v[0]), v[1:8], int(v[8]), bool(v[9]))

    def tell(self, state: ArmState) -> None:
        """The arm's side: replace the state."""
        numbers = [state.severe, state.success_rate, state.commands]
        self._up.write(np.concatenate([[state.at], state.position, state.velocity, numbers]), state.fault)

    def state(self) -> ArmState:
        """The bridge's side: the newest state; `at` is 0 before the first."""
        note = self._up.read()
        v = note.values
        return ArmState(float(v[0]), v[1:8], v[8:15], note.text, bool(v[15]), float(v[16]), int(v[17]))
