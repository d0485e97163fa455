"""Signing in with name and password: one check at a time, and longer and longer waits for whoever guesses."""

import asyncio
import time
from collections.abc import Callable

from server.auth.sessions import SignInError
from server.auth.throttle import LoginThrottle
from server.auth.users import User, UserFile

#: A check takes 64 MiB and some 50 ms of a core; more than so many that wait are sent away.
_WAITING = 20


class Passwords:
    """Checks passwords against a users file. Belongs to the server's event loop."""

    def __init__(self, users: UserFile, clock: Callable[[], float] = time.monotonic) -> None:
        """Nobody has tried yet."""
        self.users = users
        self._clock = clock
        self._attempts = LoginThrottle()
        self._one = asyncio.Lock()
        self._waiting = 0

    async def enter(self, name: str, password: str, address: str) -> User:
        """The user whose name and password these are.

        Args:
            name: As given.
            password: As given.
            address: Where the attempt comes from.

        Raises:
            SignInError: Name or password is wrong, or too many bad attempts came before this one.
            InputError: The users file cannot be read.
        """
        if self._waiting >= _WAITING:
            raise SignInError("many are signing in right now; try again in 1 s", 1.0)
        keys = (f"name {name}", f"address {address}")
        self._waiting += 1
        try:
            # One at a time, so that a thousand guesses at once do not all come before the first has failed.
            async with self._one:
                wait = self._attempts.wait(keys, self._clock())
                if wait > 0.0:
                    raise SignInError(f"too many bad sign-ins; try again in {max(1.0, wait):.0f} s", wait)
                user = await asyncio.to_thread(self.users.check, name, password)
                if user is None:
                    self._attempts.failed(keys, self._clock())
                    raise SignInError("name or password is wrong")
                self._attempts.succeeded(keys)
                return user
        finally:
            self._waiting -= 1
