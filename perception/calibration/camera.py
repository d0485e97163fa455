"""The camera's calibration in use, and the next one: pictures of the board in, an offer out, which an operator takes.

Nothing is used before an operator says so. What is refused leaves the calibration in use as it is.
"""

import time
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
import pinocchio as pin

from perception.arrays import Array
from perception.calibration.board_view import BoardView, find_board
from perception.calibration.hand_eye import CalibrationError, HandEye, calibrate
from perception.calibration.monitor import MountError, MountMonitor
from perception.segmentation.frame import View, decode_frame
from rolling_panda import messages as m
from rolling_panda import reasons
from rolling_panda.calibration.file import DAY_S, FARTHEST_SHIFT, FARTHEST_TURN, OLD_S
from rolling_panda.messages.perception import CALIBRATION, CameraMount, CameraState, CloseUpResult
from rolling_panda.messages.robot import LARGEST_DELAY, NO_OFFSETS, CameraFrame, FrameTiming, JointOffsets
from rolling_panda.model.robot import RobotModel, configuration, mount_pose, pose_message, turn_and_shift
from rolling_panda.model.wire_values import vector3

#: Keeps a calibration beyond a restart; raises OSError where it cannot.
Keep = Callable[[CameraMount], None]


class CameraCalibration:
    """Owns what a model believes of its camera. Not thread-safe: it belongs to the pipeline."""

    def __init__(
        self, model: RobotModel, mount: CameraMount | None, keep: Keep, clock: Callable[[], float] = time.time
    ) -> None:
        """Use a calibration.

        Args:
            model: The robot, whose camera is mounted.
            mount: Of an earlier start; None takes the camera to be where it is drawn.
            keep: Called with a new one before it is used.
            clock: Time of the day (s since 1970).
        """
        self._model, self._keep, self._clock = model, keep, clock
        self._mount: CameraMount | None = None
        self._offer: CameraMount | None = None
        self._with_arm: CameraMount | None = None
        self._offsets: JointOffsets | None = None
        self._refused: m.Reason | None = None
        self._views: dict[str, BoardView] = {}
        self._stamp = 0.0
        self._monitor = MountMonitor()
        self._delay: float | None = None
        self.timing: FrameTiming | None = None
        """A better calibration of the camera's clock, which the bridge can use; None without one."""
        self._use(mount)

    @property
    def state(self) -> CameraState:
        """State for people."""
        error, time = self._monitor.error, self._monitor.time
        return CameraState(
            header=m.Header(self._stamp, "camera"),
            mount=self._mount,
            views=len(self._views),
            offer=self._offer,
            refused=self._refused,
            turned=None if error is None else vector3(error.turn),
            turned_sd=None if error is None else vector3(np.sqrt(np.diag(error.covariance)[:3])),
            observations=0 if error is None else error.pictures,
            time_offset=None if time is None else time.offset,
            time_offset_sd=None if time is None else time.sd,
            warning=self._warning,
        )

    def look(self, frame: CameraFrame) -> CloseUpResult:
        """Take in a picture of the board.

        Args:
            frame: As received. The first one of a calibration is number 1 in its `point_id`.

        Raises:
            CorruptFrameError: The frame is corrupt; nothing changes.
        """
        view = decode_frame(frame, self._model)
        self._stamp = view.stamp
        if frame.point_id == f"{CALIBRATION}1":
            self._views, self._offer, self._refused = {}, None, None
        q = configuration(frame.base, frame.position)
        found = find_board(view, frame.intrinsics, self._model.pose(q, self._model.flange_id), q)
        if isinstance(found, BoardView):
            self._views[frame.point_id] = found
            self._solve(frame.joint_offsets)
        return CloseUpResult(
            header=m.Header(frame.header.stamp, "odom"),
            point_id=frame.point_id,
            number=frame.number,
            finding="seen" if isinstance(found, BoardView) else "unseen",
            reason=None if isinstance(found, BoardView) else found,
        )

    def follow(self, offsets: JointOffsets, delay: float = 0.0) -> bool:
        """Take in the calibrations that the bridge uses; returns whether one has changed.

        Wood that was seen with the earlier ones is then misplaced.

        A camera that was measured together with these offsets is offered from now on; nothing else that was measured
        before fits.

        Args:
            offsets: Taken from what the arm's encoders tell (rad).
            delay: By how much pictures are taken to be later than their times tell (s).
        """
        late, self._delay = self._delay, delay
        retimed = late is not None and late != delay
        if retimed:
            self.timing = None
            self._monitor.forget_time()
        before, self._offsets = self._offsets, offsets
        if before is None or before == offsets:
            return retimed
        fits = self._with_arm is not None and self._with_arm.joint_offsets == offsets
        self._offer, self._with_arm, self._refused = self._with_arm if fits else None, None, None
        self._views, self.timing = {}, None
        self._monitor.forget()
        return True

    def measured_with_arm(self, mount: CameraMount) -> None:
        """Take in the camera by the pictures of a new calibration of the arm; it is offered once that one is used."""
        self._with_arm = mount

    def fits(self, offsets: JointOffsets) -> bool:
        """Whether these offsets of the joints are the ones that `follow` was told last."""
        return self._offsets in (None, offsets)

    def observe(self, view: View, frame: CameraFrame, axes: Sequence[Array]) -> None:
        """Compare the canes of a picture of the row with earlier ones; what is wrong is told, and corrected on offer.

        Args:
            view: The picture.
            frame: The frame that it is from.
            axes: Centre line of each cane from its base outwards, N×3 in odom (m).
        """
        before, timed = self._monitor.error, self._monitor.time
        base, velocity = np.array([frame.base.x, frame.base.y, frame.base.phi]), None
        if frame.velocity is not None:
            q = configuration(frame.base, frame.position)
            velocity = self._model.velocity(q, np.array(frame.velocity), self._model.camera_id)
        self._monitor.observe(view.R, view.t, base, axes, velocity, view.stamp)
        if self._monitor.time is not timed:
            self.timing = self._timing()
        error = self._monitor.error
        if error is before or error is None or (self._offer is not None and self._offer.source == "board"):
            return
        self._offer = None if error.warning is None else self._corrected(error)

    def use(self, made_at: float) -> m.Answer:
        """Use the offered calibration from now on, and after a restart.

        Args:
            made_at: Of the offer that the operator saw.
        """
        offer = self._offer
        if offer is None or offer.made_at != made_at:
            return m.Answer(ok=False, reason=reasons.no_calibration_offered())
        try:
            self._keep(offer)
        except OSError as error:
            return m.Answer(ok=False, reason=reasons.calibration_not_kept(error.strerror or str(error)))
        turn, shift = turn_and_shift(self._T_flange_camera, mount_pose(offer))
        self._use(offer)
        return m.Answer(ok=True, reason=reasons.calibration_used(float(np.degrees(turn)), 1e3 * shift))

    @property
    def _T_flange_camera(self) -> Any:
        return self._model.T_flange_camera if self._mount is None else mount_pose(self._mount)

    @property
    def _warning(self) -> m.Reason | None:
        if self._monitor.error is not None and self._monitor.error.warning is not None:
            return self._monitor.error.warning
        if self._monitor.time is not None and self._monitor.time.warning is not None:
            return self._monitor.time.warning
        if self._mount is not None and not self.fits(self._mount.joint_offsets):
            return reasons.camera_of_other_arm()
        age_s = 0.0 if self._mount is None else self._clock() - self._mount.made_at
        return reasons.calibration_old(age_s // DAY_S) if age_s > OLD_S else None

    def _use(self, mount: CameraMount | None) -> None:
        self._mount, self._offer = mount, None
        self._model.mount_camera(mount)
        self.timing = None
        self._monitor.forget()

    def _timing(self) -> FrameTiming | None:
        """The delay in use, corrected by what the monitor has found; None where nothing is to be corrected."""
        time = self._monitor.time
        if time is None or time.warning is None:
            return None
        delay = float(np.clip((self._delay or 0.0) + time.offset, -LARGEST_DELAY, LARGEST_DELAY))
        return FrameTiming(delay=delay, made_at=self._clock(), views=time.pictures, delay_sd=time.sd)

    def _corrected(self, error: MountError) -> CameraMount:
        """The calibration in use, corrected by what the monitor has found."""
        pose = pose_message(self._T_flange_camera * pin.SE3(pin.exp3(error.turn), error.shift))
        sd = np.sqrt(np.diag(error.covariance))
        return CameraMount(
            position=pose.position,
            quat_xyzw=pose.quat_xyzw,
            focal=1.0 if self._mount is None else self._mount.focal,
            source="work",
            made_at=self._clock(),
            views=error.pictures,
            angle_sd=float(sd[:2].max()),
            shift_sd=float(sd[3:].max()),
            joint_offsets=self._offsets or NO_OFFSETS,
        )

    def _solve(self, offsets: JointOffsets) -> None:
        """The offer by all pictures so far, or why there is none."""
        self._offer, self._refused = None, None
        try:
            found = calibrate(tuple(self._views.values()))
            self._offer = mount_of(found, self._model, self._clock(), offsets)
        except CalibrationError as error:
            self._refused = error.reason


def mount_of(found: HandEye, drawn: RobotModel, made_at: float, offsets: JointOffsets) -> CameraMount:
    """The calibration of the camera that was found with these offsets of the joints (rad).

    Raises:
        CalibrationError: It is too far from where the model's camera is drawn.
    """
    turn, shift = turn_and_shift(drawn.T_flange_camera, found.T_flange_camera)
    if turn > FARTHEST_TURN or shift > FARTHEST_SHIFT:
        raise CalibrationError(reasons.calibration_far(float(np.degrees(turn)), 1e3 * shift))
    pose = pose_message(found.T_flange_camera)
    return CameraMount(
        position=pose.position,
        quat_xyzw=pose.quat_xyzw,
        focal=found.focal,
        made_at=made_at,
        views=found.views,
        pixels=found.pixels,
        angle_sd=found.angle_sd,
        shift_sd=found.shift_sd,
        joint_offsets=offsets,
    )


def keep_nothing(mount: CameraMount) -> None:
    """For a pipeline without a state folder."""
