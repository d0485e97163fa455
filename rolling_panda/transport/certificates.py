"""`rolling-panda certificates`: a new certificate authority, and a certificate for each process.

An existing authority can issue them instead; access control needs the common name PROCESS.ROBOT.
"""

import argparse
import datetime
import ipaddress
import os
import sys
from collections.abc import Sequence
from pathlib import Path

from cryptography import x509
from cryptography.hazmat.primitives import hashes, serialization
from cryptography.hazmat.primitives.asymmetric import ec
from cryptography.x509.oid import ExtendedKeyUsageOID, NameOID

from rolling_panda import messages as m
from rolling_panda.errors import InputError, RollingPandaError
from rolling_panda.topics import ROBOT_ID
from rolling_panda.transport.access import BEARERS, ONLOOKER, RECORDER, common_name

ROUTER = "router"
NAMES = (ROUTER, *BEARERS)
#: Names with a separate folder under `--apart`.
APART = (ROUTER, *m.PROCESSES, RECORDER)
#: Names that the router is reached by on this machine and in compose.yaml.
_HOSTS = ("127.0.0.1", "localhost", ROUTER)
_DAYS = 365
#: Valid from 1970 on, so that a clock that was reset locks no robot out.
_NOT_BEFORE = datetime.datetime(1970, 1, 1, tzinfo=datetime.UTC)
#: No expiry, as in RFC 5280.
_NEVER = datetime.datetime(9999, 12, 31, 23, 59, 59, tzinfo=datetime.UTC)
#: Certificates that expire within this time are issued again.
_RENEWAL = datetime.timedelta(days=7)


def main(argv: Sequence[str] | None = None) -> int:
    """Run the command; returns the exit code."""
    parser = argparse.ArgumentParser(
        prog="rolling-panda certificates",
        description="Make an authority and certificates for mutual TLS on the robot's wire. The authority's own key is "
        "thrown away: for another certificate make all of them anew.",
    )
    parser.add_argument("--out", type=Path, required=True, metavar="DIR", help="new folder for them")
    parser.add_argument("--days", type=int, default=_DAYS, help="how long they are good for (default: %(default)s)")
    parser.add_argument(
        "--host", action="append", default=[], help="further name or address of the router; may be given several times"
    )
    parser.add_argument(
        "--robot",
        action="append",
        metavar="ID",
        help=f"robot that they are for; of several each has a folder of its own (default: {ROBOT_ID})",
    )
    parser.add_argument(
        "--apart",
        action="store_true",
        help="a folder for each process, with its own files and the onlooker's; one that is there already is kept as "
        "long as all are good for a week more",
    )
    arguments = parser.parse_args(argv)
    hosts, robots = (*_HOSTS, *arguments.host), tuple(arguments.robot or (ROBOT_ID,))
    try:
        if arguments.apart:
            kept = make_apart(arguments.out, hosts, arguments.days, robots)
            what = f"kept what was there, good until {kept:%Y-%m-%d}" if kept else f"good for {arguments.days} days"
            print(f"{arguments.out}: a folder for each of {', '.join(APART)}; {what}")
            return 0
        make(arguments.out, hosts, arguments.days, robots)
    except RollingPandaError as error:
        print(f"rolling-panda certificates: {error}", file=sys.stderr)
        return 1
    print(f"{arguments.out}: ca.pem, and NAME.pem with NAME.key for {', '.join(NAMES)}; good for {arguments.days} days")
    print("Give each process ca.pem and its own two files only: rolling-panda PROCESS --certificates DIR")
    return 0


def make(folder: Path, hosts: Sequence[str], days: int | None, robots: Sequence[str] = (ROBOT_ID,)) -> None:
    """Write ca.pem and a certificate with its key for each of `NAMES`; each robot of several has a folder of its id.

    Args:
        folder: A new folder, for this user alone.
        hosts: Names and addresses of the router.
        days: Validity; None for no expiry, for certificates that are removed after a run.
        robots: Ids of the robots.

    Raises:
        InputError: The folder exists or cannot be made, or a value is invalid.
    """
    _check(days)
    try:
        folder.mkdir(mode=0o700, parents=True)
    except OSError as error:
        raise InputError(f"cannot make {folder}: {error.strerror}; give --out a new folder") from error
    authority = _Authority(days)
    authority.issue(folder, ROUTER, ROUTER, hosts)
    for robot in robots:
        own = folder if len(robots) == 1 else folder / robot
        own.mkdir(mode=0o700, exist_ok=True)
        for name in BEARERS:
            authority.issue(own, name, common_name(name, robot), (name,))


def make_apart(
    folder: Path, hosts: Sequence[str], days: int, robots: Sequence[str] = (ROBOT_ID,)
) -> datetime.datetime | None:
    """A folder NAME for the router and each process, with its own files alone; for containers.

    Args:
        folder: Parent of the folders, which may exist, as volumes do; old certificates in them are removed.
        hosts: Names and addresses of the router.
        days: Validity.
        robots: Id of the one robot.

    Returns:
        Expiry of the existing certificates, when they are kept; None when new ones were issued.

    Raises:
        InputError: A folder cannot be written, or a value is invalid.
    """
    _check(days)
    if len(robots) != 1:
        raise InputError(f"--apart is for one robot; got {', '.join(robots)}")
    expiry = _expiry(folder)
    if expiry is not None and expiry > datetime.datetime.now(datetime.UTC) + _RENEWAL:
        return expiry
    authority = _Authority(days)
    for name in APART:
        own = folder / name
        try:
            own.mkdir(mode=0o700, parents=True, exist_ok=True)
            for old in (*own.glob("*.pem"), *own.glob("*.key")):
                old.unlink()
            common = ROUTER if name == ROUTER else common_name(name, robots[0])
            authority.issue(own, name, common, hosts if name == ROUTER else (name,))
            if name in m.PROCESSES:
                # For its health check.
                authority.issue(own, ONLOOKER, common_name(ONLOOKER, robots[0]), (ONLOOKER,))
        except OSError as error:
            raise InputError(f"cannot write to {own}: {error.strerror}; give --out a folder of one's own") from error
    return None


