from server.robots.event_log import EventLog


def filled(lines, count):
    log = EventLog(lines)
    for number in range(1, count + 1):
        log.add("bridge", "info", f"line {number}", 0.0)
    return log


def test_only_new_lines_come_oldest_first():
    log = filled(1000, 5)
    assert [event.text for event in log.after(3, 200)] == ["line 4", "line 5"]
    assert log.after(5, 200) == ()


def test_old_lines_go_when_it_is_full():
    log = filled(10, 25)
    assert [event.number for event in log.after(0, 200)] == list(range(16, 26))


def test_a_reader_gets_the_newest_when_there_are_too_many():
    assert [event.number for event in filled(1000, 500).after(0, 200)] == list(range(301, 501))


def test_a_reader_from_before_a_restart_gets_nothing():
    assert filled(10, 3).after(99, 200) == ()
