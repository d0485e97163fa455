import pytest

from bridge.core.robot_time import RoundTrip


def test_it_tells_the_median_and_the_worst_of_the_last_second() -> None:
    trip = RoundTrip()
    assert (trip.median, trip.worst) == (0.0, 0.0)
    for number in range(200):
        at = number * 0.01
        trip.out(number, at)
        trip.back(number, at + (0.008 if number == 150 else 0.5 if number == 10 else 0.002))
    trip.forget(2.0)
    assert trip.median == pytest.approx(0.002)
    assert trip.worst == pytest.approx(0.008)


def test_an_answer_to_what_was_never_sent_says_nothing() -> None:
    trip = RoundTrip()
    trip.back(7, 1.0)
    trip.forget(1.0)
    assert trip.median == 0.0


def test_a_single_sample_is_forgotten_after_a_second() -> None:
    trip = RoundTrip()
    trip.out(1, 0.0)
    trip.back(1, 0.25)
    trip.forget(1.0)
    assert trip.worst == 0.25
    trip.forget(1.5)
    assert trip.worst == 0.0


def test_of_very_many_joint_states_the_last_thousand_are_waited_for() -> None:
    def worst(sent: int, answered: int) -> float:
        trip = RoundTrip()
        for number in range(sent):
            trip.out(number, 0.0)
        trip.back(answered, 0.5)
        return trip.worst

    assert worst(1000, 0) == 0.5
    assert worst(1001, 0) == 0.0
    assert worst(1001, 1) == worst(1001, 1000) == 0.5
