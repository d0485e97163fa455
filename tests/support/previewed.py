"""A controller with a robot that has no mass, whose preview requests are answered after some periods.

What it asks the planner is kept as `request`; a test that wants to answer sets `plan`.
"""

from controller.planning.preview_plan import PreviewRequest
from controller.planning.rollout import Rollout
from controller.planning.work_plan import PlanRequest
from rolling_panda import commands as intents
from rolling_panda.config import RobotConfig
from rolling_panda.messages.supervision import PreviewMotion, PreviewState, SessionPlan
from rolling_panda.reasons import text_of
from tests.support.controller_at_work import CONFIG, robot
from tests.support.sent import newest

ROLLOUT = Rollout(CONFIG, RobotConfig())


class Previewed:
    """`accepted` points, then `previewed`; the newest state and motion are kept."""

    def __init__(self, shown, controller=None, roll=ROLLOUT.roll, **changes):
        self.robot = robot(**changes)
        if controller is not None:
            self.robot.controller = controller
        self.state = self.motion = self.request = self.plan = self.session_plan = self._due = None
        self.path = []
        step = self.robot.controller.step

        def with_rollout(inbox, now):
            if self._due is not None:
                inbox.put(roll(self._due), now)
                self._due = None
            if self.plan is not None:
                inbox.put(self.plan, now)
            out = step(inbox, now)
            self.request = newest(out, PlanRequest) or self.request
            self.session_plan = newest(out, SessionPlan) or self.session_plan
            self._due = newest(out, PreviewRequest)
            self.state = newest(out, PreviewState) or self.state
            self.motion = newest(out, PreviewMotion) or self.motion
            return out

        self.robot.controller.step = with_rollout
        self.robot.step()
        self.robot.show(shown)
        self.robot.step()
        assert self.robot.ask(intents.Arm(user="ada")).ok

    def ask(self, kind, **content):
        answer = self.robot.ask(kind(user="ada", **content))
        self.robot.run(0.1)
        return "" if answer.reason is None else text_of(answer.reason)

    def previewed(self, *point_ids):
        """Accept these, all where none is named, and wait for the preview of all that is accepted."""
        if point_ids:
            for name in point_ids:
                assert self.ask(intents.AcceptPoint, point_id=name, revision=1) == ""
        else:
            assert self.ask(intents.AcceptAll) == ""
        return self.again()

    def again(self, point_id=""):
        assert self.ask(intents.RequestPreview, point_id=point_id) == ""
        for _ in range(200):
            if self.state.phase == "ready":
                return self.state
            self.robot.run(0.05)
        raise AssertionError(self.state)

    def worked(self, limit_s=60.0):
        """Start, and work until the work ends; the tool's path is kept."""
        assert self.ask(intents.Start) == ""
        began = self.robot.now
        while self.robot.state.mode == "AUTO":
            self.robot.step()
            pose = self.robot.model.kinematics(self.robot.q).T_odom_tool
            self.path.append(pose.translation.copy())
            assert self.robot.now - began < limit_s
        return self.robot.now - began
