import xml.etree.ElementTree as ET

import mujoco
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from controller.whole_body.dynamics import Dynamics, acceleration_of_q, basis_rate
from rolling_panda.config import RobotConfig
from rolling_panda.model.robot import ARM_Q, RobotModel, panda_urdf
from rolling_panda.resources import resource

ROBOT = RobotModel(RobotConfig(rho=0.1))
DYNAMICS = Dynamics(ROBOT)
seeds = st.integers(0, 2**32 - 1)


def state(seed):
    rng = np.random.default_rng(seed)
    q = np.zeros(12)
    q[:3], q[3:5] = rng.uniform(-3, 3, 3), rng.uniform(-9, 9, 2)
    q[ARM_Q] = rng.uniform(ROBOT.limits.lower[ARM_Q], ROBOT.limits.upper[ARM_Q])
    xi = np.concatenate([rng.uniform(-5, 5, 2), rng.uniform(-2, 2, 7)])
    return rng, q, xi


@settings(max_examples=30)
@given(seeds)
def test_inertia_is_symmetric_and_positive_definite(seed):
    _, q, xi = state(seed)
    M = DYNAMICS.terms(q, xi).M
    np.testing.assert_allclose(M, M.T, atol=1e-12)
    assert np.linalg.eigvalsh(M).min() > 1e-4


@settings(max_examples=30)
@given(seeds)
def test_inertia_rate_less_twice_the_coriolis_matrix_is_skew(seed):
    _, q, xi = state(seed)

    def M(s):
        return DYNAMICS.terms(q + s * (ROBOT.drive.basis(q[2]) @ xi), xi).M

    # Fourth order, so that the difference itself is not what is seen.
    step = 5e-4
    rate = (8 * (M(step) - M(-step)) - (M(2 * step) - M(-2 * step))) / (12 * step)
    N = rate - 2 * DYNAMICS.terms(q, xi).V
    np.testing.assert_allclose(N + N.T, 0.0, atol=1e-8)


@settings(max_examples=30)
@given(seeds)
def test_forward_undoes_inverse(seed):
    rng, q, xi = state(seed)
    acceleration = rng.uniform(-5, 5, 9)
    u = DYNAMICS.inverse(q, xi, acceleration)
    np.testing.assert_allclose(DYNAMICS.forward(q, xi, u), acceleration, atol=1e-8)
    terms = DYNAMICS.terms(q, xi)
    np.testing.assert_allclose(terms.M @ acceleration + terms.V @ xi + terms.G, u, atol=1e-9)


@settings(max_examples=30)
@given(seeds)
def test_acceleration_is_that_of_the_constrained_system_with_multipliers(seed):
    rng, q, xi = state(seed)
    u, disturbance = rng.uniform(-20, 20, 9), rng.uniform(-30, 30, 12)
    S = ROBOT.drive.basis(q[2])
    v = S @ xi
    A, step = ROBOT.drive.constraint(q[2]), 1e-6
    A_rate = (ROBOT.drive.constraint(q[2] + step) - ROBOT.drive.constraint(q[2] - step)) / (2 * step) * v[2]
    M, bias = mujoco_terms(q, v)
    # M a + bias = B u + τ_dis + Aᵀ λ and A a + Ȧ v = 0, with MuJoCo's own inertia and bias.
    KKT = np.block([[M, -A.T], [A, np.zeros((3, 3))]])
    torque = disturbance - bias
    torque[3:] += u
    a = np.linalg.solve(KKT, np.concatenate([torque, -A_rate @ v]))[:12]
    acceleration = DYNAMICS.forward(q, xi, u, disturbance)
    np.testing.assert_allclose(acceleration, a[3:], rtol=1e-6, atol=1e-6)
    np.testing.assert_allclose(acceleration_of_q(S, v, acceleration), a, rtol=1e-6, atol=1e-6)


@settings(max_examples=30)
@given(seeds)
def test_inertia_and_bias_are_those_that_mujoco_finds_in_the_same_urdf(seed):
    _, q, xi = state(seed)
    S = ROBOT.drive.basis(q[2])
    v = S @ xi
    M, bias = mujoco_terms(q, v)
    terms = DYNAMICS.terms(q, xi)
    np.testing.assert_allclose(terms.M, S.T @ M @ S, atol=1e-7)
    expected = S.T @ (bias + M @ (basis_rate(S, v) @ xi))
    np.testing.assert_allclose(terms.V @ xi + terms.G, expected, atol=1e-6)


