"""The simulated robot behind the bridge's interface: MuJoCo model, velocity servos, cutter and camera.

Physics assumptions in addition to those of `bridge.sim.robot.model`:
- Wheels and arm are velocity servos with a first-order lag. They are outside MuJoCo's actuators: implicit integration
  of stiff ones changes the wheel speeds after the friction solve, and the base slides by centimetres. Gravity and
  Coriolis torques of the arm are compensated, as on the Panda.
- Encoders are exact, unless the world has offsets and slip. Odometry errors come from slip and from contact with wood.
- Severed wood lies on the ground at once, unless it hangs in the wires. There only the camera meets it.
- Wind moves canes before the camera and the blades.
- Canes push back where the world has elastic ones. `bridge.sim.robot.touch` has the arm's estimate of torques by touch.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import mujoco
import numpy as np

from bridge.config import BridgeConfig
from bridge.core.attitude import Inertial
from bridge.core.interface import Measurement, Setpoint
from bridge.core.picture import Picture
from bridge.sim.camera.render_process import CameraRenderer
from bridge.sim.robot.cutter import CutResult, Cutter, close_blades, wood_in_plane
from bridge.sim.robot.inertial import InertialSensors
from bridge.sim.robot.model import STEP_S, build_plant
from bridge.sim.robot.touch import ExternalTorque, touching_spheres
from bridge.sim.robot.trace import CUTTER, TraceWriter
from bridge.sim.vineyard.row import Row
from bridge.sim.world.canes import Canes, Push
from bridge.sim.world.config import CALM, WorldConfig
from bridge.sim.world.display import RowMotion, capsules
from bridge.sim.world.errors import draw_errors
from bridge.sim.world.ground import Ground
from bridge.sim.world.slip import Slip
from bridge.sim.world.wind import Wind
from bridge.sim.world.wood import Wood
from rolling_panda import reasons
from rolling_panda.messages.perception import Capsule, MovedCapsule
from rolling_panda.model.differential_drive import Array
from rolling_panda.reasons import text_of

_WHEELS_ON_FLOOR = 3
_SETTLING_STEPS = 200
#: On uneven ground the robot settles at most so often, until no wheel is pressed deeper into the ground (m).
_SETTLINGS, _PRESSED = 10, 0.001
#: The ground under the wheels is laid anew when one has moved this far (m): the tangent plane is then off by 1 um.
_LEVEL_EVERY = 0.001
#: Only wood that begins this near to the blades can be between them (m).
_NEAR_BLADES = 0.3
# Torque of the servos (N·m): URDF of the base, data sheet of the Panda.
_TORQUE = np.array([60.0, 60.0, 87.0, 87.0, 87.0, 87.0, 12.0, 12.0, 12.0])


#: Time constant of the loop that makes a joint follow the lagged setpoint (s): well above a step of 1 ms.
LOOP_S = 0.010
#: Time in which wheels and arm take up a lasting load (s).
_WHEEL_HOLD_S, _ARM_HOLD_S = 0.05, 0.2


class VelocityServos:
    """First-order lag on the setpoint, then a velocity loop with bounded torque."""

    def __init__(self, lag_s: Array, torque: Array, dt: float, hold_s: Array | None = None) -> None:
        """At rest.

        Args:
            lag_s: Time constant from setpoint to speed (n, s), of which `LOOP_S` is the loop itself.
            torque: Bound (n, N·m), on top of what compensates gravity.
            dt: Step (s).
            hold_s: Time in which a joint takes up a lasting load, such as a slope, without a difference in speed
                (n, s); infinite for one that gives way to it. None: all of them give way.
        """
        self._hold = np.zeros_like(lag_s) if hold_s is None else dt / hold_s
        self._held = np.zeros_like(lag_s)
        self._blend = np.array([1.0 - math.exp(-dt / max(lag - LOOP_S, dt / 10)) for lag in lag_s])
        self._torque = torque
        self._speed = np.zeros_like(lag_s)

    def step(self, setpoint: Array, measured: Array, inertia: Array) -> Array:
        """Torques (n, N·m) towards a setpoint.

        Args:
            setpoint: Desired speeds (n, rad/s).
            measured: Measured speeds (n, rad/s).
            inertia: Current mass matrix (n×n, kg·m²), which decouples the joints.
        """
        self._speed += self._blend * (setpoint - self._speed)
        wanted = inertia @ (self._speed - measured) / LOOP_S + self._held
        self._held = np.clip(self._held + self._hold * (wanted - self._held), -self._torque, self._torque)
        bounded: Array = np.minimum(np.maximum(wanted, -self._torque), self._torque)
        return bounded


@dataclass(frozen=True)
class TrueBase:
    """True pose of base_link: x, y (m), heading (rad, not wrapped); velocity along its x and y (m/s), yaw rate."""

    pose: Array
    velocity: Array


class SimulatedRobot:
    """Implements `bridge.core.interface.Robot`; `write` advances by 1 ms."""

    def __init__(
        self,
        config: BridgeConfig,
        row: Row,
        renderer: CameraRenderer,
        trace: TraceWriter | None = None,
        world: WorldConfig = CALM,
        seed: int = 0,
    ) -> None:
        """Start at the origin of odom, at rest in the start posture.

        Args:
            config: Of the bridge.
            row: The row beside the robot.
            renderer: Renderer of the camera; closed with the robot.
            trace: Records every step; closed with the robot.
            world: Disturbances.
            seed: Of the disturbances; not negative.

        Raises:
            ModelError: The model does not compile.
        """
        self._config = config
        self.row = row
        self._renderer = renderer
        self._trace = trace
        errors, uneven = draw_errors(world, seed), world.bumps > 0.0 or world.slope_across > 0.0
        self._offset = errors.joint_offset
        self._start_arm = np.array(config.start_arm) - self._offset
        self._plant = build_plant(row, errors, uneven, config.inertial)
        self._inertial = InertialSensors(world.inertial_errors, errors.hand_eye, seed) if config.inertial else None
        self._placed = mujoco.MjData(self._plant.model)
        self._levelled: Array | None = None
        self._planes, self._wheels = np.array(self._plant.ground, int).reshape(-1, 2).T
        self._ground = Ground(world, float(errors.slope[1]), seed)
        radius = float(self._plant.model.geom("wheel_left_tyre").size[0])
        self._slip = Slip(world.slip, radius, seed) if world.slip > 0.0 else None
        self._wind = Wind(row, world.sway, seed) if world.sway > 0.0 else None
        self._wood = Wood(world, seed)
        self._delay = (world.frame_delay, world.frame_jitter)
        self._delays = np.random.default_rng([seed, 0xDE1A])
        self._exposure: float | None = None
        self._data = mujoco.MjData(self._plant.model)
        self._data.qpos[self._plant.xi_q[2:]] = self._start_arm
        mujoco.mj_forward(self._plant.model, self._data)
        if uneven:
            # No wheel begins below the ground, into which it would be pressed.
            self._data.qpos[2] = self._ground.at(self._data.xpos[self._wheels, :2])[0].max()
        self._M = np.zeros((self._plant.model.nv, self._plant.model.nv))
        self._spheres = touching_spheres(self._plant, config.opening)
        self._canes = Canes(1e9 * world.cane_modulus, self._spheres.radii, STEP_S) if world.cane_modulus > 0.0 else None
        moves = self._wind is not None or self._canes is not None
        self._motion = RowMotion(row, self._wind, self._canes) if moves else None
        self._pushes: Sequence[Push] = ()
        self._felt = ExternalTorque(self._plant, seed)
        self._servos = self._make_servos()
        self._settle()
        self._cutter = Cutter(config)
        self._heading = 0.0
        self._scenery: tuple[int, tuple[Capsule, ...]] = (-1, ())
        self.contacts = self.self_contacts = 0
        #: State of the emergency stop button.
        self.emergency = False

    @property
    def time(self) -> float:
        """Simulated time (s)."""
        return float(self._data.time)

    def read(self) -> Measurement:
        """Encoders and cutter."""
        data, plant, cutter = self._data, self._plant, self._cutter
        position, velocity = data.qpos[plant.xi_q], data.qvel[plant.xi_v]
        position[2:] += self._offset
        if self._slip is not None:
            position[:2], velocity[:2] = self._slip.encoders, velocity[:2] * self._slip.factor
        return Measurement(
            position,
            velocity,
            cutter.state,
            cutter.cut_id,
            cutter.outcome,
            cutter.detail,
            emergency=self.emergency,
            external_torque=self._felt.value.copy(),
            inertial=self._inertial_sample(),
        )

    def write(self, setpoint: Setpoint) -> None:
        """One physics step of 1 ms."""
        data = self._data
        self._advance(setpoint.xi)
        if self._exposure is not None and data.time >= self._exposure:
            self._expose()
        self.contacts, self.self_contacts = self._contacts() if data.ncon > _WHEELS_ON_FLOOR else (0, 0)
        if self._cutter.step(STEP_S, setpoint.blades):
            self._close_blades(setpoint)
        if self._trace is not None:
            self._record(self._trace, setpoint)

    def cut(self, cut_id: str, point_id: str) -> None:
        """Start to close the blades."""
        self._cutter.start(cut_id, point_id)

    def capture(self, expose: bool) -> Picture | None:
        """Expose at the true camera pose, and fetch a finished picture."""
        if expose:
            delay, jitter = self._delay
            late = max(0.0, float(self._delays.normal(delay, jitter))) if delay > 0.0 or jitter > 0.0 else 0.0
            self._exposure = self.time + late
            if late == 0.0:
                self._expose()
        return self._renderer.ready()

    def _expose(self) -> None:
        self._exposure = None
        turning = np.zeros(6)
        mujoco.mj_objectVelocity(
            self._plant.model, self._data, mujoco.mjtObj.mjOBJ_SITE, self._plant.camera, turning, 0
        )
        # MuJoCo has the angular velocity first.
        self._renderer.expose(self.row, self._site(self._plant.camera), self.time, np.roll(turning, 3))

    def close(self) -> None:
        """Close renderer and trace."""
        self._renderer.close()
        if self._trace is not None:
            self._trace.close()

    def true_base(self) -> TrueBase:
        """Ground truth of the base."""
        x, y = self._data.qpos[:2]
        w, i, j, k = self._data.qpos[3:7]
        heading = np.arctan2(2 * (w * k + i * j), 1 - 2 * (j * j + k * k))
        # Unwrapped.
        self._heading += float(np.remainder(heading - self._heading + np.pi, 2 * np.pi) - np.pi)
        c, s = np.cos(self._heading), np.sin(self._heading)
        vx, vy = self._data.qvel[:2]
        velocity = np.array([c * vx + s * vy, c * vy - s * vx, self._data.qvel[5]])
        return TrueBase(np.array([x, y, self._heading]), velocity)

    def true_base_rotation(self) -> Array:
        """Ground truth of the base's orientation R_world_base (3×3), which pitches and rolls on uneven ground."""
        R = np.zeros(9)
        mujoco.mju_quat2Mat(R, self._data.qpos[3:7])
        return R.reshape(3, 3)

    def true_tool(self) -> Array:
        """Ground truth T_world_tool (4×4)."""
        return self._site(self._plant.tool)

    def true_touch(self) -> tuple[float, str]:
        """Ground truth: sum of the forces between robot and row (N), and body of the robot with the largest one.

        The body is that of a joint, `base_link`, or empty without any contact.
        """
        force, each = np.zeros(6), dict[int, float]()
        for number, geoms in enumerate(self._data.contact.geom):
            on = self._plant.solid[geoms]
            if on.any():
                mujoco.mj_contactForce(self._plant.model, self._data, number, force)
                body = int(self._plant.model.geom_bodyid[geoms[int(on[0])]])
                each[body] = each.get(body, 0.0) + float(np.linalg.norm(force[:3]))
        for push in self._pushes:
            body = int(self._spheres.bodies[push.part])
            each[body] = each.get(body, 0.0) + float(np.linalg.norm(push.force))
        if not each:
            return 0.0, ""
        hardest = max(each, key=lambda body: each[body])
        return sum(each.values()), self._plant.model.body(hardest).name

    def true_camera(self) -> Array:
        """Ground truth T_world_camera (4×4)."""
        return self._site(self._plant.camera)

    def scenery(self) -> tuple[int, tuple[Capsule, ...]]:
        """Revision of the row, and the row as capsules for display."""
        if self._scenery[0] != self.row.revision:
            self._scenery = (self.row.revision, capsules(self.row))
        return self._scenery

    def scenery_motion(self) -> tuple[int, tuple[MovedCapsule, ...]] | None:
        """Revision of the row, and its capsules near the tool that wind and arm have displaced, for display.

        None when none has moved since the last call. In a calm world none ever has.
        """
        if self._motion is None:
            return None
        moved = self._motion.changed(self.row, self._data.site_xpos[self._plant.tool], self.time)
        return None if moved is None else (self.row.revision, moved)

    def _make_servos(self) -> VelocityServos:
        config = self._config
        lag = np.array([config.wheel_lag_s] * 2 + [config.arm_lag_s] * len(self._plant.arm_v))
        # In the calm world nothing loads them: a slope the wheels, or a cane that pushes back the arm.
        slopes = bool(self._plant.ground) or self._plant.model.opt.gravity[0] != 0.0
        wheels, arm = _WHEEL_HOLD_S if slopes else math.inf, _ARM_HOLD_S if self._canes is not None else math.inf
        return VelocityServos(lag, _TORQUE, STEP_S, np.array([wheels] * 2 + [arm] * len(self._plant.arm_v)))

    def _inertia(self) -> Array:
        """Inertia felt by the servos: that of the arm, and half of the robot for each wheel."""
        model, plant = self._plant.model, self._plant
        mujoco.mj_fullM(model, self._data, self._M)
        inertia: Array = self._M[plant.xi_block]
        inertia[:2, :] = inertia[:, :2] = 0.0
        inertia[0, 0] = inertia[1, 1] = plant.wheel_load
        return inertia

    def _advance(self, xi: Array) -> None:
        data, plant, slip = self._data, self._plant, self._slip
        if plant.ground:
            self._level_ground()
        if slip is not None:
            # A wheel that slips turns faster than it rolls.
            xi = np.concatenate([xi[:2] / slip.factor, xi[2:]])
        data.ctrl[:] = self._servos.step(xi, data.qvel[plant.xi_v], self._inertia())
        if self._canes is not None:
            self._pushes = self._canes.push(self.row, self._spheres.centers(data))
        pushed = self._spheres.generalized(data, self._pushes)
        data.qfrc_applied[:] = pushed
        # The bias is 1 ms old, as in the Panda's own compensation.
        data.qfrc_applied[plant.arm_v] += data.qfrc_bias[plant.arm_v]
        mujoco.mj_step(plant.model, data)
        self._felt.step(data, self._M, pushed)
        if self._inertial is not None:
            self._inertial.follow(data)
        if slip is not None:
            slip.roll(data.qvel[plant.xi_v[:2]] * STEP_S)

    def _level_ground(self) -> None:
        """Lay the plane under each wheel on the ground there."""
        model, planes = self._plant.model, self._planes
        places = self._data.xpos[self._wheels, :2]
        if self._levelled is not None and np.abs(places - self._levelled).max() < _LEVEL_EVERY:
            return
        self._levelled = places
        height, normal = self._ground.at(places)
        model.geom_pos[planes] = np.column_stack([places, height])
        # The shortest turn from upright to the normal, as a quaternion wxyz.
        turn = np.column_stack([1.0 + normal[:, 2], -normal[:, 1], normal[:, 0], np.zeros(len(planes))])
        model.geom_quat[planes] = turn / np.linalg.norm(turn, axis=1, keepdims=True)

    def _settle(self) -> None:
        """Let the wheels settle under load, then move to the origin."""
        data, plant = self._data, self._plant
        for _ in range(_SETTLINGS):
            for _ in range(_SETTLING_STEPS * (5 if plant.ground else 1)):
                self._advance(np.zeros(len(plant.xi_v)))
            self._move_to_origin()
            # The robot has rolled meanwhile, and the ground is another one at the origin.
            depth = self._depth_in_ground() if plant.ground else 0.0
            if depth < _PRESSED:
                break
            data.qpos[2] += depth
        self._felt.restart()
        if self._slip is not None:
            self._slip.encoders = np.zeros(2)

    def _depth_in_ground(self) -> float:
        """How far the deepest wheel is below the ground (m)."""
        self._level_ground()
        mujoco.mj_forward(self._plant.model, self._data)
        under = np.isin(self._data.contact.geom, self._planes).any(axis=1)
        return -float(self._data.contact.dist[under].min(initial=0.0))

    def _move_to_origin(self) -> None:
        """To the origin of odom at heading 0, at rest, in the start posture; height, pitch and roll stay."""
        data, plant = self._data, self._plant
        w, i, j, k = data.qpos[3:7]
        half = np.arctan2(2 * (w * k + i * j), 1 - 2 * (j * j + k * k)) / 2
        mujoco.mju_mulQuat(data.qpos[3:7], np.array([np.cos(half), 0.0, 0.0, -np.sin(half)]), np.array([w, i, j, k]))
        data.qpos[:2] = 0.0
        data.qvel[:], data.time = 0.0, 0.0
        data.qpos[plant.xi_q[:2]] = 0.0
        data.qpos[plant.xi_q[2:]] = self._start_arm
        mujoco.mj_forward(plant.model, data)

    def _site(self, site: int) -> Array:
        T = np.eye(4)
        T[:3, :3] = self._data.site_xmat[site].reshape(3, 3)
        T[:3, 3] = self._data.site_xpos[site]
        return T

    def _inertial_sample(self) -> Inertial | None:
        """The newest sample of the camera's sensors; None without them."""
        sensors = self._inertial
        if sensors is None:
            return None
        if sensors.due(self.time):
            sensors.sample(self.time, self._camera_rotation())
        return sensors.newest

    def _camera_rotation(self) -> Array:
        """R_world_camera (3×3) at the joint positions of now, as the encoders have them: sites are one step behind."""
        self._placed.qpos[:] = self._data.qpos
        mujoco.mj_kinematics(self._plant.model, self._placed)
        return np.array(self._placed.site_xmat[self._plant.camera]).reshape(3, 3)

    def _contacts(self) -> tuple[int, int]:
        """Numbers of contacts with the row and of self-contacts."""
        geom = self._data.contact.geom
        row = self._plant.solid[geom].any(axis=1)
        itself = ~row & ~self._plant.rolling[geom].any(axis=1)
        return int(np.count_nonzero(row)), int(np.count_nonzero(itself))

    def _close_blades(self, setpoint: Setpoint) -> None:
        tool = self.true_tool()
        nearest = wood_in_plane(self._blown(tool), tool)[:1].tolist()
        result = self._bite(tool)
        if result.severed:
            self.row = result.applied(self.row, self._wood.hangs(), self._wood.lies())
            self._plant.remove_severed(self.row)
        # Blades that met say so, also when the wood hangs by its bark.
        done = bool(result.severed) or result.detail == reasons.blades_met()
        self._cutter.finish("DONE" if done else "FAILED_NOT_CUT", result.detail, result.jammed)
        if self._trace is not None:
            self._trace.event({**self._cut_event(result, tool, setpoint), "nearest": nearest[0] if nearest else None})

    def _blown(self, tool: Array) -> Row:
        """The row with the wood near the blades where the wind has it now."""
        if self._wind is None:
            return self.row
        near = {index for index, rod in self.row.standing() if np.linalg.norm(rod.start - tool[:3, 3]) < _NEAR_BLADES}
        return self._wind.blown(self.row, self.time, near)

    def _bite(self, tool: Array) -> CutResult:
        row, standing = self.row, self._blown(tool)
        result = close_blades(standing, tool, self._config)
        thickest = max((2.0 * item.rod.at(item.along)[1] for item in result.severed), default=0.0)
        if result.severed and self._wood.fails(thickest):
            jams = self._wood.jams()
            return CutResult((), jams, reasons.blades_jammed() if jams else reasons.blades_met())
        return result.at_rest(row)

    def _cut_event(self, result: CutResult, tool: Array, setpoint: Setpoint) -> dict[str, Any]:
        cutter = self._cutter
        return {
            "event": "cut",
            "time": self.time,
            "clock": setpoint.at,
            "cut_id": cutter.cut_id,
            "point_id": cutter.point_id,
            "outcome": cutter.outcome,
            "detail": text_of(cutter.detail),
            "code": cutter.detail.code,
            "blade": tool[:3, 3].tolist(),
            "blade_normal": tool[:3, 1].tolist(),
            "severed": [
                {
                    "rod": item.index,
                    "kind": item.rod.kind,
                    "vine": item.rod.vine,
                    "spur": item.rod.spur,
                    "cane": item.rod.cane,
                    "along": item.along,
                    "point": item.point.tolist(),
                }
                for item in result.severed
                if not item.rod.hanging and item.rod.organ < 0
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
        row["touch"] = self.true_touch()[0] if self.contacts or self._pushes else 0.0
        trace.commit()
