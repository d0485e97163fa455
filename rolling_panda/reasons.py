"""Catalogue of reasons: the code of each with its values, its severity, its English text and what to do.

A reason is made by calling its function, so that the type checker compares the values. The docstring is the text.
Besides formats of Python it may have words that go with a number: `{canes:cane|canes}` is "cane" for 1, else "canes".
"""

from collections.abc import Callable
from dataclasses import dataclass
from inspect import signature
from string import Formatter
from typing import Any, Final, Literal, ParamSpec

import msgspec

from rolling_panda.errors import MessageError
from rolling_panda.messages.types import Reason

P = ParamSpec("P")
Severity = Literal["info", "warning", "error"]
# Values that are words: the page has a text of each, `name.…` of `web/text/page.en.json`.
Goal = Literal["the cut", "the stand-off", "the way back", "a place clear of the canes"]
Place = Literal["at the cut", "on the way in", "at the stand-off", "clear of it"]


@dataclass(frozen=True)
class Entry:
    """An entry of the catalogue.

    Attributes:
        code: The code, which never changes its meaning.
        severity: Severity.
        text: English text, with the values' names in braces.
        act: What to do, in English.
    """

    code: str
    severity: Severity
    text: str
    act: str


#: All entries, by their codes.
CATALOGUE: Final[dict[str, Entry]] = {}


class _Words(Formatter):
    """Python's formats, and words for one and for several."""

    def format_field(self, value: Any, format_spec: str) -> str:
        one, several, other = format_spec.partition("|")
        return str(super().format_field(value, format_spec)) if not several else one if value == 1 else other


_WORDS: Final = _Words()


def text_of(reason: Reason) -> str:
    """English text of a reason, with what to do. A code that this version does not know is shown with its values."""
    entry = CATALOGUE.get(reason.code)
    values = {name: text_of(value) if isinstance(value, Reason) else value for name, value in reason.values}
    try:
        told = "" if entry is None else _WORDS.vformat(entry.text, (), values)
    except (LookupError, TypeError, ValueError):
        entry = None
    if entry is None:
        return f"{reason.code} {values or ''}".strip()[:500]
    return (f"{told}: {entry.act}" if entry.act else told)[:500]


def severity_of(reason: Reason) -> Severity:
    """Severity of a reason; a warning where this version does not know its code."""
    entry = CATALOGUE.get(reason.code)
    return "warning" if entry is None else entry.severity


def with_reason(stored: Any, field: str = "reason") -> Any:
    """A decoded row or stop whose field is a reason as data; earlier versions stored text."""
    if isinstance(stored, dict) and isinstance(text := stored.get(field), str):
        return stored | {field: msgspec.to_builtins(said(text))}
    return stored


def entry_of(severity: Severity, act: str, made: Callable[P, None]) -> tuple[Entry, Callable[P, Reason]]:
    """The entry that a function describes, and the function that makes its reasons.

    Raises:
        MessageError: The text does not name exactly the parameters.
    """
    code, text = made.__name__, " ".join((made.__doc__ or "").split()).removesuffix(".")
    parameters = tuple(signature(made).parameters)
    named = {name for _, name, _, _ in Formatter().parse(text) if name is not None}
    if not text or named != set(parameters):
        raise MessageError(f"reason {code}: its text names {sorted(named)}, its parameters are {[*parameters]}")

    def make(*args: P.args, **kwargs: P.kwargs) -> Reason:
        # It fails where the arguments are not the parameters.
        made(*args, **kwargs)
        values: dict[str, Any] = dict(zip(parameters, args, strict=False)) | kwargs
        return Reason(code=code, values=tuple((name, _bounded(values[name])) for name in parameters))

    return Entry(code, severity, text, act), make


def _bounded(value: str | float | Reason) -> str | float | Reason:
    """The value within the bounds of the wire, which refuses a whole message for one value out of them."""
    if isinstance(value, Reason):
        return value
    # A number is a float on the wire, so it is one here.
    return value[:500] if isinstance(value, str) else max(-1e9, min(1e9, float(value)))


def _reason(severity: Severity, act: str) -> Callable[[Callable[P, None]], Callable[P, Reason]]:
    def enter(made: Callable[P, None]) -> Callable[P, Reason]:
        entry, make = entry_of(severity, act, made)
        if entry.code in CATALOGUE:
            raise MessageError(f"two reasons have the code {entry.code}; each needs its own")
        CATALOGUE[entry.code] = entry
        return make

    return enter


@_reason("info", "")
def said(text: str) -> None:
    """{text}."""


@_reason("warning", "")
def unexplained() -> None:
    """No reason was given."""


# Control and roles


@_reason("warning", "sign in as an operator or a supervisor")
def viewer_only() -> None:
    """A viewer may look and stop, not operate."""


@_reason("warning", "sign in as an operator or a supervisor")
def operator_needed() -> None:
    """This needs the role operator or supervisor."""


@_reason("warning", "change the mode first")
def wrong_mode(command: str, modes: str, mode: str) -> None:
    """{command} is possible in {modes}; the mode is {mode}."""


@_reason("warning", "wait until it accepts commands")
def watchdog_holds() -> None:
    """The bridge's watchdog holds the robot: no valid command reached it in time."""


@_reason("warning", "ask for it, or take it")
def control_held(user: str) -> None:
    """{user} holds control of this robot."""


@_reason("warning", "wait until the robot is at rest")
def control_passes(user: str) -> None:
    """Control passes to {user}."""


@_reason("warning", "wait, then ask them for it")
def control_being_taken(user: str) -> None:
    """{user} is taking control already."""


@_reason("warning", "confirm to take it from them; the robot stops first")
def control_unconfirmed(user: str) -> None:
    """{user} holds control."""


@_reason("warning", "take it")
def control_free() -> None:
    """Nobody holds control."""


@_reason("info", "go on")
def control_yours() -> None:
    """You hold control already."""


@_reason("warning", "wait for the answer to their request")
def control_requested(user: str) -> None:
    """{user} has asked for control already."""


@_reason("warning", "ask the person in control")
def control_not_yours() -> None:
    """You do not hold control."""


@_reason("warning", "wait until somebody asks")
def control_not_requested() -> None:
    """Nobody asks for control."""


# Controller: supervision


@_reason("error", "end one of the two controllers")
def other_controller() -> None:
    """Another controller commands this robot."""


@_reason("warning", "wait until the other has ended or is silent")
def controller_waits() -> None:
    """Another controller commands this robot, so that this one waits."""


@_reason("info", "")
def controller_commands(epoch: float) -> None:
    """This controller commands the robot: epoch {epoch:.0f}."""


@_reason("warning", "")
def commands_refused(seconds: float) -> None:
    """The bridge has refused every command for {seconds:.0f} s: another token is asked for."""


@_reason("error", "")
def foreign_motion() -> None:
    """The robot moves by commands of another sender."""


@_reason("error", "")
def ledger_failed(detail: str) -> None:
    """{detail}."""


@_reason("error", "free the disk or replace it")
def file_unwritable(path: str, detail: str) -> None:
    """{path} cannot be written: {detail}."""


@_reason("error", "")
def decision_unrecorded(cause: Reason) -> None:
    """It was decided, but is not recorded: {cause}."""


@_reason("warning", "")
def lines_unrecorded(lines: float) -> None:
    """{lines:.0f} log {lines:line|lines} of other processes beyond the rate limit {lines:is|are} not recorded."""


@_reason("error", "see whether its disk is full or hangs")
def ledger_silent(seconds: float) -> None:
    """The ledger has written nothing for {seconds:.1f} s."""


@_reason("error", "wait, or start its sender")
def nothing_received(topic: str) -> None:
    """Nothing has arrived on {topic} yet."""


@_reason("error", "")
def joints_stale(age_s: float, limit_s: float) -> None:
    """Joint states are {age_s:.2f} s old; the limit is {limit_s:g} s."""


@_reason("error", "")
def odometry_stale(age_s: float, limit_s: float) -> None:
    """Odometry is {age_s:.2f} s old; the limit is {limit_s:g} s."""


@_reason("error", "")
def bridge_stale(age_s: float, limit_s: float) -> None:
    """The bridge's state is {age_s:.2f} s old; the limit is {limit_s:g} s."""


@_reason("warning", "")
def obstacles_stale(age_s: float, limit_s: float) -> None:
    """The newest camera frame with the obstacles is {age_s:.2f} s old; the limit is {limit_s:g} s."""


@_reason("info", "")
def waits_for_picture(limit_s: float) -> None:
    """The robot stands until a newer camera frame comes: the newest one is more than {limit_s:g} s old."""


@_reason("warning", "drive to vines that it has seen, and let the camera look at them")
def lost_in_row(cause: Reason) -> None:
    """The robot does not know where it is in the row: {cause}."""


@_reason("warning", "")
def lost_by_clock() -> None:
    """The camera's clock has begun anew."""


@_reason("warning", "")
def lost_by_odometry() -> None:
    """The odometry has jumped."""


@_reason("warning", "")
def lost_among_others() -> None:
    """The camera shows other wood than was seen here before."""


@_reason("warning", "")
def lost_by_way(metres: float) -> None:
    """No known wood was recognised for {metres:.1f} m."""


@_reason("warning", "start it again")
def process_gone(process: str) -> None:
    """The {process} process is gone."""


@_reason("warning", "")
def process_unheard(process: str) -> None:
    """The {process} process has not been heard yet."""


@_reason("warning", "")
def process_silent(process: str, age_s: float, limit_s: float) -> None:
    """The {process} process is silent for {age_s:.2f} s; the limit is {limit_s:g} s."""


@_reason("warning", "look at the robot")
def never_watched(limit_s: float) -> None:
    """No operator has seen the robot yet; the limit is {limit_s:g} s."""


@_reason("warning", "look at the robot; if you do, the page draws too slowly: use another device")
def unwatched(age_s: float, limit_s: float) -> None:
    """No operator has seen the robot for {age_s:.1f} s; the limit is {limit_s:g} s."""


@_reason("info", "arm the robot to move it")
def controller_started() -> None:
    """Started; nothing moves."""


@_reason("warning", "")
def right_missing(event: str, mode: str, right: str) -> None:
    """{event} in {mode} is for the {right}."""


@_reason("warning", "")
def cause_remains(cause: Reason) -> None:
    """The cause is still there: {cause}."""


@_reason("warning", "wait")
def cause_recent(seconds: float) -> None:
    """The cause must be gone for {seconds:.0f} s first."""


@_reason("warning", "")
def fault_without_effect(mode: str) -> None:
    """A fault changes nothing: the robot is in {mode}."""


@_reason("warning", "arm the robot first")
def impossible_in_idle(event: str) -> None:
    """{event} is not possible while the robot is idle."""


@_reason("warning", "")
def impossible_in_ready(event: str) -> None:
    """{event} is not possible while the robot is ready."""


@_reason("warning", "release the hold first")
def impossible_in_teleop(event: str) -> None:
    """{event} is not possible while the robot is moved by hand."""


@_reason("warning", "pause first")
def impossible_in_auto(event: str) -> None:
    """{event} is not possible while the robot works."""


@_reason("warning", "resume first")
def impossible_in_paused(event: str) -> None:
    """{event} is not possible while the robot is paused."""


@_reason("warning", "press Start or Survey")
def nothing_interrupted() -> None:
    """No work and no survey was interrupted."""


@_reason("warning", "press I've checked first")
def impossible_in_protective_stop(event: str) -> None:
    """{event} is not possible during a protective stop."""


@_reason("warning", "press I've checked first")
def impossible_in_fault(event: str) -> None:
    """{event} is not possible in a fault."""


@_reason("warning", "reset the stop first")
def impossible_in_estop(event: str) -> None:
    """{event} is not possible while a stop is latched."""


@_reason("info", "")
def control_given(user: str) -> None:
    """{user} holds control."""


@_reason("info", "")
def control_given_over(user: str, before: str) -> None:
    """{user} holds control, before {before}."""


@_reason("info", "")
def control_asked(user: str, holder: str) -> None:
    """{user} asks {holder} for control."""


@_reason("info", "")
def control_unanswered(user: str, holder: str) -> None:
    """{holder} has not answered: {user} may ask again."""


@_reason("warning", "")
def control_returned(user: str) -> None:
    """{user} gave control back."""


