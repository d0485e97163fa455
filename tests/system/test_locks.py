"""What is declared is locked, so that an install from the lock can run."""

import re
import tomllib
from pathlib import Path

import pytest
from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

ROOT = Path(__file__).resolve().parents[2]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
RUN = PROJECT["dependencies"]


@pytest.mark.parametrize(
    ("lock", "declared"),
    [
        ("requirements-run.lock", RUN),
        ("requirements-real.lock", RUN + PROJECT["optional-dependencies"]["real"]),
        ("requirements-training.lock", PROJECT["optional-dependencies"]["training"]),
        ("requirements-peers.lock", PROJECT["optional-dependencies"]["peers"]),
        ("requirements-docs.lock", PROJECT["optional-dependencies"]["docs"]),
        ("requirements.lock", RUN + PROJECT["optional-dependencies"]["dev"]),
    ],
)
def test_every_declared_dependency_is_locked_at_an_allowed_version(lock: str, declared: list[str]) -> None:
    pinned = dict(re.findall(r"^([A-Za-z0-9_.-]+)==(\S+)", (ROOT / lock).read_text(), re.MULTILINE))
    versions = {canonicalize_name(name): version for name, version in pinned.items()}
    for line in declared:
        wanted = Requirement(line)
        version = versions.get(canonicalize_name(wanted.name))
        assert version is not None, f"{wanted.name} is not in {lock}; run `make lock`"
        assert wanted.specifier.contains(version), f"{lock} has {wanted.name} {version}; run `make lock`"


@pytest.mark.parametrize(
    "lock",
    [
        "requirements-run.lock",
        "requirements-real.lock",
        "requirements-training.lock",
        "requirements-peers.lock",
        "requirements-mpc.lock",
        "requirements-docs.lock",
        "requirements.lock",
    ],
)
def test_a_lock_has_hashes_and_no_index_address(lock: str) -> None:
    text = (ROOT / lock).read_text()
    assert text.count("--hash=sha256:") >= len(re.findall(r"^\S+==", text, re.MULTILINE))
    assert "://" not in text


def test_what_is_installed_without_its_dependencies_is_locked_at_the_version_that_is_named() -> None:
    named = re.findall(r"^MPC := (.+)$", (ROOT / "Makefile").read_text(), re.MULTILINE)
    pinned = re.findall(r"^[A-Za-z0-9_.-]+==[^\s\\]+", (ROOT / "requirements-mpc.lock").read_text(), re.MULTILINE)
    assert named == [" ".join(pinned)]
    assert "--no-deps --require-hashes -r requirements-mpc.lock" in (ROOT / "Makefile").read_text()


@pytest.mark.parametrize("file", ["Makefile", "Dockerfile", "docs/deployment.md"])
def test_what_is_installed_from_a_lock_is_held_by_it_too(file: str) -> None:
    """Without it, pip takes the newest release of a package that another one wants with an extra, which has no hash."""
    installs = re.findall(r"--require-hashes -r (\S+)( -c \S+)?", (ROOT / file).read_text())
    assert installs
    for lock, held in installs:
        assert held == f" -c {lock}"
