"""Whole-body methods by name."""

from collections.abc import Callable, Sequence

from controller.config import WholeBodyConfig
from controller.whole_body.collision import CollisionModel
from controller.whole_body.decoupled import Decoupled
from controller.whole_body.guards.collision import CollisionGuard
from controller.whole_body.guards.tipping import TippingGuard
from controller.whole_body.hierarchy import Hierarchy
from controller.whole_body.nullspace import Nullspace
from controller.whole_body.saturation import Saturation
from controller.whole_body.speed_scaling import SpeedScaling
from controller.whole_body.task import Guard, Method
from controller.whole_body.tipping import Tipping
from rolling_panda.errors import ConfigError
from rolling_panda.model.robot import RobotModel

Maker = Callable[[RobotModel, WholeBodyConfig, float, CollisionModel | None], Method]


def make_method(
    robot: RobotModel, config: WholeBodyConfig, dt: float, collision: CollisionModel | None = None
) -> Method:
    """The configured method.

    Args:
        robot: Robot model.
        config: Section `[controller.whole_body]`.
        dt: Control period (s).
        collision: Collision model with the obstacles, on the same `robot`. With None `hierarchy` avoids itself and
            the ground, and the other methods avoid nothing.

    Raises:
        ConfigError: There is no method of that name; the text lists the known ones.
    """
    try:
        make = METHODS[config.method]
    except KeyError:
        raise ConfigError(f"no whole-body method {config.method!r}; known are {', '.join(METHODS)}") from None
    return make(robot, config, dt, collision)


def guards(robot: RobotModel, config: WholeBodyConfig, dt: float, collision: CollisionModel | None) -> Sequence[Guard]:
    """The inequalities that the configuration asks for."""
    settings, out = config.hierarchy, list[Guard]()
    if settings.collisions:
        out.append(CollisionGuard(collision or CollisionModel(robot), settings, dt))
    if settings.tipping:
        out.append(TippingGuard(Tipping(robot), dt))
    return out


def _hierarchy(robot: RobotModel, config: WholeBodyConfig, dt: float, collision: CollisionModel | None) -> Method:
    return Hierarchy(robot, config, dt, guards(robot, config, dt, collision))


def _with_speed_scaling(make: Callable[[RobotModel, WholeBodyConfig, float], Method]) -> Maker:
    """Methods that know no inequalities beyond the limits are braked where obstacles are known."""

    def maker(robot: RobotModel, config: WholeBodyConfig, dt: float, collision: CollisionModel | None) -> Method:
        method = make(robot, config, dt)
        if collision is None or not config.hierarchy.collisions:
            return method
        return SpeedScaling(method, CollisionGuard(collision, config.hierarchy, dt), Saturation(robot, config, dt))

    return maker


METHODS: dict[str, Maker] = {
    Hierarchy.name: _hierarchy,
    Nullspace.name: _with_speed_scaling(Nullspace),
    Decoupled.name: _with_speed_scaling(Decoupled),
}
