"""The problems as files that a solver in another environment can read: the robot as one URDF, and arrays."""

import xml.etree.ElementTree as ET
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pinocchio as pin

from controller.config import ControllerConfig, WholeBodyConfig
from controller.whole_body.actuation import Actuation
from controller.whole_body.task import IkProblem, ToolTask
from rolling_panda.model.differential_drive import Array
from rolling_panda.model.robot import RobotModel, panda_urdf
from rolling_panda.resources import resource

_JOIN = (("arm_mount", "panda_link0"), ("panda_link8", "cutter_link"))


def write_problem(folder: Path, demands: Sequence[IkProblem], config: ControllerConfig) -> None:
    """Write `robot.urdf` and `problem.npz`.

    For each demand: q (12), the pose that asks for the demanded twist within one period (target), the velocities sent
    last (v, 12, over q), and the posture (12). Limits are over q (12), whose joints are in `names`.
    """
    robot, dt = RobotModel(), 1.0 / config.rate_hz
    # Velocities of actuators are no problem for a solver of tool poses.
    demands = [demand for demand in demands if isinstance(demand.tool, ToolTask)]
    targets = []
    for demand in demands:
        assert isinstance(demand.tool, ToolTask)
        T, twist = demand.kinematics.T_odom_tool, demand.tool.twist * dt
        targets.append(
            pin.SE3(pin.exp3(twist[3:]) @ T.rotation, T.translation + twist[:3]).homogeneous,
        )
    velocity, acceleration = rates(robot, config.whole_body)
    np.savez(
        folder / "problem.npz",
        names=np.array([str(name) for name in robot.model.names][1:]),
        q=np.array([demand.q for demand in demands]),
        target=np.array(targets),
        v=np.array([demand.kinematics.S @ demand.sent for demand in demands]),
        posture=np.array([demand.posture.q for demand in demands]),
        dt=dt,
        velocity=velocity,
        acceleration=acceleration,
        wheel_radius=robot.drive.wheel_radius,
        half_track=robot.drive.half_track,
    )
    (folder / "robot.urdf").write_text(robot_urdf(), encoding="utf-8")


def rates(robot: RobotModel, config: WholeBodyConfig) -> tuple[Array, Array]:
    """Limits of velocity and of acceleration over q (12)."""
    speed = [config.base_speed, config.base_yaw_rate]
    wheels = np.abs(Actuation(robot.drive).wheels) @ speed
    velocity = robot.limits.velocity[2:] * config.arm_velocity_scale
    arm = robot.limits.acceleration[2:] * config.arm_acceleration_scale
    base = [config.base_acceleration] * 2 + [config.base_yaw_acceleration]
    return (
        np.concatenate([[speed[0]] * 2, [speed[1]], wheels, velocity]),
        np.concatenate([base, robot.limits.acceleration[:2], arm]),
    )


def robot_urdf() -> str:
    """Base, arm and tool in one description, without shapes."""
    whole = ET.Element("robot", name="rolling_panda")
    texts = (
        resource("assets/urdf/base.urdf").read_text(),
        panda_urdf(),
        resource("assets/urdf/tool.urdf").read_text(),
    )
    for text in texts:
        for element in ET.fromstring(text):
            for shape in [child for child in element if child.tag in ("visual", "collision")]:
                element.remove(shape)
            if element.tag in ("link", "joint"):
                whole.append(element)
    for parent, child in _JOIN:
        joint = ET.SubElement(whole, "joint", name=f"{parent}_to_{child}", type="fixed")
        ET.SubElement(joint, "parent", link=parent)
        ET.SubElement(joint, "child", link=child)
    return ET.tostring(whole, encoding="unicode")
