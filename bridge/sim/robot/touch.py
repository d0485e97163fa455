"""What touches the simulated arm: the parts that canes push against, and the external torques that the arm estimates.

The estimate is that of the Panda's control box (`tau_ext_hat_filtered` of libfranka): the torque of each joint less
what gravity and the arm's own motion explain, for an arm whose foot is level and at rest. On this robot the foot
accelerates and tilts with the base, which the estimate takes for touch.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import mujoco
import numpy as np

from bridge.sim.robot.model import ARM, STEP_S, WHEELS, Plant
from bridge.sim.vineyard.row import Array
from bridge.sim.world.canes import Push

#: Time constant of the estimate's filter (s). Estimate: the maker does not publish it.
_FILTER_S = 0.01
#: SD of the offset of each joint, drawn once, and of the noise after the filter (N·m). Estimates: an offset is what the
#: joint's torque sensor and the masses of tool and cables are wrong by.
_OFFSET = np.array([0.5, 0.5, 0.5, 0.5, 0.2, 0.2, 0.2])
_NOISE = np.array([0.1, 0.1, 0.1, 0.1, 0.05, 0.05, 0.05])
#: SD of the fraction of its own torque that a joint takes for touch, drawn once: scale of its sensor, masses.
_SHARE = 0.02
_DRAWN = 1000
#: Blades: beside the gap, from below the handle's end to their tips along the tool's z (m), and their radius.
_BLADE_Z, _BLADE_RADIUS = (-0.045, -0.03, -0.015, 0.0, 0.012), 0.006


class ExternalTorque:
    """The arm's estimate of external torques."""

    def __init__(self, plant: Plant, seed: int) -> None:
        """Begin with nothing felt; offsets and noise are drawn from `seed`, which is not negative."""
        self._plant = plant
        self._rng = np.random.default_rng([seed, 0xFEE1])
        self._offset = self._rng.normal(0.0, _OFFSET)
        self._share = self._rng.normal(0.0, _SHARE, len(ARM))
        self._blend = 1.0 - math.exp(-STEP_S / _FILTER_S)
        # White noise before a filter that lets this share of it through.
        self._sd = _NOISE * math.sqrt((2.0 - self._blend) / self._blend)
        self._gravity = plant.model.opt.gravity.copy()
        self._own_down = np.array([0.0, 0.0, -float(np.linalg.norm(self._gravity))])
        self.restart()

    def restart(self) -> None:
        """Nothing is felt but the offset."""
        self.value: Array = self._offset.copy()
        self._number = _DRAWN

    def step(self, data: Any, M: Array, pushed: Array) -> None:
        """Take in a physics step.

        Args:
            data: MjData after it.
            M: Mass matrix before it (nv×nv).
            pushed: Generalised forces of canes (nv).
        """
        arm, down = self._plant.arm_v, np.empty(3)
        mujoco.mju_rotVecQuat(down, self._own_down, data.qpos[3:7])
        # Acceleration of the foot as the estimate misses it, free fall included.
        missed = data.qacc[:6].copy()
        missed[:3] += down - self._gravity
        torque = data.qfrc_constraint[arm] + pushed[arm] - M[arm, :6] @ missed
        if self._number == _DRAWN:
            self._noise, self._number = self._rng.normal(0.0, self._sd, (_DRAWN, len(ARM))), 0
        own = data.ctrl[len(WHEELS) :] + data.qfrc_applied[arm] - pushed[arm]
        torque += self._offset + self._share * own + self._noise[self._number]
        self._number += 1
        self.value += self._blend * (torque - self.value)


@dataclass(frozen=True)
class Spheres:
    """Parts of arm and tool as spheres, for canes to push against.

    Attributes:
        model: MjModel.
        bodies: Body of each (n).
        places: Middle of each in its body (n×3, m).
        radii: (n, m).
    """

    model: Any
    bodies: Any
    places: Array
    radii: Array

    def centers(self, data: Any) -> Array:
        """Middles (n×3, m, world)."""
        R = data.xmat[self.bodies].reshape(-1, 3, 3)
        centers: Array = data.xpos[self.bodies] + np.einsum("nij,nj->ni", R, self.places)
        return centers

    def generalized(self, data: Any, pushes: Sequence[Push]) -> Array:
        """Generalised force (nv) of pushes."""
        force, no_torque = np.zeros(self.model.nv), np.zeros(3)
        for push in pushes:
            body = int(self.bodies[push.part])
            at = data.xpos[body] + data.xmat[body].reshape(3, 3) @ self.places[push.part]
            mujoco.mj_applyFT(self.model, data, push.force, no_torque, at, body, force)
        return force


def touching_spheres(plant: Plant, opening: float) -> Spheres:
    """Spheres along the axes of the collision shapes of the arm from its third link on, camera and blades.

    Args:
        plant: The model.
        opening: Gap between the open blades (m).
    """
    model = plant.model
    links = [int(mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_BODY, name)) for name in ARM[2:]]
    found: list[tuple[int, Array, float]] = []
    for geom in np.flatnonzero(np.isin(model.geom_bodyid, links)):
        size, R = model.geom_size[geom], np.zeros(9)
        mujoco.mju_quat2Mat(R, model.geom_quat[geom])
        if model.geom_type[geom] == mujoco.mjtGeom.mjGEOM_BOX:
            longest, radius = int(size.argmax()), float(size.min())
            half = float(size[longest]) - radius
        else:
            # The round ends of a capsule are beyond its half length, the flat ones of a cylinder are not.
            longest, radius = 2, float(size[0])
            round_ended = model.geom_type[geom] == mujoco.mjtGeom.mjGEOM_CAPSULE
            half = float(size[1]) if round_ended else max(0.0, float(size[1]) - radius)
        axis = R.reshape(3, 3)[:, longest]
        for along in np.linspace(-half, half, 1 + math.ceil(2.0 * half / radius)):
            found.append((int(model.geom_bodyid[geom]), model.geom_pos[geom] + along * axis, radius))
    tool, R = int(model.site_bodyid[plant.tool]), np.zeros(9)
    mujoco.mju_quat2Mat(R, model.site_quat[plant.tool])
    for side in (-1.0, 1.0):
        for z in _BLADE_Z:
            place = np.array([side * (opening / 2.0 + _BLADE_RADIUS), 0.0, z])
            found.append((tool, model.site_pos[plant.tool] + R.reshape(3, 3) @ place, _BLADE_RADIUS))
    return Spheres(
        model,
        np.array([body for body, _, _ in found]),
        np.array([place for _, place, _ in found]),
        np.array([radius for _, _, radius in found]),
    )
