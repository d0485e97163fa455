"""The session's report, from rows as the ledger has them."""

from datetime import UTC, datetime

from msgspec.structs import replace

from controller.ledger.journal import RequestRow, TicketRow
from controller.ledger.session_report import SessionReportBuilder
from rolling_panda import commands as intents
from rolling_panda import messages as m
from rolling_panda import reasons
from rolling_panda.messages.supervision import SessionReport, Timeline
from rolling_panda.messages.types import Answer
from rolling_panda.transport.codec import StrictDecoder, encode
from tests.support.fake_wire import pruning_point

BEGAN = datetime(2026, 1, 31, 9, 0, tzinfo=UTC).timestamp()


def at(seconds):
    return datetime.fromtimestamp(BEGAN + seconds, UTC).isoformat(timespec="microseconds")


def ticket(name, state, vine=1, **changes):
    usual = {"point": replace(pruning_point(name), vine=vine), "state": state, "cut_id": f"c-{name}"}
    return TicketRow(**(usual | changes))


STANDS, LATE = reasons.stands_not_cut(reasons.cutter_missed()), reasons.not_reached("the cut", 4.0, 0.5)


def asked(intent, reason=None):
    return RequestRow(asked=intent, reason=reason, mode="READY")


def line(process, reason):
    return m.LogEvent(header=m.Header(), process=process, reason=reason)


def report(*rows):
    account = SessionReportBuilder()
    for seconds, row in rows:
        account.add(at(seconds), row)
    # As it comes to the server.
    return StrictDecoder(SessionReport).decode(encode(account.report()))


def test_a_cut_takes_from_the_order_of_the_one_before_or_from_the_start_of_work_to_its_own():
    told = report(
        (0.0, asked(intents.Arm(user="ada"))),
        (10.0, asked(intents.Start(user="ada"))),
        (13.0, ticket("a", "CUTTING", user="ada")),
        (17.0, ticket("b", "CUTTING", vine=2, user="ada")),
        # Seen on the way to the next one.
        (17.2, ticket("a", "DONE")),
        (17.5, ticket("b", "FAILED_NOT_CUT", vine=2, reason=STANDS)),
        (60.0, asked(intents.Continue(user="ada"))),
        (63.0, ticket("c", "CUTTING", vine=2, user="ada")),
        (65.0, ticket("c", "DONE", vine=2, user="ada")),
    )
    assert told.began_at == BEGAN
    assert [(cut.point_id, cut.outcome, round(cut.seconds, 3)) for cut in told.cuts] == [
        ("a", "DONE", 3.0),
        ("b", "FAILED_NOT_CUT", 4.0),
        ("c", "DONE", 3.0),
    ]
    assert told.cuts[1].reason == STANDS and told.cuts[1].ended_at == BEGAN + 17.5
    assert [(vine.vine, vine.done, vine.not_cut, round(vine.seconds, 3)) for vine in told.vines] == [
        (1, 1, 0, 3.0),
        (2, 1, 1, 7.0),
    ]


def test_a_cut_that_was_tried_twice_is_one_cut():
    told = report(
        (0.0, asked(intents.Start(user="ada"))),
        (3.0, ticket("a", "CUTTING", user="ada", cut_id="first")),
        (6.0, ticket("a", "CUTTING", user="ada", cut_id="second")),
        (8.0, ticket("a", "FAILED_NOT_CUT", cut_id="second", reason=STANDS)),
    )
    assert [(cut.cut_id, cut.outcome, round(cut.seconds, 3)) for cut in told.cuts] == [
        ("second", "FAILED_NOT_CUT", 6.0)
    ]
    assert told.cut_count == 1


def test_the_timeline_tells_modes_cuts_and_refusals_and_no_other_line():
    builder = SessionReportBuilder()
    lines = (
        reasons.mode_changed("IDLE", "READY", reasons.said("armed")),
        reasons.points_accepted("ada", 3, 0.8),
        reasons.cut_done("a", reasons.cut_and_gone()),
        reasons.cut_ended("b", STANDS),
        reasons.teleoperation_refused(reasons.control_held("ada")),
        reasons.robot_halted("AUTO", "ESTOP_LATCHED", reasons.said("a dog")),
    )
    changed = [builder.add(at(float(n)), line("controller", reason)) for n, reason in enumerate(lines)]
    assert changed == [True, False, True, True, True, True]
    assert not builder.add(at(9.0), line("perception", lines[2])), "only the controller decides about cuts"
    told = StrictDecoder(Timeline).decode(encode(builder.timeline()))
    assert [(round(each.at - BEGAN, 3), each.kind, each.mode) for each in told.events] == [
        (0.0, "mode", "READY"),
        (2.0, "cut", ""),
        (3.0, "failed_cut", ""),
        (4.0, "refusal", ""),
        (5.0, "mode", "ESTOP_LATCHED"),
    ]
    assert (told.began_at, told.ended_at) == (BEGAN, BEGAN + 9.0)


