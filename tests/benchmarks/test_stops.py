"""Whether a protective stop was a true one, by what the simulated robot touched then."""

import numpy as np
import pytest

from benchmarks.control.stops import Stop, stops_of
from bridge.sim.robot import trace
from bridge.sim.robot.touch import ExternalTorque
from rolling_panda import messages as m
from rolling_panda import reasons
from tests.support.worlds.contact_world import ContactWorld
from tests.system.test_contact import TURN, UP, in_the_way, scaled


def halted(at, after="PROTECTIVE_STOP", cause=None):
    told = reasons.robot_halted("AUTO", after, cause or reasons.touched_unknown("link5", 21.0))
    return m.LogEvent(header=m.Header(at), process="controller", reason=told)


def rows(**touched):
    """Two seconds of a trace; of a field some (from, until, value), in s."""
    record = np.zeros(2000, trace.ROW)
    record["clock"] = 0.001 * np.arange(2000)
    for name, (since, until, value) in touched.items():
        record[name][(record["clock"] >= since) & (record["clock"] < until)] = value
    return record


@pytest.mark.parametrize(
    ("record", "false"),
    [
        (rows(), True),
        (rows(touch=(0.95, 1.0, 24.0)), False),
        (rows(touch=(0.95, 1.0, 0.1)), True),
        (rows(self_contacts=(0.95, 1.0, 1)), False),
        (rows(touch=(0.1, 0.7, 24.0)), True),
        (rows(touch=(1.1, 1.9, 24.0)), True),
    ],
    ids=["nothing", "a post", "as good as nothing", "itself", "long before", "on the way back"],
)
def test_a_stop_is_false_where_nothing_was_touched_just_before_it(record, false):
    (stop,) = stops_of([halted(1.0)], record)
    assert stop.false == false and stop.code == "touched_unknown"


def test_each_protective_stop_is_judged_by_its_own_time_and_no_other_halt_is_one():
    told = [halted(0.5), halted(0.8, "PAUSED"), halted(1.5, cause=reasons.joints_stale(0.5, 0.2))]
    assert stops_of(told, rows(touch=(1.4, 1.6, 30.0))) == (
        Stop("touched_unknown", 0.0, False),
        Stop("joints_stale", 30.0, False),
    )


def wrong(felt: ExternalTorque, *_: object) -> None:
    """An estimate of 20 N·m at joint 2, whatever acts there."""
    felt.value = np.array([0.0, 20.0, 0.0, 0.0, 0.0, 0.0, 0.0])


@pytest.mark.long
@pytest.mark.parametrize("touches", [True, False])
def test_of_a_robot_the_stop_at_a_post_is_true_and_one_by_a_wrong_estimate_is_false(tmp_path, monkeypatch, touches):
    post, _ = in_the_way("post", "cutter", TURN, UP, 0.04)
    writer = trace.TraceWriter(tmp_path / "t")
    loop = ContactWorld((post,) if touches else (), trace=writer)
    loop.hold(joints=scaled(TURN, "cutter", 0.2))
    loop.run(0.3)
    if not touches:
        monkeypatch.setattr(ExternalTorque, "step", wrong)
    assert loop.run_until(lambda: loop.touch is not None, 3.0)
    loop.robot.close()
    (stop,) = stops_of(loop.log, trace.read(tmp_path / "t").rows)
    assert stop.code == "touched_unknown" and stop.false != touches
    assert stop.force > 20.0 or not touches