@_reason("warning", "")
def control_taken(user: str) -> None:
    """{user} takes control."""


@_reason("warning", "")
def control_lapsed(user: str, seconds: float) -> None:
    """Control by {user} has ended: nothing was heard from them for {seconds:.0f} s."""


@_reason("info", "")
def mode_changed(before: str, after: str, cause: Reason) -> None:
    """{before} → {after}: {cause}."""


@_reason("warning", "")
def robot_halted(before: str, after: str, cause: Reason) -> None:
    """{before} → {after}: {cause}."""


@_reason("info", "")
def command_by(command: str, user: str) -> None:
    """{user} pressed {command}."""


@_reason("info", "")
def homing_arm() -> None:
    """Homing the arm."""


@_reason("warning", "")
def homing_stopped(cause: Reason) -> None:
    """Homing was stopped: {cause}."""


@_reason("info", "")
def homing_stopped_by(user: str) -> None:
    """Homing was stopped by {user}."""


@_reason("info", "")
def hold_ended() -> None:
    """The hold has ended."""


@_reason("info", "")
def moved_by_hand(user: str) -> None:
    """{user} moves the robot."""


@_reason("warning", "")
def teleoperation_refused(cause: Reason) -> None:
    """Teleoperation refused: {cause}."""


@_reason("warning", "")
def button_pressed() -> None:
    """The emergency stop button of the robot is pressed."""


@_reason("warning", "")
def emergency_stop(cause: Reason) -> None:
    """Emergency stop: {cause}."""


@_reason("info", "")
def stop_reset(user: str, words: str) -> None:
    """Reset by {user}: {words}."""


@_reason("warning", "reset again in a moment")
def stop_unknown() -> None:
    """The bridge has not reported its stop yet."""


@_reason("warning", "read who pressed it and why, then reset again")
def stop_newer() -> None:
    """There is a newer stop."""


@_reason("warning", "wait")
def reset_under_way() -> None:
    """The reset is under way."""


@_reason("warning", "")
def command_refused(user: str, command: str, cause: Reason) -> None:
    """{user}: {command} refused: {cause}."""


@_reason("warning", "")
def release_refused(cause: Reason) -> None:
    """The stop is not released: {cause}."""


# Services


@_reason("warning", "ask again")
def answer_late(process: str) -> None:
    """{process} did not answer in time; nothing was done."""


@_reason("warning", "see the state")
def answer_missing() -> None:
    """It was taken up, but there is no answer in time."""


@_reason("warning", "")
def nobody_answers() -> None:
    """Nobody answers."""


@_reason("warning", "")
def recording_only() -> None:
    """This is a recording; nothing can be asked of the robot."""


# Commands


@_reason("info", "")
def home_requested(user: str) -> None:
    """{user} sends the arm home."""


@_reason("info", "")
def point_accepted(user: str, point: str, revision: float) -> None:
    """{user} accepted {point}, revision {revision:.0f}."""


@_reason("info", "")
def point_rejected(user: str, point: str) -> None:
    """{user} rejected {point}."""


@_reason("info", "")
def point_rejected_because(user: str, point: str, text: str) -> None:
    """{user} rejected {point}: {text}."""


@_reason("info", "")
def cut_judged_wrong(user: str, point: str) -> None:
    """{user}: the cut at {point} was wrong."""


@_reason("info", "")
def cut_judged_right(user: str, point: str) -> None:
    """{user}: the cut at {point} was right."""


@_reason("info", "")
def decision_undone(user: str, point: str) -> None:
    """{user} undid the decision about {point}."""


@_reason("info", "")
def point_inspected_cut(user: str, point: str, text: str) -> None:
    """{user} inspected {point}: cut: {text}."""


@_reason("info", "")
def point_inspected_not_cut(user: str, point: str, text: str) -> None:
    """{user} inspected {point}: not cut: {text}."""


@_reason("info", "")
def rule_undone(user: str) -> None:
    """{user} undid the rule, with the acceptances that it had made void."""


@_reason("info", "")
def point_moved_before(user: str, point: str, before: str) -> None:
    """{user} moved {point} before {before}."""


@_reason("info", "")
def point_moved_last(user: str, point: str) -> None:
    """{user} moved {point} to the end."""


@_reason("info", "")
def approach_set(user: str, point: str, angle_deg: float) -> None:
    """{user} set the approach of {point}: turned by {angle_deg:.0f}°."""


@_reason("info", "")
def approach_freed(user: str, point: str) -> None:
    """{user} set the approach of {point}: as the search finds it."""


@_reason("info", "")
def order_restored(user: str) -> None:
    """{user} restored the order of the plan."""


@_reason("info", "")
def preview_requested(user: str) -> None:
    """{user} requested a preview of the work."""


@_reason("info", "")
def point_preview_requested(user: str, point: str) -> None:
    """{user} requested a preview of {point}."""


@_reason("info", "")
def preview_approved(user: str, preview: str) -> None:
    """{user} approved the preview {preview}."""


@_reason("info", "")
def preview_required(user: str) -> None:
    """{user} requires a preview before each cut."""


@_reason("info", "")
def preview_optional(user: str) -> None:
    """{user} requires no previews any more."""


# Controller: motion


@_reason("warning", "")
def held_back(constraint: str) -> None:
    """{constraint} holds the robot back."""


@_reason("error", "")
def velocity_withheld() -> None:
    """A velocity outside the limits was not sent; the robot brakes."""


@_reason("error", "")
def motion_failed(detail: str) -> None:
    """The motion cannot be computed: {detail}."""


@_reason("warning", "")
def command_unknown(command: str) -> None:
    """{command} is not a command of this controller."""


@_reason("warning", "")
def site_unknown(vine: float, spur: float) -> None:
    """There is no undecided site at vine {vine:.0f}, spur {spur:.0f}."""


@_reason("warning", "pause first")
def point_worked_on(point: str) -> None:
    """{point} is being worked on."""


# Page


@_reason("error", "it is tried again by itself; until then use the emergency stop on the robot")
def no_link() -> None:
    """This page has no link to the server."""


@_reason("warning", "wait")
def stop_asked() -> None:
    """The stop was pressed on this page, and the robot has not confirmed it yet."""


@_reason("info", "wait")
def no_state_yet() -> None:
    """No state has arrived yet."""


@_reason("info", "switch on Teleoperate")
def teleoperation_off() -> None:
    """Teleoperation is switched off."""


@_reason("info", "choose Base")
def base_not_chosen() -> None:
    """The base is not what moves."""


@_reason("warning", "let go, then hold one of them")
def two_holds() -> None:
    """Two at once: it stopped."""


@_reason("info", "choose one")
def none_chosen() -> None:
    """No accepted point is chosen."""


@_reason("info", "")
def ghost_hidden() -> None:
    """The ghost is not shown."""


@_reason("info", "write why it is safe to go on")
def reset_unexplained() -> None:
    """The reset needs a reason."""


@_reason("info", "")
def nothing_decided() -> None:
    """Nothing has been decided on this page."""


@_reason("info", "")
def none_proposed() -> None:
    """There is no proposed point."""


@_reason("info", "look at the pictures")
def none_seen() -> None:
    """No sure cut has been seen here."""


@_reason("info", "")
def none_undecided() -> None:
    """There is nothing to decide at a place of this vine."""


@_reason("info", "")
def preview_approved_already(user: str) -> None:
    """{user} has approved it already."""


@_reason("info", "")
def approach_free() -> None:
    """The search chooses the approach already."""


@_reason("info", "wait")
def rule_effect_unknown() -> None:
    """It is not known yet what the rule would change."""


@_reason("info", "wait, or zoom in when it is there")
def picture_loading() -> None:
    """The picture is on its way."""


@_reason("info", "look at it, then decide")
def cut_just_changed() -> None:
    """This cut has just changed."""


@_reason("info", "go on to the next")
def point_vanished() -> None:
    """This point is gone: nothing is cut here."""


@_reason("info", "take that back first")
def acceptance_stands(point: str) -> None:
    """{point} is accepted, and keeps its content."""


@_reason("info", "they can give it to you")
def control_asked_by_you(user: str) -> None:
    """You have asked {user} for control."""


@_reason("error", "")
def server_unreachable() -> None:
    """The server cannot be reached."""


@_reason("error", "")
def server_answered(status: float) -> None:
    """The server answered {status:.0f}."""


@_reason("info", "")
def posture_unchecked() -> None:
    """The controller checks whether the arm can go there."""


@_reason("info", "choose a posture, or type an angle")
def no_posture_chosen() -> None:
    """No posture is chosen."""


@_reason("warning", "type an angle in degrees, such as 45")
def angle_no_number(text: str) -> None:
    """Not a number: “{text}”."""


# Page: alarms


@_reason("error", "wait, or start it again; the robot stops without it")
def server_silent() -> None:
    """The server is silent."""


@_reason("error", "if the robot moves, press its emergency stop; then start the bridge again")
def bridge_gone() -> None:
    """The bridge is gone, and nothing is known of the robot."""


@_reason("error", "start it again; what is queued waits")
def controller_gone() -> None:
    """The controller is gone, and the robot has stopped by itself."""


@_reason("warning", "start it again")
def perception_gone() -> None:
    """Perception is gone: nothing new is seen, and work pauses until it is back."""


@_reason("error", "")
def mode_stopped(cause: Reason) -> None:
    """Stopped: {cause}."""


@_reason("error", "")
def mode_protective_stop(cause: Reason) -> None:
    """Protective stop: {cause}."""


@_reason("error", "")
def mode_fault(cause: Reason) -> None:
    """Fault: {cause}."""


@_reason("warning", "")
def mode_paused(cause: Reason) -> None:
    """Paused: {cause}."""


@_reason("warning", "")
def work_waits() -> None:
    """The work waits to be begun again."""


@_reason("error", "press the robot's emergency stop, then free the blades by hand")
def cutter_jammed() -> None:
    """The cutter is jammed."""


@_reason("error", "see the load of its computer, then start again")
def commands_missing() -> None:
    """The bridge gets no commands in time and holds the robot."""


@_reason("error", "start the program again without --plain-wire")
def wire_plain() -> None:
    """The robot's wire is plain: every program on its machine can move it."""


@_reason("warning", "if nobody means that, have the configuration changed back")
def limits_relaxed(limits: Reason) -> None:
    """Set wider than usual: {limits}."""


@_reason("warning", "look at the vine, and say in Review whether it is cut")
def cuts_unknown(cuts: float) -> None:
    """{cuts:.0f} {cuts:cut|cuts} ended unknown."""


@_reason("warning", "close other programs")
def simulation_slow() -> None:
    """The simulation is slower than real time."""


@_reason("warning", "close other programs on the robot's computer")
def control_late() -> None:
    """Control periods come too late."""


@_reason("warning", "leading the tool may end by itself")
def page_link_slow() -> None:
    """The link between this page and the server is slow."""


@_reason("warning", "")
def joint_near_limit() -> None:
    """A joint of the arm is near its limit."""


@_reason("warning", "")
def arm_stretched() -> None:
    """The arm is nearly stretched out."""


# Page: steps out of an alarm


@_reason("info", "")
def ask_operator() -> None:
    """Ask an operator to see to it."""


@_reason("info", "")
def release_first() -> None:
    """Release the robot's own emergency stop first, once the row is clear."""


@_reason("info", "")
def check_row() -> None:
    """See that the row is clear."""


@_reason("info", "")
def press_reset() -> None:
    """Write why it is safe to go on; press Reset, then Arm."""


@_reason("info", "")
def supervisor_resets() -> None:
    """A supervisor writes why it is safe to go on, and presses Reset, then Arm."""


@_reason("info", "")
def mend_cause() -> None:
    """Mend the cause, and wait until it has been gone for a second."""


@_reason("info", "")
def cause_gone() -> None:
    """The cause has gone."""


@_reason("info", "")
def acknowledge_resume() -> None:
    """Press I've checked, then Resume."""


@_reason("info", "")
def acknowledge_arm() -> None:
    """Press I've checked, then Arm."""


@_reason("info", "")
def supervisor_acknowledges() -> None:
    """A supervisor presses I've checked, then Arm."""


@_reason("info", "")
def press_resume() -> None:
    """When that is seen to, press Resume."""


