"""What `ControllerState.allowed` tells of each command is what the controller then answers."""

import msgspec
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from controller.planning.preview_plan import Preview, PreviewRequest
from rolling_panda import commands as intents
from rolling_panda import messages as m
from rolling_panda import reasons
from rolling_panda.commands import COMMAND_OF, INTENTS, POINT_STATES
from rolling_panda.messages.perception import RobotCalibration
from rolling_panda.messages.supervision import PreviewState
from tests.controller.test_command_table import example as any_of
from tests.support.controller_at_work import CONFIG, robot
from tests.support.points import point
from tests.support.sent import every, newest

RULES = (m.PruningRule(), m.PruningRule(nodes_kept=1))
POINTS = (point("a", (0.45, 0.75, 1.05)), point("b", (0.75, 0.75, 1.1), confidence=0.5))
THICK = point("c", (1.0, 0.75, 1.0), radius=0.9 * CONFIG.work.largest_radius + 0.01)
#: What perception may show: points, and the number of the rule.
VIEWS = {
    "no points": ((), 0),
    "points": (POINTS, 0),
    "a thick cane": ((THICK,), 0),
    "another rule": ((msgspec.structs.replace(POINTS[0], position=(0.45, 0.75, 1.0), revision=2), THICK), 1),
}
SITE = m.UndecidedSite(vine=1, spur=2, reason=reasons.said("test"), needs="another look", position=(0.4, 0.8, 1.0))
COMMANDS = tuple(kind for kind in INTENTS if COMMAND_OF[kind].tag != "control")


WHEELS = m.BaseCalibration(left=0.133, right=0.133, track=0.51, made_at=5.0)
JOINTS = m.ArmCalibration(offsets=m.NO_OFFSETS, made_at=5.0)
CLOCK = m.FrameTiming(delay=0.04, made_at=5.0)


class World:
    """The controller at work, with a planner that shows each preview at the next period."""

    def __init__(self):
        self.robot, self.shown, self.sites = robot(), (), ()
        self.preview = None
        self.show("no points")
        self.at = self.now()

    def now(self):
        """Run to the next state that the controller tells; returns its time (s)."""
        r = self.robot
        for _ in range(20):
            at, out = r.now, r.step()
            self.preview = newest(out, PreviewState) or self.preview
            for request in every(out, PreviewRequest):
                r.hear(Preview(request, digest=f"{request.number:064x}"))
            if newest(out, m.ControllerState) is not None:
                self.at = at
                return at
        raise AssertionError("the controller tells no state")

    def run(self, seconds):
        until = self.robot.now + seconds
        while self.robot.now < until:
            self.now()

    def show(self, view):
        points, rule = VIEWS[view]
        self.shown, self.rule = {each.point_id: each for each in points}, RULES[rule]
        self.sites = (SITE,) if points else ()
        self.robot.show(points, self.rule, self.sites)

    def happen(self, event):
        """Something happens that nobody asked the controller for; a fault lasts until the next event."""
        r = self.robot
        r.deaf, r.bridge_changes, r.server, r.perception = set(), {}, True, True
        match event:
            case "stop":
                r.stop(f"stop-{r.now}")
            case "silent bridge":
                r.deaf = {m.BridgeState}
            case "watchdog":
                r.bridge_changes = {"watchdog": True}
            case "closing":
                r.bridge_changes = {"cutter": "closing"}
            case "server" | "perception":
                setattr(r, event, False)
            case "unknown cut":
                r.outcome = "UNKNOWN"
            case float():
                self.run(event)
            case _:
                self.show(event)

    def valid(self, kind):
        """Requests of a kind with valid arguments, as far as there are any now."""
        state = self.robot.state
        states = {each.point_id: each.state for each in state.queue}
        seen = {name: each for name, each in self.shown.items() if name in states}
        common = {"user": "ada", "role": "supervisor"}
        named = [name for name in seen if states[name] in POINT_STATES.get(kind.__name__, ())]
        match kind:
            case intents.AcceptPoint:
                fit = [seen[name] for name in named if seen[name].radius <= CONFIG.work.largest_radius]
                return [kind(**common, point_id=each.point_id, revision=each.revision) for each in fit]
            case intents.RejectPoint:
                return [kind(**common, point_id=name) for name in named]
            case intents.SetApproach:
                return [kind(**common, point_id=name) for name in named if name != state.active_point_id]
            case intents.ResolvePoint:
                return [kind(**common, point_id=name, outcome="DONE", reason="-") for name in named]
            case intents.JudgeCut:
                return [kind(**common, point_id=name, wrong=True) for name in named]
            case intents.ReconsiderPoint:
                decided = [name for name in seen if states[name] in ("ACCEPTED", "UNREACHABLE", "REJECTED")]
                return [kind(**common, point_id=name) for name in decided]
            case intents.MoveInQueue:
                order = state.order.revision
                accepted = [name for name in states if states[name] == "ACCEPTED"]
                return [kind(**common, point_id=name, revision=order) for name in accepted]
            case intents.AcceptAll:
                return [kind(**common, confidence=0.0)]
            case intents.ResetOrder:
                return [kind(**common, revision=state.order.revision)]
            case intents.ApprovePreview:
                return [kind(**common, preview_hash=self.preview.preview_hash or "0f")]
            case intents.LookAgain:
                return [kind(**common, vine=each.vine, spur=each.spur) for each in self.sites]
            case intents.RestoreAccepted:
                return [kind(**common, rule=self.rule)]
            case intents.SavePosture:
                names = {each.name for each in state.postures}
                free = [name for name in map(str, range(20)) if name not in names]
                return [kind(**common, posture=name) for name in free[:1]]
            case intents.DeletePosture:
                return [kind(**common, posture=each.name) for each in state.postures if each.user]
            case intents.UseBase | intents.UseArm | intents.UseTiming:
                self.robot.hear(RobotCalibration(header=m.Header(), base=WHEELS, arm=JOINTS, timing=CLOCK))
                return [example(kind)]
            case _:
                return [example(kind)]

    def answer(self, asked):
        self.robot.people.add("ada")
        return self.robot.controller.answer(asked, self.at)

    def check(self):
        """All that is refused is refused for the reason told; returns the commands that are allowed."""
        self.now()
        told = self.robot.state.allowed
        for kind in COMMANDS:
            if (why := told[kind.__name__]) is not None:
                for asked in (example(kind), *self.valid(kind)):
                    assert self.answer(asked) == m.Answer(ok=False, reason=why), asked
        return [kind for kind in COMMANDS if told[kind.__name__] is None]

    def ask(self, asked):
        assert self.answer(asked) == m.Answer(ok=True), asked


