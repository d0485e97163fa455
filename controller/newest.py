"""Of what the robot says, what it said last: a way that delays may bring it out of its order."""

from dataclasses import replace
from typing import TypeVar

from controller.interface import Inputs, Sample
from rolling_panda import messages as m

_Stamped = TypeVar("_Stamped", m.JointState, m.Odometry, m.BridgeState)

#: A clock behind what was said before is believed after so long (s): the bridge has started again.
_RESTART_S = 0.2


class Newest:
    """Keeps what was measured last. Something older would lead the robot by where it was, and look fresh."""

    def __init__(self) -> None:
        """Nothing has been said."""
        self._joints: Sample[m.JointState] | None = None
        self._odometry: Sample[m.Odometry] | None = None
        self._bridge: Sample[m.BridgeState] | None = None

    def of(self, inputs: Inputs) -> Inputs:
        """The inputs with joints, odometry and the bridge's state as they were measured last."""
        joints, odometry = _newer(self._joints, inputs.joints), _newer(self._odometry, inputs.odometry)
        bridge = _newer(self._bridge, inputs.bridge)
        self._joints, self._odometry, self._bridge = joints, odometry, bridge
        if joints is inputs.joints and odometry is inputs.odometry and bridge is inputs.bridge:
            return inputs
        return replace(inputs, joints=joints, odometry=odometry, bridge=bridge)


def _newer(kept: Sample[_Stamped] | None, offered: Sample[_Stamped] | None) -> Sample[_Stamped] | None:
    if kept is None or offered is None:
        return offered
    ahead = offered.message.header.stamp - kept.message.header.stamp
    # A repetition is never news, however late it comes.
    return offered if ahead > 0.0 or (ahead < 0.0 and offered.at - kept.at > _RESTART_S) else kept
