"""What frames cost along a row."""

import json

import pytest

from benchmarks.__main__ import main


@pytest.mark.long
def test_each_vine_passed_is_a_line_and_what_is_known_grows_with_them(tmp_path, capsys):
    out = tmp_path / "growth.json"
    words = [
        "perception",
        "--growth",
        "--seed",
        "3",
        "--vines",
        "2",
        "--step",
        "0.4",
        "--segmenter",
        "labels",
        "--json",
        str(out),
    ]
    assert main(words) == 0
    first, second = json.loads(out.read_text())["stretches"]
    assert (first["vines"], second["vines"]) == (1, 2)
    assert first["frame_ms"] > 0.0 and second["spurs"] > first["spurs"] > 0
    assert len(capsys.readouterr().out.splitlines()) == 3


def test_a_network_that_is_not_there_is_told(tmp_path, capsys):
    assert main(["perception", "--growth", "--vines", "1", "--weights", str(tmp_path / "none.onnx")]) == 1
    assert "none.onnx" in capsys.readouterr().err
