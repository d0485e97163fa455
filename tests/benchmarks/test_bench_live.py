import pytest

from benchmarks.control.live import Watched, configured, figures, main
from bridge.config import BridgeConfig
from controller.config import ControllerConfig
from rolling_panda.config import load_section


def test_the_demo_is_configured_for_the_rates_asked_for(tmp_path):
    path = tmp_path / "live.toml"
    path.write_text(configured(1000.0, 50.0))
    config = load_section(path, "controller", ControllerConfig)
    assert (config.rate_hz, config.base_every) == (1000.0, 20)
    assert load_section(path, "bridge", BridgeConfig).joints_hz == 1000.0


def test_figures_are_those_of_what_was_watched():
    seen = Watched(
        ticks=10_000,
        late=40,
        seconds=10.0,
        round_trip=[0.001, 0.002, 0.009],
        round_trip_worst=[0.004, 0.02, 0.01],
        tool_error=[0.003, 0.004] * 50,
        factor=[1.0],
        cores={"bridge": 0.4, "controller": 0.6},
    )
    found = figures(seen, 1000.0, 50.0)
    assert (found.achieved_hz, found.on_time_share, found.late_ticks) == (1000.0, 0.996, 40)
    assert (found.round_trip_median_s, found.round_trip_worst_s) == (0.002, 0.02)
    assert found.cores == 1.0
    assert (found.tool_error_rms_m, found.tool_error_p95_m) == (0.00354, 0.004)
    assert figures(Watched(ticks=1, seconds=1.0, round_trip=[0.1], round_trip_worst=[0.1], factor=[1.0]), 50.0, 50.0)


@pytest.mark.parametrize("words", [["--rate", "2000"], ["--rate", "100", "--base-rate", "200"], ["--base-rate", "1"]])
def test_rates_that_cannot_be_had_are_refused(words, capsys):
    with pytest.raises(SystemExit) as end:
        main(words)
    assert end.value.code == 2
    assert "outside" in capsys.readouterr().err
