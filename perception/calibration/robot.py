"""The next calibration of the robot itself: pictures of the board in, an offer out, which an operator takes."""

import time
from collections.abc import Callable

import numpy as np

from perception.calibration.base import BaseFit, BaseView, measure_wheels
from perception.calibration.board_view import find_board
from perception.calibration.hand_eye import CalibrationError
from perception.segmentation.frame import decode_frame
from rolling_panda import messages as m
from rolling_panda import reasons
from rolling_panda.messages.perception import BASE, CloseUpResult, RobotCalibration
from rolling_panda.messages.robot import CameraFrame
from rolling_panda.model.differential_drive import WheelSizes
from rolling_panda.model.robot import RobotModel, configuration


class RobotCalibrator:
    """Measures the wheels. It uses nothing itself: the bridge does. Not thread-safe: it belongs to the pipeline."""

    def __init__(self, model: RobotModel, clock: Callable[[], float] = time.time) -> None:
        """Start without pictures.

        Args:
            model: The robot with its camera; its `data` is overwritten.
            clock: Time of the day (s since 1970).
        """
        self._model, self._clock = model, clock
        self._views: dict[str, BaseView] = {}
        self._used: WheelSizes | None = None
        self.state = RobotCalibration(header=m.Header(0.0, "camera"))
        """What is known, for people and the controller."""

    def look(self, frame: CameraFrame) -> CloseUpResult:
        """Take in a picture of the board between two drives.

        Args:
            frame: As received. The first one of a calibration is number 1 in its `point_id`.

        Raises:
            CorruptFrameError: The frame is corrupt; nothing changes.
        """
        view = decode_frame(frame, self._model)
        used = self._model.drive.sizes if frame.wheels is None else WheelSizes(*frame.wheels)
        if frame.point_id == f"{BASE}1" or used != self._used:
            self._views, self._used = {}, used
        at_origin = configuration(m.PlanarPose(0.0, 0.0, 0.0), frame.position)
        T_base_camera = self._model.pose(at_origin, self._model.camera_id)
        place = np.array([frame.base.x, frame.base.y, frame.base.phi])
        found = find_board(view, view.intrinsics, None, place)
        if found is not None:
            # The frame has angles of wheels as drawn; those of the real ones follow from the sizes in use.
            drawn = self._model.drive.sizes.motion() @ np.array(frame.position[:2])
            wheels = np.linalg.solve(used.motion(), drawn)
            self._views[frame.point_id] = BaseView(found, T_base_camera, wheels, view.stamp)
        self._solve(used, view.stamp)
        return CloseUpResult(
            header=m.Header(frame.header.stamp, "odom"),
            point_id=frame.point_id,
            number=frame.number,
            finding="unseen" if found is None else "seen",
            reason=reasons.board_not_in_picture() if found is None else None,
        )

    def _solve(self, used: WheelSizes, stamp: float) -> None:
        """The offer by all pictures so far, or why there is none."""
        found: m.BaseCalibration | None = None
        refused: m.Reason | None = None
        try:
            found = self._offer(measure_wheels(tuple(self._views.values()), used, self._model.drive.sizes))
        except CalibrationError as error:
            refused = error.reason
        self.state = RobotCalibration(
            header=m.Header(stamp, "camera"), base_views=len(self._views), base=found, base_refused=refused
        )

    def _offer(self, fit: BaseFit) -> m.BaseCalibration:
        return m.BaseCalibration(
            left=fit.sizes.left,
            right=fit.sizes.right,
            track=fit.sizes.track,
            made_at=self._clock(),
            views=fit.views,
            radius_sd=fit.radius_sd,
            apart_sd=fit.apart_sd,
            track_sd=fit.track_sd,
            slip=fit.slip,
        )
