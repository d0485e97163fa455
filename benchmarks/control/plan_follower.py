"""Following a plan with a whole-body method: the tool first, base and arm posture in its null space.

The plan's clock runs as fast as the method gets along the tool's path: where a limit holds the tool back, the plan
waits, and the way stays the same.
"""

from typing import Any

import pinocchio as pin

from benchmarks.control.plan import Plan
from controller.motion.follower import tool_error
from controller.whole_body.task import IkProblem, Method, Posture, Solution, ToolTask
from rolling_panda.model.differential_drive import Array
from rolling_panda.model.robot import Kinematics, RobotModel


class PlanFollower:
    """One plan being followed; made for one motion, stepped once a control period."""

    def __init__(
        self,
        robot: RobotModel,
        method: Method,
        plan: Plan,
        gain: float = 3.0,
        free_axis: bool = False,
        base_fixed: bool = False,
    ) -> None:
        """Bind the plan.

        Args:
            robot: Its drive turns ξ̇ into q̇.
            method: Whole-body method.
            plan: The motion.
            gain: Of the tool's error (1/s).
            free_axis: True where the rotation about the tool's y does not matter.
            base_fixed: True where the plan moves the arm alone.
        """
        self._robot, self._method, self._plan = robot, method, plan
        self._gain, self._free_axis = gain, free_axis
        self._base_fixed = base_fixed
        self._dt = float(plan.t[1]) if len(plan.t) > 1 else 1.0
        self._scale = 1.0
        #: The plan's own clock (s).
        self.time = 0.0

    @property
    def done(self) -> bool:
        """True when the clock has reached the plan's end; the tool may still be coming."""
        return self.time >= self._plan.duration - 1e-6 * self._dt

    def step(self, q: Array, kinematics: Kinematics, sent: Array) -> Solution:
        """One period: what to send.

        Args:
            q: Configuration (12).
            kinematics: Of the tool at q.
            sent: ξ̇ (9) sent last.
        """
        q_ref, xi_ref, wanted = self._reference()
        rate = self._robot.drive.basis(float(q_ref[2])) @ xi_ref
        # The plan's own twist belongs to the plan's configuration; at the measured one it moves the tool alike.
        forward = kinematics.J_xi @ xi_ref
        twist = forward + self._gain * tool_error(kinematics.T_odom_tool, wanted)
        problem = IkProblem(
            q=q,
            kinematics=kinematics,
            sent=sent,
            tool=ToolTask(twist, free_axis=self._free_axis),
            posture=Posture(q_ref, rate, self._plan.q[-1]),
            base="frozen" if self._base_fixed else "row",
            scale=self._scale,
        )
        solution = self._method.solve(problem)
        self._scale = solution.scale
        # At rest nothing is asked for, and a scale of nothing must not stop the clock.
        self.time += self._dt * (solution.scale if twist.any() else 1.0)
        return solution

    def _reference(self) -> tuple[Array, Array, Any]:
        """Configuration, ξ̇ and tool pose now; between two rows as the wheels and joints move from one to the next."""
        plan, last = self._plan, len(self._plan.t) - 1
        row = min(int(self.time / self._dt + 1e-6), last)
        share = self.time / self._dt - row
        pose = _se3(plan.T_odom_tool[row])
        if row == last or share < 1e-6:
            return plan.q[row], plan.xi[row], pose
        q, xi, step = plan.q[row].copy(), plan.xi[row], share * self._dt
        q[:3] = self._robot.drive.integrate(q[:3], float(xi[0] * step), float(xi[1] * step))
        q[3:] += xi * step
        return q, xi, pose * pin.exp6(share * pin.log6(pose.actInv(_se3(plan.T_odom_tool[row + 1]))))


def _se3(T: Array) -> Any:
    return pin.SE3(T[:3, :3], T[:3, 3])
