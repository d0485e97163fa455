"""A preview as data: what it was asked for, and the motion that came of it."""

from dataclasses import dataclass, field

from controller.reach import CutPlan
from controller.swept import Swept
from rolling_panda.differential_drive import Array
from rolling_panda.messages import PruningPoint
from rolling_panda.preview_messages import PreviewedCut, PreviewRow
from rolling_panda.row_messages import Capsule


@dataclass(frozen=True, eq=False)
class PreviewRequest:
    """Everything that a preview depends on, apart from the configuration.

    Attributes:
        number: Grows by one a request.
        q: Configuration (12) at the start, at rest.
        points: Accepted points, each as it was accepted, in the order of work.
        obstacles: What stands in the way.
        cuts: What the session's plan says of points, by id; the others are searched for as in work.
        turned: Points of which somebody has said the turn of the approach about the cane, and that (rad).
        look_s: From asking for a picture to knowing what it shows (s).
    """

    number: int
    q: Array
    points: tuple[PruningPoint, ...]
    obstacles: tuple[Capsule, ...] = ()
    cuts: dict[str, CutPlan] = field(default_factory=dict)
    look_s: float = 0.5
    turned: tuple[tuple[str, float], ...] = ()


@dataclass(frozen=True, eq=False)
class Preview:
    """Answer to a request.

    Attributes:
        request: What was asked.
        cuts: For the wire, in order; those that were not come to are not in it.
        plans: Posture of each cut that was found, by id; who follows the preview cuts from these.
        rows: The motion, thinned out.
        duration: Of all of it (s).
        digest: SHA-256 of the request, the configuration and the motion; empty when there is none.
        failure: Why there is none; empty when there is one.
        swept: The room that the motion takes up; None when there is none.
    """

    request: PreviewRequest
    cuts: tuple[PreviewedCut, ...] = ()
    plans: dict[str, CutPlan] = field(default_factory=dict)
    rows: tuple[PreviewRow, ...] = ()
    duration: float = 0.0
    digest: str = ""
    failure: str = ""
    swept: Swept | None = None
