from bridge.watchdog import Watchdog


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
