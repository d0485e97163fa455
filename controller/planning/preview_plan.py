"""A preview as data: request, motion, swept volume and messages."""

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from controller.whole_body.collision import CollisionModel
from controller.whole_body.collision_geometry import Shapes
from controller.work.posture_search import CutPlan, Polylines
from controller.work.tries import Made
from rolling_panda import messages as m
from rolling_panda.messages.perception import Capsule, PruningPoint
from rolling_panda.messages.supervision import PreviewedCut, PreviewMotion, PreviewPhase, PreviewRow, PreviewState
from rolling_panda.model.differential_drive import Array
from rolling_panda.model.wire_values import actuated, planar_pose

#: Largest distance of any point of the robot between two samples (m).
STEP = 0.005


@dataclass(frozen=True, eq=False)
class SweptVolume:
    """Samples of the robot's shape along a motion.

    Attributes:
        shapes: Shapes of the robot's parts.
        time: Time of each sample (k, s).
        placed: Rotation, row by row, and centre of each part in odom (k×p×12).
    """

    shapes: Shapes
    time: Array
    placed: Array


@dataclass(frozen=True, eq=False)
class PreviewRequest:
    """All inputs of a preview except the configuration file.

    Attributes:
        number: Increases by one with each request.
        q: Configuration (12) at the start, at rest.
        points: Points as accepted, in the order of work.
        obstacles: Obstacles.
        cuts: Cuts of the current plan by point id. For other points the posture is searched as in work.
        turned: Turn of the approach about the cane (rad) for points where a person has set it.
        tries: Failed tries of each point, with the cane that was met.
        close_up_s: Time from the request of a close-up to its result (s).
    """

    number: int
    q: Array
    points: tuple[PruningPoint, ...]
    obstacles: tuple[Capsule, ...] = ()
    cuts: dict[str, CutPlan] = field(default_factory=dict)
    close_up_s: float = 0.5
    turned: tuple[tuple[str, float], ...] = ()
    tries: Made = ()
    canes: Polylines = ()


@dataclass(frozen=True, eq=False)
class Preview:
    """Result of a request.

    Attributes:
        request: The request.
        cuts: Cuts for the message, in the order of work, without those that were not reached.
        refused: Reason for each point that was come to and not cut, by id.
        plans: Posture of each cut by point id. Work that follows the preview uses them.
        rows: The motion, downsampled.
        duration: Duration (s).
        digest: SHA-256 of request, configuration and motion; empty without a motion.
        failure: Reason for the failure; None otherwise.
        swept: Swept volume of the motion; None without a motion.
    """

    request: PreviewRequest
    cuts: tuple[PreviewedCut, ...] = ()
    refused: dict[str, m.Reason] = field(default_factory=dict)
    plans: dict[str, CutPlan] = field(default_factory=dict)
    rows: tuple[PreviewRow, ...] = ()
    duration: float = 0.0
    digest: str = ""
    failure: m.Reason | None = None
    swept: SweptVolume | None = None


def state_message(
    preview: Preview | None,
    required: bool,
    phase: PreviewPhase,
    reason: m.Reason | None,
    approved_by: str,
    left: int,
    now: float,
) -> PreviewState:
    """The message of the state.

    Args:
        preview: The preview; None without one.
        required: Whether a cut needs an approved preview.
        phase: Phase of the preview.
        reason: Reason for the phase.
        approved_by: Who approved it.
        left: Number of accepted points that are not part of it.
        now: Monotonic time (s).
    """
    header = m.Header(now, "map")
    if preview is None:
        return PreviewState(header=header, required=required, phase=phase, reason=reason)
    q = preview.request.q
    return PreviewState(
        header=header,
        required=required,
        phase=phase,
        reason=reason,
        preview_hash=preview.digest,
        approved_by=approved_by,
        start=planar_pose(q),
        position=actuated(q[3:]),
        duration_s=preview.duration,
        cuts=preview.cuts,
        remaining=left,
    )


def motion_message(preview: Preview, now: float) -> PreviewMotion:
    """The message of the motion."""
    return PreviewMotion(header=m.Header(now, "map"), preview_hash=preview.digest, rows=preview.rows)


def sweep(model: CollisionModel, times: Sequence[float], configurations: Sequence[Array]) -> SweptVolume:
    """The room that is taken up by a motion through these configurations (12), which are closer than a place needs."""
    shapes = model.shapes
    reach = np.linalg.norm(shapes.half, axis=1) + shapes.around
    every = [model.placed(q) for q in configurations]
    kept = [0] if every else []
    for number in range(1, len(every)):
        if number == len(every) - 1 or _farthest(every[number + 1], every[kept[-1]], reach) > STEP:
            kept.append(number)
    placed = np.array([every[number] for number in kept]).reshape(-1, len(shapes.parts), 12)
    return SweptVolume(shapes, np.array([times[number] for number in kept]), placed)


def _farthest(placed: Array, before: Array, reach: Array) -> float:
    """How far a point of the robot has moved at most (m)."""
    turned = np.linalg.norm(placed[:, :9] - before[:, :9], axis=1) / np.sqrt(2.0)
    return float((np.linalg.norm(placed[:, 9:] - before[:, 9:], axis=1) + turned * reach).max())
