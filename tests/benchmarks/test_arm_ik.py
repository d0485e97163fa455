import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from benchmarks.control.arm_ik import ArmIk
from controller.whole_body.manipulability import arm_omega
from rolling_panda.model.robot import ARM_Q, RobotModel

ROBOT = RobotModel()
IK = ArmIk(ROBOT)


def flange(arm):
    q = np.zeros(12)
    q[ARM_Q] = arm
    return ROBOT.pose(q, ROBOT.frame_id("arm_mount")).actInv(ROBOT.pose(q, ROBOT.flange_id))


def solve(arm, q7):
    T = flange(arm)
    return IK.solve(T.rotation[None], T.translation[None], np.array([q7]))


joint = st.floats(0.02, 0.98)


@settings(max_examples=150, deadline=None)
@given(st.tuples(*[joint] * 7))
def test_the_posture_that_made_a_pose_is_among_the_answers(share):
    arm = IK.lower + np.array(share) * (IK.upper - IK.lower)
    arm[3] = min(arm[3], -0.5)
    T = flange(arm)
    answers = solve(arm, arm[6]).q[:, 0]
    differences = np.abs(np.angle(np.exp(1j * (answers - arm)))).max(axis=1)
    if abs(arm[1]) > 0.02:  # With the upper arm upright, joints 1 and 3 turn about one axis and only their sum counts.
        assert np.nanmin(differences) < 1e-5
    found = answers[np.isfinite(answers).all(axis=1)]
    assert len(found) >= 2
    for other in found:
        reached = flange(other)
        assert np.abs(reached.homogeneous - T.homogeneous).max() < 1e-7


@settings(max_examples=60, deadline=None)
@given(st.tuples(*[joint] * 7), st.floats(-2.8, 2.8))
def test_every_answer_for_another_last_joint_has_the_pose_and_the_manipulability_it_says(share, q7):
    arm = IK.lower + np.array(share) * (IK.upper - IK.lower)
    answers = solve(arm, q7)
    for other, omega in zip(answers.q[:, 0], answers.omega[:, 0], strict=True):
        if not np.isfinite(other).all():
            continue
        assert np.abs(flange(other).homogeneous - flange(arm).homogeneous).max() < 1e-7
        q = np.zeros(12)
        q[ARM_Q] = other
        assert omega == pytest.approx(arm_omega(ROBOT.kinematics(q).J), abs=1e-6)


def test_what_is_out_of_reach_has_no_answer():
    answers = IK.solve(np.eye(3)[None], np.array([[1.5, 0.0, 0.3]]), np.zeros(1))
    assert np.isnan(answers.q[..., 0]).all() and np.isnan(answers.omega).all()


def test_the_shoulder_and_the_reach_are_the_pandas():
    assert IK.shoulder == pytest.approx([0.0, 0.0, 0.691])
    assert IK.reach == pytest.approx(0.719, abs=0.001)


def test_margin_is_to_the_nearest_limit():
    middle = (IK.lower + IK.upper) / 2
    assert IK.margin(middle) == pytest.approx(((IK.upper - IK.lower) / 2).min())
    middle[5] = IK.upper[5] + 0.1
    assert IK.margin(middle) == pytest.approx(-0.1)
