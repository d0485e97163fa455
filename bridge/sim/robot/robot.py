"""The simulated robot: MuJoCo's base and arm, the cutter and the camera behind the bridge's interface.

Physics assumptions beside those of `bridge.sim.robot.model`:
- Wheels and arm are velocity servos with a first-order lag. The arm's gravity and Coriolis torques are compensated
  inside, as the Panda does it, so it holds still without being commanded.
- Encoders are exact. What the odometry gets wrong, it gets wrong by slip and by wood in the way.
- What is severed vanishes at once; it does not fall.
"""

from collections import Counter
from dataclasses import dataclass
from typing import Any

import mujoco
import numpy as np

from bridge.config import BridgeConfig
from bridge.core.interface import Measurement, Setpoint
from bridge.core.picture import Picture
from bridge.sim.camera.render_process import Photographer
from bridge.sim.robot.cutter import Bite, Cutter, bite
from bridge.sim.robot.model import STEP_S, build_plant
from bridge.sim.robot.servo import VelocityServos
from bridge.sim.robot.trace import CUTTER, TraceWriter
from bridge.sim.vineyard.row import Row
from rolling_panda.messages.perception import Capsule
from rolling_panda.model.differential_drive import Array

_SHOWN = frozenset({"post", "trunk", "cordon", "spur", "cane", "node", "wire", "hose", "old cut"})
_WHEELS_ON_FLOOR = 3
_SETTLING_STEPS = 200
# Torque of the servos (N·m): URDF of the base, data sheet of the Panda.
_TORQUE = np.array([60.0, 60.0, 87.0, 87.0, 87.0, 87.0, 12.0, 12.0, 12.0])


@dataclass(frozen=True)
class TrueBase:
    """Where base_link really is: x, y (m), heading (rad, not wrapped); velocity along its x and y (m/s), yaw rate."""

    pose: Array
    velocity: Array


