"""Version and environment of the program, for `/version` and the ledger."""

import hashlib
import os
import platform
from importlib import metadata

import msgspec

from rolling_panda import __version__

#: Environment variable with the source revision; the container image sets it.
REVISION = "ROLLING_PANDA_REVISION"


class About(msgspec.Struct, frozen=True, kw_only=True):
    """The running program."""

    name: str = "rolling-panda"
    version: str = __version__
    #: Source revision; empty where it is unknown.
    revision: str
    python: str
    #: SHA-256 over `name==version` of every installed package, sorted, a line each.
    packages_sha256: str


def about() -> About:
    """Version and environment of this process."""
    installed = sorted({f"{each.name.lower()}=={each.version}" for each in metadata.distributions()})
    return About(
        revision=os.environ.get(REVISION, ""),
        python=platform.python_version(),
        packages_sha256=hashlib.sha256("\n".join(installed).encode()).hexdigest(),
    )
