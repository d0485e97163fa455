"""How near the actuators are to their limits, as the page shows it."""

import numpy as np

from rolling_panda.messages import JointState
from rolling_panda.robot_model import Limits


def speed_shares(joints: JointState, limits: Limits) -> tuple[float, ...]:
    """Speed of each actuator in parts of its own limit, wheels first (9)."""
    return tuple(np.round(np.abs(joints.velocity) / limits.velocity, 3).tolist())
