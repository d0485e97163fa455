"""The benchmark of contacts: when a robot that stopped counts as at rest."""

import math

import pytest

from benchmarks.control.contact import AT_REST, Standing, Trial, standing_after, summarise
from tests.support.worlds.contact_world import Moment

STOP = 5.0


def moments(*stretches):
    """Moments of 10 ms after a stop: how many, whether commanded to move, and the speed (m/s)."""
    each = [(commanded, speed) for count, commanded, speed in stretches for _ in range(count)]
    return [Moment(STOP + 0.01 * k, *moment) for k, moment in enumerate(each)]


def told(standing):
    return [each if each is None else round(each, 3) for each in (standing.zero_s, standing.rest_s, standing.until)]


def test_rest_is_what_lasts_until_the_way_back_and_not_a_turning_point_of_a_swing():
    stop = moments((3, True, 0.2), (2, False, 0.05), (1, False, 0.0), (4, False, 0.05), (10, False, 0.004))
    way_back = [Moment(each.at + 0.2, each.commanded, each.speed) for each in moments((100, True, 0.03))]
    assert told(standing_after(stop + way_back, STOP)) == [0.03, 0.1, STOP + 0.2]


def test_a_robot_that_creeps_when_the_way_back_begins_was_not_at_rest_and_rest_after_it_does_not_count():
    creeps = moments((3, True, 0.2), (20, False, 2 * AT_REST), (100, True, 0.03), (50, False, 0.0))
    assert told(standing_after(creeps, STOP)) == [0.03, None, STOP + 0.23]


def test_without_a_way_back_rest_lasts_until_the_end():
    assert told(standing_after(moments((3, True, 0.2), (20, False, 0.0)), STOP)) == [0.03, 0.03, math.inf]
    assert standing_after(moments((20, True, 0.0)), STOP) == Standing()


def test_time_before_the_stop_is_none_of_the_stop():
    earlier = [Moment(STOP - 0.5, False, 0.0), *moments((3, True, 0.2), (20, False, 0.0))]
    assert told(standing_after(earlier, STOP)) == [0.03, 0.03, math.inf]


def test_figures_tell_how_many_were_at_rest_before_the_way_back():
    def trial(zero_s, rest_s, back):
        return Trial("post", "link4", 0.1, False, True, True, 60.0, 0.01, zero_s, rest_s, True, back)

    figures = summarise([trial(0.03, 0.05, True), trial(0.05, 0.07, True), trial(0.25, None, False)])
    assert figures["rests_before_way_back"].value == pytest.approx(2 / 3)
    assert figures["way_back_gone"].value == pytest.approx(2 / 3)
    assert figures["to_zero_s_median"].value == pytest.approx(0.05)
    assert figures["to_rest_s_median"].value == pytest.approx(0.06)
