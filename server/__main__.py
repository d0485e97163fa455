"""The operator's server: `rolling-panda server` or `python -m server`."""

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path

from rolling_panda.runtime.process import run_process
from server.service import check, run


def main(argv: Sequence[str] | None = None) -> int:
    """Run the process; returns the exit code."""
    return run_process("server", "Serve the operator's page, REST and the 3-D view.", run, add_arguments, argv, check)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """The server's own options."""
    parser.add_argument("--host", default="127.0.0.1", help="address to listen on (default: %(default)s)")
    parser.add_argument("--port", type=int, default=8000, help="port of the page (default: %(default)s; 0 = any)")
    parser.add_argument(
        "--also-robot-id",
        action="append",
        default=[],
        metavar="NAME",
        help="another robot at the same router, beside --robot-id; may be given several times",
    )
    parser.add_argument(
        "--sign-in-token-file",
        type=Path,
        metavar="FILE",
        help="file with the token of the first sign-in link; deleted once read (default: make one, print the link)",
    )
    parser.add_argument(
        "--users", type=Path, metavar="FILE", help="sign in with name and password; see `rolling-panda user --help`"
    )
    parser.add_argument("--tls-cert", type=Path, metavar="FILE", help="certificate with its chain, PEM: serve HTTPS")
    parser.add_argument("--tls-key", type=Path, metavar="FILE", help="its private key, PEM")


if __name__ == "__main__":
    sys.exit(main())
