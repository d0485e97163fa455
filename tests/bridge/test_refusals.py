from bridge.core.refusals import Refusals
from rolling_panda import reasons
from rolling_panda.transport.rejections import Rejections

LATE, BUSY = reasons.command_late(), reasons.blades_busy()


def test_the_first_of_a_kind_is_said_at_once_and_the_rest_summed_up() -> None:
    refusals = Refusals()
    for _ in range(3):
        refusals.add("command/motion", LATE)
    refusals.add("command/cut", BUSY)
    assert refusals.lines(0.0) == [
        reasons.refused_on("command/motion", LATE, 3),
        reasons.refused_once_on("command/cut", BUSY),
    ]
    for _ in range(7):
        refusals.add("command/motion", LATE)
    assert refusals.lines(1.0) == []
    assert refusals.lines(5.0) == [reasons.refused_on("command/motion", LATE, 7)]
    assert {(row.topic, row.count) for row in refusals.counts()} == {("command/motion", 10), ("command/cut", 1)}


def test_what_the_transport_counted_is_in_the_same_table_once() -> None:
    table = Rejections()
    refusals = Refusals(table)
    table.add("command/motion", reasons.velocity_not_finite())
    refusals.log("command/motion", reasons.velocity_not_finite())
    assert [row.count for row in refusals.counts()] == [1]
    assert len(refusals.lines(0.0)) == 1


def test_a_flood_of_different_reasons_stays_a_few_lines() -> None:
    refusals = Refusals()
    for number in range(1000):
        refusals.log("command/motion", reasons.message_undecodable(number, "it ends"))
    assert len(refusals.lines(0.0)) <= 51
