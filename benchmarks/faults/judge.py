"""What a trace says about a fault: when the robot was at rest, and whether anything was sent that must not be.

Only rows of the record at the actuators are looked at, never what the program says of itself.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bridge.config import BridgeConfig
from rolling_panda.model.robot import ARM_Q, ARM_XI
from tests.support.worlds.faulty_world import MODEL

Rows = NDArray[Any]
#: Slower than this (rad/s) is nothing.
_NOTHING = 1e-9


@dataclass(frozen=True)
class Trial:
    """What one trial gave.

    Attributes:
        fault: Name.
        requirement: That it tests.
        seed: Of the trial.
        limit_s: Allowed; infinite where the robot must go on, NaN where it may.
        note: For people, and not judged: the hop, and the controller's mode at the end.
        braking_s: From the fault until the wheels are slower than they were, for good; infinite if never.
        quiet_s: From the fault until nothing but zero is sent; infinite if never.
        replayed: Rows with an older token or number than a row before.
        beyond: Rows outside velocity, acceleration, jerk or joint limits.
        held: Whether the requirement held.
    """

    fault: str
    requirement: str
    seed: int
    limit_s: float
    note: str
    braking_s: float
    quiet_s: float
    replayed: int
    beyond: int
    held: bool


def judge(rows: Rows, begun: Sequence[int], since: float, limit_s: float) -> tuple[float, int, int, bool]:
    """`quiet_s`, `replayed`, `beyond` and `held` of a trial.

    Args:
        rows: Of the trace.
        begun: Indices at which another bridge began, which knows nothing of the last one's acceleration.
        since: Time from which `quiet_s` runs (s, the trace's clock).
        limit_s: Allowed; infinite where the robot must go on, NaN where it may.
    """
    quiet, replayed = quiet_after(rows, since), replays(rows)
    beyond = sum(violations(life) for life in np.split(rows, list(begun)))
    in_time = math.isnan(limit_s) or (math.isinf(quiet) if math.isinf(limit_s) else quiet <= limit_s + 1e-6)
    return quiet, replayed, beyond, in_time and not replayed and not beyond


def quiet_after(rows: Rows, clock: float) -> float:
    """Seconds from `clock` until nothing but zero is sent; infinite if that never comes."""
    after = rows[rows["clock"] > clock + 1e-9]
    moving = np.flatnonzero(np.abs(after["setpoint"]).max(axis=1, initial=0.0) > _NOTHING)
    if not len(moving):
        return 0.0
    last = int(moving[-1])
    return math.inf if last == len(after) - 1 else float(after["clock"][last + 1] - clock)


def braking_after(rows: Rows, clock: float) -> float:
    """Seconds from `clock` until the wheels are slower than they were by a fiftieth, for good; infinite if never."""
    after = rows[rows["clock"] > clock + 1e-9]
    speed = np.abs(after["setpoint"][:, :2]).max(axis=1, initial=0.0)
    if not len(speed):
        return math.inf
    fast = np.flatnonzero(speed >= 0.98 * speed[0])
    last = int(fast[-1])
    return math.inf if last == len(after) - 1 else float(after["clock"][last + 1] - clock)


def last_taken(rows: Rows) -> float:
    """When the last command was taken (s, the trace's clock); that of the first row if none was."""
    changed = np.flatnonzero((np.diff(rows["sequence"]) != 0) | (np.diff(rows["epoch"].astype(np.int64)) != 0))
    # A row follows the tick in which its command was taken.
    return float(rows["clock"][changed[-1]] if len(changed) else rows["clock"][0])


def replays(rows: Rows) -> int:
    """Rows that follow from an older token, or within one from an older number, than a row before."""
    epochs, numbers = rows["epoch"].astype(np.int64), rows["sequence"]
    older = np.diff(epochs) < 0
    return int(np.count_nonzero(older | ((np.diff(epochs) == 0) & (np.diff(numbers) < 0) & (numbers[1:] >= 0))))


def violations(rows: Rows) -> int:
    """Rows beyond velocity, acceleration, jerk (arm) or position (arm) of the robot."""
    limits, sent = MODEL.limits, rows["setpoint"]
    acceleration = limits.acceleration.copy()
    acceleration[:2] = BridgeConfig().wheel_acceleration
    change = np.diff(sent, axis=0)
    bad = (~np.isfinite(sent)).any(axis=1) | (np.abs(sent) > limits.velocity + 1e-9).any(axis=1)
    bad[1:] |= (np.abs(change) > acceleration * 1e-3 + 1e-9).any(axis=1)
    jerk = np.abs(np.diff(change[:, ARM_XI], axis=0)) > limits.jerk[ARM_XI] * 1e-6 + 1e-9
    bad[2:] |= jerk.any(axis=1)
    arm = rows["position"][:, 2:]
    if np.any(arm):
        bad |= ((arm < limits.lower[ARM_Q]) | (arm > limits.upper[ARM_Q])).any(axis=1)
    return int(np.count_nonzero(bad))


def summary(trials: Sequence[Trial]) -> dict[str, dict[str, object]]:
    """For each requirement: how many trials, the worst time and its limit, and whether all held."""
    out: dict[str, dict[str, object]] = {}
    for requirement in dict.fromkeys(trial.requirement for trial in trials):
        those = [trial for trial in trials if trial.requirement == requirement]
        timed = [trial for trial in those if math.isfinite(trial.limit_s)]
        # Of several limits, the trial that came nearest to its own or went furthest beyond.
        worst = max(timed, key=lambda trial: trial.quiet_s / trial.limit_s, default=None)
        out[requirement] = {
            "n": len(those),
            "held": all(trial.held for trial in those),
            "failed": sum(not trial.held for trial in those),
            "worst_s": None if worst is None or math.isinf(worst.quiet_s) else worst.quiet_s,
            "limit_s": None if worst is None else worst.limit_s,
            "p99_s": _share(timed, "quiet_s"),
            "braking_p99_s": _share(timed, "braking_s"),
            "replayed": sum(trial.replayed for trial in those),
            "beyond": sum(trial.beyond for trial in those),
        }
    return out


def _share(trials: Sequence[Trial], name: str) -> float | None:
    """The 99th percentile of one of the times, the nearest that was measured; None where that is infinite."""
    if not trials:
        return None
    found = sorted(getattr(trial, name) for trial in trials)[max(0, math.ceil(0.99 * len(trials)) - 1)]
    return float(found) if math.isfinite(found) else None