def example(kind):
    """A command of a kind with some arguments."""
    return msgspec.structs.replace(any_of(kind), role="supervisor")


EVENTS = (*VIEWS, "stop", "silent bridge", "watchdog", "closing", "server", "perception", "unknown cut", 0.2, 1.2, 16.0)
#: What leads to work is asked for more often than by chance.
USUAL = (intents.Arm, intents.AcceptAll, intents.RequestPreview, intents.ApprovePreview, intents.Start, intents.Reset)


@pytest.mark.long
@settings(max_examples=25)
@given(st.data())
def test_whatever_has_happened_a_command_is_answered_as_it_was_told(data):
    world = World()
    for _ in range(30):
        asked = [each for kind in world.check() for each in world.valid(kind)]
        usual = [each for each in asked if isinstance(each, USUAL)]
        step = data.draw(st.sampled_from((*asked, *(8 * usual), *EVENTS, "points", 16.0)))
        if isinstance(step, intents.Intent):
            world.ask(step)
        else:
            world.happen(step)


def in_state(*steps):
    """What is allowed after these steps, each of which is done."""
    world = World()
    world.run(0.3)
    for step in steps:
        if isinstance(step, type):
            world.now()
            (asked, *_) = world.valid(step)
            world.ask(asked)
        else:
            world.happen(step)
    world.now()
    return world.robot.state.allowed


@pytest.mark.long
def test_what_only_the_work_knows_is_told():
    empty = in_state()
    assert empty["RequestPreview"] == reasons.none_accepted()
    assert empty["ApprovePreview"] == reasons.preview_missing()
    assert empty["ResetOrder"] == reasons.order_of_plan()
    assert empty["RestoreAccepted"] == reasons.nothing_to_restore()
    assert empty["AcceptAll"].code == "none_proposed"
    assert in_state("a thick cane")["AcceptAll"].code == "none_acceptable"
    assert in_state("points")["AcceptAll"] is None
    accepted = in_state("points", 0.2, intents.AcceptAll)
    assert accepted["RequestPreview"] is None and accepted["AcceptAll"] is not None
    assert in_state("points", 0.2, intents.AcceptAll, intents.MoveInQueue)["ResetOrder"] is None
    assert in_state("points", "another rule", 0.2)["RestoreAccepted"] is None
    shown = ("points", 0.2, intents.AcceptAll, 20.0, intents.RequestPreview, 20.0)
    assert in_state(*shown)["ApprovePreview"] is None
    moved = in_state(*shown, intents.MoveInQueue, 0.2)["ApprovePreview"]
    assert moved == reasons.another_comes_first("b", "a")


def test_what_perception_answers_in_some_modes_alone_is_told():
    assert in_state()["UseCamera"] is None
    at_work = in_state("points", 0.2, intents.Arm, intents.AcceptAll, intents.Start, 0.2)
    assert at_work["UseCamera"] == reasons.wrong_mode("UseCamera", "IDLE, READY, PAUSED", "AUTO")
    assert "MovePoint" not in at_work


def test_a_reset_under_way_is_told():
    world = World()
    world.robot.stop()
    world.run(0.2)
    assert world.robot.state.allowed["Reset"] is None
    world.robot.deaf.add(m.BridgeState)
    (asked,) = world.valid(intents.Reset)
    world.ask(asked)
    world.now()
    assert world.robot.state.allowed["Reset"] == reasons.reset_under_way()
