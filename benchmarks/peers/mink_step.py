"""mink with DAQP: tool and posture tasks, position and velocity limits; it has no acceleration limits of its own."""

from importlib.metadata import version
from typing import Any

import mink
import mujoco
import numpy as np
from stopwatch import load, report, rolling, urdf


class Rolling(mink.Task):  # type: ignore[misc]
    """A(q) Δq = 0."""

    def __init__(self, problem: dict[str, Any]) -> None:
        """Bind the base's dimensions."""
        super().__init__(cost=np.ones(3), gain=1.0)
        self._problem = problem

    def compute_error(self, configuration: Any) -> Any:
        """Nothing to make good."""
        return np.zeros(3)

    def compute_jacobian(self, configuration: Any) -> Any:
        """A at the base's heading."""
        return rolling(self._problem, configuration.q)


def main() -> None:
    """Time it."""
    text = (
        urdf()
        .read_text()
        .replace(
            "<link", '<mujoco><compiler fusestatic="false" boundmass="1e-3" boundinertia="1e-6"/></mujoco><link', 1
        )
    )
    model = mujoco.MjModel.from_xml_string(text)
    names = [model.joint(i).name for i in range(model.njnt)]
    problem = load(names)
    speeds = dict(zip(names, problem["velocity"], strict=True))
    tool = mink.FrameTask("tool", "body", position_cost=1.0, orientation_cost=1.0)
    posture = mink.PostureTask(model, cost=1e-3, gain=0.01)
    limits = [mink.ConfigurationLimit(model), mink.VelocityLimit(model, speeds)]
    constraint = Rolling(problem)
    q, reference, dt = problem["q"], problem["posture"], float(problem["dt"])
    poses = [mink.SE3.from_matrix(T) for T in problem["target"]]
    configuration = mink.Configuration(model)

    def step(i: int) -> Any:
        configuration.update(q[i])
        tool.set_target(poses[i])
        posture.set_target(reference[i])
        try:
            return mink.solve_ik(configuration, [tool, posture], dt, "daqp", limits=limits, constraints=[constraint])
        except mink.MinkError:
            return None

    note = "weighted tasks; position and velocity limits; rolling; no acceleration limits, no collisions"
    report("mink", version("mink"), note, step, len(q))


if __name__ == "__main__":
    main()
