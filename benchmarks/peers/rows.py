"""Others' controllers as methods of the robot's controller, for rows and vines."""

from collections.abc import Callable, Collection
from functools import partial
from typing import Final

from benchmarks.peers.predictive import Following
from benchmarks.peers.reactive import reactive
from controller.config import WholeBodyConfig
from controller.whole_body.registry import METHODS, with_speed_scaling
from controller.whole_body.task import Method
from rolling_panda.model.robot import RobotModel

_MAKERS: dict[str, Callable[[RobotModel, WholeBodyConfig, float], Method]] = {
    "pink": partial(reactive, "pink"),
    "mink": partial(reactive, "mink"),
    "holistic": partial(reactive, "holistic"),
    "mpc": Following,
}
#: Those that can work off a row.
PEERS: Final = tuple(_MAKERS)


def use_peers(methods: Collection[str]) -> None:
    """Let the controller use those of others' controllers that are among the methods.

    Like methods without inequalities of their own they are braked before obstacles.
    """
    METHODS.update({name: with_speed_scaling(make) for name, make in _MAKERS.items() if name in methods})
