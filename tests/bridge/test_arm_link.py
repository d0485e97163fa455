"""What bridge and arm process tell each other through shared memory."""

from multiprocessing import get_context

import numpy as np
import pytest

from bridge.real.arm_link import ArmLink, ArmState
from rolling_panda import reasons
from rolling_panda.messages.types import Reason

REST = np.zeros(7)
WORDS = "libfranka: ⚠ \x07 reflex aborted" + "\x01" * 600


@pytest.mark.parametrize("fault", [None, reasons.arm_user_stopped(), reasons.device_fault("arm", WORDS)])
def test_the_bridge_reads_the_arms_state_with_its_fault_as_the_arm_told_it(fault: Reason | None) -> None:
    link = ArmLink(get_context("spawn"))
    link.tell(ArmState(1.0, np.arange(7.0), np.arange(7.0) / 10, reasons.arm_connecting(), True, 0.0, 0, REST))
    link.tell(ArmState(2.0, np.arange(7.0) + 1.0, np.arange(7.0), fault, False, 0.9, 12, np.arange(7.0) - 3.0))
    state = link.state()
    assert (state.at, state.fault, state.severe, state.success_rate, state.commands) == (2.0, fault, False, 0.9, 12)
    np.testing.assert_array_equal(state.position, np.arange(7.0) + 1.0)
    np.testing.assert_array_equal(state.velocity, np.arange(7.0))
    np.testing.assert_array_equal(state.external_torque, np.arange(7.0) - 3.0)


def test_before_the_first_state_nothing_is_told() -> None:
    state = ArmLink(get_context("spawn")).state()
    assert (state.at, state.fault, state.commands) == (0.0, None, 0)


def test_a_fault_that_was_not_written_to_its_end_is_a_fault_too() -> None:
    link = ArmLink(get_context("spawn"))
    link.tell(ArmState(1.0, REST, REST, Reason(code="x" * 64, values=(("y", "z" * 500),) * 9), True, 0.0, 0, REST))
    assert link.state().fault == reasons.arm_process_ended()
