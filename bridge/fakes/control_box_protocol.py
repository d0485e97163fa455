"""Messages between libfranka 0.9 and the control box as `struct` formats: protocol version 5.

Source: the public headers `research_interface/robot/{service_types,rbk_types,error}.h` of libfranka-common.
"""

import struct
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

PORT, VERSION = 1337, 5
# command, command id, size of the whole message
HEADER = struct.Struct("<III")
CONNECT, MOVE, STOP_MOVE, RECOVER = 0, 1, 2, 12
SET_LOAD = 10
#: Replies that are a bare status, 0 for success.
SETTERS = frozenset({4, 5, 6, 7, 8, 9, SET_LOAD, 11})
SUCCESS, MOTION_STARTED, PREEMPTED, REJECTED, REFLEX_ABORTED, EMERGENCY_ABORTED = 0, 1, 2, 3, 6, 7
JOINT_VELOCITY = 1

IDLE, MOVING, REFLEX, USER_STOPPED, RECOVERING = 1, 2, 4, 5, 6
GENERATOR_IDLE, GENERATOR_JOINT_VELOCITY = 0, 2
JOINT_IMPEDANCE, OTHER_CONTROLLER = 0, 3

# Indices in the arrays of errors.
POSITION_LIMIT, JOINT_REFLEX, VELOCITY_LIMIT, VELOCITY_STEP, ACCELERATION_STEP, COMMUNICATION = 0, 6, 13, 14, 15, 25
ERRORS = 41

# Fields of the state before, between and after torques, joint angles and external torques, as numbers of doubles.
_BEFORE_TAU = 6 * 16 + 1 + 9 + 3 + 1 + 9 + 3 + 2 + 2
_BEFORE_EXTERNAL = 7 + 6 + 7 + 6
_AFTER_EXTERNAL = 6 + 6 + 6 + 3 + 2 + 2 + 2 + 16 + 6 + 6
_STATE = struct.Struct(f"<Q{_BEFORE_TAU}d21d35d{_BEFORE_EXTERNAL}d7d{_AFTER_EXTERNAL}d14dBB{ERRORS}s{ERRORS}sBd")
# message id; q, dq, pose, twist, elbow; elbow valid; finished; torques
COMMAND = struct.Struct("<Q7d7d16d6d2d??7d")
# Indices in it.
VELOCITY, FINISHED = slice(8, 15), 40
_IDENTITY = np.eye(4).T.ravel().tolist()
Joints = NDArray[np.float64]


@dataclass
class State:
    """Variable part of the 1 kHz state message; `dq_d` and `ddq_d` are commanded, the rest is measured."""

    number: int = 0
    q: Joints = field(default_factory=lambda: np.zeros(7))
    dq: Joints = field(default_factory=lambda: np.zeros(7))
    dq_d: Joints = field(default_factory=lambda: np.zeros(7))
    ddq_d: Joints = field(default_factory=lambda: np.zeros(7))
    external_torque: Joints = field(default_factory=lambda: np.zeros(7))
    mode: int = IDLE
    errors: frozenset[int] = frozenset()
    reflex: frozenset[int] = frozenset()
    success_rate: float = 0.0

    def pack(self) -> bytes:
        """The 1 kHz state message."""
        moving = self.mode == MOVING
        poses = _IDENTITY * 6
        q, dq = self.q.tolist(), self.dq.tolist()
        dq_d, ddq_d = self.dq_d.tolist(), self.ddq_d.tolist()
        return _STATE.pack(
            self.number,
            *poses,
            *[0.0] * (_BEFORE_TAU - 96),
            *[0.0] * 21,
            *q,
            *q,
            *dq,
            *dq_d,
            *ddq_d,
            *[0.0] * _BEFORE_EXTERNAL,
            *self.external_torque.tolist(),
            *[0.0] * _AFTER_EXTERNAL,
            *q,
            *dq,
            GENERATOR_JOINT_VELOCITY if moving else GENERATOR_IDLE,
            JOINT_IMPEDANCE if moving else OTHER_CONTROLLER,
            bytes(i in self.errors for i in range(ERRORS)),
            bytes(i in self.reflex for i in range(ERRORS)),
            self.mode,
            self.success_rate,
        )


def reply(command: int, number: int, status: int, more: bytes = b"") -> bytes:
    """A response on the TCP connection."""
    return HEADER.pack(command, number, HEADER.size + 1 + len(more)) + bytes([status]) + more
