"""Whole-body methods by name."""

from collections.abc import Callable

from controller.config import ControllerConfig
from controller.whole_body.decoupled import Decoupled
from controller.whole_body.hierarchy import Hierarchy
from controller.whole_body.nullspace import Nullspace
from controller.whole_body.task import Method
from rolling_panda.errors import ConfigError
from rolling_panda.robot_model import RobotModel

METHODS: dict[str, Callable[[RobotModel, ControllerConfig, float], Method]] = {
    Hierarchy.name: Hierarchy,
    Nullspace.name: Nullspace,
    Decoupled.name: Decoupled,
}


def make_method(robot: RobotModel, config: ControllerConfig, dt: float) -> Method:
    """The configured method for a control period of `dt` (s).

    Raises:
        ConfigError: There is no method of that name; the text lists those there are.
    """
    try:
        make = METHODS[config.method]
    except KeyError:
        raise ConfigError(f"no whole-body method {config.method!r}; known are {', '.join(METHODS)}") from None
    return make(robot, config, dt)
