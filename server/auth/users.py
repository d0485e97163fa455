"""The users file: names, roles and argon2 hashes of the passwords."""

import hashlib
import re
from pathlib import Path
from typing import Annotated

import msgspec
from argon2 import PasswordHasher
from argon2.exceptions import Argon2Error, InvalidHashError
from msgspec import Meta, Struct

from rolling_panda.errors import InputError
from rolling_panda.messages.types import Role
from rolling_panda.runtime.state_folder import replace_durably

MIN_LENGTH, MAX_LENGTH = 10, 200
_NAME = re.compile(r"[A-Za-z0-9_.\-][A-Za-z0-9_.\- ]{0,39}")
#: Checked for unknown names, so that their refusal takes as long as that of a wrong password.
_DUMMY_HASH = PasswordHasher().hash("nobody has this password: \0")


class User(Struct, frozen=True, forbid_unknown_fields=True):
    """A user; `password` is an argon2 hash with its own salt and cost."""

    name: Annotated[str, Meta(min_length=1, max_length=40)]
    role: Role
    password: str

    @property
    def fingerprint(self) -> str:
        """Digest that changes with role and password, and reveals neither."""
        return hashlib.sha256(msgspec.json.encode(self)).hexdigest()


class _Content(Struct, frozen=True, forbid_unknown_fields=True):
    users: tuple[User, ...] = ()


class UserFile:
    """Reads and changes a users file; every call reads it again."""

    def __init__(self, path: Path) -> None:
        """Bind the file, which need not exist yet."""
        self.path = path
        self._hasher = PasswordHasher()

    def all(self) -> tuple[User, ...]:
        """All users, by name; empty without a file.

        Raises:
            InputError: The file cannot be read or is invalid.
        """
        try:
            content = msgspec.json.decode(self.path.read_bytes(), type=_Content)
        except FileNotFoundError:
            return ()
        except OSError as error:
            raise InputError(f"cannot read the users file {self.path}: {error.strerror}") from error
        except (msgspec.MsgspecError, UnicodeDecodeError) as error:
            raise InputError(
                f"{self.path} is no users file: {error}; make one with `rolling-panda user add`"
            ) from error
        return content.users

    def check(self, name: str, password: str) -> User | None:
        """The user with this name and password, else None. Takes some 50 ms either way.

        Raises:
            InputError: The file cannot be read.
        """
        found = next((user for user in self.all() if user.name == name), None)
        try:
            self._hasher.verify(_DUMMY_HASH if found is None else found.password, password)
        except (Argon2Error, InvalidHashError, UnicodeEncodeError):
            return None
        return found

    def add(self, name: str, role: Role, password: str) -> None:
        """Add a user.

        Raises:
            InputError: The name is taken or invalid, the password is too short, or the file cannot be changed.
        """
        if not _NAME.fullmatch(name):
            raise InputError(f"{name!r} is no name; give 1 to 40 letters, digits, spaces and `_.-`, no space first")
        users = self.all()
        if any(user.name == name for user in users):
            raise InputError(f"there is a user {name!r} already; `rolling-panda user password` sets another password")
        self._write((*users, User(name, role, self._hashed(password))))

    def set_password(self, name: str, password: str) -> None:
        """Change a user's password.

        Raises:
            InputError: There is no such user, the password is too short, or the file cannot be changed.
        """
        user = self._known(name)
        self._write((*self._others(name), User(name, user.role, self._hashed(password))))

    def remove(self, name: str) -> None:
        """Remove a user.

        Raises:
            InputError: There is no such user, or the file cannot be changed.
        """
        self._known(name)
        self._write(self._others(name))

    def _known(self, name: str) -> User:
        users = self.all()
        for user in users:
            if user.name == name:
                return user
        names = ", ".join(user.name for user in users) or "nobody"
        raise InputError(f"there is no user {name!r} in {self.path}; there are {names}")

    def _others(self, name: str) -> tuple[User, ...]:
        return tuple(user for user in self.all() if user.name != name)

    def _hashed(self, password: str) -> str:
        if not MIN_LENGTH <= len(password) <= MAX_LENGTH:
            raise InputError(f"a password has {MIN_LENGTH} to {MAX_LENGTH} characters; this one has {len(password)}")
        return self._hasher.hash(password)

    def _write(self, users: tuple[User, ...]) -> None:
        content = msgspec.json.encode(_Content(tuple(sorted(users, key=lambda user: user.name))))
        try:
            self.path.parent.mkdir(mode=0o700, parents=True, exist_ok=True)
            replace_durably(self.path, msgspec.json.format(content) + b"\n")
        except OSError as error:
            raise InputError(f"cannot write the users file {self.path}: {error.strerror}") from error
