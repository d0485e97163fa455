"""The preview for the wire."""

from controller.preview_plan import Preview
from rolling_panda import messages as m
from rolling_panda.differential_drive import Array
from rolling_panda.preview_messages import PreviewMotion, PreviewPhase, PreviewState


def state_message(
    preview: Preview | None,
    required: bool,
    phase: PreviewPhase,
    reason: str,
    approved_by: str,
    left: int,
    now: float,
) -> PreviewState:
    """The message of the state.

    Args:
        preview: What is shown; None when nothing is.
        required: Whether no cut begins without an approval.
        phase: Of the preview.
        reason: Why it is in that phase.
        approved_by: Who has approved it.
        left: Accepted points that are not in it.
        now: Monotonic time (s).
    """
    header = m.Header(now, "odom")
    if preview is None:
        return PreviewState(header=header, required=required, phase=phase, reason=reason[:500])
    q = preview.request.q
    a, b, c, d, e, f, g, h, i = q[3:].tolist()
    return PreviewState(
        header=header,
        required=required,
        phase=phase,
        reason=reason[:500],
        preview_hash=preview.digest,
        approved_by=approved_by,
        start=_planar(q),
        position=(a, b, c, d, e, f, g, h, i),
        duration_s=preview.duration,
        cuts=preview.cuts,
        left=left,
    )


def motion_message(preview: Preview, now: float) -> PreviewMotion:
    """The message of the motion."""
    return PreviewMotion(header=m.Header(now, "odom"), preview_hash=preview.digest, rows=preview.rows)


def _planar(q: Array) -> m.PlanarPose:
    x, y, phi = q[:3].tolist()
    return m.PlanarPose(x, y, phi)
