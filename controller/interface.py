"""Inputs and outputs of one control step."""

from dataclasses import dataclass

from controller.inputs import Inputs
from controller.ledger.journal import Record
from controller.planning.preview_plan import Preview, PreviewRequest
from controller.planning.work_plan import PlanRequest, WorkPlan
from rolling_panda import messages as m
from rolling_panda.messages.perception import CloseUpRequest
from rolling_panda.messages.supervision import ControlState, PreviewMotion, PreviewState, SessionPlan, StopState


@dataclass(frozen=True)
class StepInputs(Inputs):
    """Inputs of one step, with the newest results of the planner.

    Attributes:
        plan: Newest plan.
        preview: Newest preview.
    """

    plan: WorkPlan | None = None
    preview: Preview | None = None


@dataclass(frozen=True)
class Outputs:
    """Messages to send after one step; None or empty if nothing is due.

    `request` and `preview_request` go to the planner, `records` to the ledger.
    """

    motion: m.MotionCommand | None = None
    token: m.TokenRequest | None = None
    cut: m.CutCommand | None = None
    release: m.ReleaseStop | None = None
    stop: m.StopRequest | None = None
    state: m.ControllerState | None = None
    events: tuple[m.LogEvent, ...] = ()
    plan: SessionPlan | None = None
    request: PlanRequest | None = None
    records: tuple[Record, ...] = ()
    picture: CloseUpRequest | None = None
    control: ControlState | None = None
    stops: StopState | None = None
    preview: PreviewState | None = None
    preview_motion: PreviewMotion | None = None
    preview_request: PreviewRequest | None = None
