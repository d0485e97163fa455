"""A second look at each surveyed point, from where the tool is clear of the canes, and a third one after its cut."""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import msgspec
import numpy as np

from benchmarks.common.intervals import Figure, quantile, share
from benchmarks.perception.judge import JudgedPoint, RowJudge
from bridge.config import BridgeConfig
from bridge.sim.camera.frame import camera_frame, survey_place
from bridge.sim.camera.renderer import Camera
from bridge.sim.robot.cutter import close_blades
from bridge.sim.vineyard.row import Array, Row
from controller.config import ControllerConfig
from controller.work.close_up import not_as_accepted
from controller.work.point_queue import Ticket
from controller.work.posture_search import cut_poses
from perception.config import PerceptionConfig
from perception.plant.map import PlantMap
from perception.segmentation.frame import decode_frame
from perception.segmentation.segmenter import Segmenter
from perception.tracking.close_up import AROUND, check_close_up
from rolling_panda import messages as m
from rolling_panda.errors import InputError
from rolling_panda.messages.perception import CloseUpResult
from rolling_panda.model.robot import RobotModel, configuration

#: Numbers of the pictures, far from those of the survey, so that their noise is another.
_FIRST = 100_000
_LEFT = np.array([0.0, 1.0, 0.0])


@dataclass
class Looks:
    """What second looks came to.

    Attributes:
        before: Points that were confirmed, as surveyed.
        after: The same, where they were seen from near.
        right_voided: Points that were not confirmed although the survey was right, with the reason.
        wrong_voided: The same where the survey was wrong.
        afterwards: Of each confirmed point, after its cut in physics: what the look said, and whether wood was severed.
    """

    before: list[JudgedPoint] = field(default_factory=list)
    after: list[JudgedPoint] = field(default_factory=list)
    right_voided: list[str] = field(default_factory=list)
    wrong_voided: list[str] = field(default_factory=list)
    afterwards: list[tuple[str, bool]] = field(default_factory=list)


class CloseCamera:
    """Looks at a row from near, with all errors of the camera on."""

    def __init__(
        self,
        camera: Camera,
        segmenter: Segmenter,
        config: PerceptionConfig,
        model: RobotModel,
        known: PlantMap | None = None,
    ) -> None:
        """Bind the camera of a row; `config` and `known` as perception has them after a survey."""
        self._known = known or PlantMap()
        self._camera, self._segmenter, self._config, self._model = camera, segmenter, config, model
        self._base, self._position = survey_place()
        self._taken = _FIRST

    def look(self, row: Row, T_odom_camera: Array, point: m.PruningPoint) -> CloseUpResult:
        """What a picture from a place (4×4) shows of a point."""
        self._taken += 1
        image = self._camera.render(row, T_odom_camera, self._taken)
        frame = camera_frame(image, self._camera, self._base, self._position, self._taken)
        view = replace(decode_frame(frame, self._model), R=T_odom_camera[:3, :3], t=T_odom_camera[:3, 3])
        known = self._known.around(np.array(point.position), AROUND)
        return check_close_up(view, self._segmenter, point, self._taken, self._config, known).result

    @property
    def T_tool_camera(self) -> Array:
        """Where the camera is on the tool (4×4)."""
        q = configuration(self._base, self._position)
        tool, camera = self._model.pose(q, self._model.tool_id), self._model.pose(q, self._model.camera_id)
        out: Array = (tool.inverse() * camera).homogeneous
        return out


def look_again(points: Sequence[m.PruningPoint], row: Row, eye: CloseCamera, opinion: RowJudge, into: Looks) -> None:
    """Confirm, cut and verify each point of a row by itself; for the next one the row is whole again.

    Args:
        points: As surveyed.
        row: Before any cut.
        eye: The camera.
        opinion: The judge, who has seen the survey.
        into: Takes the results.
    """
    config, on_tool = ControllerConfig(), eye.T_tool_camera
    for point in points:
        place, along = np.array(point.position), np.array(point.tangent)
        try:
            poses = cut_poses(place, along, _LEFT, config.work.stand_off, config.work.clearance)
        except InputError:
            continue
        T_odom_camera: Array = poses.clear.homogeneous @ on_tool
        surveyed, ticket = opinion.point(point), Ticket(point, "ACCEPTED", accepted=point)
        seen = eye.look(row, T_odom_camera, point)
        if seen.finding != "seen":
            seen = eye.look(row, T_odom_camera, point)
        why = not_as_accepted(seen, ticket)
        if why or seen.position is None or seen.tangent is None:
            (into.right_voided if surveyed.right else into.wrong_voided).append("" if why is None else why.code)
            continue
        refined = msgspec.structs.replace(point, position=seen.position, tangent=seen.tangent)
        into.before.append(surveyed)
        into.after.append(opinion.point(refined))
        at = poses.cut.homogeneous.copy()
        at[:3, 3] = seen.position
        cut = close_blades(row, at, BridgeConfig())
        after = cut.applied(row)
        afterwards = eye.look(after, T_odom_camera, point)
        if afterwards.finding != "severed":
            afterwards = eye.look(after, T_odom_camera, point)
        into.afterwards.append((afterwards.finding, any(item.rod.organ < 0 for item in cut.severed)))


def summarise_looks(looks: Looks) -> dict[str, Figure]:
    """Figures of the second looks beside those of the survey alone, on the same points."""
    out: dict[str, Figure] = {}
    for name, points in (("one_look", looks.before), ("two_looks", looks.after)):
        on_cane = [point for point in points if point.right_cane]
        along = [abs(point.along_error) for point in on_cane if point.along_error is not None]
        out[f"{name}_right"] = share(sum(point.right for point in points), len(points))
        out[f"{name}_off_axis_median_m"] = quantile([point.off_axis for point in points], 0.5)
        out[f"{name}_off_axis_p95_m"] = quantile([point.off_axis for point in points], 0.95)
        out[f"{name}_along_error_median_m"] = quantile(along, 0.5)
        out[f"{name}_along_error_p95_m"] = quantile(along, 0.95)
    shown = len(looks.after) + len(looks.right_voided) + len(looks.wrong_voided)
    cut = [finding for finding, severed in looks.afterwards if severed]
    stood = [finding for finding, severed in looks.afterwards if not severed]
    out["confirmed"] = share(len(looks.after), shown)
    out["wrong_of_void"] = share(len(looks.wrong_voided), len(looks.wrong_voided) + len(looks.right_voided))
    out["seen_severed_of_cut"] = share(cut.count("severed"), len(cut))
    out["seen_standing_of_cut"] = share(cut.count("seen"), len(cut))
    out["seen_severed_of_not_cut"] = share(stood.count("severed"), len(stood))
    return out
