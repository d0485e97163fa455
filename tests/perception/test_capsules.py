import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from perception.plant.capsules import CapsuleSet
from rolling_panda.messages.perception import Capsule


def clearance(capsules, kind, place):
    return CapsuleSet(capsules, (kind,)).nearest(place[None])[0]


WIRE = Capsule("wire", (0.0, 0.0, 1.2), (2.0, 0.0, 1.2), 0.002, 0.002)
CORDON = Capsule("cordon", (0.0, 0.0, 0.9), (1.0, 0.0, 0.9), 0.02, 0.04)


def test_it_is_measured_to_the_surface_of_the_nearest_of_the_kind():
    place = np.array([1.0, 0.0, 1.0])
    assert clearance((WIRE, CORDON), "wire", place) == pytest.approx(0.198)
    assert clearance((WIRE, CORDON), "cordon", place) == pytest.approx(0.06)
    assert clearance((WIRE,), "wire", np.array([-0.3, 0.0, 1.2])) == pytest.approx(0.298)
    assert clearance((CORDON,), "wire", place) == np.inf
    assert clearance((CORDON,), "cordon", np.array([0.5, 0.0, 0.9])) == pytest.approx(-0.03)


@given(st.tuples(*[st.floats(-2.0, 2.0)] * 3))
def test_no_sample_of_the_surface_is_nearer(place):
    place = np.array(place)
    found = clearance((WIRE, CORDON), "cordon", place)
    shares = np.linspace(0.0, 1.0, 200)[:, None]
    axis = np.array(CORDON.start) + shares * np.subtract(CORDON.end, CORDON.start)
    gaps = np.linalg.norm(axis - place, axis=1) - (0.02 + 0.02 * shares[:, 0])
    assert found <= gaps.min() + 0.003
