from rolling_panda.generate import modes
from rolling_panda.generate.__main__ import ROOT
from rolling_panda.mode_table import ROWS, SEVERITY, Event


def test_the_safety_document_shows_every_transition_and_who_may_cause_it() -> None:
    text = (ROOT / "docs" / "safety.md").read_text(encoding="utf-8")
    for row in ROWS:
        if row.event not in (Event.STOP, Event.FAULT):
            assert f"    {row.before} --> {row.after}: {row.event.value} ({row.who})\n" in text
            assert f"| {row.before} → {row.after} | {row.event.value} | {row.who} |" in text
    assert "| any but ESTOP_LATCHED → ESTOP_LATCHED | stop | anyone |" in text
    assert "| any but FAULT, ESTOP_LATCHED → FAULT | fault | system |" in text


def test_the_diagram_has_every_mode() -> None:
    for mode in SEVERITY:
        assert mode in modes.diagram()
