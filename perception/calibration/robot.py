"""The next calibrations of the robot itself: pictures of the board in, offers out, which an operator takes."""

import time
from collections.abc import Callable
from typing import Generic, TypeVar

import numpy as np
from msgspec.structs import replace

from perception.calibration.base import BaseFit, BaseView, measure_wheels
from perception.calibration.board_view import BoardView, find_board
from perception.calibration.camera import mount_of
from perception.calibration.hand_eye import CalibrationError, calibrate
from perception.segmentation.frame import View, decode_frame
from rolling_panda import messages as m
from rolling_panda import reasons
from rolling_panda.messages.perception import ARM, BASE, CameraMount, CloseUpResult, RobotCalibration
from rolling_panda.messages.robot import LARGEST_OFFSET, ArmCalibration, CameraFrame, JointOffsets
from rolling_panda.model.differential_drive import WheelSizes
from rolling_panda.model.robot import RobotModel, configuration
from rolling_panda.model.wire_values import joint_offsets

Seen = TypeVar("Seen")


class _Round(Generic[Seen]):
    """Pictures of one calibration, taken with the same one in use."""

    def __init__(self, prefix: str) -> None:
        self._first = f"{prefix}1"
        self._used: object = None
        self.views: dict[str, Seen] = {}

    def add(self, name: str, used: object, view: Seen | None) -> tuple[Seen, ...]:
        """All pictures so far; the first one, or another calibration in use, begins anew."""
        if name == self._first or used != self._used:
            self.views, self._used = {}, used
        if view is not None:
            self.views[name] = view
        return tuple(self.views.values())


class RobotCalibrator:
    """Measures wheels and joints; the bridge uses the results. Not thread-safe: it belongs to the pipeline."""

    def __init__(self, model: RobotModel, clock: Callable[[], float] = time.time) -> None:
        """Start without pictures.

        Args:
            model: The robot with its camera; its `data` is overwritten.
            clock: Time of the day (s since 1970).
        """
        self._model, self._clock = model, clock
        self._base: _Round[BaseView] = _Round(BASE)
        self._arm: _Round[BoardView] = _Round(ARM)
        self.state = RobotCalibration(header=m.Header(0.0, "camera"))
        """What is known, for people and the controller."""
        self.mount: CameraMount | None = None
        """The camera by the same pictures as the arm that is offered; None without one."""

    def look(self, frame: CameraFrame) -> CloseUpResult:
        """Take in a picture of the board between two drives, or from a posture of the arm.

        Args:
            frame: As received. The first one of a calibration is number 1 in its `point_id`.

        Raises:
            CorruptFrameError: The frame is corrupt; nothing changes.
        """
        view = decode_frame(frame, self._model)
        from_arm = frame.point_id.startswith(ARM)
        unseen = self._look_from_arm(frame, view) if from_arm else self._look_from_base(frame, view)
        return CloseUpResult(
            header=m.Header(frame.header.stamp, "odom"),
            point_id=frame.point_id,
            number=frame.number,
            finding="seen" if unseen is None else "unseen",
            reason=unseen,
        )

    def _look_from_base(self, frame: CameraFrame, view: View) -> m.Reason | None:
        """Take in a picture; returns why the board is not seen, None if it is."""
        used = self._model.drive.sizes if frame.wheels is None else WheelSizes(*frame.wheels)
        at_origin = configuration(m.PlanarPose(0.0, 0.0, 0.0), frame.position)
        T_base_camera = self._model.pose(at_origin, self._model.camera_id)
        board = find_board(view, view.intrinsics, None, configuration(frame.base, frame.position))
        # The frame has angles of wheels as drawn; those of the real ones follow from the sizes in use.
        drawn = self._model.drive.sizes.motion() @ np.array(frame.position[:2])
        wheels = np.linalg.solve(used.motion(), drawn)
        seen = BaseView(board, T_base_camera, wheels, view.stamp) if isinstance(board, BoardView) else None
        views = self._base.add(frame.point_id, used, seen)
        found, refused = None, None
        try:
            found = self._base_offer(measure_wheels(views, used, self._model.drive.sizes))
        except CalibrationError as error:
            refused = error.reason
        self.state = replace(
            self.state,
            header=m.Header(view.stamp, "camera"),
            base_views=len(views),
            base=found,
            base_refused=refused,
        )
        return None if isinstance(board, BoardView) else board

    def _base_offer(self, fit: BaseFit) -> m.BaseCalibration:
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

    def _look_from_arm(self, frame: CameraFrame, view: View) -> m.Reason | None:
        """Take in a picture; returns why the board is not seen, None if it is."""
        q = configuration(frame.base, frame.position)
        board = find_board(view, frame.intrinsics, self._model.pose(q, self._model.flange_id), q)
        seen = board if isinstance(board, BoardView) else None
        views = self._arm.add(frame.point_id, frame.joint_offsets, seen)
        found, refused, self.mount = None, None, None
        try:
            found, self.mount = self._arm_offer(views, frame.joint_offsets)
        except CalibrationError as error:
            refused = error.reason
        self.state = replace(
            self.state, header=m.Header(view.stamp, "camera"), arm_views=len(views), arm=found, arm_refused=refused
        )
        return None if isinstance(board, BoardView) else board

    def _arm_offer(self, views: tuple[BoardView, ...], used: JointOffsets) -> tuple[ArmCalibration, CameraMount]:
        """The joints' offsets, and the camera that belongs to them."""
        fit, made_at = calibrate(views, self._model), self._clock()
        # The angles of the frames are less the offsets in use.
        offsets = np.array(used) + fit.offsets
        worst = int(np.abs(offsets).argmax())
        if abs(offsets[worst]) > LARGEST_OFFSET:
            off = float(np.degrees(offsets[worst]))
            raise CalibrationError(reasons.arm_far(worst + 1, off, float(np.degrees(LARGEST_OFFSET))))
        arm = ArmCalibration(
            offsets=joint_offsets(offsets),
            made_at=made_at,
            views=fit.views,
            pixels=fit.pixels,
            offset_sd=fit.offset_sd,
        )
        return arm, mount_of(fit, self._model, made_at, arm.offsets)
