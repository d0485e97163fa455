"""What the server relies on in viser beyond its public interface is missed, by its name, where it is gone."""

import ast
import dataclasses
import tomllib
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
import viser

from server.scene.viser_adapter import contract
from server.scene.viser_adapter.contract import ASSUMPTIONS, Assumption, ViserChangedError, check
from server.scene.viser_adapter.view_server import ViewServer

ROOT = Path(contract.__file__).resolve().parents[3]
ADAPTER = Path(contract.__file__).parent


@pytest.fixture(scope="module")
def server() -> Iterator[viser.ViserServer]:
    views = ViewServer(lambda: None)
    yield views.viser
    views.close()


class Without:
    """Viser's server without the attribute at the end of a path."""

    def __init__(self, server: Any, path: str) -> None:
        self._server, self._path = server, path

    def __getattr__(self, name: str) -> Any:
        first, _, rest = self._path.partition(".")
        if name == first and not rest:
            raise AttributeError(name)
        found = getattr(self._server, name)
        return Without(found, rest) if name == first else found


@dataclasses.dataclass
class Changed:
    """What a class of viser could become: with other fields."""

    other: int = 0

    def window_generator(self, client_id: int) -> None:
        """As before."""


def taken_away(assumption: Assumption, server: viser.ViserServer, monkeypatch: pytest.MonkeyPatch) -> Any:
    """Viser as it would be where an assumption does not hold."""
    kind, _, path = assumption.name.partition(".")
    if kind == "ViserServer":
        return Without(server, path)
    if "window_generator" in path:
        monkeypatch.setattr(contract.buffers.AsyncMessageBuffer, "window_generator", lambda self, name: None)
    elif kind == "AsyncMessageBuffer":
        monkeypatch.setattr(contract.buffers, "AsyncMessageBuffer", Changed)
    elif assumption.name.startswith("viser._messages."):
        monkeypatch.setattr(contract.messages, assumption.name.split(".")[2].partition("(")[0], Changed)
    elif "index.html" in assumption.name:
        page = contract.client_page().replace(assumption.name.split("'")[1].encode(), b"another();")
        monkeypatch.setattr(contract, "client_page", lambda: page)
    else:
        # A getter that gives away a copy.
        copied = property(lambda handle: handle._impl.position.copy())
        monkeypatch.setattr(viser.SceneNodeHandle, "position", copied)
    return server


def test_this_viser_is_as_the_server_needs_it(server: viser.ViserServer) -> None:
    check(server)


@pytest.mark.parametrize("assumption", ASSUMPTIONS, ids=[each.name for each in ASSUMPTIONS])
def test_what_is_gone_is_named_with_what_breaks(
    assumption: Assumption, server: viser.ViserServer, monkeypatch: pytest.MonkeyPatch
) -> None:
    with pytest.raises(ViserChangedError) as caught:
        check(taken_away(assumption, server, monkeypatch))
    told = str(caught.value)
    assert f"lacks {assumption.name}," in told and assumption.breaks in told and contract.TESTED_VERSION in told


def test_every_private_name_in_the_adapter_is_in_the_contract() -> None:
    known = "".join(each.name for each in ASSUMPTIONS)
    for file in ADAPTER.glob("*.py"):
        for node in ast.walk(ast.parse(file.read_text(encoding="utf-8"))):
            if isinstance(node, ast.Attribute) and node.attr.startswith("_") and not node.attr.startswith("__"):
                if not (isinstance(node.value, ast.Name) and node.value.id == "self"):
                    assert node.attr in known, f"{file.name}: {ast.unparse(node)}"


def test_every_used_attribute_is_in_the_contract() -> None:
    """What is read from viser's private objects: each attribute of `_server` and of a message buffer."""
    known = "".join(each.name for each in ASSUMPTIONS)
    for node in ast.walk(ast.parse((ADAPTER / "view_server.py").read_text(encoding="utf-8"))):
        if isinstance(node, ast.Attribute) and ast.unparse(node.value) in ("self._server", "buffer"):
            assert node.attr in known, ast.unparse(node)


@pytest.mark.long
def test_nothing_outside_the_adapter_knows_viser_from_inside() -> None:
    for package in (
        "rolling_panda",
        "bridge",
        "controller",
        "perception",
        "server",
        "recorder",
        "labelling",
        "benchmarks",
    ):
        for file in (ROOT / package).rglob("*.py"):
            if file.is_relative_to(ADAPTER):
                continue
            tree = ast.parse(file.read_text(encoding="utf-8"))
            for node in ast.walk(tree):
                modules = [name.name for name in node.names] if isinstance(node, ast.Import) else []
                if isinstance(node, ast.ImportFrom):
                    modules = [node.module or "", *(f"{node.module}.{name.name}" for name in node.names)]
                assert not any(each.startswith(("viser.", "viser._")) for each in modules), f"{file}: {modules}"
                if package == "server" and file.parent.name == "scene" and isinstance(node, ast.Attribute):
                    private = node.attr.startswith("_") and not node.attr.startswith("__")
                    assert not private or ast.unparse(node.value) == "self", f"{file}: {ast.unparse(node)}"


def test_the_tested_version_is_the_one_that_is_installed() -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    assert f"viser=={contract.TESTED_VERSION}" in project["dependencies"]
