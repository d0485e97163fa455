"""Filter against measurements that arrive out of order."""

from dataclasses import replace
from typing import TypeVar

from controller.inputs import Sample
from controller.interface import StepInputs
from rolling_panda import messages as m

_Stamped = TypeVar("_Stamped", m.JointState, m.Odometry, m.BridgeState)

#: An older stamp is accepted after this time (s): the bridge has restarted.
_RESTART_S = 0.2


class StaleMessageFilter:
    """Keeps the newest measurement of each topic. An older one that arrives late is dropped."""

    def __init__(self) -> None:
        """Start without measurements."""
        self._joints: Sample[m.JointState] | None = None
        self._odometry: Sample[m.Odometry] | None = None
        self._bridge: Sample[m.BridgeState] | None = None

    def of(self, inputs: StepInputs) -> StepInputs:
        """The inputs with the newest joint state, odometry and bridge state."""
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
    # A repetition is never new, however late it arrives.
    return offered if ahead > 0.0 or (ahead < 0.0 and offered.at - kept.at > _RESTART_S) else kept
