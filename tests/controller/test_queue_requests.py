"""What the controller's log says of what operators ask."""

from rolling_panda import commands as intents
from rolling_panda import reasons
from rolling_panda.reasons import text_of
from tests.controller.test_core_work import point, robot


def test_each_request_is_one_line_of_the_log():
    r = robot()
    r.step()
    r.show((point("p1", (0.3, 0.75, 1.0)),))
    r.step()
    before = len(r.events)
    for intent, words in [
        (intents.Start(user="ada"), "start refused"),
        (intents.Arm(user="ada"), "IDLE → READY: ada pressed arm"),
        (intents.AcceptAll(user="ada"), text_of(reasons.points_accepted("ada", 1, 0.8))),
        (intents.RejectPoint(user="ada", point_id="p1", reason="rotten"), "ada rejected p1: rotten"),
        (intents.AcceptPoint(user="ada", point_id="p1", revision=1), "ada accepted p1, revision 1"),
        (intents.Start(user="ada"), "READY → AUTO: ada pressed start"),
        (intents.Pause(user="ada"), "AUTO → PAUSED: ada pressed pause"),
        (intents.Resume(user="ada"), "PAUSED → READY: ada pressed resume"),
        (intents.Home(user="ada"), "ada sends the arm home"),
    ]:
        r.ask(intent)
        r.step()
        lines = [line for line in r.events[before:] if "ada" in line]
        before = len(r.events)
        assert len(lines) == 1 and words in lines[0], (intent, lines)
