"""Sign-in with name and password: one check at a time, with exponential backoff of failures."""

import asyncio
import time
from collections.abc import Callable

from rolling_panda import reasons
from server.auth.sessions import SignInError
from server.auth.throttle import LoginThrottle
from server.auth.users import User, UserFile

#: A check takes 64 MiB and some 50 ms of a core; further attempts than these are refused.
_MAX_WAITING = 20


class Passwords:
    """Checks passwords against a users file. Belongs to the server's event loop."""

    def __init__(self, users: UserFile, clock: Callable[[], float] = time.monotonic) -> None:
        """No attempt has failed."""
        self.users = users
        self._clock = clock
        self._throttle = LoginThrottle()
        self._lock = asyncio.Lock()
        self._waiting = 0

    async def check(self, name: str, password: str, address: str) -> User:
        """The user with this name and password.

        Args:
            name: As given.
            password: As given.
            address: Of the client.

        Raises:
            SignInError: Name or password is wrong, or too many attempts have failed.
            InputError: The users file cannot be read.
        """
        if self._waiting >= _MAX_WAITING:
            raise SignInError(reasons.sign_ins_crowded(), 1.0)
        keys = (f"name {name}", f"address {address}")
        self._waiting += 1
        try:
            # One at a time, so that concurrent guesses do not bypass the backoff.
            async with self._lock:
                wait = self._throttle.wait(keys, self._clock())
                if wait > 0.0:
                    raise SignInError(reasons.sign_in_throttled(max(1.0, wait)), wait)
                user = await asyncio.to_thread(self.users.check, name, password)
                if user is None:
                    self._throttle.failed(keys, self._clock())
                    raise SignInError(reasons.sign_in_wrong())
                self._throttle.succeeded(keys)
                return user
        finally:
            self._waiting -= 1
