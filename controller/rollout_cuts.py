"""What a preview says of each cut: when, how near to what, and how it ends."""

from dataclasses import dataclass

from controller.motion import Measured
from controller.queue import PointQueue
from controller.whole_body.collision import CollisionModel
from controller.whole_body.joint_limits import margin
from controller.whole_body.manipulability import arm_omega
from rolling_panda.preview_messages import PreviewedCut
from rolling_panda.robot_model import Limits


@dataclass
class _Least:
    """The least of everything since a point was begun with."""

    point_id: str
    begins: float
    closed: float | None = None
    clearance: float = 1e3
    between: tuple[str, str] = ("", "")
    omega: float = 1e3
    margin: float = 1e3


class CutLog:
    """`look` at the robot now and then; `cuts` at the end."""

    def __init__(self, limits: Limits, collision: CollisionModel, queue: PointQueue) -> None:
        """Nothing has been worked on.

        Args:
            limits: Of the joints.
            collision: Knows what stands around, and what the blades may touch now.
            queue: Knows what became of each point.
        """
        self._limits, self._collision, self._queue = limits, collision, queue
        self._points: list[_Least] = []

    def look(self, robot: Measured, active: str, now: float) -> None:
        """The robot is on the way to, at, or from the `active` point; empty: of the last one still."""
        if active and (not self._points or self._points[-1].point_id != active):
            begins = now if self._points else 0.0
            self._points.append(_Least(active, begins))
        if not self._points:
            return
        least = self._points[-1]
        near = self._collision.least(robot.q)
        if near.distance < least.clearance:
            least.clearance, least.between = near.distance, near.pair
        least.omega = min(least.omega, arm_omega(robot.kinematics.J))
        least.margin = min(least.margin, margin(robot.q, self._limits))

    def closed(self, point_id: str, now: float) -> None:
        """The blades close on a point."""
        for least in self._points:
            if least.point_id == point_id and least.closed is None:
                least.closed = now

    def cuts(self, now: float, why: str) -> tuple[PreviewedCut, ...]:
        """All of them, the work having ended `now`, early for the reason `why`; empty when nothing was left."""
        ends = [each.begins for each in self._points[1:]] + [now]
        return tuple(self._cut(each, end, why) for each, end in zip(self._points, ends, strict=True))

    def _cut(self, least: _Least, ends: float, why: str) -> PreviewedCut:
        ticket = self._queue.get(least.point_id)
        done = least.closed is not None
        reason = why if ticket is None or ticket.state in ("ACCEPTED", "INTENT") else ticket.reason
        return PreviewedCut(
            point_id=least.point_id,
            revision=0 if ticket is None else ticket.point.revision,
            begins_s=least.begins,
            cut_s=least.closed,
            ends_s=ends,
            result="cut" if done else f"not cut: {reason}"[:500],
            clearance=least.clearance,
            between=least.between,
            manipulability=least.omega,
            joint_margin=least.margin,
        )
