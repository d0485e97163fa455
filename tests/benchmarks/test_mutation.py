"""What is mutated and what may survive is up to date, and a survivor that nobody justified is told."""

from pathlib import Path

import pytest

from benchmarks.mutation.run import ROOT, Change, Found, justified, score
from benchmarks.mutation.targets import TARGETS
from rolling_panda.errors import InputError


def test_every_target_has_files_and_tests() -> None:
    for target in TARGETS.values():
        assert all(list(ROOT.glob(pattern)) for pattern in target.files)
        assert not any(path.startswith(("bridge/sim/", "bridge/fakes/")) for path in target.paths(ROOT))
        assert all((ROOT / "tests" / test).exists() for test in target.tests)


def test_what_may_survive_is_still_in_the_code_and_says_why() -> None:
    for row in justified():
        assert row.becomes and row.was not in row.becomes and len(row.why) > 10


def test_a_justification_of_code_that_is_gone_is_refused(tmp_path: Path) -> None:
    file = tmp_path / "justified.toml"
    file.write_text('[[justified]]\nfile = "Makefile"\nwas = "no such line"\nbecomes = ["x"]\nwhy = "y"\n')
    with pytest.raises(InputError, match="out of date: 'no such line' is not in Makefile"):
        justified(file)


def test_survivors_are_justified_or_told(tmp_path: Path) -> None:
    file = tmp_path / "justified.toml"
    file.write_text('[[justified]]\nfile = "Makefile"\nwas = ".PHONY:"\nbecomes = ["PHONY"]\nwhy = "a name"\n')
    fine, bad = Change("Makefile", ".PHONY:", "PHONY"), Change("Makefile", ".PHONY:", "")
    found = Found(mutants=20, chosen=12, counts={"killed": 5, "timeout": 1, "survived": 2}, alive=[fine, bad])
    told = score("make", found, justified(file))
    assert (told.mutants, told.tried, told.killed, told.justified, told.unjustified) == (20, 8, 6, 1, [bad])
    document = told.document(sample=12, seed=3)
    assert document["killed_share"][0] == 0.75 and document["unjustified"] == 1
