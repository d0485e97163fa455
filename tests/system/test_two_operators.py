"""Two operators and a viewer decide about the same points over HTTP, in any order, with cuts and restarts between.

The server, the queue, the operator's rules and the ledger are the product's; what must come of it is said by a model.
"""

import json
import tempfile
from pathlib import Path

import msgspec
import pytest
from hypothesis import Phase, settings
from hypothesis import strategies as st
from hypothesis.stateful import (
    RuleBasedStateMachine,
    initialize,
    invariant,
    precondition,
    rule,
    run_state_machine_as_test,
)

from controller.config import WorkConfig
from controller.ledger.check import reading, verify
from controller.ledger.journal import EventLogger, Journal, LedgerState, RequestRow, TicketRow
from controller.ledger.store import Entry, Ledger, read
from controller.work.point_queue import PointQueue, QueueRequests
from rolling_panda import messages as m
from rolling_panda.reasons import said
from tests.support.fake_wire import FakeWire
from tests.support.points import point as pruning_point
from tests.support.running_server import running_server

NAMES = ("p0", "p1")
PEOPLE = {"ada": "supervisor", "bob": "operator", "vic": "viewer"}
#: Mostly those who may.
ANYBODY = st.sampled_from(["ada", "bob", "ada", "bob", "vic"])
ACCEPTABLE = ("PROPOSED", "REJECTED", "FAILED_NOT_CUT")


def point(name, revision):
    at = NAMES.index(name)
    return pruning_point(name, (0.3 * at, 0.75, 1.0), revision=revision, confidence=0.2 + 0.2 * at)


class Robot:
    """The controller's queue behind the wire, with a ledger; it can be restarted."""

    def __init__(self, folder):
        self.ledger = Ledger(folder)
        self.revisions = dict.fromkeys(NAMES, 1)
        self.cuts = 0
        self.begin()

    def begin(self):
        rows = [msgspec.json.decode(body, type=TicketRow) for _, body in self.ledger.newest("ticket")]
        self.journal = Journal()
        self.queue = PointQueue(WorkConfig(), self.journal)
        self.queue.restore(rows)
        self.handlers = QueueRequests(self.queue, EventLogger(self.journal)).handlers()
        self.see()

    def see(self):
        points = tuple(point(name, revision) for name, revision in self.revisions.items())
        self.queue.update(m.PruningPoints(header=m.Header(), segmenter="test", frames=1, points=points))
        self.record()

    def record(self):
        records = self.journal.drain()
        if records:
            self.ledger.append(Entry("t", r.kind, r.name, msgspec.json.encode(r.body).decode()) for r in records)
        self.journal.observe(LedgerState(self.journal.number), 0.0)

    def answer(self, intent):
        refused = self.handlers[type(intent)](intent, 0.0)
        self.journal.add("request", intent.user, RequestRow(asked=intent, reason=refused, mode="READY"))
        self.record()
        return m.Answer(ok=refused is None, reason=refused)


