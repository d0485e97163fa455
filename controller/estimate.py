"""The configuration now, from joint states and odometry that come at different rates."""

import numpy as np

from rolling_panda import messages as m
from rolling_panda.differential_drive import Array, DifferentialDrive

#: Odometry is carried forward by no more than this (s); older odometry is a fault, not something to guess from.
_LONGEST = 0.1


def configuration_now(joints: m.JointState, odometry: m.Odometry, drive: DifferentialDrive) -> Array:
    """Q (12): the base carried forward from its odometry to the time of the joint state.

    The two stamps are of one clock, the sender's, so that their difference holds whatever the wire's delay is.

    Args:
        joints: Newest joint state.
        odometry: Newest odometry.
        drive: Geometry of the base.
    """
    q = np.empty(12)
    pose = odometry.pose
    ahead = min(max(joints.header.stamp - odometry.header.stamp, 0.0), _LONGEST)
    if ahead > 0.0 and (odometry.linear or odometry.angular):
        left, right = drive.wheels(odometry.linear * ahead, odometry.angular * ahead)
        q[:3] = drive.integrate(np.array([pose.x, pose.y, pose.phi]), left, right)
    else:
        q[:3] = pose.x, pose.y, pose.phi
    q[3:] = joints.position
    return q
