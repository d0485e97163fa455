"""What stands in for the robot, its body and the bridge's disk in a world where everything happens at random."""

import random
from dataclasses import replace
from types import SimpleNamespace

import numpy as np

from bridge.core.interface import Measurement
from controller.motion.body import Setpoints
from controller.motion.contact import Touch
from controller.motion.teleoperation import Teleoperation
from controller.supervision.modes import Event
from controller.work.cutting import Blades
from controller.work.movement import MotionResult
from controller.work.tries import Tried
from rolling_panda import reasons
from rolling_panda.model.map_frame import MapFrame
from rolling_panda.model.robot import RobotModel

MODEL = RobotModel()
WHEELS = np.array([0.03, 0.03, *(0.0,) * 7])
ARM = (MODEL.limits.lower[5:] + MODEL.limits.upper[5:]) / 2


class Saturation:
    """Speeds are so small that they are kept and lost at once."""

    def ramp(self, sent):
        return np.where(np.abs(sent) < 0.02, 0.0, 0.5 * sent)

    def admits(self, xi, sent):
        return bool(np.all(np.isfinite(xi)) and np.abs(xi).max() < 0.1)

    def brake(self, sent):
        return self.ramp(sent)

    def smooth(self, xi, sent, before):
        return xi


TRIED = Tried((0.0, 0.0, 0.0))


class Sequence:
    """Drives for some periods, stands, cuts, and goes on, with the product's own blades."""

    idle = False

    def __init__(self, config, queue, run_id, chance, permit):
        self._queue, self._chance, self._permit, self.close_up_s = queue, chance, permit, 0.0
        self.blades = Blades(config.work, queue, run_id)
        self.phase, self.places, self.ending = "", (), ""
        self.abort()

    @property
    def cutting(self):
        return self.blades.busy

    def abort(self):
        self.active, self.in_canes, self._left, self._accepted = "", "", 0, None

    def start(self):
        self.abort()
        self._survey = 0

    def survey(self, distance):
        self.abort()
        self._survey = 20 if distance else 0

    def continue_survey(self):
        self.survey(1.0)

    def finish_cut_and_pause(self, why):
        self.ending = why

    def stopped_by(self, touch):
        ticket = self._queue.get(self.active)
        if self.in_canes or ticket is None or ticket.state != "ACCEPTED":
            return None
        return self._queue.put_off(self.active, TRIED, reasons.missed_once(touch.reason), touch.reason)

    def watch(self, bridge, look, sight, now):
        return self.blades.watch(bridge, now)

    def picture(self, now):
        return None

    def clear_of_canes(self, q):
        return q

    def step(self, sent, now):
        rest = Saturation().ramp(sent)
        if self.in_canes:
            if self.blades.busy:
                return MotionResult(rest, self.blades.command(now))
            unknown = self._queue.get(self.in_canes).state == "UNKNOWN"
            self.abort()
            return MotionResult(rest, None, (Event.LOST, reasons.cutter_unsure()) if unknown else None)
        if self.ending:
            return MotionResult(rest, None, (Event.LOST, self.ending))
        if self._survey:
            self._survey -= 1
            return MotionResult(WHEELS, None, None if self._survey else (Event.FINISHED, reasons.survey_blind()))
        ticket = self._queue.get(self.active)
        if ticket is None or ticket.state != "ACCEPTED" or ticket.accepted is not self._accepted:
            ticket = self._queue.next(lambda name: bool(self._permit(self._queue.get(name))))
            if ticket is None:
                return MotionResult(rest, None, (Event.FINISHED, reasons.work_done()))
            self.active, self._accepted = ticket.point.point_id, ticket.accepted
            self._left = self._chance.randrange(2, 15)
        self._left -= 1
        if self._left > 0:
            return MotionResult(WHEELS)
        if not sent.any() and self._left < -3:
            self.in_canes = self.active
            self.blades.start(self.active, TRIED, now)
        return MotionResult(rest)


