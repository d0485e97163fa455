"""Which program runs here."""

from importlib import metadata

import pytest

from rolling_panda import __version__
from rolling_panda.cli.about import REVISION, about


def test_it_names_version_revision_and_what_is_installed(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(REVISION, "0123abc")
    told = about()
    assert (told.version, told.revision) == (__version__, "0123abc")
    assert about() == told
    installed = list(metadata.distributions())
    monkeypatch.setattr(metadata, "distributions", lambda: installed[1:])
    assert about().packages_sha256 != told.packages_sha256


def test_a_revision_that_nobody_told_is_empty(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv(REVISION, raising=False)
    assert about().revision == ""