@_reason("info", "")
def resume_work() -> None:
    """When that is seen to, press Resume: the work goes on."""


@_reason("info", "")
def hold_again() -> None:
    """Hold again to go on."""


@_reason("info", "")
def resume_survey() -> None:
    """When that is seen to, press Resume: the survey goes on."""


@_reason("info", "")
def press_survey() -> None:
    """Press Survey to find points."""


@_reason("info", "")
def accept_start() -> None:
    """Accept points, then press Start."""


@_reason("info", "")
def press_use_calibration() -> None:
    """Use the calibration that is offered; the row is then looked at anew."""


@_reason("info", "")
def pause_then_calibration() -> None:
    """Pause, and use the calibration that is offered."""


@_reason("info", "")
def press_start() -> None:
    """Press Start to go on."""


@_reason("info", "")
def approve_start() -> None:
    """Press Approve and Start to go on."""


@_reason("info", "")
def preview_start() -> None:
    """Press Preview, Approve and Start to go on."""


@_reason("info", "")
def robot_leads_back() -> None:
    """Nothing yet: the robot leads itself back. If it does not, press Pause, then Resume and Home."""


@_reason("info", "")
def lead_back() -> None:
    """Lead the tool back towards the base; or let go, and press Home."""


@_reason("info", "")
def press_home() -> None:
    """Press Home, or lead the tool back towards the base."""


@_reason("info", "")
def resume_home() -> None:
    """Press Resume, then Home."""


@_reason("info", "")
def arm_and_home() -> None:
    """Press Arm, then Home."""


@_reason("info", "")
def home_when_ready() -> None:
    """Once the robot is ready again, press Home."""


# Server


@_reason("info", "")
def done() -> None:
    """Done."""


@_reason("warning", "")
def hold_refused(user: str, cause: Reason) -> None:
    """Hold by {user} refused: {cause}."""


@_reason("warning", "")
def gizmo_refused(user: str, cause: Reason) -> None:
    """No gizmo for {user}: {cause}."""


@_reason("info", "")
def request_done(command: str, user: str, result: Reason) -> None:
    """{command} by {user}: {result}."""


@_reason("warning", "")
def request_refused(command: str, user: str, cause: Reason) -> None:
    """{command} by {user} refused: {cause}."""


@_reason("warning", "wait until they let go")
def held_by_other(user: str) -> None:
    """{user} is holding the robot."""


@_reason("warning", "let go of it first")
def other_robot_held(robot: str) -> None:
    """You hold {robot}."""


@_reason("warning", "let go, then hold again")
def hold_overdue(resume_s: float) -> None:
    """Your hold ended, as nothing was heard of it for more than {resume_s:.1f} s."""


@_reason("warning", "wait until the page shows the robot as it is now")
def hold_view_stale(limit_s: float) -> None:
    """The view of the robot is not current: teleoperation needs one younger than {limit_s:.1f} s."""


@_reason("warning", "show the gizmo first")
def hold_without_target() -> None:
    """There is no target yet."""


@_reason("info", "")
def hold_began(user: str) -> None:
    """{user} holds the robot."""


@_reason("info", "")
def hold_released(user: str) -> None:
    """{user} let go of the robot."""


@_reason("info", "")
def hold_lapsed() -> None:
    """The hold ended: it was not renewed, or the page no longer sees the robot."""


@_reason("info", "press again to continue")
def hold_interrupted() -> None:
    """The hold ended: the page or its link was too slow."""


@_reason("info", "press again to continue")
def hold_ended_elsewhere() -> None:
    """The hold was ended from elsewhere."""


@_reason("warning", "")
def hold_stopped() -> None:
    """The robot was stopped."""


@_reason("warning", "wait until the robot reports its posture")
def tool_unknown() -> None:
    """The gizmo cannot be shown, as the pose of the tool is unknown."""


@_reason("warning", "ask less often")
def motion_rate_exceeded(limit_hz: float) -> None:
    """At most {limit_hz:.0f} requests for motion are accepted per second."""


@_reason("warning", "normalize it")
def quaternion_not_unit(length: float) -> None:
    """A quaternion has length 1, this one has {length:.3f}."""


@_reason("warning", "")
def software_stop(user: str, cause: Reason) -> None:
    """Software stop by {user}: {cause}."""


@_reason("error", "use the robot's emergency stop")
def stop_unconfirmed() -> None:
    """The stop was sent, but the bridge has not confirmed it."""


@_reason("warning", "")
def stop_half_confirmed() -> None:
    """Stopped: the bridge has latched the stop, the controller has not confirmed it."""


@_reason("info", "")
def stop_confirmed() -> None:
    """Stopped: bridge and controller have latched the stop."""


@_reason("error", "use the emergency stop of each robot that has not stopped")
def stop_of_all_unconfirmed(robots: str) -> None:
    """The stop was sent to all robots, but the bridge of {robots} has not confirmed it."""


@_reason("warning", "")
def stop_of_all_half_confirmed(robots: str) -> None:
    """All robots stopped; the controller of {robots} has not confirmed it."""


@_reason("info", "")
def stop_of_all_confirmed(robots: str) -> None:
    """Stopped: bridge and controller of {robots} have latched the stop."""


@_reason("error", "check that it runs")
def service_silent(process: str, detail: str) -> None:
    """The {process} does not answer: {detail}."""


@_reason("warning", "ask again")
def not_reported(process: str) -> None:
    """The {process} has not reported yet."""


@_reason("warning", "")
def no_recording() -> None:
    """This is a robot, not a recording."""


@_reason("warning", "")
def no_camera_image() -> None:
    """No camera image has come yet."""


@_reason("warning", "the cut itself is recorded; make room on the disk, or give the server another folder with --state")
def cut_picture_lost(error: str) -> None:
    """A picture of a cut could not be kept: {error}."""


@_reason("warning", "the report leaves it out")
def cut_picture_damaged(cut: str, moment: str, error: str) -> None:
    """The picture {moment} cut {cut} cannot be read: {error}."""


@_reason("warning", "ask for a newer one")
def camera_frame_gone(frame: float, newest: float) -> None:
    """Frame {frame:.0f} is not among the newest ones; {newest:.0f} is."""


@_reason("warning", "")
def point_unknown(point: str) -> None:
    """There is no point {point}."""


@_reason("warning", "look at them in GET /api/robots")
def robot_unknown(robot: str, robots: str) -> None:
    """There is no robot {robot} here; there are: {robots}."""


@_reason("info", "")
def rule_effect(changed: float, removed: float, added: float, voided: float) -> None:
    """{changed:.0f} changed, {removed:.0f} removed, {added:.0f} added; acceptances void: {voided:.0f}."""


@_reason("info", "")
def rule_without_effect() -> None:
    """Nothing would change."""


@_reason("warning", "accept the points again")
def acceptances_not_restored(cause: Reason) -> None:
    """The rule is restored, its acceptances are not: {cause}."""


@_reason("warning", "ask for another one")
def preview_expired(cause: Reason) -> None:
    """The preview has expired: {cause}."""


@_reason("warning", "ask for one")
def preview_missing() -> None:
    """There is no preview to approve."""


@_reason("warning", "look again")
def preview_replaced(newest: str, approved: str) -> None:
    """The preview is another one now: {newest}, not {approved}."""


@_reason("warning", "wait until the robot reports its posture")
def posture_unknown() -> None:
    """The position of the robot is unknown."""


@_reason("warning", "ask for another one")
def preview_base_moved(distance_m: float) -> None:
    """The preview has expired: the base moved {distance_m:.2f} m."""


@_reason("warning", "ask for another one")
def preview_base_turned(angle_deg: float) -> None:
    """The preview has expired: the base turned by {angle_deg:.0f}°."""


@_reason("warning", "ask for another one")
def preview_arm_moved(angle_rad: float) -> None:
    """The preview has expired: a joint of the arm moved by {angle_rad:.2f} rad."""


@_reason("warning", "open the sign-in link of this server, or its page")
def not_signed_in() -> None:
    """You are not signed in."""


@_reason("warning", "sign in as a supervisor")
def supervisor_needed() -> None:
    """Only a supervisor may do this."""


@_reason("warning", "open the page of this server")
def origin_foreign() -> None:
    """This request does not come from the page of this server (Origin)."""


@_reason("warning", "")
def origin_missing(path: str) -> None:
    """Refused {path} without an origin."""


@_reason("warning", "")
def origin_refused(path: str, origin: str) -> None:
    """Refused {path} from origin {origin}."""


@_reason("warning", "try later")
def visitor_rate_exceeded() -> None:
    """Too many requests without a session come from this address."""


@_reason("warning", "send less")
def body_too_long(limit: float) -> None:
    """A request body has at most {limit:.0f} bytes."""


@_reason("warning", "")
def body_unreadable() -> None:
    """The body is not JSON in UTF-8."""


@_reason("warning", "")
def http_error(status: float, detail: str) -> None:
    """HTTP status {status:.0f}: {detail}."""


@_reason("warning", "")
def request_invalid(detail: str) -> None:
    """The request is wrong: {detail}."""


@_reason("warning", "")
def sign_in_wrong() -> None:
    """Name or password is wrong."""


@_reason("warning", "ask a supervisor for another one")
def sign_in_link_void() -> None:
    """This sign-in link has been used, has expired or is not from this server."""


@_reason("warning", "wait, then try again")
def sign_in_throttled(wait_s: float) -> None:
    """Too many failed sign-ins; try again in {wait_s:.0f} s."""


@_reason("warning", "try again in 1 s")
def sign_ins_crowded() -> None:
    """Too many sign-ins at once."""


@_reason("warning", "sign in with the link that it printed")
def sign_in_without_passwords() -> None:
    """This server has no users file."""


@_reason("warning", "rolling-panda user add NAME")
def invitation_impossible() -> None:
    """People sign in here with a password."""


@_reason("warning", "")
def sign_in_refused(user: str, address: str, cause: Reason) -> None:
    """Sign-in as {user} from {address} refused: {cause}."""


@_reason("warning", "")
def link_refused(address: str, cause: Reason) -> None:
    """Sign-in by link from {address} refused: {cause}."""


@_reason("warning", "")
def page_closed(user: str, cause: Reason) -> None:
    """A page of {user} was closed: {cause}."""


@_reason("warning", "")
def view_closed(user: str, cause: Reason) -> None:
    """A view of {user} was closed: {cause}."""


@_reason("info", "")
def signed_in(user: str, role: str) -> None:
    """{user} signed in ({role})."""


@_reason("info", "")
def signed_out(user: str) -> None:
    """{user} signed out."""


@_reason("info", "")
def invited(user: str, guest: str, role: str) -> None:
    """{user} made a sign-in link for {guest} ({role})."""


@_reason("warning", "")
def account_changed(user: str) -> None:
    """The account of {user} was removed or changed."""


@_reason("error", "repair it; nobody new can sign in")
def users_unreadable(detail: str) -> None:
    """The users file cannot be read: {detail}."""


@_reason("warning", "")
def view_message_dropped(user: str, kind: str) -> None:
    """A view of {user} sent {kind} to the 3-D view; dropped."""


@_reason("warning", "")
def view_from_outside() -> None:
    """Refused a connection to the 3-D view from outside the page."""


@_reason("warning", "")
def page_message_invalid(user: str, detail: str) -> None:
    """A page of {user} was closed: {detail}."""


@_reason("warning", "")
def message_rejected(topic: str, cause: Reason) -> None:
    """Refused a message on {topic}: {cause}."""


@_reason("warning", "")
def limit_raised(key: str, value: float, usual: float, limit: float) -> None:
    """{key} = {value:g}, usually {usual:g}, at most {limit:g}."""


@_reason("warning", "")
def limit_lowered(key: str, value: float, usual: float, limit: float) -> None:
    """{key} = {value:g}, usually {usual:g}, at least {limit:g}."""


@_reason("warning", "")
def safeguard_off(key: str) -> None:
    """{key} is off."""


@_reason("error", "")
def robot_unseen() -> None:
    """Not seen yet."""


@_reason("error", "release it there once the row is clear, then reset")
def emergency_stop_pressed() -> None:
    """The emergency stop on the robot is pressed."""


@_reason("error", "")
def bridge_silent() -> None:
    """The bridge is silent."""


