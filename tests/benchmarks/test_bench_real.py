"""What the measurement of the real bridge makes of what it has seen."""

from benchmarks.faults.real import FAULTS, LIMIT_S, Found, Trial, summary
from rolling_panda import reasons


def trial(number: int, base_s: float, arm_s: float, told: bool = True) -> Trial:
    return Trial(FAULTS[number].name, base_s, arm_s, told)


def test_the_slowest_of_each_fault_counts_and_a_reason_that_was_not_told_is_missing() -> None:
    found = Found(trials=[trial(0, 0.1, 0.2), trial(0, LIMIT_S + 0.01, 0.1), trial(3, 0.2, 0.0, told=False)])
    rows = {row["fault"]: row for row in summary(found, 60.0)["faults"]}
    assert set(rows) == {FAULTS[0].name, FAULTS[3].name}
    assert (rows[FAULTS[0].name]["n"], rows[FAULTS[0].name]["base_s"]) == (2, LIMIT_S + 0.01)
    assert not rows[FAULTS[0].name]["within"]
    assert rows[FAULTS[3].name]["within"] and rows[FAULTS[3].name]["told"] == 0


def test_a_line_names_a_fault_by_the_code_of_a_cause_and_the_devices_words() -> None:
    lost, stopped = FAULTS[2], FAULTS[4]
    assert all(fault.code in reasons.CATALOGUE for fault in FAULTS)
    assert stopped.named_by(reasons.robot_faulty(reasons.arm_user_stopped()))
    assert not stopped.named_by(reasons.robot_faulty(reasons.arm_silent()))
    for words in ("communication_constraints_violation", "joint_reflex"):
        told = reasons.software_stop("robot", reasons.device_fault("arm", words))
        assert lost.named_by(told) == (words == lost.words)


def test_an_arm_that_never_rests_is_not_within_any_limit() -> None:
    rows = summary(Found(trials=[trial(2, 0.1, float("inf"))]), 60.0)["faults"]
    assert rows[0]["within"] is False
