"""The arm's process: libfranka's 1 kHz loop, with nothing else that could delay it.

A Python thread that is busy for some milliseconds loses packets. So bridge and arm are two processes with shared
memory. When the bridge ends for any reason, targets stop: the arm holds and the process ends.
"""

import gc
import os
import time
from typing import Any

import numpy as np
from panda_py import libfranka

from bridge.real.arm_follower import ArmFollower
from bridge.real.arm_link import ArmLink, ArmState
from bridge.real.config import ArmConfig
from rolling_panda import reasons
from rolling_panda.messages.types import Reason
from rolling_panda.model.robot import Limits
from rolling_panda.runtime.scheduling import set_priority

_RETRY_S = 1.0
# Time without a message of the bridge after which this process checks that the bridge exists (s).
_ORPHAN_S = 1.0
# libfranka's filter is off above this (Hz): the follower's targets are smooth already.
_NO_FILTER = 1000.0
_AT_REST = 1e-6
_MODE = libfranka.RobotMode


def run(config: ArmConfig, limits: Limits, link: ArmLink, moving: bool, parent: int) -> None:
    """Serve the arm until the bridge ends; the body of the process.

    Args:
        config: Address, payload, deadlines.
        limits: Of the robot, over ξ.
        link: To the bridge.
        moving: False only reads.
        parent: Process id of the bridge.
    """
    set_priority("control")
    gc.freeze()
    gc.disable()
    session = _Session(config, limits, link, moving, parent)
    while not session.ended():
        try:
            session.serve()
        except RuntimeError as error:
            # Base class of all errors of libfranka.
            session.say(reasons.device_fault("Panda", _words(error)))
            time.sleep(_RETRY_S)


class _Session:
    def __init__(self, config: ArmConfig, limits: Limits, link: ArmLink, moving: bool, parent: int) -> None:
        self._config, self._link, self._moving, self._parent = config, link, moving, parent
        self._follower = ArmFollower(limits, config.joint_margin, config.fade_s, config.deadline_s)
        self._position, self._velocity, self._external_torque = np.zeros(7), np.zeros(7), np.zeros(7)
        self._success_rate, self._commands = 0.0, 0
        self._seen = 0
        self._releases = link.target().releases
        self._fault: Reason | None = reasons.arm_connecting()
        self._severe = False

    def ended(self) -> bool:
        """Whether the bridge is closing or gone."""
        target = self._link.target()
        silent = time.monotonic() - target.at > _ORPHAN_S
        return target.closing or (silent and os.getppid() != self._parent)

    def say(self, fault: Reason | None, severe: bool = False) -> None:
        """Report to the bridge why the arm does not follow; None if it does."""
        self._fault, self._severe = fault, severe
        self._send_state()

    def serve(self) -> None:
        """One connection: prepare the arm, then follow, or wait for the end of a fault."""
        config = self._config
        enforce = (
            libfranka.RealtimeConfig.kEnforce if config.realtime == "enforce" else libfranka.RealtimeConfig.kIgnore
        )
        robot = libfranka.Robot(config.address, enforce)
        if self._moving:
            torque, force = [config.contact_torque] * 7, [config.contact_force] * 6
            robot.set_collision_behavior(torque, torque, torque, torque, force, force, force, force)
            inertia = np.diag(config.load_inertia).ravel().tolist()
            robot.set_load(config.load_mass, list(config.load_center), inertia)
        while not self.ended():
            state = robot.read_once()
            self._note(state)
            self._check(state)
            if self._severe and self._link.target().releases != self._releases:
                self._releases = self._link.target().releases
                self._recover(robot)
            elif self._fault is not None or not self._moving:
                robot.read(self._watch)
            else:
                self._follow(robot)

    def _check(self, state: Any) -> None:
        """Check whether the arm can be commanded. A fault that needs a release stays until the release."""
        if state.robot_mode == _MODE.kReflex:
            if not self._severe:
                self._fault = reasons.arm_reflex(str(state.last_motion_errors) + str(state.current_errors))
            self._severe = True
        elif state.robot_mode == _MODE.kUserStopped:
            self._fault, self._severe = reasons.arm_user_stopped(), True
        elif not self._severe:
            idle = state.robot_mode in (_MODE.kIdle, _MODE.kMove)
            self._fault = None if idle else reasons.arm_not_ready(str(state.robot_mode))

    def _recover(self, robot: Any) -> None:
        """A person has said that the arm may go on."""
        if robot.read_once().robot_mode == _MODE.kUserStopped:
            return
        try:
            robot.automatic_error_recovery()
        except RuntimeError as error:
            self.say(reasons.arm_not_recovered(_words(error)), severe=True)
        else:
            self.say(None)

    def _follow(self, robot: Any) -> None:
        # libfranka's own limits are off: its velocities end 0.01 to 0.06 rad/s below the data sheet's, and where lost
        # packets have carried a joint beyond them it brakes at once by all that the joint can, at four times its jerk.
        try:
            robot.control_joint_velocity(
                self._command, libfranka.ControllerMode.kJointImpedance, limit_rate=False, cutoff_frequency=_NO_FILTER
            )
        except RuntimeError as error:
            self.say(reasons.device_fault("Panda", _words(error)), severe=True)

    def _command(self, state: Any, duration: Any) -> Any:
        """Libfranka's callback, each millisecond."""
        now = time.monotonic()
        target = self._link.target()
        if target.number != self._seen:
            self._seen = target.number
            self._follower.aim(target.velocity, target.at)
        self._commands += 1
        self._note(state)
        self._releases = target.releases
        ending = target.closing or (now - target.at > _ORPHAN_S and os.getppid() != self._parent)
        dq = self._follower.step(now, self._position, np.array(state.dq_d), np.array(state.ddq_d), hold=ending)
        out = libfranka.JointVelocities(dq.tolist())
        out.motion_finished = ending and float(np.abs(dq).max()) < _AT_REST
        return out

    def _watch(self, state: Any) -> bool:
        """Libfranka's callback while nothing is commanded; True to go on watching."""
        self._note(state)
        severe, fault = self._severe, self._fault
        self._check(state)
        if (severe, fault) != (self._severe, self._fault):
            self._send_state()
        released = self._link.target().releases != self._releases
        return not (self.ended() or (released and self._severe) or (self._moving and self._fault is None))

    def _note(self, state: Any) -> None:
        self._position, self._velocity = np.array(state.q), np.array(state.dq)
        self._external_torque = np.array(state.tau_ext_hat_filtered)
        self._success_rate = float(state.control_command_success_rate)
        self._send_state()

    def _send_state(self) -> None:
        self._link.tell(
            ArmState(
                time.monotonic(),
                self._position,
                self._velocity,
                self._fault,
                self._severe,
                self._success_rate,
                self._commands,
                self._external_torque,
            )
        )


def _words(error: RuntimeError) -> str:
    return str(error).removeprefix("libfranka: ").splitlines()[0]