@_reason("error", "")
def controller_silent() -> None:
    """The controller is silent."""


@_reason("warning", "")
def perception_silent() -> None:
    """Perception is silent."""


@_reason("error", "")
def robot_stopped(cause: Reason) -> None:
    """Stopped: {cause}."""


@_reason("error", "")
def robot_protective_stop(cause: Reason) -> None:
    """Protective stop: {cause}."""


@_reason("error", "")
def robot_fault(cause: Reason) -> None:
    """Fault: {cause}."""


@_reason("error", "")
def robot_cutter_jammed() -> None:
    """The cutter is jammed."""


@_reason("warning", "")
def cut_unknown() -> None:
    """A cut ended unknown."""


@_reason("warning", "send less")
def socket_bytes_exceeded(limit_hz: float) -> None:
    """The page sent more than {limit_hz:.0f} bytes a second."""


@_reason("warning", "send less")
def socket_messages_exceeded(limit_hz: float) -> None:
    """The page sent more than {limit_hz:.0f} messages a second."""


@_reason("warning", "send less")
def session_messages_exceeded(limit_hz: float) -> None:
    """Its session sent more than {limit_hz:.0f} messages a second through all of its connections."""


@_reason("warning", "close some, then try again")
def too_many_sockets() -> None:
    """Too many pages and views are open."""


@_reason("warning", "")
def socket_unread() -> None:
    """The page did not read what it was sent."""


@_reason("warning", "close other pages, then try again")
def too_many_connections() -> None:
    """Too many connections are open."""


@_reason("warning", "")
def connection_refused(address: str, whose: str) -> None:
    """Refused a connection from {address}: too many of {whose} are in use."""


@_reason("warning", "")
def connection_refused_of_all(address: str) -> None:
    """Refused a connection from {address}: too many of all addresses together are in use."""


@_reason("warning", "")
def connection_replaced_of_all() -> None:
    """Too many connections of all addresses together: the longest idle one was ended."""


@_reason("warning", "")
def connection_replaced(whose: str) -> None:
    """Too many connections of {whose}: the longest idle one was ended."""


@_reason("warning", "")
def request_ended(address: str, part: str) -> None:
    """Ended a request from {address}: its {part} did not come in time."""


@_reason("warning", "send it again")
def request_late(part: str) -> None:
    """The request's {part} did not come in time."""


@_reason("error", "leave out --plain-wire to close it")
def plain_wire() -> None:
    """The wire is plain: every program on this machine can move the robot."""


@_reason("warning", "")
def lines_left_out(cause: Reason, lines: float) -> None:
    """{cause} (and {lines:.0f} {lines:line|lines} like it before)."""


# Labels


@_reason("warning", "load it anew, or save yours all the same")
def mask_changed(detail: str) -> None:
    """{detail}."""


@_reason("warning", "")
def label_file_unusable(detail: str) -> None:
    """{detail}."""


# Bridge: its stored state


@_reason("warning", "")
def bridge_state_absent() -> None:
    """There was no stored state of the bridge."""


@_reason("warning", "")
def bridge_state_set_aside(path: str) -> None:
    """The stored state of the bridge is set aside in {path}."""


# Perception: explanations of cuts


@_reason("info", "")
def past_node(distance_mm: float, node: float) -> None:
    """{distance_mm:.0f} mm past bud {node:.0f}, so that {node:.0f} {node:bud|buds} and the basal bud stay."""


@_reason("info", "")
def midway_past_node(distance_mm: float, node: float) -> None:
    """{distance_mm:.0f} mm past bud {node:.0f}, half the way on: {node:.0f} {node:bud|buds} and the basal bud stay."""


@_reason("info", "")
def spur_cut_only(place: Reason) -> None:
    """Spur cut on the only cane on this spur: {place}."""


@_reason("info", "")
def spur_cut_lowest(canes: float, diameter_mm: float, place: Reason) -> None:
    """Spur cut on the lowest of {canes:.0f} canes that is thick enough ({diameter_mm:.0f} mm): {place}."""


@_reason("info", "")
def spur_cut_thickest(canes: float, diameter_mm: float, place: Reason) -> None:
    """Spur cut on the thickest of {canes:.0f} thin canes ({diameter_mm:.0f} mm): {place}."""


@_reason("info", "")
def guyot_cut_lower(distance_mm: float, node: float) -> None:
    """Guyot, on the lower of two canes, the next spur: {distance_mm:.0f} mm past bud {node:.0f}."""


@_reason("info", "")
def guyot_cut_upper(distance_mm: float, node: float) -> None:
    """Guyot, on the upper of two canes, which will fruit: {distance_mm:.0f} mm past bud {node:.0f}."""


@_reason("info", "")
def old_cane_removed(distance_mm: float) -> None:
    """Guyot, last year's cane is taken off its head: {distance_mm:.0f} mm past the trunk."""


@_reason("info", "")
def renewal_cut(others: float) -> None:
    """Renewal cut: the old stub falls with {others:.0f} other {others:cane|canes}, just past the cane that stays."""


@_reason("info", "look which cane should stay")
def close_choice(cut: Reason, difference_mm: float) -> None:
    """{cut}; with {difference_mm:.1f} mm more or less in thickness another cane would stay."""


@_reason("info", "")
def placed_past_node(user: str, distance_mm: float, node: float) -> None:
    """Placed by {user}: {distance_mm:.0f} mm past bud {node:.0f} on this cane."""


@_reason("info", "")
def placed_below_nodes(user: str) -> None:
    """Placed by {user}: below the first bud on this cane."""


@_reason("info", "")
def moved_past_node(user: str, distance_mm: float, node: float) -> None:
    """Moved by {user}: {distance_mm:.0f} mm past bud {node:.0f} on this cane."""


@_reason("info", "")
def moved_below_nodes(user: str) -> None:
    """Moved by {user}: below the first bud on this cane."""


# Perception: undecided sites


@_reason("info", "")
def old_cane_unseen() -> None:
    """Last year's cane is not seen where it leaves the trunk."""


@_reason("info", "")
def cut_unconfirmed() -> None:
    """A cut was seen here, but not yet in enough pictures or from enough places."""


@_reason("info", "")
def canes_at_same_height() -> None:
    """Two canes leave the spur at about the same height, so which is the lower is open."""


@_reason("info", "")
def no_cane_followed() -> None:
    """No cane could be followed to this spur."""


@_reason("info", "")
def not_two_canes(canes: float) -> None:
    """{canes:.0f} {canes:cane|canes} seen on the spur, and the Guyot rule is about two: left for a person."""


@_reason("info", "")
def low_cane_near_limit() -> None:
    """A low cane is too near the least thickness to tell which cane should stay."""


@_reason("info", "")
def canes_equally_thin() -> None:
    """All canes are thin and about equally thick, so which should stay is open."""


@_reason("info", "")
def cane_base_hidden() -> None:
    """The base of the cane to keep is hidden, so its buds cannot be counted from the first."""


@_reason("info", "")
def nodes_lacking(seen: float, needed: float) -> None:
    """Only {seen:.0f} of {needed:.0f} buds seen on the cane to keep; never guessed."""


@_reason("info", "")
def pruned_already(distance_mm: float, node: float) -> None:
    """The cane ends {distance_mm:.0f} mm past bud {node:.0f}: it is pruned already."""


@_reason("info", "")
def beyond_node_hidden(node: float) -> None:
    """What lies beyond bud {node:.0f} is not in view."""


@_reason("info", "")
def cut_place_hidden() -> None:
    """The place of the cut is hidden."""


@_reason("info", "")
def node_may_be_hidden() -> None:
    """A stretch of the cane to keep is hidden where another bud may be."""


@_reason("info", "")
def nodes_side_by_side() -> None:
    """Two buds seem to sit side by side, so one may belong to another cane."""


@_reason("info", "")
def nodes_far_apart() -> None:
    """Two buds are so far apart that one between them may not have been seen."""


@_reason("info", "")
def cane_crosses_cut() -> None:
    """Another cane passes so close to the cut that the shears would take it too."""


@_reason("info", "")
def blades_without_place() -> None:
    """No place for the blades between two buds."""


@_reason("info", "")
def cane_beyond_shears(diameter_mm: float) -> None:
    """The cane is {diameter_mm:.0f} mm thick, more than the shears may cut."""


@_reason("info", "")
def stub_beyond_shears(diameter_mm: float) -> None:
    """The stub is {diameter_mm:.0f} mm thick, more than the shears may cut."""


@_reason("info", "cut this one by hand")
def wire_near_cut(distance_mm: float) -> None:
    """A wire or hose passes within {distance_mm:.0f} mm of the cut."""


@_reason("info", "cut this one by hand")
def wood_near_cut(kind: str, distance_mm: float) -> None:
    """The {kind} is within {distance_mm:.0f} mm of the cut."""


@_reason("info", "")
def other_cane_left(why: Reason) -> None:
    """The other cane of this spur is left for a person: {why}."""


@_reason("info", "")
def other_canes_left(canes: float, why: Reason) -> None:
    """The {canes:.0f} other canes of this spur are left for a person: {why}."""


@_reason("info", "")
def stub_unclear() -> None:
    """The old stub is not seen clearly."""


@_reason("info", "")
def keeper_close(difference_mm: float) -> None:
    """With {difference_mm:.1f} mm more or less in thickness another cane would stay."""


@_reason("info", "")
def cane_below_keeper() -> None:
    """One of them grows below the cane that stays."""


@_reason("info", "")
def stub_too_short(length_mm: float) -> None:
    """Only {length_mm:.0f} mm of the stub are free."""


@_reason("info", "")
def shears_touch_keeper() -> None:
    """The shears would touch the cane that stays."""


@_reason("info", "")
def spur_at_image_edge() -> None:
    """The spur is at the edge of the image, so not all of its canes may be in view."""


@_reason("info", "")
def stray_cane_hidden() -> None:
    """A cane seems to start here, but its base is hidden."""


@_reason("info", "check it yourself")
def looks_exhausted(why: Reason, looks: float) -> None:
    """{why}; {looks:.0f} {looks:look|looks} from the front {looks:has|have} not shown more."""


@_reason("info", "go there, or is the camera covered, or its depth missing or in another unit?")
def no_cordon_in_range(near: float, far: float) -> None:
    """No cordon is seen {near:g} to {far:g} m away."""


@_reason("info", "")
def spur_left(spur: float, why: Reason) -> None:
    """Spur {spur:.0f}: {why}."""


@_reason("info", "look again from 0.6 to 1 m")
def no_cane_with_depth() -> None:
    """No cane with depth was recognised."""


@_reason("info", "look again from nearer")
def cane_without_spur() -> None:
    """A cane begins here at trunk or cordon, but no spur was recognised."""


@_reason("info", "")
def no_spur_recognised() -> None:
    """No spur was recognised: the cordon with its spurs must be in the picture."""


@_reason("info", "")
def no_cane_recognised() -> None:
    """No cane was recognised in this picture."""


@_reason("info", "go nearer or give a larger picture")
def canes_too_narrow(width: float, needed: float) -> None:
    """Canes are {width:.1f} pixels wide; {needed:g} are needed."""


# Perception: points by hand and the rule


@_reason("info", "decide about it")
def point_placed(point: str) -> None:
    """{point} is placed."""


@_reason("info", "")
def site_left(vine: float, spur: float) -> None:
    """Vine {vine:.0f}, spur {spur:.0f} stays as it is."""


@_reason("info", "decide about it")
def site_reopened(vine: float, spur: float) -> None:
    """Vine {vine:.0f}, spur {spur:.0f} is to be decided again."""


@_reason("warning", "drive there, with Survey for instance, and click again")
def row_unseen_there() -> None:
    """This part of the row has not been seen yet."""


@_reason("warning", "click on a blue line")
def click_beside_cane(distance_mm: float) -> None:
    """The nearest known cane is {distance_mm:.0f} mm beside the click."""


@_reason("warning", "")
def click_elsewhere(why: Reason, distance_mm: float) -> None:
    """{why}; click {distance_mm:.0f} mm or more away along the cane."""


@_reason("warning", "reject it, and place one by hand")
def on_no_cane() -> None:
    """It is on no known cane."""


@_reason("warning", "")
def cut_there_already() -> None:
    """The cane has been cut there already."""


