"""Passwords are checked one at a time, and neither guesses nor a crowd keep the others from signing in."""

import asyncio
import threading

import pytest

from rolling_panda.errors import InputError
from server.auth.passwords import Passwords
from server.auth.sessions import SignInError
from server.auth.throttle import FREE
from server.auth.users import User

ADA = User("ada", "operator", "hash")


class Users:
    """One user, whose password is `right`; checks wait for `go`."""

    def __init__(self):
        self.go = threading.Event()
        self.go.set()
        self.at_once = self.most_at_once = 0
        self.broken = False

    def check(self, name, password):
        self.at_once += 1
        self.most_at_once = max(self.most_at_once, self.at_once)
        self.go.wait(20.0)
        self.at_once -= 1
        if self.broken:
            raise InputError("the file is no users file")
        return ADA if (name, password) == ("ada", "right") else None


@pytest.fixture
def users():
    return Users()


async def refused(passwords, name="ada", password="wrong", address="1"):
    with pytest.raises(SignInError) as caught:
        await passwords.check(name, password, address)
    return caught.value


def test_a_crowd_is_checked_one_by_one_and_who_is_too_many_is_sent_away(users):
    async def crowd():
        passwords = Passwords(users, lambda: 0.0)
        users.go.clear()
        waiting = [asyncio.create_task(passwords.check("ada", "right", str(n))) for n in range(21)]
        await asyncio.sleep(0)
        users.go.set()
        *entered, away = await asyncio.gather(*waiting, return_exceptions=True)
        assert entered == [ADA] * 20 and users.most_at_once == 1
        assert isinstance(away, SignInError) and away.wait_s == 1.0 and away.reason.code == "sign_ins_crowded"
        assert await passwords.check("ada", "right", "late") == ADA
        # As many are let in again once the crowd has gone.
        again = [asyncio.create_task(passwords.check("ada", "right", str(n))) for n in range(21)]
        *entered, away = await asyncio.gather(*again, return_exceptions=True)
        assert entered == [ADA] * 20 and isinstance(away, SignInError)

    asyncio.run(crowd())


def test_who_guesses_waits_by_name_and_by_address_for_as_long_as_is_said(users):
    async def guesses():
        now = 0.0
        passwords = Passwords(users, lambda: now)
        for _ in range(FREE):
            assert (await refused(passwords)).wait_s == 0.0
        for name, address in (("ada", "2"), ("eve", "1")):
            told = await refused(passwords, name, "right", address)
            assert told.wait_s == 1.0 and "try again in 1 s" in str(told)
        now = 0.7
        told = await refused(passwords, password="right")
        assert told.wait_s == pytest.approx(0.3) and "try again in 1 s" in str(told)
        now = 1.1
        assert await passwords.check("ada", "right", "1") == ADA
        for _ in range(FREE - 1):
            assert (await refused(passwords)).wait_s == 0.0
        assert await passwords.check("ada", "right", "1") == ADA

    asyncio.run(guesses())


def test_a_users_file_that_cannot_be_read_keeps_no_place(users):
    async def broken():
        passwords = Passwords(users, lambda: 0.0)
        users.broken = True
        for _ in range(25):
            with pytest.raises(InputError, match="no users file"):
                await passwords.check("ada", "right", "1")
        users.broken = False
        assert await passwords.check("ada", "right", "1") == ADA

    asyncio.run(broken())