def test_a_cut_is_one_event_though_the_cutter_reports_it_before_the_close_up_decides():
    builder = SessionReportBuilder()
    lines = (
        reasons.cut_done("a", reasons.cutter_cut()),
        reasons.cut_done("b", reasons.cutter_cut()),
        reasons.cut_done("a", reasons.cut_and_gone()),
        reasons.cut_ended("b", reasons.stands_unknown(reasons.cutter_cut())),
        # Without a close-up the cutter's report is all there is.
        reasons.cut_ended("c", reasons.cutter_missed()),
        # A second cut of a point is another event.
        reasons.cut_done("a", reasons.cutter_cut()),
    )
    for n, reason in enumerate(lines):
        builder.add(at(float(n)), line("controller", reason))
    told = builder.timeline()
    assert [(round(each.at - BEGAN, 3), each.kind) for each in told.events] == [
        (2.0, "cut"),
        (3.0, "failed_cut"),
        (4.0, "failed_cut"),
        (5.0, "cut"),
    ]
    assert told.left_out == 0


def test_a_long_session_keeps_its_newest_events_and_counts_the_others():
    builder = SessionReportBuilder()
    for n in range(520):
        builder.add(at(float(n)), line("controller", reasons.cut_done(f"p{n}", reasons.cut_and_gone())))
    told = StrictDecoder(Timeline).decode(encode(builder.timeline()))
    assert (len(told.events), told.left_out, told.events[0].at) == (500, 20, BEGAN + 20.0)


def test_a_point_that_is_given_up_before_the_blades_close_is_told_each_time_it_was_tried():
    given_up = replace(ticket("a", "FAILED_NOT_CUT", user="ada", reason=LATE), cut_id="")
    accepted = replace(ticket("a", "ACCEPTED", user="ada"), cut_id="")
    told = report(
        (0.0, accepted),
        (1.0, asked(intents.Start(user="ada"))),
        (6.0, given_up),
        # Seen anew it is recorded again, and was tried once all the same.
        (7.0, given_up),
        (20.0, accepted),
        (21.0, asked(intents.Start(user="ada"))),
        (24.0, given_up),
    )
    assert [(cut.cut_id, cut.point_id, cut.outcome, cut.reason, cut.user, cut.seconds) for cut in told.cuts] == [
        ("", "a", "FAILED_NOT_CUT", LATE, "ada", 5.0),
        ("", "a", "FAILED_NOT_CUT", LATE, "ada", 3.0),
    ]
    assert told.vines[0].not_cut == 2


def test_a_point_that_is_given_up_at_its_second_try_leaves_the_first_cut_as_it_was():
    failed = ticket("a", "FAILED_NOT_CUT", user="ada", reason=STANDS)
    missed = ticket("a", "FAILED_NOT_CUT", user="ada", reason=LATE)
    told = report(
        (0.0, ticket("a", "ACCEPTED", user="ada")),
        (1.0, asked(intents.Start(user="ada"))),
        (2.0, ticket("a", "CUTTING", user="ada")),
        (3.0, failed),
        (10.0, ticket("a", "ACCEPTED", user="ada")),
        (11.0, asked(intents.Start(user="ada"))),
        (15.0, missed),
        (16.0, missed),
    )
    assert [(cut.cut_id, cut.reason, cut.seconds) for cut in told.cuts] == [
        ("c-a", STANDS, 1.0),
        ("", LATE, 4.0),
    ]


def test_who_says_later_how_a_cut_ended_takes_the_robot_no_time():
    told = report(
        (0.0, asked(intents.Start(user="ada"))),
        (3.0, ticket("a", "CUTTING", user="ada")),
        (5.0, ticket("a", "UNKNOWN", user="ada")),
        (500.0, ticket("a", "DONE", user="ada", reason=reasons.inspected("bob", "seen by eye"))),
    )
    (cut,) = told.cuts
    assert (cut.outcome, cut.user, cut.seconds, cut.ended_at - BEGAN) == ("DONE", "ada", 3.0, 5.0)
    assert told.vines[0].unknown == 0 and told.vines[0].done == 1


