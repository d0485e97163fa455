"""A simulated robot that drives along a row and back, with a picture now and then: frames for localisation.

The physics, wheels, ground, wind and camera are the simulation's own. A driver who sees the row steers by it, as people
do; perception gets none of that.
"""

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import pinocchio as pin
from msgspec.structs import replace

from bridge.config import BridgeConfig
from bridge.core.attitude import BaseOrientation
from bridge.core.camera_trigger import CameraTrigger, Posture
from bridge.core.interface import Setpoint
from bridge.core.odometer import Odometer
from bridge.sim.camera.config import CameraConfig
from bridge.sim.camera.renderer import InlineRenderer
from bridge.sim.robot.model import STEP_S
from bridge.sim.robot.robot import SimulatedRobot
from bridge.sim.vineyard.config import VineyardConfig, load_vineyard
from bridge.sim.vineyard.grow import grow
from bridge.sim.world.config import WorldConfig
from bridge.sim.world.growth import overgrown
from rolling_panda import messages as m
from rolling_panda.config import load_section
from rolling_panda.messages.robot import CameraFrame
from rolling_panda.model.differential_drive import Array
from rolling_panda.model.robot import RobotModel, configuration
from rolling_panda.model.wire_values import actuated
from rolling_panda.resources import resource

#: How the driver steers: towards the line through the origin along the row (rad/s for m and for rad), and at most.
_TO_LINE, _TO_HEADING, _MOST = 0.4, 0.8, 0.3
#: Slower than this the driver steers less (m/s).
_MOVES = 0.05
#: Acceleration (m/s²), and how long the robot rests at either end (s).
_ACCELERATION, _RESTS_S = 0.2, 2.0
#: Time at rest before the first drive (s).
_STANDS_S = 1.0
#: The end of a way is so near (m). Gain by which the arm follows its motion (1/s).
_NEAR, _FOLLOWS = 0.01, 5.0


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


