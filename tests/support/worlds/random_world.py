"""Controller and bridge on a robot without a body, in a world where everything happens at random; a judge watches.

Supervision, modes, lease, queue, cuts under way, journal, latch, gate, watchdog and cut orders are the product's. What
moves the robot is a stand-in that drives a little and then cuts, so that a million steps take minutes.
"""

import random
from dataclasses import dataclass, replace

import msgspec
import numpy as np

from bridge.config import BridgeConfig, OdometryConfig
from bridge.core.bridge import BridgeCore
from bridge.core.odometer import Odometer
from bridge.core.state_memory import Remembered
from controller.config import ControllerConfig
from controller.core import Controller
from controller.ledger.journal import LedgerState, Records
from rolling_panda import commands as intents
from rolling_panda import messages as m
from rolling_panda import reasons
from rolling_panda.config import RobotConfig
from rolling_panda.messages.perception import Obstacles
from rolling_panda.messages.supervision import BaseVelocity, ControlState, Person, Presence, StopState, TeleopTarget
from rolling_panda.reasons import said
from rolling_panda.runtime.latest_file import KeptValue
from rolling_panda.topics import TOPIC_OF
from rolling_panda.transport.inbox import Inbox
from server.robots.presence import PRESENT_S
from tests.support.fake_wire import as_received
from tests.support.points import point
from tests.support.sent import every, newest
from tests.support.worlds.random_judge import Judge
from tests.support.worlds.random_parts import MODEL, CutDisk, Movement, Robot

PEOPLE = {"ada": "supervisor", "bob": "operator", "vic": "viewer"}
DT = 0.01
#: A point this far aside is on the cane beside it (m).
_OTHER_CANE = 0.008


@dataclass
class Somebody:
    """Somebody with a page, which is not heard or shows nothing new until so many steps have been made."""

    unheard_until: int = 0
    blind_until: int = 0
    holding: bool = False
    said_at: float = float("-inf")


