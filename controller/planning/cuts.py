"""Planner of the accepted cuts: a collision-free posture for each, in the fastest order."""

import hashlib

import msgspec
import numpy as np

from controller.config import ControllerConfig
from controller.inputs import Sample
from controller.motion.speed_limits import plan_limits
from controller.motion.surroundings import obstacles_of
from controller.motion.torque import torque_report
from controller.planning.base_path import BasePlanner
from controller.planning.path import PathPlanner, Stand
from controller.planning.plan import Plan
from controller.planning.scheduler import Scheduler, Stop, Target
from controller.planning.work_plan import PlannedCut, PlanRequest, WorkPlan, planned_points
from controller.whole_body.collision import CollisionModel
from controller.whole_body.manipulability import arm_omega
from controller.work.cut_clearance import CutClearance
from controller.work.posture_search import CutPlan, PostureSearch, Unreachable
from rolling_panda.config import RobotConfig
from rolling_panda.errors import ControlError
from rolling_panda.messages.perception import Obstacles, PruningPoint
from rolling_panda.messages.types import Header
from rolling_panda.model.differential_drive import Array
from rolling_panda.model.robot import RobotModel

#: Estimated time from the order to cut to its outcome (s), for the duration of the work only.
CLOSING_S = 0.5
#: Rows of a motion between two evaluations of the arm's manipulability.
_LOOK = 10

#: Shortest time between two rows of a plan (s): a control rate of 1 kHz would add no information.
_ROW_S = 0.01


class CutPlanner:
    """Answers plan requests. Equal requests have equal answers, from any instance."""

    def __init__(self, config: ControllerConfig, robot_config: RobotConfig) -> None:
        """Build the models (about half a second)."""
        self._config, self._robot_config = config, robot_config
        robot = self._robot = RobotModel(robot_config)
        self._collision = CollisionModel(robot)
        self._limits = plan_limits(
            robot,
            base_speed=config.base_speed,
            base_yaw_rate=config.base_yaw_rate,
            base_acceleration=config.base_acceleration,
            arm_velocity_scale=config.arm_velocity_scale,
            arm_acceleration_scale=config.arm_acceleration_scale,
            joint_margin=config.joint_margin,
            dt=max(1.0 / config.rate_hz, _ROW_S),
        )
        paths = PathPlanner(robot, self._collision, self._limits)
        self._sessions = Scheduler(paths, BasePlanner(robot.drive, self._limits), self._limits, config.tool_speed)
        self._clearance = CutClearance(RobotModel(robot_config), config)
        self._search = PostureSearch(RobotModel(robot_config), config, self._clearance.admits)

    def plan(self, request: PlanRequest) -> WorkPlan:
        """The work on the points of a request; takes a fraction of a second to seconds a point.

        Raises:
            ControlError: The request's configuration is not finite.
        """
        if not np.isfinite(request.q).all():
            raise ControlError(f"a plan from {request.q.tolist()} was asked for; every coordinate must be finite")
        self._collision.set_obstacles(obstacles_of(request.obstacles))
        self._clearance.update(Sample(Obstacles(header=Header(), capsules=request.obstacles), 0.0))
        refused: dict[str, str] = {}
        cuts: dict[str, CutPlan] = {}
        targets = []
        turned = dict(request.turned)
        for point in request.points:
            found = self._posture(point, request.q, turned.get(point.point_id))
            if isinstance(found, str):
                refused[point.point_id] = found
                continue
            cuts[point.point_id] = found
            targets.append(self._target(point.point_id, found))
        schedule = self._sessions.plan(request.q, targets, wanted=request.order)
        refused |= schedule.refused
        points = {point.point_id: point for point in request.points}
        planned = []
        for stop in schedule.stops:
            cut = self._cut(points[stop.name], cuts[stop.name], stop)
            if isinstance(cut, str):
                refused[stop.name] = cut
            else:
                planned.append(cut)
        said = planned_points(request, planned, refused)
        digest = self._digest(request, planned, refused)
        return WorkPlan(request, tuple(planned), refused, said, schedule.duration, digest)

    def _posture(self, point: PruningPoint, q: Array, azimuth: float | None) -> CutPlan | str:
        """A posture to make the cut from, or why there is none."""
        self._clearance.forget()
        finding = self._search.find(np.array(point.position), np.array(point.tangent), q, azimuth)
        try:
            while True:
                next(finding)
        except StopIteration as end:
            found = end.value
        if isinstance(found, CutPlan):
            return found
        assert isinstance(found, Unreachable)
        lacking = self._clearance.lacking
        if not lacking:
            return found.reason
        return f"{found.reason}; in the best one, {lacking}: move the point along its cane, or cut this one by hand"

    def _target(self, name: str, cut: CutPlan) -> Target:
        config = self._config
        hold_s = 2.0 * config.clearance / config.advance_speed + config.slow_zone / config.cut_speed + CLOSING_S
        least = self._collision.least(cut.q_clear).distance
        stand = Stand(cut.q_clear, 0.0, cut.joint_margin, cut.manipulability, least)
        return Target(name, stand, hold_s)

    def _cut(self, point: PruningPoint, cut: CutPlan, stop: Stop) -> PlannedCut | str:
        """Figures of a cut, or the reason why its motion is refused."""
        way = stop.planned.plan
        tightest = None
        if len(way.t) > 1:
            report = torque_report(self._robot, way.t, way.q, way.xi)
            tightest = report.tightest
            if not report.feasible:
                return (
                    f"on the way {tightest.joint} would need {tightest.peak:.0f} Nm, it has {tightest.limit:.0f} Nm; "
                    f"lower arm_velocity_scale or arm_acceleration_scale"
                )
        return PlannedCut(
            point=point,
            cut=cut,
            way=way,
            begins=stop.begins,
            clearance=stop.clearance.distance,
            between=stop.clearance.pair,
            manipulability=min(cut.manipulability, self._least_omega(way)),
            torque_margin=0.0 if tightest is None else tightest.margin,
            torque_joint="" if tightest is None else tightest.joint,
        )

    def _least_omega(self, way: Plan) -> float:
        return min(arm_omega(self._robot.kinematics(q).J) for q in way.q[::_LOOK])

    def _digest(self, request: PlanRequest, cuts: list[PlannedCut], refused: dict[str, str]) -> str:
        encode = msgspec.msgpack.Encoder(order="deterministic").encode
        out = hashlib.sha256()
        for part in (
            self._config,
            self._robot_config,
            request.points,
            request.obstacles,
            request.order,
            request.turned,
            refused,
        ):
            out.update(encode(part))
        out.update(np.ascontiguousarray(request.q, dtype="<f8").tobytes())
        for cut in cuts:
            out.update(cut.point.point_id.encode())
            out.update(cut.way.digest.encode())
            for q in (cut.cut.q_clear, cut.cut.q_stand_off, cut.cut.q_cut):
                out.update(np.ascontiguousarray(q, dtype="<f8").tobytes())
        return out.hexdigest()
