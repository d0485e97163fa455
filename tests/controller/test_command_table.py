"""The table of commands: each row has a handler that is reached, and each message is one that the wire takes."""

import msgspec
import pytest

from controller.config import ControllerConfig
from controller.core import Controller
from rolling_panda.commands import COMMANDS, INTENTS, Intent
from rolling_panda.config import RobotConfig
from rolling_panda.messages.perception import PruningRule
from rolling_panda.topics import INTENT, PLANT

#: A value of each field that a message needs.
VALUES = {
    "point_id": "p1", "revision": 1, "vine": 1, "spur": 1, "reason": "-", "outcome": "DONE", "preview_hash": "0f",
    "required": True, "rule": PruningRule(), "origin": (0.0, 0.0, 0.0), "direction": (1.0, 0.0, 0.0), "sequence": 1,
    "u": 0.5, "v": 0.5, "along": 0.0,
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
    assert "not something this controller does" not in answer.reason


def test_an_intent_outside_the_table_is_refused(controller):
    class Dance(Intent, frozen=True, kw_only=True):
        """No row has it."""

    answer = controller.answer(Dance(user="ada"), 0.0)
    assert not answer.ok and "Dance" in answer.reason


def test_every_command_is_a_request_of_its_process():
    for command in COMMANDS:
        service = PLANT if command.process == "perception" else INTENT
        assert command.message in service.requests and service.server == command.process


@pytest.mark.parametrize("command", COMMANDS, ids=lambda row: row.name)
def test_the_text_for_the_log_can_be_made(command):
    assert "{" not in command.text(example(command.message))
