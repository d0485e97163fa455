"""Which program this is: for `/version`, for the ledger, and for whoever asks what was running then."""

import hashlib
import os
import platform
from importlib import metadata

import msgspec

from rolling_panda import __version__

#: Which state of the source it was made from; the container image sets it.
REVISION = "ROLLING_PANDA_REVISION"


class About(msgspec.Struct, frozen=True, kw_only=True):
    """A program as it runs here."""

    name: str = "rolling-panda"
    version: str = __version__
    #: Commit that it was made from, empty where nobody said.
    revision: str
    python: str
    #: SHA-256 over `name==version` of every installed package, sorted, a line each.
    packages_sha256: str


def about() -> About:
    """What runs here."""
    installed = sorted({f"{each.name.lower()}=={each.version}" for each in metadata.distributions()})
    return About(
        revision=os.environ.get(REVISION, ""),
        python=platform.python_version(),
        packages_sha256=hashlib.sha256("\n".join(installed).encode()).hexdigest(),
    )
