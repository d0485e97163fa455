import json

import pytest
from matplotlib.figure import Figure
from PIL import Image

from benchmarks.common import plots
from benchmarks.common.documents import one_row_a_line
from benchmarks.peers.stopwatch import histogram


def reach(reached, target=0):
    return {
        "samples": [{"target": target, "t": [0.0, 0.1, 0.2], "omega": [0.05, 0.06, 0.07]}],
        "results": [
            {"target": i, "distance": 0.5 + 0.04 * i, "reached": reached(i), "position_error": 0.2} for i in range(100)
        ],
    }


def write(folder, name, document):
    (folder / name).write_text(one_row_a_line(document), encoding="utf-8")


def test_pictures_are_drawn_from_the_results_alone(tmp_path, capsys):
    write(tmp_path, "reach_hierarchy.json", reach(lambda i: True))
    write(tmp_path, "reach_nullspace.json", reach(lambda i: i < 10))
    assert plots.main(["--results", str(tmp_path), "--out", str(tmp_path / "out"), "reach_by_distance"]) == 0
    path = tmp_path / "out" / "reach_by_distance.png"
    assert str(path) in capsys.readouterr().out
    first = path.read_bytes()
    with Image.open(path) as picture:
        assert picture.width > 700
    # The same results give the same file, others another one.
    plots.main(["--results", str(tmp_path), "--out", str(tmp_path / "out"), "reach_by_distance"])
    assert path.read_bytes() == first
    write(tmp_path, "reach_nullspace.json", reach(lambda i: i < 60))
    plots.main(["--results", str(tmp_path), "--out", str(tmp_path / "out"), "reach_by_distance"])
    assert path.read_bytes() != first


def test_a_picture_without_its_file_is_left_out_and_said(tmp_path, capsys):
    assert plots.main(["--results", str(tmp_path), "--out", str(tmp_path)]) == 1
    said = capsys.readouterr().err
    assert all(name in said for name in plots.PICTURES)
    assert not list(tmp_path.glob("*.png"))


def test_omega_along_needs_one_goal_for_all(tmp_path, capsys):
    write(tmp_path, "reach_hierarchy.json", reach(lambda i: True))
    write(tmp_path, "reach_nullspace.json", reach(lambda i: False, target=1))
    assert plots.main(["--results", str(tmp_path), "--out", str(tmp_path), "omega_along_a_reach"]) == 1
    assert "no goal in common" in capsys.readouterr().err


@pytest.mark.parametrize("text", ["", "{", "[]", "{}"])
def test_a_broken_file_gets_one_line(tmp_path, capsys, text):
    (tmp_path / "reach_hierarchy.json").write_text(text)
    assert plots.main(["--results", str(tmp_path), "--out", str(tmp_path), "reach_by_distance"]) == 1
    error = capsys.readouterr().err
    assert error.startswith("rolling-panda bench plots:") and error.count("\n") == 1


def test_a_document_reads_back_with_one_row_a_line():
    document = {"machine": "m", "summary": {"reached": 3, "share": 1 / 3}, "results": [{"x": 1.0, "ok": True}] * 4}
    text = one_row_a_line(document)
    read = json.loads(text)
    assert read["results"] == document["results"]
    assert read["summary"] == {"reached": 3, "share": 0.333333}
    assert sum("ok" in line for line in text.splitlines()) == 4


def test_times_of_a_step_are_drawn_with_those_of_the_peers_that_are_there(tmp_path):
    def times(median):
        return {"median_us": median, "histogram": histogram([median] * 9)}

    document = times(150.0) | {"parts": {"step": times(50.0), "nullspace step": times(70.0)}}
    document["peers"] = [{"name": "Pink", "version": "4", **times(150.0)}, {"name": "TSID", "absent": "it crashed"}]
    write(tmp_path, "tick.json", document)
    figure = Figure()
    plots.PICTURES["tick"](tmp_path, figure)
    (axes,) = figure.axes
    assert [text.get_text() for text in axes.get_legend().get_texts()] == [
        "whole control step: 150 µs",
        "hierarchy, everything on: 50 µs",
        "nullspace: 70 µs",
        "Pink 4: 150 µs",
    ]
    assert plots.main(["--results", str(tmp_path), "--out", str(tmp_path), "tick"]) == 0