class RandomWorld:
    def __init__(self, seed, kill_in_intent=False):
        self.kill_in_intent = kill_in_intent
        self.chance = Movement.chance = random.Random(seed)
        self.judge = Judge()
        self.robot = Robot(self.judge, self.chance)
        self.memory, self.cut_disk = KeptValue(Remembered()), CutDisk(self.chance)
        self.now, self.steps, self.starts, self.number = 0.0, 0, 0, 0
        self.people = {name: Somebody() for name in PEOPLE}
        self.names, self.offsets, self.revision = ["p0", "p1", "p2"], [0.0] * 3, 1
        self.disk, self.rows, self.durable, self.kept_stops = self.judge.disk, [], 0, ()
        self.ledger_failure, self.ledger_stuck = None, 0
        self.deaf = self.mute = 0
        self.orders, self.motions, self.stop_ids = [], [], []
        self.start_bridge()
        self.start_controller()

    # --- starts --------------------------------------------------------------------------------------------------

    def start_bridge(self):
        odometer = Odometer(MODEL.drive, OdometryConfig(), DT)
        config = BridgeConfig(joints_hz=1000.0)
        self.bridge = BridgeCore(
            self.robot, config, MODEL.limits, odometer, "sim", memory=self.memory, cuts=self.cut_disk
        )
        # A simulated cut ends with its bridge: what the robot was told is not told again.
        self.robot.now = replace(self.robot.now, velocity=np.zeros(9))
        self.judge.bridge_started()

    def start_controller(self):
        in_cutting = self.starts > 0 and any(t.state == "CUTTING" for t in self.queue.tickets())
        self.starts += 1
        self.controller = Controller(ControllerConfig(), RobotConfig(), run_id=f"r{self.starts}")
        written = self.chance.randrange(len(self.rows) + 1) if self.rows else 0
        self.judge.controller_started(self.rows[written - 1][0] if written else self.durable, in_cutting)
        for _, name, body in self.rows[:written]:
            self.disk[name] = body
        self.rows, self.durable = [], 0
        self.queue, self.holder = Movement.newest.queue, ""
        self.controller.restore(tuple(self.disk.values()), self.kept_stops)
        self.inbox, self.stops = Inbox(), []
        self.inbox.present = frozenset(m.PROCESSES)
        self.judge.mode(self.controller.mode, "restart", self)
        self.judge.restored(self.queue)

    @property
    def touched(self):
        """Whether the arm has touched something, and has not gone back from it yet."""
        return Movement.newest.body.contact.touch is not None

    # --- one step ------------------------------------------------------------------------------------------------

    def step(self):
        self.steps += 1
        chance = self.chance
        # Now and then both have not been scheduled for a while.
        self.now += DT if chance.random() < 0.999 else chance.choice((0.03, 0.3, 3.0))
        if chance.random() < 0.1:
            self.happen()
        if self.kill_in_intent and chance.random() < 0.1 and Movement.newest.sequence.in_canes:
            self.start_controller()
        out = self.bridge.step(self.now)
        if out.state is not None:
            self.judge.bridge_told(bool(out.state.stop_id))
        for message in (out.joints, out.state, out.odometry, out.stops, *out.events):
            assert message is None or as_received(message) == message
        self.mute = max(0, self.mute - 1)
        if not self.mute:
            self.hear(*(message for message in (out.joints, out.state, out.odometry) if message is not None))
        self.control()

    def control(self):
        self.number += 1
        self.hear(*(m.Heartbeat(process=process, sequence=self.number) for process in ("server", "perception")))
        self.hear(Obstacles(header=m.Header(self.now), capsules=()))
        heard = [name for name, person in self.people.items() if self.steps >= person.unheard_until]
        for name in heard:
            self.people[name].said_at = self.now
        self.judge.heard(heard, self.now)
        if self.steps % 10 == 0:
            self.hear(Presence(sequence=self.number, people=self.there()))
        holder = next((name for name, person in self.people.items() if person.holding), None)
        # The server lets no viewer hold.
        if holder is not None and PEOPLE[holder] != "viewer" and self.steps % 3 == 0:
            target = TeleopTarget(sequence=self.number, hold=True, user=holder, base=BaseVelocity(0.01, 0.0))
            self.hear(target)
            self.judge.held(holder, self.now)
        self.judge.delivered(self.inbox, self.stops)
        self.stops = []
        out = [message for message in self.controller.step(self.inbox, self.now) if message is not None]
        for message in out:
            assert type(message) not in TOPIC_OF or as_received(message) == message
        self.holder = newest(out, ControlState).user
        self.judge.stepped(self, newest(out, m.MotionCommand))
        self.write([record for records in every(out, Records) for record in records.rows])
        self.send(out)

    def hear(self, *messages):
        """Messages arrive at the controller."""
        for message in messages:
            self.inbox.put(message, self.now)

    def there(self):
        """Whom the server lists: who has said something within a second, and how long ago."""
        return tuple(
            Person(name, name, PEOPLE[name], age, 0.0 if self.steps >= person.blind_until else 1e6)
            for name, person in self.people.items()
            if (age := self.now - person.said_at) <= PRESENT_S
        )

    def write(self, records):
        self.rows += [(r.number, r.name, r.body) for r in records if r.kind == "ticket"]
        self.ledger_stuck = max(0, self.ledger_stuck - 1)
        if not self.ledger_stuck and not self.ledger_failure and self.chance.random() < 0.7:
            self.durable = self.controller.recorded
            for _, name, body in self.rows:
                self.disk[name] = body
            self.rows = []
        self.hear(LedgerState(self.durable, self.ledger_failure))

    def send(self, out):
        self.deaf = max(0, self.deaf - 1)
        for message in out:
            match message:
                case StopState():
                    self.kept_stops = message.stops
                case m.ReleaseStop() if self.bridge.on_release(message, self.now).ok:
                    self.judge.bridge_released(self.robot.now.emergency)
                case m.CutCommand():
                    self.orders = [*self.orders[-10:], message]
            if self.deaf:
                continue
            match message:
                case m.TokenRequest():
                    self.bridge.on_token(message, self.now)
                case m.StopRequest():
                    self.bridge.on_stop(message, self.now)
                    self.judge.stop_at_bridge(message.stop_id)
                case m.MotionCommand():
                    self.motions = [*self.motions[-30:], message]
                    self.bridge.on_motion(message, self.now)
                case m.CutCommand():
                    self.bridge.on_cut(message, self.now)

    # --- what happens --------------------------------------------------------------------------------------------

    def happen(self):
        likely = [self.ask] * 12 + [self.hold] * 6 + [self.look_away] * 3 + [self.perceive] * 3 + [self.help_on] * 70
        faults = [
            self.stop,
            self.press,
            self.lose,
            self.replay,
            self.break_ledger,
            self.kill_bridge,
            self.kill_controller,
        ]
        self.chance.choice(likely + 2 * faults)()

    def help_on(self):
        """Somebody does what brings the robot to work, so that much of the time it is at work."""
        self.ledger_failure, self.robot.now = None, replace(self.robot.now, emergency=False)
        mode, user = self.controller.mode, self.chance.choice(("ada", "ada", "ada", "bob"))
        steps = {
            "IDLE": intents.Arm, "READY": intents.Start, "PAUSED": intents.Resume,
            "PROTECTIVE_STOP": intents.Acknowledge, "FAULT": intents.Acknowledge,
        }  # fmt: skip
        if mode == "ESTOP_LATCHED":
            self.answer(intents.Reset(user=user, reason="checked"))
        elif mode in steps:
            if mode == "READY":
                self.prepare(user)
            if not self.answer(steps[mode](user=user)) and self.chance.random() < 0.2:
                self.answer(intents.TakeControl(user=user, confirm=True))

    def prepare(self, user):
        """Look at what nobody knows, accept what is there, and drive on to new points where all is done."""
        for ticket in self.queue.tickets():
            name = ticket.point.point_id
            if ticket.state == "UNKNOWN":
                self.answer(intents.ResolvePoint(user=user, point_id=name, outcome="DONE", reason="looked"))
            elif name in self.names and ticket.state == "DONE":
                place = self.names.index(name)
                self.names[place] = f"p{self.steps}-{place}"
                self.perceive()
            elif name in self.names and ticket.state in ("REJECTED", "FAILED_NOT_CUT"):
                self.answer(intents.AcceptPoint(user=user, point_id=name, revision=self.revision))
        self.answer(intents.AcceptAll(user=user))

    def answer(self, intent):
        if self.steps < self.people[intent.user].unheard_until:
            return False
        intent = msgspec.structs.replace(intent, role=PEOPLE[intent.user])
        holder, before = self.holder, self.controller.mode
        answer = self.controller.answer(intent, self.now)
        self.judge.answered(intent, answer.ok, holder, before, self)
        return answer.ok

    def ask(self):
        chance = self.chance
        user, point = chance.choice(("ada", "ada", "bob", "bob", "vic")), chance.choice(self.names)
        revision = self.revision - chance.choice((0, 0, 0, 1))
        made = chance.choice(
            [
                intents.Arm(user=user), intents.Start(user=user), intents.Start(user=user),
                intents.Survey(user=user), intents.Pause(user=user), intents.Resume(user=user),
                intents.Home(user=user), intents.Acknowledge(user=user),
                intents.Reset(user=user, reason="checked", stop_id=chance.choice(("", "", "another"))),
                intents.AcceptPoint(user=user, point_id=point, revision=max(0, revision)),
                intents.AcceptPoint(user=user, point_id=point, revision=max(0, revision)),
                intents.RejectPoint(user=user, point_id=point), intents.ReconsiderPoint(user=user, point_id=point),
                intents.ResolvePoint(
                    user=user, point_id=point, outcome=chance.choice(("DONE", "FAILED_NOT_CUT")), reason="looked"
                ),
                intents.AcceptAll(user=user), intents.TakeControl(user=user, confirm=chance.random() < 0.5),
                intents.RequestControl(user=user), intents.GrantControl(user=user), intents.ReturnControl(user=user),
            ]
        )  # fmt: skip
        self.answer(made)

    def hold(self):
        for person in self.people.values():
            person.holding = False
        self.people[self.chance.choice(tuple(PEOPLE))].holding = self.chance.random() < 0.5

    def look_away(self):
        person = self.people[self.chance.choice(tuple(PEOPLE))]
        until = self.steps + self.chance.choice((30, 150, 400))
        if self.chance.random() < 0.5:
            person.unheard_until, person.holding = until, False
        else:
            person.blind_until = until

    def perceive(self):
        self.offsets[self.chance.randrange(3)] = self.chance.choice(
            (0.0, 0.002, 0.02, _OTHER_CANE) if self.chance.random() < 0.1 else (0.0,)
        )
        self.revision += self.chance.random() < 0.2
        points = tuple(
            point(name, (0.3 * place + offset, 0.75, 1.0), revision=self.revision, cane=int(offset == _OTHER_CANE))
            for place, (name, offset) in enumerate(zip(self.names, self.offsets, strict=True))
            if self.chance.random() < 0.98
        )
        message = m.PruningPoints(header=m.Header(self.now), segmenter="test", frames=1, points=points)
        self.hear(message)

    def stop(self):
        """A stop that reaches both, or the one, or one of them again much later."""
        if self.stop_ids and self.chance.random() < 0.3:
            stop_id = self.chance.choice(self.stop_ids)
        else:
            stop_id = f"s{self.steps}"
            self.stop_ids = [*self.stop_ids[-20:], stop_id]
        request = m.StopRequest(stop_id=stop_id, source="server", user="vic", reason=said("test"))
        where = self.chance.choice(("both", "both", "bridge", "controller"))
        if where != "controller":
            self.bridge.on_stop(request, self.now)
            self.judge.stop_at_bridge(stop_id)
        if where != "bridge":
            self.stops.append(request)
            self.hear(request)
        if self.chance.random() < 0.2:
            self.chance.choice((self.kill_bridge, self.kill_controller))()

    def press(self):
        self.robot.now = replace(self.robot.now, emergency=self.chance.random() < 0.5)

    def lose(self):
        """For a while one does not hear the other."""
        if self.chance.random() < 0.5:
            self.deaf = self.chance.choice((2, 10, 40))
        else:
            self.mute = self.chance.choice((2, 10, 40, 80))

    def replay(self):
        """Old commands and orders come once more, and some with another token."""
        for motion in self.chance.sample(self.motions, min(5, len(self.motions))):
            self.bridge.on_motion(motion, self.now)
            forged = msgspec.structs.replace(motion, token="eve", sequence=motion.sequence + 10**6, xi=(0.09,) * 9)
            self.bridge.on_motion(forged, self.now)
        for order in self.orders[-4:]:
            self.bridge.on_cut(order, self.now)
            self.bridge.on_cut(msgspec.structs.replace(order, cut_id=f"eve-{self.steps}", token="eve"), self.now)

    def break_ledger(self):
        if self.chance.random() < 0.3:
            self.ledger_failure = reasons.ledger_failed("the disk is full")
        else:
            self.ledger_stuck = self.chance.choice((5, 30, 100))

    def kill_bridge(self):
        self.start_bridge()

    def kill_controller(self):
        self.start_controller()
