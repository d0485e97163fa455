"""Clients that may hold control, and the fencing token of each command."""

from dataclasses import dataclass


@dataclass(frozen=True)
class Client:
    """Somebody who may hold control: a key that tells apart who has the same name, and the name."""

    key: str
    user: str


@dataclass(frozen=True)
class Token:
    """What every motion command and cut order carries: an older one actuates nothing.

    Attributes:
        epoch: Grows with each lease given, each new beginning and each start of the controller, durably.
        nonce: Random: two controllers that count alike are still told apart.
    """

    epoch: int
    nonce: str
