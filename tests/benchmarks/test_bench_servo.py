"""The benchmark of the last way to a cut: its judge, and its figures of both."""

import pytest

from benchmarks.control.servo import WORLDS, Closing, Scene, close_blades, pictures, tell_cuts


def test_figures_are_of_the_same_cuts_with_and_without(capsys) -> None:
    without = Closing(aside=0.003, deep=0.004, time_s=3.0, sights=0)
    better = Closing(aside=0.001, deep=0.0, time_s=3.1, sights=5)
    worse = Closing(aside=0.006, deep=0.008, time_s=3.1, sights=4)
    figures = tell_cuts("wind", [(without, better), (without, better), (without, worse)])
    assert figures["nearer"] == 2 and figures["n"] == 3 and figures["longer_s"] == pytest.approx(0.1)
    assert figures["without"]["off_m_median"]["value"] == pytest.approx(0.005)
    assert figures["with"]["off_m_median"]["value"] == pytest.approx(0.001)
    assert "nearer in 2 of 3" in capsys.readouterr().out


def test_the_same_cane_stands_in_every_world_and_only_wind_moves_it() -> None:
    calm, wind = Scene(3300, WORLDS["calm"]), Scene(3300, WORLDS["wind 20 mm"])
    assert (calm.rest == wind.rest).all() and (calm.cane(0.0) == calm.cane(0.7)).all()
    assert not (wind.cane(0.0) == wind.cane(0.7)).all()


def test_without_disturbance_the_blades_close_around_the_middle_with_and_without_pictures() -> None:
    for servo in (False, True):
        made = close_blades(3300, WORLDS["calm"], servo)
        assert made is not None and made.off < 0.003 and (made.sights > 0) == servo


@pytest.mark.long
def test_rendered_pictures_show_the_cane_until_there_is_no_depth() -> None:
    found = pictures([210], "labels")
    near = [each for each in found if each.away < 0.04]
    assert near and all(each.told == "camera_not_at_standoff" for each in near)
    off = [each.off for each in found if each.off is not None]
    assert len(off) > 0.7 * (len(found) - len(near)) and max(off) < 0.003