@_reason("warning", "")
def cane_begins_there() -> None:
    """The cane begins there."""


@_reason("warning", "")
def node_too_near(distance_mm: float, needed_mm: float) -> None:
    """{distance_mm:.0f} mm from a bud: the blades need {needed_mm:.0f} mm."""


@_reason("warning", "")
def wire_passes_there(distance_mm: float) -> None:
    """A wire passes within {distance_mm:.0f} mm of there."""


@_reason("warning", "click again")
def picture_too_old() -> None:
    """That picture is not among the newest ones any more."""


@_reason("warning", "")
def request_unknown(request: str) -> None:
    """Perception cannot do {request}."""


@_reason("warning", "")
def ray_without_direction() -> None:
    """A line of sight needs a direction."""


@_reason("warning", "")
def point_there_already(point: str, distance_mm: float) -> None:
    """{point} is there already, within {distance_mm:.0f} mm."""


@_reason("warning", "reject it, and place one by hand")
def renewal_cut_fixed() -> None:
    """A renewal cut is on the old stub."""


@_reason("warning", "reject it, and cut it with hand shears")
def removal_fixed() -> None:
    """A removal is beside the head of the vine."""


@_reason("info", "")
def rule_in_force() -> None:
    """This rule is in force already."""


@_reason("info", "")
def points_by_new_rule(points: float) -> None:
    """{points:.0f} {points:point|points} by the new rule."""


@_reason("info", "")
def points_by_that_rule(points: float) -> None:
    """{points:.0f} {points:point|points} by that rule."""


@_reason("info", "")
def points_by_rule_before(points: float) -> None:
    """{points:.0f} {points:point|points} by the rule before."""


@_reason("warning", "look again")
def rule_changed_since() -> None:
    """The rule has been changed since."""


@_reason("warning", "set it by its numbers")
def no_rule_before() -> None:
    """Perception knows of no rule before this one."""


# Perception: close-ups, withdrawals and the log


@_reason("info", "")
def camera_not_at_standoff(distance: float, near: float, far: float) -> None:
    """The camera was {distance:.2f} m away; it has to be {near:g} to {far:g} m."""


@_reason("info", "")
def no_close_up(limit_s: float) -> None:
    """No picture of it came within {limit_s:g} s."""


@_reason("info", "")
def place_outside_picture() -> None:
    """The place was not inside the picture."""


@_reason("info", "")
def cut_not_followed() -> None:
    """No close-up has shown it before."""


@_reason("info", "")
def cane_jumped(aside_mm: float, limit_mm: float) -> None:
    """The nearest cane was {aside_mm:.0f} mm aside; a cane moves by no more than {limit_mm:.0f} mm in that time."""


@_reason("info", "")
def cane_hidden() -> None:
    """Its cane is hidden."""


@_reason("info", "")
def no_cane_at_place() -> None:
    """No cane runs through the place."""


@_reason("info", "")
def beyond_cut_hidden() -> None:
    """What lies beyond the cut is hidden."""


@_reason("info", "")
def cane_end_unclear() -> None:
    """Whether the cane goes on is not clear."""


@_reason("info", "")
def which_cane_unclear(distance_mm: float) -> None:
    """A cane stands {distance_mm:.0f} mm beside the place; what is around it does not tell whether it is the one."""


@_reason("info", "")
def which_internode_unclear() -> None:
    """The picture is shifted along the canes, and the nodes of this one do not tell which internode is which."""


@_reason("info", "")
def node_near_cut(distance_mm: float) -> None:
    """A bud is seen {distance_mm:.0f} mm from the cut."""


@_reason("info", "")
def node_before_cut_unseen() -> None:
    """The bud before the cut was not seen."""


@_reason("warning", "")
def point_unknown_to_perception() -> None:
    """Perception knows no such point."""


@_reason("info", "")
def withdrawn_as_cut(point: str, vine: float, spur: float, frames: float) -> None:
    """{point} (vine {vine:.0f}, spur {spur:.0f}) withdrawn: cut, as its wood was gone in {frames:.0f} frames."""


@_reason("info", "")
def withdrawn_as_elsewhere(point: str, vine: float, spur: float) -> None:
    """{point} (vine {vine:.0f}, spur {spur:.0f}) withdrawn: closer looks put the cut elsewhere on this spur."""


@_reason("info", "")
def withdrawn_as_unconfirmed(point: str, vine: float, spur: float) -> None:
    """{point} (vine {vine:.0f}, spur {spur:.0f}) withdrawn: too few views from other sides show this cut."""


@_reason("info", "")
def withdrawn_as_contradicted(point: str, vine: float, spur: float) -> None:
    """{point} (vine {vine:.0f}, spur {spur:.0f}) withdrawn: more pictures speak against this cut than for it."""


@_reason("info", "")
def perception_started() -> None:
    """Perception is up and waits for camera frames."""


@_reason("warning", "check the points yourself, or use a network that tells unfamiliar pictures")
def familiarity_unknown() -> None:
    """Familiarity unknown: the network in use does not tell pictures that are unlike those of its training."""


@_reason("info", "")
def new_point(points: float) -> None:
    """One new pruning point, {points:.0f} in all."""


@_reason("info", "")
def new_points(new: float, points: float) -> None:
    """{new:.0f} new pruning points, {points:.0f} in all."""


@_reason("info", "")
def wood_off_row(count: float, kind: str) -> None:
    """Left out of the obstacles: {count:.0f} {kind}, off the row."""


@_reason("info", "")
def wood_there_twice(count: float, kind: str) -> None:
    """Left out of the obstacles: {count:.0f} {kind}, where a longer one is."""


@_reason("info", "")
def wood_above_cordon(count: float, kind: str) -> None:
    """Left out of the obstacles: {count:.0f} {kind}, not standing: nothing of it is below the cordon."""


@_reason("info", "")
def wood_leaning(count: float, kind: str) -> None:
    """Left out of the obstacles: {count:.0f} {kind}, leaning."""


@_reason("info", "")
def wood_lying(count: float, kind: str) -> None:
    """Left out of the obstacles: {count:.0f} {kind}, lying."""


@_reason("info", "")
def wood_too_thick(count: float, kind: str) -> None:
    """Left out of the obstacles: {count:.0f} {kind}, too thick."""


@_reason("info", "")
def wood_hardly_seen(count: float, kind: str) -> None:
    """Left out of the obstacles: {count:.0f} {kind}, hardly seen."""


@_reason("error", "")
def frame_refused(cause: Reason) -> None:
    """A camera frame was refused: {cause}."""


@_reason("error", "")
def frame_posture_invalid(frame: float) -> None:
    """The posture of frame {frame:.0f} is not of 12 finite numbers."""


@_reason("error", "")
def frame_intrinsics_invalid(frame: float, fx: float, fy: float, cx: float, cy: float) -> None:
    """The camera model of frame {frame:.0f} is invalid: focal lengths {fx:g} and {fy:g}, centre {cx:g} and {cy:g}."""


@_reason("error", "")
def frame_depth_unit_invalid(frame: float, unit_m: float, limit_m: float) -> None:
    """The depth unit of frame {frame:.0f} is {unit_m:g} m; allowed is more than 0, at most {limit_m:g} m."""


@_reason("error", "")
def frame_failed(detail: str) -> None:
    """Its processing failed: {detail}."""


@_reason("error", "")
def frame_class_unknown(frame: float, index: float, classes: float) -> None:
    """Frame {frame:.0f} has the class {index:.0f}; there are {classes:.0f}, from 0."""


@_reason("error", "")
def frame_image_corrupt(frame: float, image: str, detail: str) -> None:
    """The {image} image of frame {frame:.0f} is corrupt: {detail}."""


@_reason("error", "")
def frame_image_size_wrong(frame: float, image: str, width: float, height: float) -> None:
    """The {image} image of frame {frame:.0f} has not the bytes of {width:.0f}×{height:.0f} pixels."""


@_reason("error", "")
def colour_not_jpeg(frame: float, detail: str) -> None:
    """The colour image of frame {frame:.0f} is not a JPEG: {detail}."""


@_reason("error", "")
def colour_size_wrong(frame: float, width: float, height: float, columns: float, rows: float) -> None:
    """The colour image of frame {frame:.0f} has {width:.0f}×{height:.0f} pixels, not {columns:.0f}×{rows:.0f}."""


@_reason("warning", "see whether the lens is covered or the exposure wrong")
def picture_blank(brightest: float) -> None:
    """The colour image is blank: its brightest value is {brightest:.0f} of 255."""


@_reason("warning", "see what is before the camera; decide yourself where to cut, or train on such pictures")
def picture_unfamiliar(strangeness: float, limit: float) -> None:
    """Unfamiliar picture: it is unlike all that the network was trained on ({strangeness:.2f}, limit {limit:.2f})."""


@_reason("warning", "choose the segmenter network")
def frame_without_labels(segmenter: str) -> None:
    """The frame has no label image for {segmenter}; only the simulated camera sends one."""


@_reason("warning", "install the network's weights, or name a file of them")
def network_missing(detail: str) -> None:
    """No segmentation without the network's weights: {detail}."""


@_reason("error", "")
def frame_overdue(limit_s: float) -> None:
    """A frame has taken more than {limit_s:g} s."""


# Work: points


@_reason("warning", "")
def point_state(point: str, state: str) -> None:
    """{point} is {state}."""


@_reason("warning", "look, and report the outcome first")
def outcome_undecided(point: str) -> None:
    """It is unknown whether {point} is cut."""


@_reason("warning", "")
def point_unreachable(point: str, why: Reason) -> None:
    """{point} is accepted, and cannot be reached: {why}."""


@_reason("warning", "")
def point_unseen(point: str) -> None:
    """Perception does not see {point} any more."""


@_reason("warning", "look at it again")
def point_revised(point: str, seen: float, now: float) -> None:
    """{point} has changed since: revision {seen:.0f} was seen, it is {now:.0f} now."""


@_reason("warning", "look at it again")
def point_replaced(point: str, now: str, seen: str) -> None:
    """{point} is not what was seen: its hash is {now}, not {seen}."""


@_reason("warning", "cut it by hand")
def cane_too_thick(point: str, diameter_mm: float, limit_mm: float) -> None:
    """The cane of {point} is {diameter_mm:.0f} mm thick, the limit is {limit_mm:.0f} mm."""


@_reason("info", "")
def rejected() -> None:
    """Rejected."""


@_reason("warning", "")
def nothing_to_take_back(point: str, state: str) -> None:
    """{point} is {state}: there is no decision to take back."""


@_reason("warning", "")
def outcome_known(point: str, state: str) -> None:
    """The outcome of {point} is not in question: it is {state}."""


@_reason("info", "")
def inspected(user: str, finding: str) -> None:
    """{user} looked: {finding}."""


@_reason("info", "")
def not_queued_yet() -> None:
    """The controller has not taken it up yet."""


@_reason("info", "accept a point")
def none_accepted() -> None:
    """No point is accepted."""


@_reason("warning", "move the robot, or turn the approach")
def none_reachable(count: float) -> None:
    """No accepted point can be reached, of {count:.0f}."""


@_reason("warning", "lower the confidence, or accept points one by one")
def none_so_confident(confidence: float) -> None:
    """No proposed point has a confidence of {confidence:.2f} or more."""


@_reason("warning", "")
def none_acceptable(count: float, first: Reason) -> None:
    """None of {count:.0f} {count:point|points} can be accepted; the first: {first}."""


@_reason("info", "")
def points_accepted(user: str, count: float, confidence: float) -> None:
    """{user} accepted {count:.0f} {count:point|points} of confidence {confidence:.2f} and more."""


@_reason("info", "")
def cutting() -> None:
    """The blades close."""


@_reason("warning", "look, and report the outcome")
def interrupted() -> None:
    """The controller ended before it knew whether this was cut."""


@_reason("info", "wait until perception reports it again")
def accepted_before_restart() -> None:
    """Accepted before a restart."""


@_reason("warning", "accept it again")
def record_damaged() -> None:
    """Its record does not match its hash."""


@_reason("warning", "accept it again if it is right")
def acceptance_void(why: Reason) -> None:
    """The acceptance is void: {why}."""


@_reason("warning", "")
def acceptance_lost(point: str, why: Reason) -> None:
    """{point}: {why}."""


