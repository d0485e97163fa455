from controller.journal import Journal
from controller.lines import Lines


def test_what_is_said_is_told_once_and_recorded():
    journal = Journal()
    lines = Lines(journal)
    lines.now = 3.0
    lines.say("warning", "x" * 600)
    (told,) = lines.take()
    assert (told.header.stamp, told.severity, len(told.text)) == (3.0, "warning", 500)
    assert lines.take() == ()
    assert [record.body for record in journal.take()] == [told]
