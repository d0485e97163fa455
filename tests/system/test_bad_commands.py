"""Whatever else arrives where motion commands belong moves nothing, is counted, and can be read in the log."""

import math
import queue
from pathlib import Path
from typing import Any

import msgspec
import numpy as np
import pytest
import zenoh

from bridge.sim.robot import trace
from rolling_panda.messages import Reason
from rolling_panda.reasons import text_of
from rolling_panda.runtime.process import ROBOT_ID
from rolling_panda.topics import MOTION, key
from tests.support.processes.live_robot import LiveRobot

pytestmark = pytest.mark.paced

FAST = [0.5] * 9


def bad_commands(token: str, epoch: int, echo: int) -> dict[str, bytes]:
    """Messages that would move the robot if any part of them were believed, by what is wrong with them."""
    good: dict[str, Any] = {"type": "MotionCommand", "epoch": epoch, "sequence": 2**40, "echo": echo, "xi": FAST}
    good["token"] = token

    def spoilt(**changes: Any) -> bytes:
        return msgspec.msgpack.encode(good | changes)

    return {
        "NaN": spoilt(xi=[math.nan, *FAST[1:]]),
        "infinity": spoilt(xi=[math.inf, *FAST[1:]]),
        "wrong length": spoilt(xi=FAST[:8]),
        "a text": spoilt(xi=["fast", *FAST[1:]]),
        "a truth value": spoilt(xi=[True, *FAST[1:]]),
        "unknown field": spoilt(force=True),
        "old sequence": spoilt(sequence=0),
        "old epoch": spoilt(epoch=0),
        "another token": spoilt(token="guessed"),
        "an epoch of its own": spoilt(epoch=epoch + 1, token="mine"),
        "an absurd epoch": spoilt(epoch=2**62, token="mine"),
        "out of limits": spoilt(xi=[50.0, *FAST[1:]]),
        "another type": spoilt(type="TeleopTarget"),
        "not msgpack": b"\xc1 move",
        "nothing": b"",
    }


def overheard_token(session: zenoh.Session) -> str:
    """The token of the controller's own commands: who listens on the wire knows it."""
    heard: queue.Queue[bytes] = queue.Queue()
    subscriber = session.declare_subscriber(key(ROBOT_ID, MOTION.name), lambda sample: heard.put(bytes(sample.payload)))
    command = msgspec.msgpack.decode(heard.get(timeout=10))
    subscriber.undeclare()
    return str(command.get("token", ""))


@pytest.mark.long
def test_bad_commands_move_nothing_and_are_told(tmp_path: Path) -> None:
    with LiveRobot(tmp_path) as robot:
        robot.wait(lambda: robot.mode() == "IDLE", 30, "the controller")
        robot.wait(lambda: robot.state()["bridge"] and not robot.state()["bridge"]["watchdog"], 20, "setpoints")

        def reasons() -> int:
            return len(robot.state()["bridge"]["rejections"])

        config = zenoh.Config()
        config.insert_json5("mode", '"client"')
        config.insert_json5("connect/endpoints", f'["{robot.endpoint}"]')
        with zenoh.open(config) as session:
            token = overheard_token(session)
            for name in bad_commands(token, 0, 0):
                known = reasons()

                def counted(name: str = name, known: int = known) -> bool:
                    state = robot.state()
                    bad = bad_commands(token, state["bridge"]["epoch"], state["joints"]["sequence"])
                    # Again until it is seen: newest wins, so a good command close behind replaces it.
                    session.put(key(ROBOT_ID, MOTION.name), bad[name])
                    return reasons() > known

                robot.wait(counted, 5, f"{name} to be counted, with a reason of its own")
        rejections = robot.state()["bridge"]["rejections"]
        assert all(row["topic"] == MOTION.name for row in rejections)

        def told(cause: str) -> bool:
            lines = [event["text"] for event in robot.client.get("/api/events").json()["events"]]
            return any(MOTION.name in line and cause[:60] in line for line in lines)

        for row in rejections:
            cause = text_of(msgspec.convert(row["reason"], Reason))
            # Lines of the log come by another topic than the rejections.
            robot.wait(lambda cause=cause: told(cause), 5, f"the log to tell of: {cause}")
    rows = trace.read(robot.trace).rows
    assert np.abs(rows["setpoint"]).max() == 0.0
    assert np.ptp(rows["position"][:, :2], axis=0).max() < 1e-3