@_reason("warning", "")
def no_longer_reported() -> None:
    """Perception no longer reports it."""


@_reason("warning", "")
def moved_over_restart(distance_mm: float) -> None:
    """It is {distance_mm:.0f} mm from where it was accepted, before perception or the controller started again."""


@_reason("warning", "")
def other_cane() -> None:
    """It is now a cut of another cane, or another kind of cut."""


@_reason("warning", "")
def other_nodes_kept(before: float, now: float) -> None:
    """It left {before:.0f} {before:bud|buds} when it was accepted, and leaves {now:.0f} now."""


@_reason("info", "")
def seen_elsewhere(distance_mm: float) -> None:
    """The same cane is now seen {distance_mm:.0f} mm from where it was accepted."""


@_reason("warning", "")
def turned_after_acceptance(angle_deg: float) -> None:
    """Its cane turned by {angle_deg:.0f}° after it was accepted."""


@_reason("warning", "")
def rule_cuts_elsewhere(rule: Reason, distance_mm: float) -> None:
    """The rule is now: {rule}. It cuts {distance_mm:.0f} mm away."""


@_reason("warning", "")
def rule_cuts_otherwise(rule: Reason) -> None:
    """The rule is now: {rule}. It cuts otherwise here."""


@_reason("warning", "")
def rule_wants_no_cut(rule: Reason) -> None:
    """The rule is now: {rule}. It asks for no such cut."""


@_reason("info", "")
def spur_rule(nodes: float, diameter_mm: float, past_mm: float) -> None:
    """Spur, buds kept: {nodes:.0f}, from {diameter_mm:g} mm, {past_mm:.0f} mm past the last bud."""


@_reason("info", "")
def guyot_rule(nodes: float, fruiting: float, diameter_mm: float, past_mm: float) -> None:
    """Guyot, buds kept: {nodes:.0f} + {fruiting:.0f}, from {diameter_mm:g} mm, {past_mm:.0f} mm past the last bud."""


@_reason("warning", "accept again what is to be cut")
def nothing_to_restore() -> None:
    """The controller knows of no acceptance that this rule made void."""


@_reason("info", "")
def acceptances_restored(points: str) -> None:
    """Accepted again after the rule was undone: {points}."""


# Work: order and approach


@_reason("warning", "look at the order again")
def order_changed_by(user: str, seen: float, now: float) -> None:
    """{user} has changed the order since: number {seen:.0f} was seen, it is {now:.0f} now."""


@_reason("warning", "look at the order again")
def order_changed(seen: float, now: float) -> None:
    """The order has changed since: number {seen:.0f} was seen, it is {now:.0f} now."""


@_reason("warning", "accept it first")
def not_in_order(point: str) -> None:
    """{point} is not accepted; only accepted points have a place in the order of work."""


@_reason("warning", "")
def unreachable_in_order(point: str, why: Reason) -> None:
    """{point} cannot be reached, so it has no place in the order of work: {why}."""


@_reason("warning", "")
def before_itself(point: str) -> None:
    """{point} cannot come before itself."""


@_reason("info", "")
def order_of_plan() -> None:
    """The order is the plan's already."""


@_reason("warning", "choose a smaller angle")
def approach_too_far(angle_deg: float, limit_deg: float) -> None:
    """The approach cannot be turned by {angle_deg:.0f}°; at most {limit_deg:.0f}° are possible."""


# Work: postures


@_reason("info", "")
def posture_saved(user: str, name: str) -> None:
    """{user} saved the posture “{name}”."""


@_reason("info", "")
def posture_deleted(user: str, name: str) -> None:
    """{user} deleted the posture “{name}”."""


@_reason("warning", "give it a name")
def posture_name_empty() -> None:
    """The posture has no name."""


@_reason("warning", "choose a shorter one")
def posture_name_long(length: float, most: float) -> None:
    """The name has {length:.0f} characters, at most {most:.0f} are possible."""


@_reason("warning", "choose another name, or delete that posture first")
def posture_name_taken(name: str) -> None:
    """There is a posture “{name}” already."""


@_reason("warning", "")
def posture_not_saved(name: str) -> None:
    """There is no saved posture “{name}”."""


@_reason("warning", "delete one first")
def postures_full(most: float) -> None:
    """{most:.0f} postures are saved, more are not possible."""


@_reason("warning", "wait for the joint states")
def posture_unmeasured() -> None:
    """The posture of the arm is not known yet."""


@_reason("warning", "")
def posture_out_of_range(joint: float, angle_deg: float, low_deg: float, high_deg: float) -> None:
    """Joint {joint:.0f} cannot turn to {angle_deg:.1f}°, only from {low_deg:.1f}° to {high_deg:.1f}°."""


@_reason("warning", "drive the base elsewhere, or choose another posture")
def posture_touches(distance_mm: float, part: str, other: str, needed_mm: float) -> None:
    """In this posture {distance_mm:.0f} mm would be between {part} and {other}, {needed_mm:.0f} mm are needed."""


@_reason("warning", "choose another place for the tool")
def tool_inside(part: str, other: str, depth_mm: float) -> None:
    """There {part} would be {depth_mm:.0f} mm inside {other}."""


# Work: motions and cuts


@_reason("warning", "wait until it is there")
def homing() -> None:
    """The arm is being brought home."""


@_reason("warning", "wait until the cut has ended")
def blades_closing() -> None:
    """The blades are closing."""


@_reason("info", "")
def arm_home() -> None:
    """The arm is home."""


@_reason("warning", "")
def homing_blocked(cause: str) -> None:
    """Homing was stopped: the arm is held by {cause}."""


@_reason("warning", "")
def survey_blocked(cause: str) -> None:
    """The survey was stopped: the robot is held by {cause}."""


@_reason("info", "")
def survey_returns(places: float) -> None:
    """The survey drives back to look again at {places:.0f} {places:place|places}."""


@_reason("info", "")
def calibration_few_views(seen: float, needed: float) -> None:
    """The board was seen from {seen:.0f} places; it takes {needed:.0f}."""


@_reason("warning", "let the base stand still, and calibrate again")
def calibration_base_moved(distance: float) -> None:
    """The base moved by {distance:.1f} mm between the pictures of the board."""


@_reason("warning", "give the arm room to turn about more than one axis, and calibrate again")
def calibration_axes_parallel(turn: float, needed: float) -> None:
    """The pictures of the board are turned about one axis: {turn:.1f}° about a second one; it takes {needed:g}°."""


@_reason("warning", "see that the board is flat, of the right size and does not move, and calibrate again")
def calibration_error_high(pixels: float, limit: float) -> None:
    """The board's corners are {pixels:.2f} px from where they should be; at most {limit:g} px are allowed."""


@_reason("warning", "bring more light on the board, and calibrate again")
def calibration_unsure(angle: float, shift: float, most_angle: float, most_shift: float) -> None:
    """The calibration is uncertain by {angle:.2f}°, {shift:.1f} mm; allowed: {most_angle:.2f}°, {most_shift:g} mm."""


@_reason("warning", "look whether the camera is on its bracket as drawn")
def calibration_far(turn: float, shift: float) -> None:
    """By the board the camera is {turn:.1f}° and {shift:.0f} mm from where it is drawn: too far to be believed."""


@_reason("warning", "free the arm, and calibrate again")
def calibration_blocked(cause: str) -> None:
    """The calibration was stopped: the arm is held by {cause}."""


@_reason("info", "")
def board_seen(seen: float, places: float) -> None:
    """The camera has looked at the board from {places:.0f} places and has seen it from {seen:.0f}."""


@_reason("warning", "put the board 45 cm before the camera in its survey posture, and calibrate again")
def board_unseen(places: float) -> None:
    """The camera has looked from {places:.0f} places and has not seen the board."""


@_reason(
    "warning", "bring the arm to its survey posture (Home), put the board 45 cm before the camera, and calibrate again"
)
def board_not_ahead(cause: Reason) -> None:
    """The calibration has not begun: {cause}."""


@_reason("warning", "see that camera and perception work, and calibrate again")
def board_without_picture(cause: Reason) -> None:
    """The calibration has not begun, as the camera told nothing of the board: {cause}."""


@_reason("info", "")
def row_looked_at(seen: float, places: float) -> None:
    """The camera has looked at the row from {seen:.0f} of {places:.0f} places."""


@_reason("info", "")
def board_not_in_picture() -> None:
    """The board is not in this picture, or too little of it."""


@_reason("info", "")
def board_in_part(corners: float, needed: float) -> None:
    """Too little of the board is in this picture: {corners:.0f} of its corners; it takes {needed:.0f}."""


@_reason("info", "calibrate the camera first")
def no_calibration_offered() -> None:
    """There is no new calibration to use."""


@_reason("warning", "see that the disk has room and can be written")
def calibration_not_kept(cause: str) -> None:
    """The calibration could not be written: {cause}."""


@_reason("info", "")
def calibration_used(turn: float, shift: float) -> None:
    """The camera's new calibration is in use, {turn:.2f}° and {shift:.1f} mm from the old one; the row is seen anew."""


@_reason("info", "")
def withdrawn_for_calibration(point: str) -> None:
    """{point} was withdrawn, as camera or arm have a new calibration."""


@_reason("warning", "see that the board is in the picture from everywhere, and calibrate again")
def base_few_views(seen: float, needed: float) -> None:
    """The board was seen from {seen:.0f} places of the base; it takes {needed:.0f}."""


@_reason("warning", "calibrate again")
def base_clock_jumped(gap: float) -> None:
    """The robot's clock has jumped: {gap:.1f} s lie between two pictures of the board."""


@_reason("warning", "give the base room to drive and to turn, and calibrate again")
def base_moved_little(way: float, turn: float, least_way: float, least_turn: float) -> None:
    """The base moved by {way:.0f} mm and {turn:.0f}°; it takes {least_way:.0f} mm and {least_turn:.0f}°."""


@_reason("warning", "calibrate on firm, even ground, with a board that stands still")
def base_slipped(slip: float, most: float) -> None:
    """The wheels slipped, or the board moved: by {slip:.1f} % of the way; allowed: {most:g} %."""


@_reason("warning", "see that the board is of the right size and stands still, and calibrate again")
def base_implausible(radius: float, track: float, most: float) -> None:
    """By the board the wheels are {radius:.1f} % larger, {track:.1f} % wider apart: over {most:g} % off the drawing."""


@_reason("warning", "calibrate on firm ground, with light on the board")
def base_unsure(radius: float, track: float, most: float) -> None:
    """The wheels' radius is uncertain by {radius:.2f} % and their track by {track:.2f} %; allowed: {most:g} %."""


@_reason("warning", "free the base, and calibrate again")
def base_blocked(cause: str) -> None:
    """The calibration was stopped: the base is held by {cause}."""


@_reason("info", "calibrate the base first")
def no_base_offered() -> None:
    """There is no new calibration of the base to use."""


@_reason("info", "let the robot survey some metres")
def no_timing_offered() -> None:
    """There is no new calibration of the camera's clock to use."""


@_reason("info", "")
def timing_calibration_used(delay: float) -> None:
    """The camera clock's new calibration is in use: pictures are exposed {delay:.0f} ms later than their times tell."""


@_reason("warning", "let the robot come to rest, and use it again")
def calibration_in_motion() -> None:
    """A calibration is taken into use at rest only."""


@_reason("warning", "calibrate again")
def calibration_of_other_wheels(most: float) -> None:
    """The calibration differs from the wheels as drawn by more than {most:g} %, and is not used."""


@_reason("info", "")
def calibration_under_way() -> None:
    """A calibration is being written already."""


@_reason("warning", "")
def calibration_refused(cause: Reason) -> None:
    """The calibration was not taken into use: {cause}."""


@_reason("info", "")
def base_calibration_used(radius: float, track: float) -> None:
    """The base's new calibration is in use: its wheels are {radius:.2f} % larger, {track:.2f} % wider apart."""


@_reason("warning", "give the arm room to look from all around, and calibrate again")
def arm_postures_alike(sd: float, most: float) -> None:
    """The postures do not tell the arm's joints apart: ± {sd:.2f}° at best; allowed: {most:g}°."""