def _check(days: int | None) -> None:
    if days is not None and not 1 <= days <= 3650:
        raise InputError(f"--days {days} is out of range; give 1 to 3650")


def _expiry(folder: Path) -> datetime.datetime | None:
    """The first expiry of the certificates; None where one is missing or unreadable, or the authorities differ."""
    ends, authorities = [], set()
    try:
        for name in APART:
            if not (folder / name / f"{name}.key").is_file():
                return None
            authorities.add((folder / name / "ca.pem").read_bytes())
            ends.append(
                x509.load_pem_x509_certificate((folder / name / f"{name}.pem").read_bytes()).not_valid_after_utc
            )
    except (OSError, ValueError):
        return None
    return min(ends) if len(authorities) == 1 else None


def out_of_date(folder: Path, name: str) -> str:
    """Why the certificate of `name` in a folder is not valid by this machine's clock; empty where it is."""
    now = datetime.datetime.now(datetime.UTC)
    for file in (folder / "ca.pem", folder / f"{name}.pem"):
        try:
            found = x509.load_pem_x509_certificate(file.read_bytes())
        except (OSError, ValueError) as error:
            return f"{file} cannot be read: {error}"
        begin, end = found.not_valid_before_utc, found.not_valid_after_utc
        if not begin <= now <= end:
            return (
                f"{file} is good from {begin:%Y-%m-%d} to {end:%Y-%m-%d}, and this machine's clock says "
                f"{now:%Y-%m-%d}: set the clock, or make new ones with `rolling-panda certificates --out DIR`"
            )
    return ""


class _Authority:
    """Issues certificates; its key is never stored."""

    def __init__(self, days: int | None) -> None:
        self._key = ec.generate_private_key(ec.SECP256R1())
        self._issuer = _name("Rolling Panda, this wire's own authority")
        self._end = _NEVER if days is None else datetime.datetime.now(datetime.UTC) + datetime.timedelta(days=days)
        public = self._key.public_key()
        root = (
            _certificate(self._issuer, self._issuer, public, self._end)
            .add_extension(x509.BasicConstraints(ca=True, path_length=0), critical=True)
            .add_extension(_usage(authority=True), critical=True)
            .add_extension(x509.SubjectKeyIdentifier.from_public_key(public), critical=False)
            .sign(self._key, hashes.SHA256())
        )
        self._root = root.public_bytes(serialization.Encoding.PEM)

    def issue(self, folder: Path, name: str, common: str, hosts: Sequence[str]) -> None:
        """Write NAME.pem and NAME.key, and ca.pem where it is missing."""
        if not (folder / "ca.pem").exists():
            _write(folder / "ca.pem", self._root, 0o644)
        key = ec.generate_private_key(ec.SECP256R1())
        purpose = ExtendedKeyUsageOID.SERVER_AUTH if name == ROUTER else ExtendedKeyUsageOID.CLIENT_AUTH
        identifier = x509.AuthorityKeyIdentifier.from_issuer_public_key(self._key.public_key())
        certificate = (
            _certificate(_name(common), self._issuer, key.public_key(), self._end)
            .add_extension(x509.BasicConstraints(ca=False, path_length=None), critical=True)
            .add_extension(_usage(authority=False), critical=True)
            .add_extension(x509.ExtendedKeyUsage([purpose]), critical=False)
            .add_extension(x509.SubjectAlternativeName([_host(host) for host in hosts]), critical=False)
            .add_extension(identifier, critical=False)
            .sign(self._key, hashes.SHA256())
        )
        private = key.private_bytes(
            serialization.Encoding.PEM, serialization.PrivateFormat.PKCS8, serialization.NoEncryption()
        )
        _write(folder / f"{name}.pem", certificate.public_bytes(serialization.Encoding.PEM), 0o644)
        _write(folder / f"{name}.key", private, 0o600)


def _certificate(
    subject: x509.Name, issuer: x509.Name, key: ec.EllipticCurvePublicKey, end: datetime.datetime
) -> x509.CertificateBuilder:
    builder = x509.CertificateBuilder().subject_name(subject).issuer_name(issuer).public_key(key)
    return builder.serial_number(x509.random_serial_number()).not_valid_before(_NOT_BEFORE).not_valid_after(end)


def _name(common: str) -> x509.Name:
    return x509.Name([x509.NameAttribute(NameOID.COMMON_NAME, common)])


def _usage(authority: bool) -> x509.KeyUsage:
    return x509.KeyUsage(
        digital_signature=not authority,
        key_cert_sign=authority,
        crl_sign=authority,
        content_commitment=False,
        key_encipherment=False,
        data_encipherment=False,
        key_agreement=False,
        encipher_only=False,
        decipher_only=False,
    )


def _host(text: str) -> x509.GeneralName:
    try:
        return x509.IPAddress(ipaddress.ip_address(text))
    except ValueError:
        return x509.DNSName(text)


def _write(path: Path, content: bytes, mode: int) -> None:
    descriptor = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL, mode)
    with os.fdopen(descriptor, "wb") as file:
        file.write(content)


if __name__ == "__main__":
    sys.exit(main())
