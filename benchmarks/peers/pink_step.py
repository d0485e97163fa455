"""Pink (package pin-pink) with DAQP: tool and posture tasks, all limits, rolling wheels as a constraint."""

from importlib.metadata import version
from typing import Any

import numpy as np
import pinocchio as pin
from pink import Configuration, solve_ik
from pink.exceptions import PinkError
from pink.limits import AccelerationLimit, ConfigurationLimit, VelocityLimit
from pink.tasks import FrameTask, PostureTask, Task
from stopwatch import load, report, rolling, urdf


class Rolling(Task):  # type: ignore[misc]
    """A(q) Δq = 0."""

    def __init__(self, problem: dict[str, Any]) -> None:
        """Bind the base's dimensions."""
        super().__init__(cost=1.0, gain=1.0)
        self._problem = problem

    def compute_error(self, configuration: Any) -> Any:
        """Nothing to make good."""
        return np.zeros(3)

    def compute_jacobian(self, configuration: Any) -> Any:
        """A at the base's heading."""
        return rolling(self._problem, configuration.q)

    def __repr__(self) -> str:
        """Name."""
        return "Rolling()"


def main() -> None:
    """Time it."""
    model = pin.buildModelFromUrdf(str(urdf()))
    problem = load(list(model.names)[1:])
    model.velocityLimit = problem["velocity"]
    data = model.createData()
    tool = FrameTask("tool", position_cost=1.0, orientation_cost=1.0)
    posture = PostureTask(cost=1e-3, gain=0.01)
    acceleration = AccelerationLimit(model, problem["acceleration"])
    limits = [ConfigurationLimit(model), VelocityLimit(model), acceleration]
    constraint = Rolling(problem)
    q, target, before, reference, dt = (problem[key] for key in ("q", "target", "v", "posture", "dt"))
    dt = float(dt)
    poses = [pin.SE3(T) for T in target]

    def step(i: int) -> Any:
        configuration = Configuration(model, data, q[i], copy_data=False)
        tool.set_target(poses[i])
        posture.set_target(reference[i])
        acceleration.set_last_integration(before[i], dt)
        try:
            return solve_ik(
                configuration,
                [tool, posture],
                dt,
                solver="daqp",
                limits=limits,
                constraints=[constraint],
                safety_break=False,
            )
        except PinkError:
            return None

    note = "weighted tasks; position, velocity and acceleration limits; rolling; no collisions"
    report("Pink", version("pin-pink"), note, step, len(q))


if __name__ == "__main__":
    main()
