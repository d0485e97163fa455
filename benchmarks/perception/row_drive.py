"""A simulated robot that drives along a row and back, with a picture now and then: frames for localisation.

The physics, wheels, ground, wind and camera are the simulation's own. A driver who sees the row steers by it, as people
do; perception gets none of that.
"""

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import pinocchio as pin

from bridge.config import BridgeConfig
from bridge.core.interface import Setpoint
from bridge.core.odometer import Odometer
from bridge.sim.camera.config import CameraConfig
from bridge.sim.camera.renderer import InlineRenderer
from bridge.sim.robot.model import STEP_S
from bridge.sim.robot.robot import SimulatedRobot
from bridge.sim.vineyard.config import VineyardConfig
from bridge.sim.vineyard.grow import grow
from bridge.sim.world.config import WorldConfig
from bridge.sim.world.growth import overgrown
from rolling_panda import messages as m
from rolling_panda.config import load_section
from rolling_panda.messages.robot import CameraFrame
from rolling_panda.model.robot import RobotModel, configuration
from rolling_panda.model.wire_values import actuated
from rolling_panda.resources import resource

#: How the driver steers: towards the line through the origin along the row (rad/s for m and for rad), and at most.
_TO_LINE, _TO_HEADING, _MOST = 0.4, 0.8, 0.3
#: Slower than this the driver steers less (m/s).
_MOVES = 0.05
#: Acceleration (m/s²), and how long the robot rests at either end (s).
_ACCELERATION, _RESTS_S = 0.2, 2.0


@dataclass(frozen=True)
class TrueFrame:
    """A frame, and where the base truly was.

    Attributes:
        frame: As the bridge would send it.
        T_world_base: True pose of the base (pin.SE3), as a robot without errors of build would have for this camera.
        outbound: Whether the robot was on its way out.
    """

    frame: CameraFrame
    T_world_base: pin.SE3
    outbound: bool


def row_drive(
    seed: int, metres: float, world: WorldConfig, speed: float = 0.15, pictures_hz: float = 2.0
) -> Iterator[TrueFrame]:
    """Drive out along the row and back.

    Args:
        seed: Of row, camera and disturbances.
        metres: How far.
        world: Disturbances.
        speed: Of the base (m/s).
        pictures_hz: Pictures a second.
    """
    path = resource("assets/config/sim.toml")
    config = load_section(path, "bridge", BridgeConfig)
    vineyard = load_section(path, "vineyard", VineyardConfig)
    spacing = vineyard.vine_spacing
    grown = grow(VineyardConfig(vines=math.ceil((metres + 2.0) / spacing) + 1, vine_spacing=spacing), seed)
    row = overgrown(grown, world, seed)
    renderer = InlineRenderer(load_section(path, "camera", CameraConfig), seed, world)
    robot, model = SimulatedRobot(config, row, renderer, None, world, seed), RobotModel()
    odometer = Odometer(model.drive, config.odometry, STEP_S, seed)
    q = configuration(m.PlanarPose(0.0, 0.0, 0.0), actuated(np.concatenate([[0.0, 0.0], config.start_arm])))
    T_base_camera = model.pose(q, model.camera_id)
    every, sequence, v, ticks, rested = round(1.0 / (pictures_hz * STEP_S)), 0, 0.0, 0, 0.0
    outbound = True
    odometer.follow(robot.read().position[:2])
    while True:
        base = robot.true_base().pose
        left = (metres - base[0]) if outbound else base[0]
        wanted = math.copysign(min(speed, math.sqrt(2 * _ACCELERATION * max(left, 0.0))), 1.0 if outbound else -1.0)
        if left < 0.01:
            wanted, rested = 0.0, rested + STEP_S
            if rested > _RESTS_S:
                if not outbound:
                    break
                outbound, rested = False, 0.0
        v += float(np.clip(wanted - v, -_ACCELERATION * STEP_S, _ACCELERATION * STEP_S))
        turn = float(np.clip(-_TO_HEADING * base[2] - _TO_LINE * base[1] * np.sign(v), -_MOST, _MOST))
        turn *= min(1.0, abs(v) / _MOVES)
        wheels = model.drive.wheels(v, turn)
        robot.write(Setpoint(np.array([*wheels, *np.zeros(7)]), False, 0, 0, robot.time))
        odometer.follow(robot.read().position[:2])
        ticks += 1
        exposes = ticks % every == 0
        if exposes:
            pose, position = odometer.pose, actuated(robot.read().position)
            camera, stamp = robot.true_camera(), robot.time
            going = outbound
        picture = robot.capture(exposes)
        if picture is not None:
            T_world_camera = pin.SE3(camera[:3, :3].copy(), camera[:3, 3].copy())
            frame = CameraFrame(
                header=m.Header(stamp, "camera"),
                sequence=sequence,
                intrinsics=CameraConfig().intrinsics(),
                base=pose,
                position=position,
                color_jpeg=picture.color_jpeg,
                depth_zlib=picture.depth_zlib,
                depth_unit=picture.depth_unit,
                labels_zlib=picture.labels_zlib,
            )
            yield TrueFrame(frame, T_world_camera * T_base_camera.inverse(), going)
            sequence += 1
    robot.close()
