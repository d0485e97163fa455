"""What must never be broken, judged at the robot and by what people were answered; it believes no mode and no log."""

from collections import Counter
from dataclasses import dataclass, field

import numpy as np

from controller.ledger.journal import LedgerState
from rolling_panda import commands as intents
from rolling_panda import messages as m
from rolling_panda.commands import COMMAND_OF

#: A lease lives so long, a hold so long (s); and a period more.
LEASE_S, HOLD_S, PERIOD_S = 1.0, 0.15, 0.011
#: From the speeds of this world the controller brakes in this time (s).
BRAKING_S = 0.045


@dataclass
class Judge:
    """`told` counts what happened, so that a run in which nothing happens proves nothing."""

    told: Counter = field(default_factory=Counter)
    #: The cane of each accepted point when somebody accepted it.
    accepted: dict = field(default_factory=dict)
    #: Points whose acceptance is over by this record; it counts for good when that record is on disk.
    revoked: dict = field(default_factory=dict)
    cut_ids: set = field(default_factory=set)
    #: Points on which the blades have closed, as far as anybody can know.
    bitten: dict = field(default_factory=dict)
    under_way: str = ""
    at_bridge: set = field(default_factory=set)
    at_controller: set = field(default_factory=set)
    released: set = field(default_factory=set)
    last_xi: np.ndarray = field(default_factory=lambda: np.zeros(9))
    last_token: tuple = (0, -1)
    #: What moved the robot in the commands that the running controller sent: by epoch and sequence.
    sent: dict = field(default_factory=dict)
    heard_at: dict = field(default_factory=dict)
    held_at: dict = field(default_factory=dict)
    last_mode: str = "IDLE"
    started_by: str = ""
    reset_by: str = ""
    last_sent: np.ndarray = field(default_factory=lambda: np.zeros(9))
    pressed_for: int = 0
    may_at: float = -1.0
    kills_in_intent: int = 0
    #: What the ledger has of each point.
    disk: dict = field(default_factory=dict)
    #: Points that this controller has been shown.
    shown_points: set = field(default_factory=set)

    # --- at the robot --------------------------------------------------------------------------------------------

    def actuated(self, setpoint, emergency):
        self.pressed_for = self.pressed_for + 1 if emergency else 0
        grows = bool(np.any(np.abs(setpoint.xi) > np.abs(self.last_xi) + 1e-9))
        self.last_xi = setpoint.xi.copy()
        token = setpoint.epoch, setpoint.sequence
        if grows:
            self.told["periods that moved more"] += 1
            assert not self.at_bridge, "motion under a latched stop"
            assert self.pressed_for < 2, "motion with the emergency stop pressed"
            assert self.sent.get(token), f"motion by a command that nobody might send: {token}"
            assert token >= self.last_token, "motion by an older token"
            self.last_token = token

    def cut(self, cut_id, point_id):
        self.told["cuts"] += 1
        assert cut_id not in self.cut_ids, f"{cut_id} is cut twice"
        self.cut_ids.add(cut_id)
        assert point_id in self.accepted and point_id not in self.revoked, f"{point_id} is cut unaccepted"
        assert not self.bitten.get(point_id), f"{point_id} is cut twice"
        assert not self.at_bridge, "a cut under a latched stop"
        written = self.disk.get(point_id)
        # An order that is on its way when its controller is killed may come after a start has found the intent.
        assert written is not None and written.cut_id == cut_id, "a cut before its intent"
        assert written.state in ("CUTTING", "UNKNOWN"), f"a cut of what is {written.state}"
        assert np.abs(self.last_xi).max() <= 0.04 + 1e-9, "a cut in motion"
        del self.accepted[point_id]
        self.bitten[point_id] = True
        self.under_way = point_id

    def ended(self, outcome):
        self.told[f"cuts {outcome}"] += 1
        if outcome == "FAILED_NOT_CUT":
            self.bitten[self.under_way] = False

    # --- stops ---------------------------------------------------------------------------------------------------

    def stop_at_bridge(self, stop_id):
        if stop_id not in self.released:
            self.at_bridge.add(stop_id)

    def bridge_released(self, emergency):
        assert not emergency, "released with the emergency stop pressed"
        self.released |= self.at_bridge
        self.at_bridge = set()
        self.told["releases"] += 1

    def bridge_told(self, latched):
        assert latched or not self.at_bridge, "a stop is no longer latched that nobody released"

    def bridge_started(self):
        self.told["starts of the bridge"] += 1
        # A bridge begins at rest.
        self.last_xi = np.zeros(9)

    # --- the controller ------------------------------------------------------------------------------------------

    def controller_started(self, written, in_cutting):
        self.told["starts of the controller"] += 1
        for point, number in self.revoked.items():
            if number <= written:
                self.accepted.pop(point, None)
        self.revoked = {}
        # What the last one sent is followed until the bridge misses it.
        self.started_by = self.reset_by = ""
        self.last_sent, self.may_at = np.zeros(9), -1.0
        self.kills_in_intent += in_cutting
        self.heard_at, self.held_at, self.shown_points = {}, {}, set()

    def restored(self, queue):
        """A cut that may have been made is a question for a person, or its end is known; never work to be done."""
        for name, bitten in self.bitten.items():
            ticket = queue.get(name)
            if bitten and ticket is not None:
                self.told[f"after a kill {ticket.state}"] += 1
                assert ticket.state in ("UNKNOWN", "DONE"), f"{name} may be cut, and is {ticket.state}"

    def heard(self, names, now):
        self.heard_at |= dict.fromkeys(names, now)

    def held(self, name, now):
        # Who presses, or asks for something, is heard from too.
        self.held_at, self.heard_at[name] = {name: now}, now

    def delivered(self, inbox, stops):
        for stop in stops:
            if stop.stop_id not in self.released:
                self.at_controller.add(stop.stop_id)
                self.reset_by = ""
        bridge, ledger = inbox.newest(m.BridgeState), inbox.newest(LedgerState)
        if bridge is not None and bridge.message.stop_id:
            self.at_controller.add(bridge.message.stop_id)
        self.shown = bridge is not None and not bridge.message.stop_id
        self.failure = None if ledger is None else ledger.message.failure

    def stepped(self, world, motion):
        now, mode = world.now, world.controller.mode
        self.mode(mode, "step", world)
        if self.at_controller:
            assert mode == "ESTOP_LATCHED", f"{mode} with a stop latched"
        elif self.failure:
            assert mode in ("FAULT", "ESTOP_LATCHED"), f"{mode} without a ledger"
        self._perceived(world)
        if motion is not None:
            xi = np.array(motion.xi)
            grows = bool(np.any(np.abs(xi) > np.abs(self.last_sent) + 1e-9))
            self.last_sent = xi
            may = self._may_move(world, mode, now)
            assert not grows or may, f"the controller moves the robot in {mode} by {self.started_by!r}"
            # While the controller brakes, the bridge may still be on its way up to what it was told before.
            self.may_at = now if may else self.may_at
            self.sent[motion.epoch, motion.sequence] = now - self.may_at < BRAKING_S
            if len(self.sent) > 1000:
                self.sent = dict(list(self.sent.items())[-500:])

    def mode(self, mode, why, world):
        before, self.last_mode = self.last_mode, mode
        if before == mode:
            return
        self.told[f"{before} to {mode}"] += 1
        if why == "restart":
            assert mode in ("IDLE", "ESTOP_LATCHED"), f"a start in {mode}"
            if before == "ESTOP_LATCHED":
                assert mode == before or not self.at_controller, "a restart released a stop"
            return
        if before == "ESTOP_LATCHED":
            # A fault that was there beneath shows at once.
            by_leave = self.reset_by == "supervisor" and self.shown
            assert by_leave and mode in ("IDLE", "FAULT"), f"a stop was left to {mode}"
            self.released |= self.at_controller
            self.at_controller = set()
        if mode in ("AUTO", "TELEOP"):
            assert before == "READY", f"{before} to {mode}"
        if mode != "AUTO" and before == "AUTO":
            self.started_by = ""

    def answered(self, intent, ok, holder, before, world):
        after = world.controller.mode
        self.told[f"{type(intent).__name__} {'granted' if ok else 'refused'}"] += 1
        if ok:
            self.heard_at[intent.user] = world.now
            assert intent.role != "viewer", f"a viewer may {intent}"
            if COMMAND_OF[type(intent)].control and before != "FAULT":
                assert holder in ("", intent.user), f"{intent} while {holder} holds control"
            if isinstance(intent, intents.Acknowledge) and before == "FAULT":
                assert intent.role == "supervisor"
            self._decided(intent, world)
        self.mode(after, "answer", world)
        if ok and isinstance(intent, intents.Start | intents.Home):
            self.started_by = intent.user
        if ok and isinstance(intent, intents.Reset):
            assert intent.role == "supervisor", "a stop is reset by a supervisor"
            self.reset_by = intent.role

    def _decided(self, intent, world):
        points = [intent.point_id] if hasattr(intent, "point_id") else []
        if isinstance(intent, intents.AcceptAll):
            tickets = world.queue.tickets()
            points = [ticket.point.point_id for ticket in tickets if ticket.state == "ACCEPTED"]
        for name in points:
            if isinstance(intent, intents.AcceptPoint) or (
                isinstance(intent, intents.AcceptAll) and (name not in self.accepted or name in self.revoked)
            ):
                assert not self.bitten.get(name), f"{name}, on which the blades have closed, is accepted anew"
                self.accepted[name] = world.queue.get(name).point.cane
                self.revoked.pop(name, None)
            elif isinstance(intent, intents.RejectPoint | intents.ReconsiderPoint) and name in self.accepted:
                self.revoked[name] = world.controller.recorded
            elif isinstance(intent, intents.ResolvePoint):
                self.bitten[name] = intent.outcome == "DONE"

    def _perceived(self, world):
        """What is on another cane or vanished is not accepted any more, unless its cut is under way."""
        points = world.inbox.newest(m.PruningPoints)
        if points is None:
            return
        seen = {point.point_id: point.cane for point in points.message.points}
        for name, cane in self.accepted.items():
            ticket = world.queue.get(name)
            if name in self.revoked or ticket is None or ticket.state in ("CUTTING", "UNKNOWN"):
                continue
            # After a start an acceptance waits until its point is seen again.
            vanished = name not in seen and name in self.shown_points
            if vanished or seen.get(name, cane) != cane:
                self.revoked[name] = world.controller.recorded
        self.shown_points |= set(seen)

    def _may_move(self, world, mode, now):
        holder = world.holder
        if not holder or now - self.heard_at.get(holder, now) > LEASE_S + PERIOD_S:
            return False
        if mode == "TELEOP":
            return now - self.held_at.get(holder, -1.0) <= HOLD_S + PERIOD_S
        # Back from what it has touched.
        back = mode == "PROTECTIVE_STOP" and world.touched
        return back or (mode in ("AUTO", "READY") and bool(self.started_by))
