"""Arrays as the wire has them: tuples of plain numbers."""

from rolling_panda.messages.robot import JointOffsets
from rolling_panda.messages.types import Actuated, ArmTorques, PlanarPose, Vector3
from rolling_panda.model.differential_drive import Array


def vector3(point: Array) -> Vector3:
    """A point or a direction (3)."""
    x, y, z = point.tolist()
    return x, y, z


def actuated(values: Array) -> Actuated:
    """Values over ξ (9)."""
    a, b, c, d, e, f, g, h, i = values.tolist()
    return a, b, c, d, e, f, g, h, i


def arm_torques(values: Array) -> ArmTorques:
    """Torques of the arm's joints (7)."""
    a, b, c, d, e, f, g = values.tolist()
    return a, b, c, d, e, f, g


def joint_offsets(values: Array) -> JointOffsets:
    """Offsets of the arm's joints (7)."""
    a, b, c, d, e, f, g = values.tolist()
    return a, b, c, d, e, f, g


def planar_pose(q: Array) -> PlanarPose:
    """The pose of the base, the first three of q."""
    x, y, phi = q[:3].tolist()
    return PlanarPose(x, y, phi)
