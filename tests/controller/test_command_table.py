"""The table of commands: each row has a handler that is reached, and each message is one that the wire takes."""

import math

import msgspec
import pytest

from controller.config import ControllerConfig
from controller.core import Controller
from rolling_panda import commands as intents
from rolling_panda import reasons
from rolling_panda.commands import COMMAND_OF, COMMANDS, INTENTS, Intent
from rolling_panda.config import RobotConfig
from rolling_panda.messages.perception import PruningRule
from rolling_panda.reasons import text_of
from rolling_panda.topics import INTENT, PLANT

#: A value of each field that a message needs.
VALUES = {
    "point_id": "p1", "revision": 1, "vine": 1, "spur": 1, "reason": "-", "outcome": "DONE", "preview_hash": "0f",
    "required": True, "rule": PruningRule(), "origin": (0.0, 0.0, 0.0), "direction": (1.0, 0.0, 0.0), "sequence": 1,
    "u": 0.5, "v": 0.5, "along": 0.0, "wrong": True, "made_at": 5.0,
    "posture": "over the row", "angles": ControllerConfig().work.home,
}  # fmt: skip


def example(message):
    needed = (field.name for field in msgspec.structs.fields(message) if field.required and field.name != "user")
    return message(user="ada", **{name: VALUES[name] for name in needed})


@pytest.fixture(scope="module")
def controller():
    return Controller(ControllerConfig(), RobotConfig())


@pytest.mark.parametrize("command", [row for row in COMMANDS if row.message in INTENTS], ids=lambda row: row.name)
def test_the_controller_answers_every_command_of_the_table(controller, command):
    answer = controller.answer(example(command.message), 0.0)
    assert answer.ok or answer.reason
    assert answer.reason is None or answer.reason.code != "command_unknown"


def test_an_intent_outside_the_table_is_refused(controller):
    class Dance(Intent, frozen=True, kw_only=True):
        """No row has it."""

    answer = controller.answer(Dance(user="ada"), 0.0)
    assert answer.reason == reasons.command_unknown("Dance")


def test_every_command_is_a_request_of_its_process():
    for command in COMMANDS:
        service = PLANT if command.process == "perception" else INTENT
        assert command.message in service.requests and service.server == command.process


@pytest.mark.parametrize("command", COMMANDS, ids=lambda row: row.name)
def test_the_line_of_the_log_names_the_person(command):
    if command.log is not None:
        line = command.log(example(command.message))
        assert dict(line.values)["user"] == "ada" and "{" not in text_of(line)


def test_the_line_of_the_log_has_what_was_asked_for():
    for asked, line in [
        (intents.RejectPoint(user="ada", point_id="p1"), reasons.point_rejected("ada", "p1")),
        (
            intents.RejectPoint(user="ada", point_id="p1", reason="rot"),
            reasons.point_rejected_because("ada", "p1", "rot"),
        ),
        (intents.MoveInQueue(user="ada", point_id="p1", revision=1), reasons.point_moved_last("ada", "p1")),
        (
            intents.MoveInQueue(user="ada", point_id="p1", revision=1, before="p2"),
            reasons.point_moved_before("ada", "p1", "p2"),
        ),
        (intents.SetApproach(user="ada", point_id="p1"), reasons.approach_freed("ada", "p1")),
        (intents.SetApproach(user="ada", point_id="p1", azimuth=math.pi / 2), reasons.approach_set("ada", "p1", 90.0)),
        (intents.JudgeCut(user="ada", point_id="p1", wrong=True), reasons.cut_judged_wrong("ada", "p1")),
        (intents.JudgeCut(user="ada", point_id="p1", wrong=False), reasons.cut_judged_right("ada", "p1")),
        (intents.RequestPreview(user="ada"), reasons.preview_requested("ada")),
        (intents.RequestPreview(user="ada", point_id="p1"), reasons.point_preview_requested("ada", "p1")),
        (intents.ApprovePreview(user="ada", preview_hash="0123456789"), reasons.preview_approved("ada", "01234567")),
        (intents.RequirePreview(user="ada", required=True), reasons.preview_required("ada")),
        (intents.RequirePreview(user="ada", required=False), reasons.preview_optional("ada")),
        (
            intents.ResolvePoint(user="ada", point_id="p1", outcome="DONE", reason="seen"),
            reasons.point_inspected_cut("ada", "p1", "seen"),
        ),
        (
            intents.ResolvePoint(user="ada", point_id="p1", outcome="FAILED_NOT_CUT", reason="seen"),
            reasons.point_inspected_not_cut("ada", "p1", "seen"),
        ),
    ]:
        assert COMMAND_OF[type(asked)].log(asked) == line
