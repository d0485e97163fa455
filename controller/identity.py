"""Clients that may hold control, and the fencing token of the commands."""

from dataclasses import dataclass


@dataclass(frozen=True)
class Client:
    """Somebody who may hold control: a key that tells apart who has the same name, and the name."""

    key: str
    user: str


@dataclass(frozen=True)
class Token:
    """What every motion command and cut order carries: any other one actuates nothing.

    Attributes:
        epoch: Given out by the bridge, one more with each token.
        nonce: Drawn by this controller, 64 random bits.
    """

    epoch: int
    nonce: str