@_reason("warning", "see that the board is flat and does not move, with light on it, and calibrate again")
def arm_unsure(sd: float, most: float) -> None:
    """The zeros of the arm's joints are uncertain by {sd:.2f}°; allowed: {most:g}°."""


@_reason("warning", "see that the board is of the right size and stands still; else have the arm serviced")
def arm_far(joint: float, offset: float, most: float) -> None:
    """By the board the zero of joint {joint:.0f} is off by {offset:.1f}°; at most {most:.0f}° are believed."""


@_reason("info", "calibrate the arm first")
def no_arm_offered() -> None:
    """There is no new calibration of the arm to use."""


@_reason("info", "")
def arm_calibration_used(change: float) -> None:
    """The arm's new calibration is in use: its joints are up to {change:.2f}° from where they were taken to be."""


@_reason("warning", "use the camera's new calibration on the screen Engineer, or calibrate the camera again")
def camera_of_other_arm() -> None:
    """The camera was calibrated with other zeros of the arm's joints, and no longer fits."""


@_reason("warning", "cuts may miss")
def camera_looks_left(angle: float, sd: float) -> None:
    """The camera looks {angle:.1f}° (± {sd:.1f}°) to the left of where it was calibrated."""


@_reason("warning", "cuts may miss")
def camera_looks_right(angle: float, sd: float) -> None:
    """The camera looks {angle:.1f}° (± {sd:.1f}°) to the right of where it was calibrated."""


@_reason("warning", "cuts may miss")
def camera_looks_up(angle: float, sd: float) -> None:
    """The camera looks {angle:.1f}° (± {sd:.1f}°) above where it was calibrated."""


@_reason("warning", "cuts may miss")
def camera_looks_down(angle: float, sd: float) -> None:
    """The camera looks {angle:.1f}° (± {sd:.1f}°) below where it was calibrated."""


@_reason("warning", "points seen in motion are off; use the camera clock's new calibration on the screen Engineer")
def frames_late(offset: float, interval: float) -> None:
    """Camera pictures are {offset:.0f} ms (± {interval:.0f} ms) later than their times tell."""


@_reason("warning", "points seen in motion are off; use the camera clock's new calibration on the screen Engineer")
def frames_early(offset: float, interval: float) -> None:
    """Camera pictures are {offset:.0f} ms (± {interval:.0f} ms) earlier than their times tell."""


@_reason("warning", "calibrate it again")
def calibration_old(days: float) -> None:
    """The camera was calibrated {days:.0f} days ago."""


@_reason("warning", "calibrate it again")
def base_calibration_old(days: float) -> None:
    """The base was calibrated {days:.0f} days ago."""


@_reason("warning", "calibrate it again")
def arm_calibration_old(days: float) -> None:
    """The arm was calibrated {days:.0f} days ago."""


@_reason("warning", "check the camera, and use the new calibration of its clock, if there is one")
def timing_calibration_old(days: float) -> None:
    """The camera's clock was calibrated {days:.0f} days ago."""


@_reason("warning", "")
def survey_blind() -> None:
    """The survey has ended; perception has reported nothing."""


@_reason("info", "")
def surveyed(vines: float, spurs: float, points: float, unclear: float, asking: float) -> None:
    """Seen: {vines:.0f} {vines:vine|vines}, {spurs:.0f} {spurs:spur|spurs}, {points:.0f} {points:point|points};
    {unclear:.0f} unclear, {asking:.0f} to decide.
    """  # noqa: D205


@_reason("info", "")
def looked_again_without_point(vine: float, spur: float) -> None:
    """Looked again at vine {vine:.0f}, spur {spur:.0f}: nothing is left open, and there is nothing to cut."""


@_reason("info", "")
def looked_again(vine: float, spur: float, points: str) -> None:
    """Looked again at vine {vine:.0f}, spur {spur:.0f}: nothing is left open; points: {points}."""


@_reason("info", "")
def looked_again_unclear(vine: float, spur: float, why: Reason) -> None:
    """Looked again at vine {vine:.0f}, spur {spur:.0f}; still unclear: {why}."""


@_reason("info", "decide about it")
def looked_again_asks(vine: float, spur: float, why: Reason) -> None:
    """Looked again at vine {vine:.0f}, spur {spur:.0f}; it is for you to decide: {why}."""


@_reason("info", "")
def work_done() -> None:
    """No accepted point is left."""


@_reason("warning", "move the robot, or turn the approach")
def work_done_but(unreachable: float) -> None:
    """All that can be reached is cut; out of reach: {unreachable:.0f}."""


@_reason("warning", "")
def point_left(point: str, why: Reason) -> None:
    """{point} was left: {why}."""


@_reason("warning", "")
def point_gone() -> None:
    """The point has gone."""


@_reason("warning", "")
def accepted_again() -> None:
    """It was accepted again."""


@_reason("warning", "")
def point_not_cut(point: str, why: Reason) -> None:
    """{point} was not cut: {why}."""


@_reason("info", "")
def cut_done(point: str, outcome: Reason) -> None:
    """{point}: {outcome}."""


@_reason("warning", "")
def cut_ended(point: str, outcome: Reason) -> None:
    """{point}: {outcome}."""


@_reason("error", "look, and report the outcome")
def outcome_unknown(point: str, why: Reason) -> None:
    """The outcome of {point} is unknown: {why}."""


@_reason("warning", "")
def not_reached(goal: Goal, position_mm: float, rotation_deg: float) -> None:
    """In the time allowed {goal} was missed by {position_mm:.1f} mm and {rotation_deg:.1f}°."""


@_reason("warning", "")
def not_reached_for(goal: Goal, position_mm: float, rotation_deg: float, cause: str) -> None:
    """{cause} held the robot; {goal} was missed by {position_mm:.1f} mm and {rotation_deg:.1f}°."""


@_reason("warning", "")
def joints_not_reached(goal: Goal, rotation_deg: float, cause: str) -> None:
    """{cause} held the arm; {goal} was missed by {rotation_deg:.1f}° in a joint."""


@_reason("warning", "")
def retreat_by_joints(point: str, why: Reason) -> None:
    """{point}: the straight way back failed, the arm now retreats by its joints: {why}."""


@_reason("error", "look at both places before you go on")
def touched(part: str, other: str, force_n: float) -> None:
    """Contact with about {force_n:.0f} N: {part}, and probably {other}."""


@_reason("error", "look what it was before you go on")
def touched_unknown(part: str, force_n: float) -> None:
    """Contact with about {force_n:.0f} N: {part}, and something that the robot does not know."""


@_reason("warning", "look whether the cane can be bent aside, or cut this one by hand")
def cane_in_way(part: str, other: str, force_n: float) -> None:
    """A cane in the way, about {force_n:.0f} N: {part}, and probably {other}."""


@_reason("warning", "")
def cane_met(part: str, other: str, force_n: float) -> None:
    """A cane pushed with about {force_n:.0f} N: {part}, and probably {other}. The cut is tried again another way."""


@_reason("warning", "")
def missed_once(why: Reason) -> None:
    """{why}. The cut is tried again another way."""


@_reason("warning", "")
def not_seen_once(why: Reason) -> None:
    """{why}. The cut is tried again."""


@_reason("warning", "")
def given_up_after(tries: float, why: Reason) -> None:
    """After {tries:.0f} {tries:try|tries}: {why}."""


@_reason("info", "")
def cane_on_way_out(part: str, other: str, force_n: float) -> None:
    """A cane pushes on the way out, about {force_n:.0f} N: {part}, and probably {other}. The robot goes on."""


@_reason("info", "")
def backed_off() -> None:
    """After the contact the robot has gone back a little on its way."""


@_reason("warning", "look whether the robot is caught")
def not_backed_off() -> None:
    """After the contact the robot could not go back on its way."""


@_reason("error", "check the arm's connection and its control box")
def touch_unfelt() -> None:
    """The arm no longer reports external torques: no contact would be felt."""


@_reason("warning", "stay near the stop button")
def touch_never_felt() -> None:
    """The arm reports no external torques: contacts do not stop the robot."""


@_reason("error", "check the brakes, the drive and what may hold the robot")
def tracking_error(part: str, error_rad: float, limit_rad: float) -> None:
    """The robot does not follow: {part} is {error_rad:.2f} rad from its command; the limit is {limit_rad:.2f} rad."""


@_reason("warning", "move the point along its cane, or cut this one by hand")
def no_clear_posture(near: Reason) -> None:
    """Every posture that reaches it comes too near to an obstacle; in the best one: {near}."""


@_reason("warning", "move the point along its cane, or cut this one by hand")
def no_room_where_seen(near: Reason) -> None:
    """No approach has room where the close-up sees the cut: {near}."""


@_reason("info", "")
def turned_where_seen(point: str, near: Reason) -> None:
    """{point} is approached another way, for where the close-up sees it: {near}."""


@_reason("warning", "")
def too_near(place: Place, distance_mm: float, part: str, other: str, needed_mm: float) -> None:
    """{place}, {distance_mm:.0f} mm would be between {part} and {other}, {needed_mm:.0f} mm are needed."""


@_reason("warning", "")
def out_of_reach(distance: float, height: float) -> None:
    """No posture of the arm reaches it: it is {distance:.2f} m beside the robot's path and {height:.2f} m high."""


@_reason("warning", "")
def no_square_approach() -> None:
    """The cane points straight at the robot: no approach is square to it."""


@_reason("warning", "")
def not_reachable(why: Reason) -> None:
    """Not reachable: {why}."""


# Work: checks of a cut


@_reason("info", "")
def cutter_cut() -> None:
    """The cutter reports a cut."""


@_reason("warning", "")
def cutter_missed() -> None:
    """The cutter reports that nothing was cut."""


@_reason("error", "")
def cutter_unsure() -> None:
    """The cutter does not know whether it cut."""


@_reason("warning", "")
def no_order_given(limit_s: float) -> None:
    """No order was given within {limit_s:g} s."""


@_reason("error", "look whether it is cut")
def no_cutter_report(limit_s: float) -> None:
    """The cutter did not report for {limit_s:g} s."""


@_reason("info", "")
def cut_and_gone() -> None:
    """Cut, and the wood is off."""


@_reason("warning", "pull it out of the wires by hand")
def cut_and_hangs(aside_mm: float) -> None:
    """Cut; the cane has not fallen: it hangs {aside_mm:.0f} mm beside the cut."""


@_reason("error", "look")
def beside_but(report: Reason, aside_mm: float) -> None:
    """{report}, but its cane is seen {aside_mm:.0f} mm beside the cut."""


@_reason("error", "look")
def gone_but(report: Reason) -> None:
    """{report}, but the wood beyond is gone."""


@_reason("warning", "")
def unseen_after(report: Reason, why: Reason) -> None:
    """{report}; not seen afterwards: {why}."""


@_reason("warning", "")
def robot_left() -> None:
    """The robot left before the close-up."""


@_reason("warning", "")
def stands_cut_again(report: Reason) -> None:
    """{report}, but it still stands: it is cut once more."""


@_reason("error", "look")
def stands_unknown(report: Reason) -> None:
    """Twice: {report}. It still stands."""


@_reason("warning", "")
def stands_not_cut(report: Reason) -> None:
    """Twice: {report}. It was not cut."""


@_reason("warning", "")
def not_accepted_any_more() -> None:
    """It is not accepted any more."""


@_reason("warning", "")
def gone_already() -> None:
    """Its cane is off already, as the close-up shows."""


@_reason("warning", "")
def changed_in_close_up(why: Reason) -> None:
    """In the close-up: {why}."""


@_reason("warning", "")
def unseen_in_close_up(why: Reason) -> None:
    """The close-up did not show it: {why}."""


@_reason("info", "")
def blades_close_where_seen(point: str, age_s: float) -> None:
    """{point}: the blades close where a picture has shown the cane {age_s:.1f} s before."""


@_reason("info", "")
def blades_close_unseen(point: str) -> None:
    """{point}: no picture on the last way has shown the cane; the blades close where the close-up has seen it."""


@_reason("info", "")
def cut_where_seen(point: str, distance_mm: float) -> None:
    """{point} is cut {distance_mm:.0f} mm from where it was accepted: the close-up sees the same cane there."""


@_reason("info", "")
def cut_where_room(point: str, distance_mm: float) -> None:
    """{point} is cut {distance_mm:.0f} mm along the wood, where the blades have room: the same nodes stay."""


