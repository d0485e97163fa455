"""The controller is killed at random moments of its work; what it has acknowledged is there when it starts again."""

import random
import subprocess
import sys
import time

import pytest

from controller.ledger.check import verify
from controller.ledger.start import restored
from rolling_panda import commands as intents
from rolling_panda import messages as m
from rolling_panda.config import TransportConfig
from rolling_panda.errors import ServiceError
from rolling_panda.runtime.launch import child_environment
from rolling_panda.topics import CONTROLLER, INTENT, POINTS
from rolling_panda.transport.zenoh import Transport
from tests.support.points import point
from tests.support.processes.local_router import local_router

pytestmark = pytest.mark.paced

#: A controller process as it is, but for the model of the robot, whose start would take most of the test's time: queue,
#: ledger, loop and wire are the product's.
CHILD = """
import sys, threading
from pathlib import Path
from controller.config import WorkConfig, ControllerConfig
from controller.ledger.journal import EventLogger, Journal, LedgerState, Records, RequestRow
from controller.ledger.store import Ledger
from controller.ledger.start import restored
from controller.ledger.writer import LedgerWriter
from controller.loop import controller_runner
from controller.work.point_queue import QueueRequests
from controller.work.point_queue import PointQueue
from rolling_panda import messages as m
from rolling_panda.reasons import said, text_of
from rolling_panda.config import TransportConfig
from rolling_panda.transport.inbox import Reply
from rolling_panda.transport.zenoh import Transport

class Desk:
    waits = False

    def __init__(self, rows):
        self.journal = Journal()
        self.queue = PointQueue(WorkConfig(), self.journal)
        self.queue.restore(rows)
        self.handlers = QueueRequests(self.queue, EventLogger(self.journal)).handlers()
        self.cuts = 0
        self.intent = None

    @property
    def recorded(self):
        return self.journal.number

    def answer(self, intent, now):
        refused = self.handlers[type(intent)](intent, 0.0)
        self.journal.add("request", intent.user, RequestRow(asked=intent, reason=refused, mode="READY"))
        return m.Answer(ok=refused is None, reason=refused)

    def step(self, inbox, now):
        out = []
        while (request := inbox.next_request()) is not None:
            out.append(Reply(request, self.answer(request.message, now)))
        recorded, points = inbox.newest(LedgerState), inbox.newest(m.PruningPoints)
        if recorded is not None:
            self.journal.observe(recorded.message, now)
        if points is not None:
            self.queue.update(points.message)
        ticket = self.queue.next()
        if self.intent is not None and self.journal.holds(self.intent[1]):
            self.queue.resolve(self.intent[0], "DONE", said("cut"))
            self.intent = None
        elif self.intent is None and ticket is not None:
            self.cuts += 1
            name = ticket.point.point_id
            self.intent = name, self.queue.begin_cut(name, f"{sys.argv[3]}-{self.cuts}")
        state = m.ControllerState(header=m.Header(), mode="READY", phase="", reason=said("ready"), allowed={},
            active_point_id="", method="test", T_odom_tool=None, T_odom_tool_desired=None, position_error=0.0,
            rotation_error=0.0, manipulability=0.0, joint_margin=0.0, tick_s=0.0,
            ticks=0, late_ticks=0, queue=self.queue.entries())
        return [*out, state, Records(self.journal.drain())]

folder = Path(sys.argv[1])
desk = Desk(restored(folder).tickets)
with Transport(TransportConfig(connect=(sys.argv[2],), plain_wire=True), "controller", "rp1") as transport:
    controller_runner(desk, transport, 100.0, LedgerWriter(lambda: Ledger(folder))).run(threading.Event())
"""


#: Kills of one ledger, and places to cut: more than can be accepted between so many kills.
ROUND, PLACES = 25, 500


def points(count):
    made = tuple(point(f"p{n}", (0.1 * n, 0.75, 1.0)) for n in range(count))
    return m.PruningPoints(header=m.Header(), segmenter="test", frames=1, points=made)


class Operator:
    """Accepts points one after the other and notes what was acknowledged to it."""

    def __init__(self, endpoint):
        self.wire = Transport(TransportConfig(connect=(endpoint,), plain_wire=True), "server", "rp1")
        self.show = self.wire.publisher(POINTS)
        self.state = self.wire.slot(CONTROLLER)
        self.accepted, self.done, self.next, self.all, self.shown_at = set(), set(), 0, points(PLACES), 0.0

    def work(self, until):
        while time.monotonic() < until:
            if time.monotonic() - self.shown_at > 0.1:
                self.shown_at = time.monotonic()
                self.show.put(self.all)
            name = f"p{self.next}"
            try:
                answer = self.wire.call(INTENT, intents.AcceptPoint(user="ada", point_id=name, revision=1))
            except ServiceError:
                time.sleep(0.05)
                continue
            if answer.ok:
                self.accepted.add(name)
            if answer.ok or answer.reason.code in ("point_unknown", "not_acceptable"):
                self.next += 1
            self.look()

    def look(self):
        newest = self.state.take()
        if newest is not None:
            self.done |= {entry.point_id for entry in newest.message.queue if entry.state == "DONE"}


def lost(folder, operator):
    """What was acknowledged and is not in the ledger as that or as something later."""
    states = {row.point.point_id: row.state for row in restored(folder).tickets}
    kept = ("ACCEPTED", "UNREACHABLE", "CUTTING", "DONE", "UNKNOWN")
    gone = {name for name in operator.accepted if states.get(name) not in kept}
    return gone | {name for name in operator.done if states.get(name) != "DONE"}


@pytest.mark.parametrize("kills", [4, pytest.param(500, marks=pytest.mark.slow)])
def test_no_acknowledged_decision_is_lost(tmp_path, kills):
    chance = random.Random(3)
    for begin in range(0, kills, ROUND):
        folder = tmp_path / str(begin)
        folder.mkdir()
        # Each round has its own: what a router keeps for clients that were killed goes with it.
        with local_router() as endpoint:
            operator = Operator(endpoint)
            with operator.wire:
                for kill in range(begin, min(kills, begin + ROUND)):
                    killed(folder, endpoint, operator, chance)
                    assert verify(folder).problem == ""
                    assert lost(folder, operator) == set(), f"after kill {kill + 1}"
                assert operator.done


def killed(folder, endpoint, operator, chance):
    """One life of the controller: it comes up, does some work, and is killed in the middle of more."""
    child = subprocess.Popen([sys.executable, "-c", CHILD, str(folder), endpoint, f"run{chance.random()}"],
                             env=child_environment())  # fmt: skip
    try:
        before = len(operator.accepted)
        while len(operator.accepted) == before:
            operator.work(time.monotonic() + 0.02)
            assert child.poll() is None and operator.next < PLACES
        operator.work(time.monotonic() + chance.uniform(0.0, 0.1))
    finally:
        child.kill()
        child.wait()
    operator.look()
