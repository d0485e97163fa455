import json

import pytest

from benchmarks import tick
from benchmarks.__main__ import main


def test_tick_writes_the_figures_it_prints(tmp_path, capsys):
    file = tmp_path / "tick.json"
    assert main(["tick", "--steps", "150", "--json", str(file)]) == 0
    figures = json.loads(file.read_text())
    assert figures["steps"] == 150
    assert 0 < figures["median_us"] <= figures["p99_us"] <= figures["max_us"]
    assert f"median {figures['median_us']} us" in capsys.readouterr().out


def test_no_steps_are_refused(capsys):
    with pytest.raises(SystemExit) as end:
        tick.main(["--steps", "0"])
    assert end.value.code == 2
    assert "at least 1" in capsys.readouterr().err


def test_an_unknown_benchmark_is_refused_with_the_known_ones(capsys):
    with pytest.raises(SystemExit) as end:
        main(["tock"])
    assert end.value.code == 2
    assert "tick" in capsys.readouterr().err