class RowRobot:
    """A simulated robot beside a row, whose camera takes pictures as it moves."""

    def __init__(
        self, seed: int, metres: float, world: WorldConfig, pictures_hz: float, inertial: bool = False
    ) -> None:
        """At rest at the origin, in the survey posture.

        Args:
            seed: Of row, camera and disturbances.
            metres: Length of the way along the row that has vines beside it.
            world: Disturbances.
            pictures_hz: Pictures a second.
            inertial: Whether the camera's inertial sensors correct the odometry.
        """
        path = resource("assets/config/sim.toml")
        config = replace(load_section(path, "bridge", BridgeConfig), inertial=inertial)
        spacing = load_vineyard(path).vine_spacing
        grown = grow(VineyardConfig(vines=math.ceil((metres + 2.0) / spacing) + 1, vine_spacing=spacing), seed)
        self.row = overgrown(grown, world, seed)
        renderer = InlineRenderer(load_section(path, "camera", CameraConfig), seed, world)
        self._robot, self.model = SimulatedRobot(config, self.row, renderer, None, world, seed), RobotModel()
        orientation = BaseOrientation(RobotModel()) if inertial else None
        self._odometer = Odometer(self.model.drive, config.odometry, STEP_S, seed, orientation)
        self._odometer.follow(self._robot.read(), 0.0)
        self._trigger = CameraTrigger(pictures_hz, pictures_hz, STEP_S)
        q = configuration(m.PlanarPose(0.0, 0.0, 0.0), actuated(np.concatenate([[0.0, 0.0], config.start_arm])))
        self._T_base_camera = self.model.pose(q, self.model.camera_id)
        self._every, self._ticks, self._v = round(1.0 / (pictures_hz * STEP_S)), 0, 0.0
        self._camera = self._robot.true_camera()
        self._outbound = True
        self._postures: list[Posture] = []

    def drive(self, to: float, speed: float, acceleration: float, rest_s: float) -> Iterator[TrueFrame]:
        """Drive along the row.

        Args:
            to: Where (m).
            speed: Of the base (m/s).
            acceleration: At both ends (m/s²).
            rest_s: Time at rest there (s).
        """
        sign = math.copysign(1.0, to - self._robot.true_base().pose[0])
        self._outbound, rested = sign > 0.0, 0.0
        while True:
            base = self._robot.true_base().pose
            left = sign * (to - base[0])
            wanted = sign * min(speed, math.sqrt(2 * acceleration * max(left, 0.0)))
            if left < _NEAR:
                wanted, rested = 0.0, rested + STEP_S
                if rested > rest_s:
                    return
            self._v += float(np.clip(wanted - self._v, -acceleration * STEP_S, acceleration * STEP_S))
            turn = float(np.clip(-_TO_HEADING * base[2] - _TO_LINE * base[1] * np.sign(self._v), -_MOST, _MOST))
            turn *= min(1.0, abs(self._v) / _MOVES)
            wheels = self.model.drive.wheels(self._v, turn)
            if (frame := self._step(np.array([*wheels, *np.zeros(7)]))) is not None:
                yield frame

    def reach(self, posture: Array, move_s: float, rest_s: float) -> Iterator[TrueFrame]:
        """Bring the arm to a posture (7, rad) in a time (s), and rest there; the base stands."""
        start = self._robot.read().position[2:].copy()
        for tick in range(round((move_s + rest_s) / STEP_S)):
            phase = min(math.pi * tick * STEP_S / move_s, math.pi)
            wanted = start + (posture - start) * 0.5 * (1.0 - math.cos(phase))
            speed = (posture - start) * 0.5 * math.pi / move_s * math.sin(phase)
            speed += _FOLLOWS * (wanted - self._robot.read().position[2:])
            if (frame := self._step(np.array([0.0, 0.0, *speed]))) is not None:
                yield frame

    def stand(self, seconds: float) -> Iterator[TrueFrame]:
        """Stand still."""
        for _ in range(round(seconds / STEP_S)):
            if (frame := self._step(np.zeros(9))) is not None:
                yield frame

    def later(self, frame: CameraFrame, offset: float) -> CameraFrame:
        """A frame with the posture of a time (s) after its own, as by `frame_time_offset`."""
        stamp = frame.header.stamp + offset
        posture = min(self._postures, key=lambda known: abs(known.header.stamp - stamp))
        return replace(
            frame,
            header=posture.header,
            base=posture.base,
            position=posture.position,
            velocity=posture.velocity,
            attitude=posture.attitude,
            delay=offset,
        )

    def close(self) -> None:
        """Free the simulation."""
        self._robot.close()

    def _step(self, xi: Array) -> TrueFrame | None:
        robot = self._robot
        robot.write(Setpoint(xi, False, 0, 0, robot.time))
        measured = robot.read()
        self._odometer.follow(measured, robot.time)
        posture = Posture(
            robot.time,
            m.Header(robot.time, "camera"),
            self._odometer.pose,
            actuated(measured.position),
            velocity=actuated(measured.velocity),
            attitude=self._odometer.attitude,
        )
        self._postures.append(posture)
        self._trigger.follow(posture)
        self._ticks += 1
        exposes = self._ticks % self._every == 0
        if exposes:
            self._trigger.exposed(self._ticks, posture)
            self._camera = robot.true_camera()
        picture = robot.capture(exposes)
        frame = None if picture is None else self._trigger.frame(picture)
        if frame is None:
            return None
        T_world_camera = pin.SE3(self._camera[:3, :3].copy(), self._camera[:3, 3].copy())
        return TrueFrame(frame, T_world_camera * self._T_base_camera.inverse(), self._outbound)


def row_drive(
    seed: int,
    metres: float,
    world: WorldConfig,
    speed: float = 0.15,
    pictures_hz: float = 2.0,
    inertial: bool = False,
) -> Iterator[TrueFrame]:
    """Drive out along the row and back.

    Args:
        seed: Of row, camera and disturbances.
        metres: How far.
        world: Disturbances.
        speed: Of the base (m/s).
        pictures_hz: Pictures a second.
        inertial: Whether the camera's inertial sensors correct the odometry. They begin at rest.
    """
    robot = RowRobot(seed, metres, world, pictures_hz, inertial)
    if inertial:
        yield from robot.stand(_STANDS_S)
    for to in (metres, 0.0):
        yield from robot.drive(to, speed, _ACCELERATION, _RESTS_S)
    robot.close()
