"""Messages between bridge and arm process through shared memory."""

from dataclasses import dataclass
from multiprocessing.context import SpawnContext
from typing import Any

import msgspec
import numpy as np

from rolling_panda import reasons
from rolling_panda.messages.types import Reason
from rolling_panda.model.differential_drive import Array

# Room for a reason with one text of 500 characters, each of which JSON may write as six bytes.
_ROOM = 3200
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
        fault: Reason why the arm does not follow; None without a fault.
        severe: Whether a person has to release the fault.
        success_rate: Fraction of the last 100 commands that arrived in time.
        commands: Number of commands since the start.
        external_torque: libfranka's `tau_ext_hat_filtered` (7, N·m), less gravity, motion and the load of `set_load`.
    """

    at: float
    position: Array
    velocity: Array
    fault: Reason | None
    severe: bool
    success_rate: float
    commands: int
    external_torque: Array


@dataclass(frozen=True)
class Note:
    """One write: how many there have been, the numbers, the words."""

    number: int
    values: Array
    words: bytes


class SharedNote:
    """Holds the newest note of one writer, and nobody waits; can be handed to a process that is being started."""

    def __init__(self, context: SpawnContext, size: int) -> None:
        """Room for `size` numbers, all zero."""
        # Two counters precede the numbers: writes begun and writes ended. They differ during a write.
        self._numbers: Any = context.RawArray("d", size + 2)
        self._words: Any = context.RawArray("c", _ROOM)

    def write(self, values: Array, words: bytes = b"") -> None:
        """Replace the content; one writer only. The words contain no zero byte."""
        numbers = np.frombuffer(self._numbers)
        numbers[0] += 1
        numbers[2:] = values
        self._words.raw = words[:_ROOM].ljust(_ROOM, b"\0")
        numbers[1] = numbers[0]

    def read(self) -> Note:
        """The newest note; number 0 before the first."""
        numbers = np.frombuffer(self._numbers)
        for _ in range(_TRIES):
            ended = numbers[1]
            values, words = numbers[2:].copy(), self._words.raw
            if numbers[0] == ended:
                break
        # A writer that died during a write leaves an inconsistent note, which its age reveals.
        return Note(int(ended), values, words.rstrip(b"\0"))


class ArmLink:
    """Both directions of the link; passed to the arm's process at its start."""

    def __init__(self, context: SpawnContext) -> None:
        """Empty."""
        self._down = SharedNote(context, 10)
        self._up = SharedNote(context, 25)

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
        fault = b"" if state.fault is None else msgspec.json.encode(state.fault)
        self._up.write(
            np.concatenate([[state.at], state.position, state.velocity, numbers, state.external_torque]), fault
        )

    def state(self) -> ArmState:
        """The bridge's side: the newest state; `at` is 0 before the first."""
        note = self._up.read()
        v = note.values
        return ArmState(
            float(v[0]), v[1:8], v[8:15], _fault(note.words), bool(v[15]), float(v[16]), int(v[17]), v[18:25]
        )


def _fault(words: bytes) -> Reason | None:
    if not words:
        return None
    try:
        return msgspec.json.decode(words, type=Reason)
    except ValueError:
        # Of a writer that died while it wrote.
        return reasons.arm_process_ended()
