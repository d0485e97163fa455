"""The whole robot in Pinocchio: base and tool from our URDF, the Panda by path, q = [x, y, φ, θ_l, θ_r, q₁…q₇].

Velocities of frames are those of the geometric Jacobian in a frame at the tool with the axes of odom
(Pinocchio's LOCAL_WORLD_ALIGNED): [v; ω] in m/s and rad/s.
"""

import xml.etree.ElementTree as ET
from dataclasses import dataclass
from typing import Any

import msgspec
import numpy as np
import pinocchio as pin
from msgspec import Struct

from rolling_panda import messages as m
from rolling_panda.config import RobotConfig
from rolling_panda.errors import ModelError
from rolling_panda.messages.perception import CameraMount
from rolling_panda.messages.robot import Intrinsics
from rolling_panda.model.differential_drive import NQ, Array, DifferentialDrive
from rolling_panda.resources import panda_description, resource

#: Indices of the arm's joints in q and in ξ.
ARM_Q, ARM_XI = slice(5, 12), slice(2, 9)
_MESH_ROOT = "package://example-robot-data/robots/panda_description"


@dataclass(frozen=True)
class Limits:
    """What the robot can do. Positions over q (12), the others over ξ (9); where there is no limit it is infinite."""

    lower: Array
    upper: Array
    velocity: Array
    acceleration: Array
    jerk: Array


class Kinematics(Struct, frozen=True):
    """Tool kinematics at one q: the pose, J (6×12), S (12×9) and J_ξ = J S (6×9)."""

    T_odom_tool: Any
    J: Array
    S: Array
    J_xi: Array


class RobotModel:
    """Kinematics of the robot. Not thread-safe: one instance a thread, since Pinocchio's data is a work space."""

    def __init__(self, config: RobotConfig | None = None) -> None:
        """Assemble base, arm and tool.

        Raises:
            ModelError: A description is missing, or the assembly has other coordinates than q.
        """
        config = config or RobotConfig()
        self.model = assemble()
        self.data = self.model.createData()
        if (self.model.nq, self.model.nv) != (NQ, NQ):
            raise ModelError(f"the assembled robot has nq = {self.model.nq}, nv = {self.model.nv}; it must have {NQ}")
        self.tool_id = self.frame_id("tool")
        self.camera_id = self.frame_id("camera")
        self.flange_id = self.frame_id("panda_link8")
        #: The camera on the flange as drawn (pin.SE3).
        self.T_flange_camera = self._on_flange.actInv(self.model.frames[self.camera_id].placement)
        self._focal = 1.0
        self.drive = _drive(self.model, config)
        self.limits = _limits(self.model, config)

    @property
    def _on_flange(self) -> Any:
        """The flange's pose in the frame of the last joint."""
        return self.model.frames[self.flange_id].placement

    def mount_camera(self, mount: CameraMount | None) -> None:
        """Take the camera to be where its calibration has it; None takes it back to where it is drawn."""
        T_flange_camera = self.T_flange_camera if mount is None else mount_pose(mount)
        self.model.frames[self.camera_id].placement = self._on_flange * T_flange_camera
        self._focal = 1.0 if mount is None else mount.focal

    def lens(self, reported: Intrinsics) -> Intrinsics:
        """The camera model that was calibrated, for the one that a frame reports."""
        if self._focal == 1.0:
            return reported
        return msgspec.structs.replace(reported, fx=reported.fx * self._focal, fy=reported.fy * self._focal)

    def frame_id(self, name: str) -> int:
        """Index of a named frame.

        Raises:
            ModelError: No such frame; the text lists the known ones.
        """
        if not self.model.existFrame(name):
            known = ", ".join(sorted(frame.name for frame in self.model.frames))
            raise ModelError(f"no frame {name!r}; known are {known}")
        return int(self.model.getFrameId(name))

    def kinematics(self, q: Array) -> Kinematics:
        """Tool pose and Jacobians at q (12); updates the placement of every frame and joint."""
        pin.computeJointJacobians(self.model, self.data, q)
        pin.updateFramePlacements(self.model, self.data)
        J = pin.getFrameJacobian(self.model, self.data, self.tool_id, pin.LOCAL_WORLD_ALIGNED)
        S = self.drive.basis(float(q[2]))
        return Kinematics(self.data.oMf[self.tool_id].copy(), J, S, J @ S)

    def pose(self, q: Array, frame_id: int) -> Any:
        """T_odom_frame (pin.SE3) at q (12)."""
        pin.framesForwardKinematics(self.model, self.data, q)
        return self.data.oMf[frame_id].copy()

    def velocity(self, q: Array, xi: Array, frame_id: int) -> Array:
        """Velocity of a frame in its own axes, v (m/s) and ω (rad/s), at q (12) with actuated velocities ξ (9)."""
        J = pin.computeFrameJacobian(self.model, self.data, q, frame_id, pin.LOCAL)
        out: Array = J @ self.drive.basis(float(q[2])) @ xi
        return out


