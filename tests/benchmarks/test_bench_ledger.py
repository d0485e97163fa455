"""The bench of the ledger records real work, on three kinds of disk, and says what it cost."""

import json

import pytest

from benchmarks.__main__ import main

pytestmark = pytest.mark.processes


@pytest.mark.long
def test_it_measures_three_kinds_of_disk(tmp_path):
    file = tmp_path / "ledger.json"
    assert main(["ledger", "--seconds", "1.0", "--json", str(file)]) == 0
    figures = json.loads(file.read_text())
    for name in ("no disk", "disk", "slow disk"):
        assert figures[name]["steps"] == 100 and 0 < figures[name]["median_us"] <= figures[name]["p99_us"]
