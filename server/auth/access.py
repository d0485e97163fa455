"""Access options of the command line: sign-in by password or single-use link, over TLS or on this machine alone."""

import argparse
import ipaddress
import ssl
from dataclasses import dataclass
from pathlib import Path

from rolling_panda.errors import InputError
from server.auth.users import UserFile


@dataclass(frozen=True)
class Tls:
    """Files of a certificate (with its chain) and its private key, PEM."""

    certificate: Path
    key: Path


@dataclass(frozen=True)
class Access:
    """The access to the server.

    Attributes:
        users: Users who sign in with a password; None where sign-in is by link.
        tls: None for plain HTTP.
    """

    users: UserFile | None = None
    tls: Tls | None = None

    @property
    def scheme(self) -> str:
        """URL scheme of the page."""
        return "http" if self.tls is None else "https"


def access(arguments: argparse.Namespace) -> Access:
    """The checked access options of the command line.

    Raises:
        InputError: Options or files do not fit, or sign-in by link would be open to other machines.
    """
    return Access(_users(arguments), _tls(arguments))


def _users(arguments: argparse.Namespace) -> UserFile | None:
    if arguments.users is None:
        if not _is_loopback(arguments.host):
            raise InputError(
                f"--host {arguments.host} is open to other machines, where a link that works once is not enough: "
                f"name a users file with --users, and a certificate with --tls-cert and --tls-key"
            )
        return None
    if arguments.sign_in_token_file is not None:
        raise InputError("--users and --sign-in-token-file exclude each other: with users, no link signs in")
    users = UserFile(arguments.users)
    if not users.all():
        raise InputError(
            f"nobody could sign in: {arguments.users} has no user; "
            f"run: rolling-panda user add NAME --role supervisor --file {arguments.users}"
        )
    return users


def _tls(arguments: argparse.Namespace) -> Tls | None:
    certificate, key = arguments.tls_cert, arguments.tls_key
    if certificate is None and key is None:
        return None
    if certificate is None or key is None:
        raise InputError("--tls-cert and --tls-key belong together; give both")
    try:
        ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER).load_cert_chain(certificate, key, password=lambda: b"")
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or getattr(error, "reason", None) or str(error)
        raise InputError(f"cannot use the certificate {certificate} with the key {key}: {reason}") from error
    return Tls(certificate, key)


def _is_loopback(host: str) -> bool:
    try:
        return ipaddress.ip_address(host).is_loopback
    except ValueError:
        return host == "localhost"