def drift(accelerate):
    """Change of energy (J) over 0.4 s of motion, Runge–Kutta of fourth order at 1 ms."""
    q = np.array([0.3, -0.2, 0.7, 0.0, 0.0, 0.3, -0.4, 0.5, -1.9, 0.6, 1.7, 0.4])
    xi = np.array([6.0, -4.0, 0.8, -0.6, 0.9, 0.7, -1.2, 0.8, 1.0])
    before, dt = DYNAMICS.energy(q, xi), 0.001
    for _ in range(400):
        rates = []
        for share in (0.0, 0.5, 0.5, 1.0):
            q_s, xi_s = (q, xi) if not rates else (q + share * dt * rates[-1][0], xi + share * dt * rates[-1][1])
            rates.append((ROBOT.drive.basis(q_s[2]) @ xi_s, accelerate(q_s, xi_s)))
        q = q + dt / 6 * sum(w * rate[0] for w, rate in zip((1, 2, 2, 1), rates, strict=True))
        xi = xi + dt / 6 * sum(w * rate[1] for w, rate in zip((1, 2, 2, 1), rates, strict=True))
    return DYNAMICS.energy(q, xi) - before


def test_free_motion_keeps_its_energy_and_would_not_without_the_basis_rate():
    assert abs(drift(lambda q, xi: DYNAMICS.forward(q, xi, np.zeros(9)))) < 1e-6

    def without_basis_rate(q, xi):
        S = ROBOT.drive.basis(q[2])
        M, bias = mujoco_terms(q, S @ xi)
        return np.linalg.solve(S.T @ M @ S, -S.T @ bias)

    # The check is worth something only if it sees the term that is easily forgotten.
    assert abs(drift(without_basis_rate)) > 1e-2


@settings(max_examples=20)
@given(seeds)
def test_power_of_the_actuators_is_the_rate_of_energy(seed):
    rng, q, xi = state(seed)
    u = rng.uniform(-20, 20, 9)
    acceleration, step = DYNAMICS.forward(q, xi, u), 1e-5

    def energy(s):
        half = q[2] + 0.5 * s * (ROBOT.drive.basis(q[2]) @ xi)[2]
        return DYNAMICS.energy(q + s * (ROBOT.drive.basis(half) @ xi), xi + s * acceleration)

    rate = (energy(step) - energy(-step)) / (2 * step)
    assert rate == pytest.approx(xi @ u, rel=1e-5, abs=1e-3)


def test_gravity_pulls_the_stretched_arm_down_and_leaves_the_wheels_alone():
    q = np.zeros(12)
    q[ARM_Q] = [0.0, 1.57, 0.0, -0.07, 0.0, 1.6, 0.0]
    G = DYNAMICS.terms(q, np.zeros(9)).G
    np.testing.assert_allclose(G[:2], 0.0, atol=1e-9)
    # About 15 kg of moving links at some 0.35 m, and the cutter's 1.2 kg at 0.9 m.
    assert -87.0 < G[3] < -30.0


def _urdf_for_mujoco():
    """Base, arm and tool as one URDF without shapes, so that MuJoCo reads the inertias itself."""
    whole = ET.Element("robot", name="rolling_panda")
    compiler = ET.SubElement(ET.SubElement(whole, "mujoco"), "compiler")
    compiler.attrib.update(fusestatic="false", balanceinertia="false", boundmass="1e-12", boundinertia="1e-12")
    texts = [resource(f"assets/urdf/{name}.urdf").read_text() for name in ("base", "tool")] + [panda_urdf()]
    for text in texts:
        for element in ET.fromstring(text):
            if element.tag in ("link", "joint"):
                for shape in [*element.findall("visual"), *element.findall("collision")]:
                    element.remove(shape)
                whole.append(element)
    for parent, child in (("arm_mount", "panda_link0"), ("panda_link8", "cutter_link")):
        joint = ET.SubElement(whole, "joint", name=f"{parent}_{child}", type="fixed")
        ET.SubElement(joint, "parent", link=parent)
        ET.SubElement(joint, "child", link=child)
    return ET.tostring(whole, encoding="unicode")


MUJOCO = mujoco.MjModel.from_xml_string(_urdf_for_mujoco())
MUJOCO_DATA = mujoco.MjData(MUJOCO)
_ADDRESS = [MUJOCO.joint(name).dofadr[0] for name in list(ROBOT.model.names)[1:]]


def mujoco_terms(q, v):
    """MuJoCo's inertia matrix (12×12) and its bias forces with gravity (12), in the order of q."""
    MUJOCO_DATA.qpos[_ADDRESS], MUJOCO_DATA.qvel[_ADDRESS] = q, v
    mujoco.mj_forward(MUJOCO, MUJOCO_DATA)
    M = np.zeros((12, 12))
    mujoco.mj_fullM(MUJOCO, MUJOCO_DATA, M)
    return M[np.ix_(_ADDRESS, _ADDRESS)], MUJOCO_DATA.qfrc_bias[_ADDRESS].copy()
