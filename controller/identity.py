"""Clients that may hold control, and the fencing token of the commands."""

from dataclasses import dataclass


@dataclass(frozen=True)
class Client:
    """A client that may have control: its key, which distinguishes clients of one user, and the user's name."""

    key: str
    user: str


@dataclass(frozen=True)
class Token:
    """Fencing token: part of every motion command and cut order. The bridge refuses any other token.

    Attributes:
        epoch: Issued by the bridge, increased by one with each token.
        nonce: 64 random bits drawn by this controller.
    """

    epoch: int
    nonce: str
