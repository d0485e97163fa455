"""`rolling-panda user`: the users who sign in with a password."""

import argparse
import getpass
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import get_args

from rolling_panda.errors import InputError, RollingPandaError
from rolling_panda.messages.types import Role
from rolling_panda.runtime.process import ROBOT_ID
from rolling_panda.runtime.state_folder import usual_state_folder
from server.auth.users import MIN_LENGTH, UserFile

FILE = "users.json"


def main(argv: Sequence[str] | None = None) -> int:
    """Run the command; returns the exit code."""
    arguments = _parser().parse_args(argv)
    path: Path = arguments.file or (arguments.state or usual_state_folder(arguments.robot_id)) / FILE
    try:
        output = arguments.run(UserFile(path), arguments)
    except RollingPandaError as error:
        print(f"rolling-panda user: {error}", file=sys.stderr)
        return 1
    except (KeyboardInterrupt, EOFError):
        print("rolling-panda user: nothing was changed", file=sys.stderr)
        return 1
    print(output)
    return 0


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="rolling-panda user",
        description="Users who sign in with a password: `rolling-panda server --users FILE`. Changes apply at once.",
    )
    commands = parser.add_subparsers(dest="command", metavar="COMMAND", required=True)
    add = commands.add_parser("add", help="add a user; prompts for the password")
    add.add_argument("--role", choices=get_args(Role), default="operator", help="(default: %(default)s)")
    add.set_defaults(run=_add)
    remove = commands.add_parser("remove", help="remove a user and end their sessions")
    remove.set_defaults(run=_remove)
    password = commands.add_parser("password", help="change a user's password and end their sessions")
    password.set_defaults(run=_password)
    everyone = commands.add_parser("list", help="names and roles")
    everyone.set_defaults(run=_list)
    for command in (add, remove, password):
        command.add_argument("name", help="letters, digits, spaces and `_.-`")
    for command in (add, password):
        command.add_argument("--password-stdin", action="store_true", help="read the password from standard input")
    for command in (add, remove, password, everyone):
        state = usual_state_folder("ROBOT_ID")
        command.add_argument("--robot-id", default=ROBOT_ID, help="robot on the wire (default: %(default)s)")
        command.add_argument("--state", type=Path, metavar="DIR", help=f"folder of its state (default: {state})")
        command.add_argument("--file", type=Path, metavar="FILE", help=f"users file (default: {FILE} in that folder)")
    return parser


def _add(users: UserFile, arguments: argparse.Namespace) -> str:
    users.add(arguments.name, arguments.role, _new_password(arguments.password_stdin))
    return f"{arguments.name} may sign in as {arguments.role}; the users file is {users.path}"


def _remove(users: UserFile, arguments: argparse.Namespace) -> str:
    users.remove(arguments.name)
    return f"{arguments.name} may sign in no more"


def _password(users: UserFile, arguments: argparse.Namespace) -> str:
    users.set_password(arguments.name, _new_password(arguments.password_stdin))
    return f"{arguments.name} has another password now"


def _list(users: UserFile, arguments: argparse.Namespace) -> str:
    return "\n".join(f"{user.role:<12}{user.name}" for user in users.all()) or "nobody may sign in"


def _new_password(from_stdin: bool) -> str:
    # Never an argument: those can be read by others on the machine and stay in the shell's history.
    if from_stdin:
        return sys.stdin.readline().rstrip("\n")
    password = getpass.getpass(f"Password, at least {MIN_LENGTH} characters: ")
    if getpass.getpass("Once more: ") != password:
        raise InputError("the two passwords differ; nothing was changed")
    return password


if __name__ == "__main__":
    sys.exit(main())
