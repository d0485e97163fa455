from bridge.core.refusals import Refusals
from rolling_panda.transport.rejections import Rejections


def test_the_first_of_a_kind_is_said_at_once_and_the_rest_summed_up() -> None:
    refusals = Refusals()
    for _ in range(3):
        refusals.add("command/motion", "too old")
    refusals.add("command/cut", "busy")
    assert refusals.lines(0.0) == ["refused on command/motion: too old (3 times)", "refused on command/cut: busy"]
    for _ in range(7):
        refusals.add("command/motion", "too old")
    assert refusals.lines(1.0) == []
    assert refusals.lines(5.0) == ["refused on command/motion: too old (7 times)"]
    assert {(row.topic, row.count) for row in refusals.counts()} == {("command/motion", 10), ("command/cut", 1)}


def test_a_long_reason_is_cut() -> None:
    refusals = Refusals()
    refusals.add("command/motion", "x" * 400)
    assert refusals.lines(0.0) == ["refused on command/motion: " + "x" * 300]


def test_what_the_transport_counted_is_in_the_same_table_once() -> None:
    table = Rejections()
    refusals = Refusals(table)
    table.add("command/motion", "NaN")
    refusals.log("command/motion", "NaN")
    assert [row.count for row in refusals.counts()] == [1]
    assert len(refusals.lines(0.0)) == 1


def test_a_flood_of_different_reasons_stays_a_few_lines() -> None:
    refusals = Refusals()
    for number in range(1000):
        refusals.log("command/motion", f"{number} bytes refused")
    assert len(refusals.lines(0.0)) <= 51
