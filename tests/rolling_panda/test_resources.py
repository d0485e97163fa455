"""Data files are found in a checkout and in an installed wheel."""

from pathlib import Path

import pytest

from rolling_panda import resources
from rolling_panda.errors import ModelError


def test_in_a_checkout() -> None:
    assert resources.resource("assets/urdf/base.urdf").is_file()


def test_installed_from_a_wheel(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    package = tmp_path / "site-packages" / "rolling_panda"
    (package / "data" / "web").mkdir(parents=True)
    (package / "data" / "web" / "index.html").touch()
    monkeypatch.setattr(resources, "_PACKAGE", package)
    assert resources.resource("web/index.html") == package / "data" / "web" / "index.html"


def test_what_is_missing_is_named() -> None:
    with pytest.raises(ModelError, match=r"web/none\.html is not part of this installation"):
        resources.resource("web/none.html")


def test_the_arms_description_is_found_with_its_meshes() -> None:
    folder = resources.panda_description()
    assert (folder / "urdf" / "panda.urdf").is_file()
    assert any((folder / "meshes").rglob("*.dae"))
