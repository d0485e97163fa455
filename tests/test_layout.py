"""Every file stays short enough to be read at one go."""

import subprocess

from rolling_panda.generate.__main__ import ROOT, generated

LONGEST = 400
SOURCES = ("*.py", "*.js", "*.css", "*.html")


def test_no_source_is_longer_than_four_hundred_lines() -> None:
    listed = subprocess.run(["git", "ls-files", *SOURCES], cwd=ROOT, capture_output=True, text=True, check=True)
    sources = [ROOT / name for name in listed.stdout.split() if (ROOT / name).exists()]
    assert {path.suffix for path in sources} == {".py", ".js", ".css", ".html"}
    written = set(sources) - generated().keys()
    lines = {path: len(path.read_text(encoding="utf-8").splitlines()) for path in written}
    long = {str(path.relative_to(ROOT)): count for path, count in lines.items() if count > LONGEST}
    assert not long, f"{LONGEST} lines are allowed; give one of the concepts in these its own file: {long}"
