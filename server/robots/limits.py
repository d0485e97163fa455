"""How near the actuators are to their limits, as the page shows it."""

import numpy as np

from rolling_panda.messages.robot import JointState
from rolling_panda.model.robot import Limits


def speed_shares(joints: JointState, limits: Limits) -> tuple[float, ...]:
    """Speed of each actuator in parts of its own limit, wheels first (9)."""
    return tuple(np.round(np.abs(joints.velocity) / limits.velocity, 3).tolist())
