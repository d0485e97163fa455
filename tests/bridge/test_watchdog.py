from bridge.core.limiter import Watchdog


def test_a_setpoint_is_followed_then_fades_then_the_watchdog_trips() -> None:
    watchdog = Watchdog(0.07, 0.2)
    watchdog.feed(1.0)
    assert watchdog.trust(1.069) == 1.0
    assert 0.45 < watchdog.trust(1.135) < 0.55
    assert not watchdog.tripped(1.199)
    assert watchdog.trust(1.2001) == 0.0
    assert watchdog.tripped(1.2001)


def test_it_starts_tripped() -> None:
    watchdog = Watchdog(0.07, 0.2)
    assert watchdog.tripped(0.0)
    assert watchdog.trust(0.0) == 0.0


def test_a_late_older_setpoint_does_not_turn_the_clock_back() -> None:
    watchdog = Watchdog(0.07, 0.2)
    watchdog.feed(1.0)
    watchdog.feed(0.5)
    assert watchdog.trust(1.05) == 1.0


def test_jitter_shorter_than_the_fade_changes_nothing() -> None:
    watchdog = Watchdog(0.07, 0.2)
    for feed in range(100):
        watchdog.feed(feed * 0.069)
        assert watchdog.trust(feed * 0.069 + 0.068) == 1.0


def test_a_setpoint_that_takes_long_to_brake_fades_early_enough_to_be_nothing_at_the_deadline() -> None:
    watchdog = Watchdog(0.07, 0.2)
    watchdog.feed(1.0, braking_s=0.16)
    assert watchdog.trust(1.039) == 1.0
    assert 0.45 < watchdog.trust(1.12) < 0.55
    watchdog.feed(2.0, braking_s=0.05)
    assert watchdog.trust(2.069) == 1.0
    # Beyond what any brake can do, a setpoint is followed for two periods of control.
    watchdog.feed(3.0, braking_s=5.0)
    assert watchdog.trust(3.019) == 1.0 and watchdog.trust(3.03) < 1.0
