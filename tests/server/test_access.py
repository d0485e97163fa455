"""What the server's options let in: what does not fit is one clear line, before anything is served."""

import argparse
import os
import pty
import signal
import time

import pytest
from cryptography.hazmat.primitives import serialization

from rolling_panda.errors import InputError
from server.__main__ import add_arguments
from server.auth.access import Tls, access
from server.auth.users import UserFile
from tests.support.certificates import self_signed


def told(*words):
    parser = argparse.ArgumentParser()
    add_arguments(parser)
    return access(parser.parse_args([str(word) for word in words]))


def test_on_this_machine_a_link_is_enough():
    for host in ("127.0.0.1", "127.8.8.8", "::1", "localhost"):
        assert told("--host", host).users is None
    assert told().scheme == "http"


@pytest.mark.parametrize("host", ["0.0.0.0", "::", "192.168.1.7", "panda.example.org"])
def test_for_other_machines_it_is_not(host):
    with pytest.raises(InputError, match=f"--host {host} is open to other machines.*--users"):
        told("--host", host)


def test_a_users_file_without_users_lets_nobody_in_and_says_so(tmp_path):
    with pytest.raises(InputError, match="nobody could sign in.*rolling-panda user add NAME"):
        told("--users", tmp_path / "none.json")


def test_users_let_in_from_elsewhere_but_not_beside_a_link(tmp_path):
    file = tmp_path / "users.json"
    UserFile(file).add("ada", "operator", "long enough a one")
    assert told("--host", "0.0.0.0", "--users", file).users.check("ada", "long enough a one")
    with pytest.raises(InputError, match="exclude each other"):
        told("--users", file, "--sign-in-token-file", tmp_path / "token")


def test_a_certificate_needs_its_own_key(tmp_path):
    certificate, key = self_signed(tmp_path)
    allowed = told("--tls-cert", certificate, "--tls-key", key)
    assert allowed.scheme == "https" and allowed.tls == Tls(certificate, key)
    with pytest.raises(InputError, match="belong together"):
        told("--tls-cert", certificate)
    (tmp_path / "other").mkdir()
    _, other = self_signed(tmp_path / "other")
    for wrong, why in (
        (other, r"\[X509: KEY_VALUES_MISMATCH"),
        (tmp_path / "none.pem", "No such file"),
        ("a\0b", "embedded null"),
    ):
        with pytest.raises(InputError, match=f"cannot use the certificate .* with the key [^:]*: {why}"):
            told("--tls-cert", certificate, "--tls-key", wrong)


def test_a_key_with_a_passphrase_is_refused_and_nobody_is_asked_for_it(tmp_path):
    certificate, key = self_signed(tmp_path)
    plain = serialization.load_pem_private_key(key.read_bytes(), None)
    locked = serialization.BestAvailableEncryption(b"secret")
    assert told("--tls-cert", certificate, "--tls-key", key).tls is not None
    key.write_bytes(plain.private_bytes(serialization.Encoding.PEM, serialization.PrivateFormat.PKCS8, locked))
    # OpenSSL itself would ask on the terminal, which a service has nobody at.
    child, terminal = pty.fork()
    if child == 0:
        try:
            told("--tls-cert", certificate, "--tls-key", key)
        except InputError:
            os._exit(7)
        finally:
            os._exit(8)
    end, status = time.monotonic() + 20.0, None
    while status is None and time.monotonic() < end:
        done, code = os.waitpid(child, os.WNOHANG)
        status = os.waitstatus_to_exitcode(code) if done else None
        time.sleep(0.01)
    if status is None:
        os.kill(child, signal.SIGKILL)
        os.waitpid(child, 0)
    os.close(terminal)
    assert status == 7
