"""TSID: inverse dynamics by tasks on accelerations; velocity and acceleration bounds of the joints."""

from importlib.metadata import version
from typing import Any

import numpy as np
import pinocchio as pin
import tsid
from stopwatch import load, report, urdf


def main() -> None:
    """Time it."""
    folders = pin.StdVec_StdString()
    folders.append(str(urdf().parent))
    robot = tsid.RobotWrapper(str(urdf()), folders, False)
    model = robot.model()
    problem = load(list(model.names)[1:])
    formulation = tsid.InverseDynamicsFormulationAccForce("tsid", robot, False)
    q, v, reference, dt = problem["q"], problem["v"], problem["posture"], float(problem["dt"])
    formulation.computeProblemData(0.0, q[0], v[0])
    tool = tsid.TaskSE3Equality("tool", robot, "tool")
    tool.setKp(100.0 * np.ones(6))
    tool.setKd(20.0 * np.ones(6))
    formulation.addMotionTask(tool, 1.0, 1, 0.0)
    posture = tsid.TaskJointPosture("posture", robot)
    posture.setKp(1.0 * np.ones(12))
    posture.setKd(2.0 * np.ones(12))
    formulation.addMotionTask(posture, 1e-3, 1, 0.0)
    bounds = tsid.TaskJointBounds("bounds", robot, dt)
    bounds.setVelocityBounds(-problem["velocity"], problem["velocity"])
    bounds.setAccelerationBounds(-problem["acceleration"], problem["acceleration"])
    formulation.addMotionTask(bounds, 1.0, 0, 0.0)
    solver = tsid.SolverHQuadProgFast("qp")
    solver.resize(formulation.nVar, formulation.nEq, formulation.nIn)
    sample, rest = tsid.TrajectorySample(12, 6), tsid.TrajectorySample(12)
    poses = [np.concatenate([T[:3, 3], T[:3, :3].ravel(order="F")]) for T in problem["target"]]

    def step(i: int) -> Any:
        sample.value(poses[i])
        sample.derivative(np.zeros(6))
        sample.second_derivative(np.zeros(6))
        tool.setReference(sample)
        rest.value(reference[i])
        posture.setReference(rest)
        solution = solver.solve(formulation.computeProblemData(0.0, q[i], v[i]))
        return formulation.getAccelerations(solution) if solution.status == 0 else None

    assert model.nv == 12 and pin.__version__
    note = (
        "weighted tasks on accelerations; velocity and acceleration bounds; base taken as able to slip; no collisions"
    )
    report("TSID", version("tsid"), note, step, len(q))


if __name__ == "__main__":
    main()