def assemble() -> Any:
    """Pinocchio model of base, arm and tool, with nq = nv = 12."""
    base = pin.buildModelFromXML(resource("assets/urdf/base.urdf").read_text())
    arm = pin.buildModelFromXML(panda_urdf())
    tool = pin.buildModelFromXML(resource("assets/urdf/tool.urdf").read_text())
    whole = pin.appendModel(base, arm, base.getFrameId("arm_mount"), pin.SE3.Identity())
    return pin.appendModel(whole, tool, whole.getFrameId("panda_link8"), pin.SE3.Identity())


def panda_urdf(name: str = "panda.urdf") -> str:
    """URDF text of the Panda without its hand, with mesh files as absolute paths.

    Args:
        name: `panda.urdf` (meshes) or `panda_collision.urdf` (spheres and cylinders).
    """
    folder = panda_description()
    root = ET.parse(folder / "urdf" / name).getroot()
    for element in list(root):
        label = element.get("name", "")
        if "hand" in label or "finger" in label:
            root.remove(element)
    for mesh in root.iter("mesh"):
        mesh.set("filename", mesh.get("filename", "").replace(_MESH_ROOT, str(folder)))
    return ET.tostring(root, encoding="unicode")


def configuration(base: m.PlanarPose, position: m.Actuated) -> Array:
    """Q (12) from a base pose in odom and the actuated coordinates ξ."""
    return np.array([base.x, base.y, base.phi, *position])


def on_plane(pose: Array) -> Any:
    """The pin.SE3 of a pose on the plane: x, y (m), heading (rad); more is ignored."""
    return pin.SE3(pin.exp3(np.array([0.0, 0.0, pose[2]])), np.array([pose[0], pose[1], 0.0]))


def pose_message(placement: Any) -> m.Pose:
    """The wire form of a pin.SE3."""
    x, y, z = (float(value) for value in placement.translation)
    qx, qy, qz, qw = (float(value) for value in pin.Quaternion(placement.rotation).coeffs())
    return m.Pose((x, y, z), (qx, qy, qz, qw))


def placement(pose: m.Pose) -> Any:
    """The pin.SE3 of a wire pose; its quaternion is normalised.

    Raises:
        ModelError: The quaternion is too far from unit length to mean a rotation.
    """
    quaternion = pin.Quaternion(*(pose.quat_xyzw[i] for i in (3, 0, 1, 2)))
    if abs(quaternion.norm() - 1.0) > 1e-2:
        raise ModelError(f"quat_xyzw {pose.quat_xyzw} has length {quaternion.norm():.3f}; it must be 1")
    quaternion.normalize()
    return pin.SE3(quaternion.toRotationMatrix(), np.array(pose.position))


def mount_pose(mount: CameraMount) -> Any:
    """T_flange_camera of a calibration (pin.SE3)."""
    return placement(m.Pose(mount.position, mount.quat_xyzw))


def turn_and_shift(T_a: Any, T_b: Any) -> tuple[float, float]:
    """Angle (rad) and distance (m) between two poses (pin.SE3)."""
    off = T_a.actInv(T_b)
    return float(np.linalg.norm(pin.log3(off.rotation))), float(np.linalg.norm(off.translation))


def _drive(model: Any, config: RobotConfig) -> DifferentialDrive:
    left = model.jointPlacements[model.getJointId("wheel_left")].translation
    right = model.jointPlacements[model.getJointId("wheel_right")].translation
    # The wheels roll on the floor, so the height of their axle is their radius.
    radius, track = config.wheel_radius or float(left[2]), config.track or float(left[1] - right[1])
    return DifferentialDrive(radius, track / 2, config.rho)


def _limits(model: Any, config: RobotConfig) -> Limits:
    lower, upper = model.lowerPositionLimit.copy(), model.upperPositionLimit.copy()
    lower[:5], upper[:5] = -np.inf, np.inf
    velocity = np.concatenate([[config.wheel_velocity] * 2, model.velocityLimit[ARM_Q]])
    acceleration = np.array([config.wheel_acceleration, config.wheel_acceleration, *config.arm_acceleration])
    jerk = np.array([np.inf, np.inf, *config.arm_jerk])
    return Limits(lower, upper, velocity, acceleration, jerk)
