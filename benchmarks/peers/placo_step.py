"""PlaCo: tool and joints tasks in C++, position and velocity limits; the sideways slip of the base is a soft task."""

from importlib.metadata import version
from typing import Any

import numpy as np
import placo
from stopwatch import load, report, urdf


def main() -> None:
    """Time it."""
    robot = placo.RobotWrapper(str(urdf()), placo.Flags.ignore_collisions)
    names = list(robot.joint_names())
    problem = load(names)
    for name, limit in zip(names, problem["velocity"], strict=True):
        robot.set_velocity_limit(name, float(limit))
    solver = placo.KinematicsSolver(robot)
    solver.mask_fbase(True)
    solver.enable_velocity_limits(True)
    solver.enable_joint_limits(True)
    solver.dt = float(problem["dt"])
    tool = solver.add_frame_task("tool", np.eye(4))
    tool.configure("tool", "soft", 1.0, 1.0)
    joints = solver.add_joints_task()
    joints.configure("posture", "soft", 1e-3)
    arm = [i for i, name in enumerate(names) if name.startswith("panda_")]
    q, target, reference = problem["q"], problem["target"], problem["posture"]

    def step(i: int) -> Any:
        # The first seven coordinates are PlaCo's floating base, which stays where it is.
        robot.state.q[7:] = q[i]
        robot.update_kinematics()
        tool.T_world_frame = target[i]
        joints.set_joints({names[j]: float(reference[i][j]) for j in arm})
        try:
            return solver.solve(False)
        except RuntimeError:
            return None

    note = "weighted tasks; position and velocity limits; base taken as able to slip; no accelerations, no collisions"
    report("PlaCo", version("placo"), note, step, len(q))


if __name__ == "__main__":
    main()