class Movement:
    """Stands where the controller's `Movement` stands; `newest` is that of the running controller."""

    chance = random.Random(0)

    def __init__(
        self,
        config,
        robot_config,
        queue,
        lines,
        run_id,
        known,
        method=None,
        permit=lambda _: None,
        planned_from=None,
        as_shown=None,
    ):
        self.queue, saturation = queue, Saturation()
        Movement.newest = self
        self._setpoints, self._saturation = Setpoints(saturation), saturation
        nothing = SimpleNamespace(reason=None, model=SimpleNamespace(nearest=None))
        contact = SimpleNamespace(touch=None, lost=False, force=None)
        self.body = SimpleNamespace(
            frame=MapFrame(), robot=MODEL, measured=None, tracking_error=nothing, surroundings=nothing, contact=contact
        )
        self.sequence = Sequence(config, queue, run_id, self.chance, permit)
        follower = SimpleNamespace(jog=lambda xi, robot: SimpleNamespace(xi=np.clip(xi, -0.03, 0.03)))
        self.teleoperation = Teleoperation(
            config.teleoperation, config.work, follower, MODEL.drive, 0.01, lambda *_: None, lambda *_: None
        )
        self.posture_check = SimpleNamespace(refusal=lambda *_: None)
        self.tracking, self._home, self._back = None, 0, 0

    @property
    def homing(self):
        return self._home > 0

    @property
    def backing_off(self):
        return self._back > 0

    @property
    def at_rest(self):
        return self._setpoints.at_rest

    def update(self, inputs):
        if not self.at_rest and self.chance.random() < 0.002:
            self.body.contact.touch = Touch("cutter", "post 1", np.array([0.0, 40.0, 0.0]), np.zeros(3))

    def home_refused(self):
        return None

    def go_home(self):
        self._home = 30

    def stopped_by_contact(self):
        return self.sequence.stopped_by(self.body.contact.touch)

    def back_off(self):
        self._back = 30

    def stay(self):
        self._home = self._back = 0

    def leave(self, mode):
        self.stay()
        if mode == "AUTO":
            self.sequence.abort()
        self.teleoperation.refuse()

    def unknown_motion(self, bridge):
        return bridge.moving and bridge.sequence > self._setpoints.moved

    def busy(self, bridge):
        if self._home or self.sequence.cutting or (bridge is not None and bridge.cutter == "closing"):
            return reasons.blades_closing()
        return None

    def ramp(self):
        return MotionResult(self._saturation.ramp(self._setpoints.sent))

    def step(self, mode, held, now, waits=False):
        if mode == "PROTECTIVE_STOP" and self._back and held:
            self._back -= 1
            return MotionResult(-WHEELS)
        self._back, self.body.contact.touch = 0, None
        if not held or mode not in ("READY", "TELEOP", "AUTO"):
            return self.ramp()
        if mode == "TELEOP":
            return MotionResult(self.teleoperation.step(None).xi)
        if mode == "AUTO":
            return self.ramp() if waits else self.sequence.step(self._setpoints.sent, now)
        self._home = max(0, self._home - 1)
        return MotionResult(WHEELS) if self._home else self.ramp()

    def send(self, xi, token, joints, latched):
        xi = self._setpoints.smooth(xi)
        if token is None or joints is None or (latched and not xi.any()):
            self._setpoints.withhold()
            return None
        return self._setpoints.command(xi, token, joints.message.sequence)


class Robot:
    """Does what it is told; the judge sees it."""

    def __init__(self, judge, chance):
        self._judge, self._chance, self._ends = judge, chance, 0
        self.now = Measurement(np.array([0.0, 0.0, *ARM]), np.zeros(9), "open", "", "", reasons.blades_met())

    def read(self):
        return self.now

    def write(self, setpoint):
        self._judge.actuated(setpoint, self.now.emergency)
        self.now = replace(self.now, velocity=setpoint.xi)
        if self.now.cutter == "closing":
            self._ends -= 1
            if self._ends <= 0:
                outcome = self._chance.choice(("DONE", "DONE", "DONE", "FAILED_NOT_CUT", "UNKNOWN"))
                self._judge.ended(outcome)
                self.now = replace(self.now, cutter="open", outcome=outcome)

    def cut(self, cut_id, point_id):
        self._judge.cut(cut_id, point_id)
        self._ends = self._chance.randrange(3, 60)
        self.now = replace(self.now, cutter="closing", cut_id=cut_id, outcome="")

    def capture(self, expose):
        return None

    def close(self):
        pass


class CutDisk:
    """Remembers cuts through restarts; the disk takes its time, and now and then takes nothing."""

    def __init__(self, chance):
        self._chance, self._on_disk, self._told = chance, set(), {}

    @property
    def known(self):
        self._told = {}
        return frozenset(self._on_disk)

    def keep(self, cut_id):
        if self._told.get(cut_id, "waiting") == "waiting":
            self._told[cut_id] = self._chance.choice(("waiting", "waiting", "kept", "kept", "kept", "failed"))
            if self._told[cut_id] == "kept" or self._chance.random() < 0.3:
                self._on_disk.add(cut_id)
        return self._told[cut_id]