def test_refusals_and_changes_of_control_are_told_and_the_newest_go_over_the_wire():
    rows = [(1.0, asked(intents.TakeControl(user="bob", confirm=True)))]
    rows += [(2.0 + n, asked(intents.Start(user="bob"), reasons.control_held(f"user {n}"))) for n in range(150)]
    told = report(*rows)
    assert [(change.user, change.asked) for change in told.control] == [("bob", "TakeControl")]
    assert told.refusal_count == 150 and len(told.refusals) == 100
    assert (told.refusals[-1].asked, told.refusals[-1].reason) == ("Start", reasons.control_held("user 149"))


def test_points_without_a_cut_and_lines_of_the_log_are_not_in_it():
    account = SessionReportBuilder()
    assert account.add(at(0.0), Answer(ok=True)), "it began then"
    accepted = replace(ticket("a", "ACCEPTED", user="ada"), cut_id="")
    assert not account.add(at(1.0), accepted) and not account.add(at(2.0), Answer(ok=True))
    assert account.report().cuts == () and account.report().began_at == BEGAN


def test_points_out_of_reach_are_counted_by_vine_until_they_are_in_reach_or_taken_off():
    def row(name, state, vine):
        return replace(ticket(name, state, vine), cut_id="")

    rows = [(1.0, row(name, "UNREACHABLE", vine)) for name, vine in (("a", 1), ("b", 2), ("c", 2), ("d", 3))]
    rows += [(2.0, row("b", "ACCEPTED", 2)), (3.0, row("d", "REJECTED", 3)), (4.0, ticket("e", "CUTTING", 2))]
    told = report((0.5, asked(intents.Start(user="ada"))), *rows, (5.0, ticket("e", "DONE", 2)))
    assert [(vine.vine, vine.done, vine.unreachable) for vine in told.vines] == [(1, 0, 1), (2, 1, 1)]
    assert told.cut_count == 1, "nothing was tried where nothing can be reached"
    account = SessionReportBuilder()
    assert account.add(at(1.0), row("a", "UNREACHABLE", 1)) and account.add(at(2.0), row("a", "ACCEPTED", 1))


def test_only_the_newest_changes_of_control_go_over_the_wire():
    told = report(*((float(n), asked(intents.TakeControl(user=f"user {n}"))) for n in range(150)))
    assert [change.user for change in told.control] == [f"user {n}" for n in range(50, 150)]


def test_a_refusal_and_a_change_of_control_change_the_report():
    account = SessionReportBuilder()
    account.add(at(0.0), Answer(ok=True))
    assert account.add(at(1.0), asked(intents.Start(user="bob"), reasons.control_held("ada")))
    assert account.add(at(2.0), asked(intents.TakeControl(user="bob")))


def test_who_began_a_cut_is_told_with_its_end_and_a_cut_without_a_known_end_counts_for_its_vine():
    told = report(
        (0.0, asked(intents.Start(user="ada"))),
        (0.2, ticket("a", "CUTTING", user="ada")),
        (0.4, ticket("a", "UNKNOWN", reason=STANDS)),
    )
    (cut,) = told.cuts
    assert (cut.user, cut.outcome, round(cut.seconds, 3), cut.reason) == ("ada", "UNKNOWN", 0.2, STANDS)
    assert [(vine.done, vine.not_cut, vine.unknown) for vine in told.vines] == [(0, 0, 1)]


def test_points_that_are_given_up_one_after_the_other_take_the_time_since_the_one_before():
    def row(name, state):
        return replace(ticket(name, state, user="ada"), cut_id="")

    account = SessionReportBuilder()
    account.add(at(0.0), asked(intents.Start(user="ada")))
    for name in ("a", "b"):
        account.add(at(0.0), row(name, "ACCEPTED"))
    assert account.add(at(0.5), row("a", "FAILED_NOT_CUT")) and account.add(at(2.5), row("b", "FAILED_NOT_CUT"))
    told = account.report().cuts
    assert [(cut.point_id, cut.seconds, cut.ended_at - BEGAN) for cut in told] == [("a", 0.5, 0.5), ("b", 2.0, 2.5)]
    assert account.add(at(3.0), ticket("c", "CUTTING"))


def test_a_point_that_stays_out_of_reach_changes_the_report_once():
    builder = SessionReportBuilder()
    beyond = TicketRow(point=pruning_point("a"), state="UNREACHABLE", cut_id="")
    assert [builder.add(at(second), beyond) for second in (0.0, 1.0, 2.0)] == [True, False, False]