# Planning


@_reason("warning", "look at it and approve it first")
def preview_not_approved() -> None:
    """The preview is ready."""


@_reason("warning", "ask for one and approve it")
def preview_needed() -> None:
    """A preview before each cut is required."""


@_reason("warning", "approve it")
def preview_awaited(point: str) -> None:
    """The way to {point} waits for its preview."""


@_reason("warning", "ask for another preview")
def not_in_preview(point: str) -> None:
    """{point} is not in the approved preview as it is accepted now."""


@_reason("warning", "ask for another preview")
def not_cut_in_preview(point: str, why: Reason) -> None:
    """The approved preview does not cut {point}: {why}."""


@_reason("warning", "ask for another preview")
def skipped_before(point: str, before: str) -> None:
    """{before} was skipped, so that the motion to {point} is another one than was approved."""


@_reason("info", "")
def previewed_work_ended() -> None:
    """The work that it was approved for has ended."""


@_reason("info", "wait")
def robot_moves() -> None:
    """The robot still moves."""


@_reason("info", "wait")
def plan_being_made() -> None:
    """The plan is being made."""


@_reason("warning", "accept it first")
def point_to_accept(point: str, state: str) -> None:
    """{point} is {state}."""


@_reason("warning", "move the point that you want first to the front")
def another_comes_first(other: str, point: str) -> None:
    """In the order of work {other} comes before {point}."""


@_reason("error", "ask for another one")
def preview_failed(why: Reason) -> None:
    """The preview failed: {why}."""


@_reason("warning", "")
def robot_elsewhere(distance: float) -> None:
    """The robot stands {distance:.2f} m from its start."""


@_reason("warning", "")
def robot_turned(angle_deg: float) -> None:
    """The robot is turned by {angle_deg:.0f}° from its start."""


@_reason("warning", "")
def joint_elsewhere(angle_rad: float) -> None:
    """A joint of the arm is {angle_rad:.2f} rad from its start."""


@_reason("warning", "")
def accepted_later(point: str) -> None:
    """{point} was accepted after the preview was made."""


@_reason("warning", "")
def accepted_anew(point: str) -> None:
    """{point} was accepted again."""


@_reason("warning", "")
def no_longer_accepted(point: str) -> None:
    """{point} is no longer accepted."""


@_reason("warning", "")
def no_longer_reachable(point: str) -> None:
    """{point} cannot be reached any more."""


@_reason("warning", "")
def revised(point: str) -> None:
    """{point} was revised."""


@_reason("warning", "")
def order_changed_after() -> None:
    """The order of work was changed after it was made."""


@_reason("warning", "")
def approach_turned_after(point: str) -> None:
    """The approach to {point} was turned after it was made."""


@_reason("warning", "")
def new_obstacle(kind: str, x: float, y: float, z: float) -> None:
    """A {kind} is seen at ({x:.1f}, {y:.1f}, {z:.1f}) m that was not there when it was made."""


@_reason("warning", "")
def obstacle_near_way(kind: str, distance_mm: float, part: str, point: str, needed_mm: float) -> None:
    """A {kind} is seen {distance_mm:.0f} mm from the way of {part} to {point}, {needed_mm:.0f} mm are needed."""


@_reason("warning", "")
def obstacle_in_way(kind: str, part: str, point: str, needed_mm: float) -> None:
    """A {kind} is seen in the way of {part} to {point}, {needed_mm:.0f} mm are needed."""


@_reason("warning", "")
def work_ended_before() -> None:
    """The work ended before it."""


@_reason("warning", "lower arm_velocity_scale or arm_acceleration_scale")
def torque_lacking(joint: str, needed: float, limit: float) -> None:
    """On the way {joint} would need {needed:.0f} Nm, it has {limit:.0f} Nm."""


@_reason("warning", "")
def takes_too_long(limit_s: float) -> None:
    """The search takes longer than {limit_s:.0f} s a point."""


@_reason("error", "")
def planning_failed(why: Reason) -> None:
    """Planning failed: {why}."""


@_reason("error", "ask again, which starts it anew")
def planner_ended() -> None:
    """The planning process ended."""


@_reason("info", "wait")
def first_plan() -> None:
    """The first plan is being made."""


@_reason("info", "wait")
def plan_awaited() -> None:
    """A plan is about to be made."""


# Bridge


@_reason("warning", "")
def message_undecodable(size: float, detail: str) -> None:
    """{size:.0f} bytes are not a message of this topic: {detail}."""


@_reason("warning", "")
def message_without_type(size: float) -> None:
    """{size:.0f} bytes are not a message of this topic: their type is empty."""


@_reason("warning", "")
def message_too_large(size: float, limit: float) -> None:
    """{size:.0f} bytes are too many for a message, which has at most {limit:.0f}."""


@_reason("warning", "")
def command_old() -> None:
    """The sequence is not newer than the last."""


@_reason("warning", "")
def echo_unsent() -> None:
    """The command echoes a joint state that was never sent."""


@_reason("warning", "")
def command_late() -> None:
    """The command was computed from a joint state that is too old."""


@_reason("warning", "")
def velocity_not_finite() -> None:
    """The velocity is not a finite number."""


@_reason("warning", "")
def velocity_too_high() -> None:
    """The velocity is outside the robot's limits."""


@_reason("warning", "")
def must_begin_at_rest() -> None:
    """The first setpoint after a standstill must be zero."""


@_reason("warning", "")
def epoch_old() -> None:
    """The command is of an older controller."""


@_reason("warning", "")
def epoch_unknown() -> None:
    """The bridge has not issued this epoch."""


@_reason("warning", "")
def token_foreign() -> None:
    """The token does not belong to this epoch."""


@_reason("warning", "")
def token_held() -> None:
    """Another controller commands the robot; a token is issued once the other has ended or is silent."""


@_reason("warning", "")
def token_at_rest_only() -> None:
    """The robot still moves; a token is issued at rest."""


@_reason("error", "end the bridge and run: rolling-panda bridge --begin-anew")
def epochs_used_up() -> None:
    """No epoch is left."""


@_reason("warning", "")
def blades_busy() -> None:
    """The blades are still at the last cut."""


@_reason("error", "free the disk or replace it")
def cut_not_remembered() -> None:
    """The cut cannot be remembered: the disk is full or broken."""


@_reason("warning", "")
def cut_in_motion() -> None:
    """The robot moves; the blades close at rest."""


@_reason("warning", "reset the stop first")
def stop_latched() -> None:
    """The software stop is latched."""


@_reason("warning", "")
def cutter_inhibited() -> None:
    """No valid setpoint keeps the cutter enabled."""


@_reason("warning", "")
def not_in_command() -> None:
    """The command is not from the controller that commands the robot."""


@_reason("warning", "")
def other_refusals() -> None:
    """Refused for other reasons."""


@_reason("warning", "")
def refused_on(topic: str, cause: Reason, times: float) -> None:
    """Refused on {topic}, {times:.0f} times: {cause}."""


@_reason("warning", "")
def refused_once_on(topic: str, cause: Reason) -> None:
    """Refused on {topic}: {cause}."""


@_reason("info", "")
def token_given_back(epoch: float) -> None:
    """The controller that held epoch {epoch:.0f} has given way."""


@_reason("info", "")
def token_issued(epoch: float) -> None:
    """A controller has the token: epoch {epoch:.0f}."""


@_reason("warning", "")
def setpoints_missing() -> None:
    """No valid setpoint: the base stands, the arm holds, the cutter is inhibited."""


@_reason("info", "")
def setpoints_arrive() -> None:
    """Setpoints arrive: the robot follows."""


@_reason("warning", "check the camera's cable; until then odometry is by the wheels alone")
def inertial_lost() -> None:
    """The camera's inertial sensors send nothing."""


@_reason("info", "")
def inertial_works() -> None:
    """The camera's inertial sensors work again."""


@_reason("warning", "")
def robot_faulty(cause: Reason) -> None:
    """The robot does not move: {cause}."""


@_reason("info", "")
def robot_ready_again() -> None:
    """The robot is ready again; it waits for a setpoint at rest."""


@_reason("info", "")
def cut_reported(cut: str, result: Reason) -> None:
    """Cut {cut}: {result}."""


@_reason("warning", "")
def cut_not_done(cut: str, outcome: str, cause: Reason) -> None:
    """Cut {cut} is {outcome}: {cause}."""


@_reason("error", "stop the robot")
def moved_in_mode(mode: str) -> None:
    """The robot is commanded to move, though the controller's mode is {mode}."""


@_reason("error", "stop the robot")
def moved_without_mode() -> None:
    """The robot is commanded to move, though no controller publishes its mode."""


@_reason("warning", "")
def no_stop_latched() -> None:
    """No stop is latched."""


@_reason("warning", "release it first")
def emergency_button_pressed() -> None:
    """The robot's emergency stop button is pressed."""


@_reason("warning", "look at the newest stop first")
def another_stop_latched(latched: str, asked: str) -> None:
    """The latched stop is {latched}, not {asked}."""


# Bridge: devices


@_reason("error", "")
def device_fault(device: str, detail: str) -> None:
    """The {device} reports: {detail}."""


@_reason("error", "")
def both(first: Reason, second: Reason) -> None:
    """{first}; {second}."""


@_reason("warning", "start it without that to move the robot")
def bridge_reads_only() -> None:
    """The bridge was started with --readonly."""


@_reason("error", "see whether the base is on and its nodes run")
def base_silent(topic: str) -> None:
    """The base sends no wheel speeds on {topic}."""


@_reason("error", "see whether the base is on and its nodes run")
def base_unmonitored(topic: str) -> None:
    """The base sends no emergency-stop state on {topic}."""


@_reason("error", "")
def base_stopped(causes: str) -> None:
    """Emergency stop of the base: {causes}."""


@_reason("error", "confirm it at the base")
def base_stop_unconfirmed() -> None:
    """The emergency stop of the base is being confirmed."""


@_reason("error", "")
def base_runaway() -> None:
    """The wheels turn though zero is commanded; the relay board was told to stop the motors."""


@_reason("error", "")
def arm_connecting() -> None:
    """The arm is not connected yet."""


@_reason("error", "")
def arm_process_ended() -> None:
    """The process of the arm has ended."""


@_reason("error", "")
def arm_silent() -> None:
    """The control box of the arm sends no state."""


@_reason("error", "")
def arm_reflex(errors: str) -> None:
    """The arm has stopped by a reflex: {errors}."""


@_reason("error", "release it")
def arm_user_stopped() -> None:
    """The user stop of the arm is pressed."""


@_reason("error", "")
def arm_not_ready(mode: str) -> None:
    """The arm is not ready to move: it is in {mode}."""


@_reason("error", "")
def arm_not_recovered(detail: str) -> None:
    """The arm cannot recover: {detail}."""


@_reason("info", "")
def no_cut_yet() -> None:
    """Nothing has been cut yet."""


@_reason("warning", "")
def blades_jammed() -> None:
    """The blades jammed in the wood, and opened again."""


@_reason("info", "")
def blades_met() -> None:
    """The blades met."""


@_reason("warning", "")
def inhibited_before_closing() -> None:
    """The cutter was inhibited before the blades began to close."""


@_reason("warning", "")
def inhibited_while_closing() -> None:
    """The cutter was inhibited while the blades closed."""


@_reason("warning", "")
def cutter_silent(limit_s: float) -> None:
    """The cutter did not answer within {limit_s:g} s."""


@_reason("warning", "")
def cutter_jam_reported(detail: str) -> None:
    """The blades have jammed: {detail}."""


@_reason("warning", "")
def blades_not_closed() -> None:
    """The blades have jammed before their end position."""


@_reason("warning", "set [real.cutter] service")
def no_cutter() -> None:
    """No cutter is configured."""


@_reason("info", "")
def wood_severed(wood: str) -> None:
    """Severed: {wood}."""


@_reason("warning", "")
def nothing_between_blades() -> None:
    """Nothing was between the blades."""


@_reason("warning", "")
def blades_on_hard_part(kind: str) -> None:
    """The blades have jammed on a {kind}."""


@_reason("warning", "")
def wood_beyond_blades(kind: str, diameter_mm: float) -> None:
    """The blades have jammed: the {kind} is {diameter_mm:.0f} mm thick."""