class SimulatedRobot:
    """Implements `bridge.core.interface.Robot`; `write` lets 1 ms pass."""

    def __init__(
        self,
        config: BridgeConfig,
        row: Row,
        photographer: Photographer,
        trace: TraceWriter | None = None,
    ) -> None:
        """Stand at odom's origin in the start posture, at rest.

        Args:
            config: Of the bridge.
            row: What stands beside the robot.
            photographer: Renders the camera's pictures; closed with the robot.
            trace: Records every step; closed with the robot.

        Raises:
            ModelError: The model does not compile.
        """
        self._config = config
        self.row = row
        self._photographer = photographer
        self._trace = trace
        self._plant = build_plant(row)
        self._data = mujoco.MjData(self._plant.model)
        self._data.qpos[self._plant.xi_q[2:]] = config.start_arm
        mujoco.mj_forward(self._plant.model, self._data)
        self._M = np.zeros((self._plant.model.nv, self._plant.model.nv))
        self._servos = self._make_servos()
        self._settle()
        self._cutter = Cutter(config)
        self._heading = 0.0
        self._scenery: tuple[int, tuple[Capsule, ...]] = (-1, ())
        self.contacts = self.self_contacts = 0
        #: The emergency stop button that the simulated robot would have is pressed.
        self.emergency = False

    @property
    def time(self) -> float:
        """Simulated time (s)."""
        return float(self._data.time)

    def read(self) -> Measurement:
        """Encoders and cutter."""
        data, plant, cutter = self._data, self._plant, self._cutter
        return Measurement(
            data.qpos[plant.xi_q],
            data.qvel[plant.xi_v],
            cutter.state,
            cutter.cut_id,
            cutter.outcome,
            cutter.detail,
            emergency=self.emergency,
        )

    def write(self, setpoint: Setpoint) -> None:
        """One physics step of 1 ms."""
        data = self._data
        self._advance(setpoint.xi)
        self.contacts, self.self_contacts = self._contacts() if data.ncon > _WHEELS_ON_FLOOR else (0, 0)
        if self._cutter.step(STEP_S, setpoint.blades):
            self._bite(setpoint)
        if self._trace is not None:
            self._record(self._trace, setpoint)

    def cut(self, cut_id: str, point_id: str) -> None:
        """Begin to close the blades."""
        self._cutter.begin(cut_id, point_id)

    def capture(self, expose: bool) -> Picture | None:
        """Expose from where the camera really is, or fetch what is ready."""
        if expose:
            self._photographer.expose(self.row, self._site(self._plant.camera))
        return self._photographer.ready()

    def close(self) -> None:
        """End the camera and the trace."""
        self._photographer.close()
        if self._trace is not None:
            self._trace.close()

    def true_base(self) -> TrueBase:
        """Ground truth of the base."""
        x, y = self._data.qpos[:2]
        w, i, j, k = self._data.qpos[3:7]
        heading = np.arctan2(2 * (w * k + i * j), 1 - 2 * (j * j + k * k))
        # Follow the turns: arctan2 jumps at half a turn.
        self._heading += float(np.remainder(heading - self._heading + np.pi, 2 * np.pi) - np.pi)
        c, s = np.cos(self._heading), np.sin(self._heading)
        vx, vy = self._data.qvel[:2]
        velocity = np.array([c * vx + s * vy, c * vy - s * vx, self._data.qvel[5]])
        return TrueBase(np.array([x, y, self._heading]), velocity)

    def true_tool(self) -> Array:
        """Ground truth T_world_tool (4×4)."""
        return self._site(self._plant.tool)

    def true_camera(self) -> Array:
        """Ground truth T_world_camera (4×4)."""
        return self._site(self._plant.camera)

    def scenery(self) -> tuple[int, tuple[Capsule, ...]]:
        """Revision of the row, and the row as rods for the display."""
        if self._scenery[0] != self.row.revision:
            self._scenery = (self.row.revision, _capsules(self.row))
        return self._scenery

    def _make_servos(self) -> VelocityServos:
        config = self._config
        lag = np.array([config.wheel_lag_s] * 2 + [config.arm_lag_s] * len(self._plant.arm_v))
        return VelocityServos(lag, _TORQUE, STEP_S)

    def _inertia(self) -> Array:
        """What the servos have to move: the arm as it stands, and half of the robot for each wheel."""
        model, plant = self._plant.model, self._plant
        mujoco.mj_fullM(model, self._data, self._M)
        inertia: Array = self._M[plant.xi_block]
        inertia[:2, :] = inertia[:, :2] = 0.0
        inertia[0, 0] = inertia[1, 1] = plant.wheel_load
        return inertia

    def _advance(self, xi: Array) -> None:
        data, plant = self._data, self._plant
        data.ctrl[:] = self._servos.step(xi, data.qvel[plant.xi_v], self._inertia())
        # The bias of the step before: 1 ms old, as the Panda's own compensation is.
        data.qfrc_applied[plant.arm_v] = data.qfrc_bias[plant.arm_v]
        mujoco.mj_step(plant.model, data)

    def _settle(self) -> None:
        """Let the wheels take their load, then call this place the origin."""
        data, plant = self._data, self._plant
        for _ in range(_SETTLING_STEPS):
            self._advance(np.zeros(len(plant.xi_v)))
        w, i, j, k = data.qpos[3:7]
        half = np.arctan2(2 * (w * k + i * j), 1 - 2 * (j * j + k * k)) / 2
        mujoco.mju_mulQuat(data.qpos[3:7], np.array([np.cos(half), 0.0, 0.0, -np.sin(half)]), np.array([w, i, j, k]))
        data.qpos[:2] = 0.0
        data.qvel[:], data.time = 0.0, 0.0
        data.qpos[plant.xi_q[:2]] = 0.0
        data.qpos[plant.xi_q[2:]] = self._config.start_arm
        mujoco.mj_forward(plant.model, data)

    def _site(self, site: int) -> Array:
        T = np.eye(4)
        T[:3, :3] = self._data.site_xmat[site].reshape(3, 3)
        T[:3, 3] = self._data.site_xpos[site]
        return T

    def _contacts(self) -> tuple[int, int]:
        """Contacts with the row, and of the robot with itself."""
        geom = self._data.contact.geom
        row = self._plant.solid[geom].any(axis=1)
        itself = ~row & ~self._plant.rolling[geom].any(axis=1)
        return int(np.count_nonzero(row)), int(np.count_nonzero(itself))

    def _bite(self, setpoint: Setpoint) -> None:
        tool = self.true_tool()
        result = bite(self.row, tool, self._config)
        self.row = result.row
        self._cutter.finish("DONE" if result.severed else "FAILED_NOT_CUT", _sentence(result), result.jammed)
        if self._trace is not None:
            self._trace.event(self._cut_event(result, tool, setpoint))

    def _cut_event(self, result: Bite, tool: Array, setpoint: Setpoint) -> dict[str, Any]:
        cutter = self._cutter
        return {
            "event": "cut",
            "time": self.time,
            "clock": setpoint.at,
            "cut_id": cutter.cut_id,
            "point_id": cutter.point_id,
            "outcome": cutter.outcome,
            "detail": cutter.detail,
            "blade": tool[:3, 3].tolist(),
            "blade_normal": tool[:3, 1].tolist(),
            "severed": [
                {
                    "rod": item.index,
                    "kind": item.rod.kind,
                    "vine": item.rod.vine,
                    "spur": item.rod.spur,
                    "cane": item.rod.cane,
                    "point": item.point.tolist(),
                }
                for item in result.severed
            ],
        }

    def _record(self, trace: TraceWriter, setpoint: Setpoint) -> None:
        base, row = self.true_base(), trace.row
        row["time"], row["clock"] = self._data.time, setpoint.at
        row["base"], row["base_velocity"] = base.pose, base.velocity
        row["position"] = self._data.qpos[self._plant.xi_q]
        row["velocity"] = self._data.qvel[self._plant.xi_v]
        row["setpoint"] = setpoint.xi
        row["tool"] = self._data.site_xpos[self._plant.tool]
        row["epoch"], row["sequence"] = setpoint.epoch, setpoint.sequence
        row["cutter"] = CUTTER.index(self._cutter.state)
        row["contacts"], row["self_contacts"] = self.contacts, self.self_contacts
        trace.commit()


def _sentence(result: Bite) -> str:
    if not result.severed:
        return result.detail
    counts = Counter(item.rod.kind for item in result.severed)
    return "severed " + " and ".join(f"{count} {kind}{'s' * (count > 1)}" for kind, count in counts.items())


def _capsules(row: Row) -> tuple[Capsule, ...]:
    return tuple(
        Capsule(
            rod.kind,
            (float(rod.start[0]), float(rod.start[1]), float(rod.start[2])),
            (float(rod.end[0]), float(rod.end[1]), float(rod.end[2])),
            float(rod.start_radius),
            float(rod.end_radius),
        )
        for _, rod in row.standing()
        if rod.kind in _SHOWN
    )
