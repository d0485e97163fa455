"""The wheel holds the product: no benchmarks, no training, no tests."""

from pathlib import Path

from hatchling.builders.wheel import WheelBuilder

ROOT = Path(__file__).resolve().parents[2]


def test_the_wheel_holds_the_packages_the_page_and_the_assets_and_nothing_else() -> None:
    files = {Path(file.distribution_path) for file in WheelBuilder(str(ROOT)).recurse_included_files()}
    assert {file.parts[0] for file in files} == {
        "rolling_panda", "bridge", "controller", "perception", "server", "recorder", "labelling"
    }  # fmt: skip
    assert not [file for file in files if "training" in file.parts]
    for needed in ("rolling_panda/data/web/index.html", "rolling_panda/data/assets/config/sim.toml"):
        assert Path(needed) in files
