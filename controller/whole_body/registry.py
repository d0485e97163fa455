"""Whole-body methods by name, and the speed scale for methods without inequality constraints.

There the velocity is scaled as a whole until every row of the guard holds. Its direction does not change: the robot
stops before an obstacle and moves on as soon as the commanded motion leads away from it.
"""

from collections.abc import Callable, Sequence

import numpy as np

from controller.config import WholeBodyConfig
from controller.whole_body.collision import CollisionModel
from controller.whole_body.decoupled import Decoupled
from controller.whole_body.guards.collision import CollisionGuard
from controller.whole_body.guards.tipping import TippingGuard
from controller.whole_body.hierarchy import Hierarchy
from controller.whole_body.nullspace import Nullspace
from controller.whole_body.saturation import Saturation
from controller.whole_body.task import Guard, IkProblem, Inequalities, Method, Solution
from controller.whole_body.tipping import Tipping
from rolling_panda.errors import ConfigError
from rolling_panda.model.differential_drive import Array
from rolling_panda.model.robot import RobotModel

#: Below this scale the reason is reported.
_TOLD = 0.5
#: Below this scale the problem counts as infeasible.
_HELD = 1e-2


class SpeedScaling:
    """A method whose speed a guard limits."""

    def __init__(self, method: Method, guard: Guard, saturation: Saturation) -> None:
        """Bind the parts, all of the same control period."""
        self.name, self.flows = method.name, method.flows
        self._method, self._guard, self._saturation = method, guard, saturation

    def solve(self, problem: IkProblem) -> Solution:
        """The actuator velocities that answer the problem; see `Method.solve`."""
        out = self._method.solve(problem)
        if not problem.finite:
            return out
        speed_scale, what = allowed_speed_scale(self._guard.rows(problem), out.xi)
        if speed_scale >= 1.0:
            return out
        limited = self._saturation.apply(speed_scale * out.xi, problem.q, problem.sent)
        reason = what if speed_scale < _TOLD else out.reason
        return Solution(
            limited.xi, out.scale * speed_scale, out.manipulability, out.feasible and speed_scale >= _HELD, reason
        )


def allowed_speed_scale(rows: Inequalities, xi: Array) -> tuple[float, str]:
    """The largest speed scale, 0…1, for which every row holds, and the name of the most restrictive row.

    For a row that no scale satisfies (a pair that has to part), the distance must not become smaller.

    Args:
        rows: A ξ̇ ≥ lower.
        xi: ξ̇ (9).
    """
    speed_scale, what = 1.0, ""
    for rate, lower, name in zip((rows.A @ xi).tolist(), np.minimum(rows.lower, 0.0).tolist(), rows.names, strict=True):
        if rate < lower and lower / rate < speed_scale:
            speed_scale, what = lower / rate, name
    return speed_scale, what


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


def with_speed_scaling(make: Callable[[RobotModel, WholeBodyConfig, float], Method]) -> Maker:
    """Methods that know no inequalities beyond the limits are braked where obstacles are known."""

    def maker(robot: RobotModel, config: WholeBodyConfig, dt: float, collision: CollisionModel | None) -> Method:
        method = make(robot, config, dt)
        if collision is None or not config.hierarchy.collisions:
            return method
        return SpeedScaling(method, CollisionGuard(collision, config.hierarchy, dt), Saturation(robot, config, dt))

    return maker


METHODS: dict[str, Maker] = {
    Hierarchy.name: _hierarchy,
    Nullspace.name: with_speed_scaling(Nullspace),
    Decoupled.name: with_speed_scaling(Decoupled),
}
