"""What may import what, where import-linter cannot say it, and that its contracts do notice a breach."""

import ast
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
PACKAGES = ("rolling_panda", "bridge", "controller", "perception", "server", "recorder", "labelling", "benchmarks")


def imports(file: Path) -> set[str]:
    """Every module that a file imports, wherever in it, with its dots."""
    found: set[str] = set()
    for node in ast.walk(ast.parse(file.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            found |= {name.name for name in node.names}
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{file}: import by full name"
            found.add(node.module or "")
    return found


def test_messages_and_errors_need_the_standard_library_and_msgspec_only() -> None:
    package = ROOT / "rolling_panda"
    for file in (package / "errors.py", *(package / "messages").glob("*.py")):
        outside = {name for name in imports(file) if not name.startswith("rolling_panda.messages")}
        assert {name.split(".")[0] for name in outside} <= sys.stdlib_module_names | {"msgspec"}, file


@pytest.mark.long
def test_a_socket_is_opened_by_few() -> None:
    users = {
        str(file.relative_to(ROOT))
        for package in PACKAGES
        for file in (ROOT / package).rglob("*.py")
        if "zenoh" in {module.split(".")[0] for module in imports(file)}
    }
    assert users == {"rolling_panda/transport/zenoh.py", "benchmarks/faults/faulty_router.py"}


@pytest.mark.parametrize(
    ("package", "breach", "contract"),
    [
        ("perception", "import controller", "processes share only rolling_panda"),
        ("rolling_panda", "import server", "rolling_panda imports no process"),
        ("server", "import zenoh", "zenoh behind rolling_panda.transport.zenoh"),
        ("server", "import mujoco", "MuJoCo behind bridge.sim"),
        ("bridge/core", "import rolling_panda.transport.zenoh", "the cores of processes have no wire"),
        ("controller", "import viser", "viser behind the server's scene"),
        ("bridge", "import tests.support.chromium", "nothing that is shipped to run imports benchmarks or tests"),
        ("tests/support", "import benchmarks.page", "only the tests of the benchmarks import them"),
        ("benchmarks", "import tests.web.test_page", "benchmarks import nothing of the tests but their support"),
    ],
)
def test_a_breach_is_noticed(tmp_path: Path, package: str, breach: str, contract: str) -> None:
    for name in (*PACKAGES, "tests"):
        for file in (ROOT / name).rglob("*.py"):
            copy = tmp_path / file.relative_to(ROOT)
            copy.parent.mkdir(parents=True, exist_ok=True)
            copy.write_bytes(file.read_bytes())
    (tmp_path / "pyproject.toml").write_bytes((ROOT / "pyproject.toml").read_bytes())
    (tmp_path / package / "breach.py").write_text(f'"""A breach."""\n\n{breach}\n')
    done = subprocess.run(
        [str(Path(sys.executable).with_name("lint-imports")), "--no-cache"],
        cwd=tmp_path,
        capture_output=True,
        text=True,
        timeout=60,
    )
    assert done.returncode == 1, done.stdout + done.stderr
    assert f"{contract} BROKEN" in done.stdout
