"""Two operators and a viewer arm, drive, take, grant and give back control, stop and reset, in any order, over HTTP.

Server, router, controller and bridge are the product's and talk as they always do; a model says what must come of each
request, and the robot's actuators whether it moved.
"""

import threading
import time

import pytest
from hypothesis import Phase, settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, initialize, invariant, rule, run_state_machine_as_test

from tests.support.live_two import live_two

# Minutes, since what a person asks takes its time on the wire.
pytestmark = [pytest.mark.alone, pytest.mark.slow]

PEOPLE = {"ada": "supervisor", "bob": "operator", "vic": "viewer"}
ANYBODY = st.sampled_from(["ada", "bob", "ada", "bob", "vic"])
#: Of a busy machine, not of the program: what a person would try again.
_AGAIN = {
    "watchdog_holds",
    "joints_stale",
    "odometry_stale",
    "bridge_stale",
    "obstacles_stale",
    "nothing_received",
    "process_silent",
    "reset_under_way",
    "control_passes",
    "stop_unknown",
}
PATIENCE_S = 15.0


class Control(RuleBasedStateMachine):
    """`holder`, `asking` and `mode` are the model."""

    live = None
    clients = None

    @initialize()
    def begin(self):
        self.holder = self.asking = None
        self.mode = "IDLE"
        # What an earlier example left: stopped, reset, and nobody in control.
        self.post("vic", "stop", reason="begin")
        self.until(lambda: self.state()["controller"]["mode"] == "ESTOP_LATCHED")
        self.live.start_controller()
        self.until(lambda: self.state()["controller"]["mode"] == "ESTOP_LATCHED" and not self.control()["holder"])
        self.expect("ada", "reset", 200, reason="begin")

    def post(self, who, path, **body):
        return self.clients[who].post(f"/api/{path}", json=body)

    def expect(self, who, path, status, **body):
        """Ask; what is refused for the machine's own slowness is asked again."""
        end = time.monotonic() + PATIENCE_S
        while True:
            answer = self.post(who, path, **body)
            again = answer.json().get("code") in _AGAIN
            if answer.status_code == status or not again or time.monotonic() > end:
                break
            time.sleep(0.05)
        assert answer.status_code == status, f"{who} {path} {body}: {answer.status_code} {answer.text}, not {status}"
        return status == 200

    def state(self):
        return self.clients["ada"].get("/api/state").json()

    def control(self):
        answer = self.clients["ada"].get("/api/control")
        return answer.json() if answer.status_code == 200 else {"holder": "nobody has said"}

    def until(self, condition):
        end = time.monotonic() + PATIENCE_S
        while not condition():
            assert time.monotonic() < end, (self.mode, self.holder, self.state()["controller"], self.control())
            time.sleep(0.02)

    def status(self, who, granted):
        return 403 if PEOPLE[who] == "viewer" else 200 if granted else 409

    @rule(who=ANYBODY)
    def arm(self, who):
        if self.expect(who, "arm", self.status(who, self.mode == "IDLE" and self.holder in (None, who))):
            self.mode, self.holder = "READY", who

    @rule(who=ANYBODY, what=st.sampled_from(["start", "pause", "resume", "acknowledge"]))
    def what_is_not_to_be_had_now(self, who, what):
        self.expect(who, what, self.status(who, False))

    @rule(who=ANYBODY, confirm=st.booleans())
    def take(self, who, confirm):
        if self.expect(who, "control/take", self.status(who, self.holder in (None, who) or confirm), confirm=confirm):
            self.asking = None if self.asking == who else self.asking
            self.holder = who

    @rule(who=ANYBODY)
    def request(self, who):
        granted = self.holder not in (None, who) and self.asking in (None, who)
        if self.expect(who, "control/request", self.status(who, granted)):
            self.asking = who

    @rule(who=ANYBODY)
    def grant(self, who):
        if self.expect(who, "control/grant", self.status(who, self.holder == who and self.asking is not None)):
            self.holder, self.asking = self.asking, None

    @rule(who=ANYBODY)
    def give_back(self, who):
        if self.expect(who, "control/return", self.status(who, self.holder == who)):
            self.holder = self.asking = None

    @rule(who=ANYBODY)
    def stop(self, who):
        answer = self.post(who, "stop", reason="test")
        assert answer.status_code == 200, answer.text
        self.mode = "ESTOP_LATCHED"

    @rule(who=ANYBODY, stale=st.sampled_from([False, False, True]))
    def reset(self, who, stale):
        granted = self.mode == "ESTOP_LATCHED" and not stale
        status = 200 if granted and who == "ada" else 409 if who == "ada" else 403
        if self.expect(who, "reset", status, reason="checked", **({"stop_id": "s-another"} if stale else {})):
            self.mode = "IDLE"

    @rule(who=ANYBODY)
    def drive(self, who):
        """Hold for a moment and let go: the robot moves for who may, and stands again afterwards."""
        before = len(self.live.robot.rows)
        may = self.holder in (None, who)
        moves = may and self.mode == "READY" and PEOPLE[who] != "viewer"
        end = time.monotonic() + (PATIENCE_S if moves else 0.4)
        while time.monotonic() < end and not (moves and self.live.moved(before) > 0.02):
            self.clients[who].get("/api/state")
            answer = self.post(who, "teleop", hold=True, base={"linear": 0.05, "angular": 0.0})
            assert answer.status_code == self.status(who, may), answer.text
            time.sleep(0.05)
        self.post(who, "teleop", hold=False)
        assert (self.live.moved(before) > 0.02) is moves, f"{who} in {self.mode}, {self.holder} in control"
        if moves:
            self.holder = who
            self.until(lambda: self.live.moved(len(self.live.robot.rows) - 20) < 1e-3)

    @rule()
    def restart(self):
        """The controller ends and starts again: a stop stays, nobody holds control, and nothing moves."""
        before = len(self.live.robot.rows)
        self.live.start_controller()
        self.holder = self.asking = None
        self.mode = "ESTOP_LATCHED" if self.mode == "ESTOP_LATCHED" else "IDLE"
        assert self.live.moved(before) < 1e-3

    @invariant()
    def the_robot_says_what_the_model_says(self):
        if not hasattr(self, "mode"):
            return
        self.until(lambda: self.state()["controller"]["mode"] == self.mode)
        self.until(lambda: (self.control().get("user") or None, self.control().get("coming")) == (self.holder, ""))
        assert self.live.moved(len(self.live.robot.rows) - 5) < 1e-3
        latched = {told["process"]: bool(told["stops"]) for told in self.state()["stops"]}
        assert latched["bridge"] is (self.mode == "ESTOP_LATCHED")


def test_two_operators_share_a_robot(tmp_path):
    with live_two(tmp_path) as live:
        people = {name: live.server.client(role, name) for name, role in PEOPLE.items()}
        clients = {name: person.__enter__() for name, person in people.items()}
        with live.server.client("operator", "nobody"):
            pass
        away = threading.Event()

        def look():
            """Everybody's page is open: they are heard, and see the robot."""
            watchers = [live.server.visitor() for _ in clients]
            for watcher, client in zip(watchers, clients.values(), strict=True):
                watcher.cookies.update(client.cookies)
            while not away.wait(0.15):
                for watcher in watchers:
                    watcher.get("/api/state")
            for watcher in watchers:
                watcher.close()

        looking = threading.Thread(target=look)
        looking.start()
        try:
            Control.live, Control.clients = live, clients
            run_state_machine_as_test(
                Control,
                settings=settings(max_examples=6, stateful_step_count=30, deadline=None, phases=[Phase.generate]),
            )
        finally:
            away.set()
            looking.join()
            for person in people.values():
                person.__exit__(None, None, None)