class Operators(RuleBasedStateMachine):
    """`self.states` and `self.users` are the model: what each point must be, and by whom."""

    server = None
    clients = None

    @initialize()
    def begin(self):
        self.folder = tempfile.TemporaryDirectory()
        self.robot = Robot(Path(self.folder.name))
        self.server.wire.answer = self.robot.answer
        self.states, self.users = dict.fromkeys(NAMES, "PROPOSED"), dict.fromkeys(NAMES, "")
        self.asked = self.refused = 0

    def ask(self, who, path, expected, **body):
        """Ask over HTTP; `expected` is whether the controller has to grant it, if the role may ask at all."""
        answer = self.clients[who].post(f"/api/points/{path}", json=body)
        if PEOPLE[who] == "viewer":
            assert answer.status_code == 403
            return False
        self.asked += 1
        self.refused += not expected
        assert answer.status_code == (200 if expected else 409), f"{path} {body}: {answer.text}"
        assert answer.json()["ok"] is expected and (expected or answer.json()["reason"])
        return expected

    @rule(who=ANYBODY, name=st.sampled_from(NAMES), behind=st.sampled_from([0, 0, 0, 1]))
    def accept(self, who, name, behind):
        granted = self.states[name] in ACCEPTABLE and behind == 0
        revision = self.robot.revisions[name] - behind
        if self.ask(who, f"{name}/accept", granted, revision=revision):
            self.states[name], self.users[name] = "ACCEPTED", who

    @rule(who=ANYBODY, name=st.sampled_from((*NAMES, "p9")))
    def reject(self, who, name):
        granted = self.states.get(name) in ("PROPOSED", "ACCEPTED", "REJECTED", "FAILED_NOT_CUT")
        if self.ask(who, f"{name}/reject", granted, reason="no"):
            self.states[name], self.users[name] = "REJECTED", who

    @rule(who=ANYBODY, least=st.sampled_from([0.0, 0.5, 0.9]))
    def accept_all(self, who, least):
        found = [name for name in NAMES if self.states[name] == "PROPOSED" and point(name, 1).confidence >= least]
        if self.ask(who, "accept-all", bool(found), confidence=least):
            for name in found:
                self.states[name], self.users[name] = "ACCEPTED", who

    @rule(
        who=ANYBODY,
        name=st.sampled_from(NAMES),
        outcome=st.sampled_from(["DONE", "FAILED_NOT_CUT"]),
    )
    def resolve(self, who, name, outcome):
        if self.ask(who, f"{name}/resolve", self.states[name] == "UNKNOWN", outcome=outcome, reason="looked"):
            self.states[name] = outcome

    @rule(outcome=st.sampled_from(["DONE", "FAILED_NOT_CUT", "UNKNOWN", "killed"]))
    def cut(self, outcome):
        """The robot cuts the next point; or it is killed in the middle, and nobody knows."""
        ticket = self.robot.queue.next()
        wanted = [name for name in NAMES if self.states[name] == "ACCEPTED"]
        assert (ticket.point.point_id if ticket else None) == (wanted[0] if wanted else None)
        if ticket is None:
            return
        name = ticket.point.point_id
        self.robot.cuts += 1
        self.robot.queue.begin_cut(name, f"cut-{self.robot.cuts}")
        self.robot.record()
        if outcome == "killed":
            self.robot.begin()
        else:
            self.robot.queue.resolve(name, outcome, said("test"))
            self.robot.record()
        self.states[name] = "UNKNOWN" if outcome == "killed" else outcome

    @precondition(lambda self: "UNKNOWN" in self.states.values())
    @rule(who=st.sampled_from(["ada", "bob"]), what=st.sampled_from(["accept", "reject"]))
    def pass_over_what_nobody_knows(self, who, what):
        """An unknown cut is neither taken off nor accepted anew before somebody has looked."""
        name = next(name for name in NAMES if self.states[name] == "UNKNOWN")
        body = {"revision": self.robot.revisions[name]} if what == "accept" else {"reason": "no"}
        self.ask(who, f"{name}/{what}", False, **body)

    @rule()
    def restart(self):
        self.robot.begin()

    @rule(name=st.sampled_from(NAMES))
    def look_again(self, name):
        """Perception refines a point by less than matters: the acceptance stands."""
        self.robot.revisions[name] += 1
        self.robot.see()

    @invariant()
    def the_queue_is_as_the_model_says(self):
        if not hasattr(self, "robot"):
            return
        entries = {entry.point_id: entry for entry in self.robot.queue.entries()}
        assert {name: entry.state for name, entry in entries.items()} == self.states
        decided = {name: entry.user for name, entry in entries.items() if entry.state != "PROPOSED"}
        assert decided == {name: self.users[name] for name in decided}

    def teardown(self):
        if not hasattr(self, "robot"):
            return
        self.robot.ledger.close()
        folder = Path(self.folder.name)
        assert verify(folder).problem == ""
        with reading(folder) as database:
            requests = [json.loads(row.entry.body) for row in read(database) if row.entry.kind == "request"]
        # Each question and each refusal is on record, once.
        assert len(requests) == self.asked
        assert sum(request["reason"] is not None for request in requests) == self.refused
        self.folder.cleanup()


@pytest.mark.long
@pytest.mark.parametrize(("examples", "steps"), [(8, 30), pytest.param(300, 50, marks=pytest.mark.slow)])
def test_whoever_decides_in_whatever_order(examples, steps):
    with running_server(FakeWire()) as server:
        clients = {}
        managers = [server.client(role, user) for user, role in PEOPLE.items()]
        try:
            for user, manager in zip(PEOPLE, managers, strict=True):
                clients[user] = manager.__enter__()
            Operators.server, Operators.clients = server, clients
            run_state_machine_as_test(
                Operators,
                settings=settings(
                    max_examples=examples, stateful_step_count=steps, deadline=None, phases=[Phase.generate]
                ),
            )
        finally:
            for manager in managers:
                manager.__exit__(None, None, None)
