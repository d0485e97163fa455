"""`rolling-panda certificates`: an authority of one's own and a certificate for each process, to begin with.

Whoever has an authority already makes these with it instead: what counts is the common name, PROCESS.ROBOT.
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
from rolling_panda.wire_access import ONLOOKER, common_name

ROUTER = "router"
NAMES = (ROUTER, *m.PROCESSES, ONLOOKER)
#: Names that the router is reached by on this machine and in compose.yaml.
_HOSTS = ("127.0.0.1", "localhost", ROUTER)
_DAYS = 365


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
        "--robot", default=ROBOT_ID, metavar="ID", help="robot that they are for (default: %(default)s)"
    )
    arguments = parser.parse_args(argv)
    try:
        make(arguments.out, (*_HOSTS, *arguments.host), arguments.days, arguments.robot)
    except RollingPandaError as error:
        print(f"rolling-panda certificates: {error}", file=sys.stderr)
        return 1
    print(f"{arguments.out}: ca.pem, and NAME.pem with NAME.key for {', '.join(NAMES)}; good for {arguments.days} days")
    print("Give each process ca.pem and its own two files only: rolling-panda PROCESS --certificates DIR")
    return 0


def make(folder: Path, hosts: Sequence[str], days: int, robot_id: str = ROBOT_ID) -> None:
    """Write ca.pem and a certificate with its key for each of `NAMES`.

    Args:
        folder: Is made; must not exist yet.
        hosts: Names and addresses by which the router is reached.
        days: How long they are good for.
        robot_id: The robot whose processes they are for.

    Raises:
        InputError: The folder is there already or cannot be made, or a value makes no sense.
    """
    if not 1 <= days <= 3650:
        raise InputError(f"--days {days} is out of range; give 1 to 3650")
    try:
        folder.mkdir(mode=0o700, parents=True)
    except OSError as error:
        raise InputError(f"cannot make {folder}: {error.strerror}; give --out a new folder") from error
    authority = ec.generate_private_key(ec.SECP256R1())
    issuer = _name("Rolling Panda, this wire's own authority")
    end = datetime.datetime.now(datetime.UTC) + datetime.timedelta(days=days)
    public = authority.public_key()
    root = (
        _certificate(issuer, issuer, public, end)
        .add_extension(x509.BasicConstraints(ca=True, path_length=0), critical=True)
        .add_extension(_usage(authority=True), critical=True)
        .add_extension(x509.SubjectKeyIdentifier.from_public_key(public), critical=False)
        .sign(authority, hashes.SHA256())
    )
    _write(folder / "ca.pem", root.public_bytes(serialization.Encoding.PEM), 0o644)
    for name in NAMES:
        common = ROUTER if name == ROUTER else common_name(name, robot_id)
        _issue(folder, name, common, hosts if name == ROUTER else (name,), authority, issuer, end)


def _issue(
    folder: Path,
    name: str,
    common: str,
    hosts: Sequence[str],
    authority: ec.EllipticCurvePrivateKey,
    issuer: x509.Name,
    end: datetime.datetime,
) -> None:
    key = ec.generate_private_key(ec.SECP256R1())
    purpose = ExtendedKeyUsageOID.SERVER_AUTH if name == ROUTER else ExtendedKeyUsageOID.CLIENT_AUTH
    certificate = (
        _certificate(_name(common), issuer, key.public_key(), end)
        .add_extension(x509.BasicConstraints(ca=False, path_length=None), critical=True)
        .add_extension(_usage(authority=False), critical=True)
        .add_extension(x509.ExtendedKeyUsage([purpose]), critical=False)
        .add_extension(x509.SubjectAlternativeName([_host(host) for host in hosts]), critical=False)
        .add_extension(x509.AuthorityKeyIdentifier.from_issuer_public_key(authority.public_key()), critical=False)
        .sign(authority, hashes.SHA256())
    )
    private = key.private_bytes(
        serialization.Encoding.PEM, serialization.PrivateFormat.PKCS8, serialization.NoEncryption()
    )
    _write(folder / f"{name}.pem", certificate.public_bytes(serialization.Encoding.PEM), 0o644)
    _write(folder / f"{name}.key", private, 0o600)


def _certificate(
    subject: x509.Name, issuer: x509.Name, key: ec.EllipticCurvePublicKey, end: datetime.datetime
) -> x509.CertificateBuilder:
    # An hour back, for machines whose clocks differ.
    begin = datetime.datetime.now(datetime.UTC) - datetime.timedelta(hours=1)
    builder = x509.CertificateBuilder().subject_name(subject).issuer_name(issuer).public_key(key)
    return builder.serial_number(x509.random_serial_number()).not_valid_before(begin).not_valid_after(end)


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
