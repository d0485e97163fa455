"""Last year's cane of a Guyot vine is taken off in physics, with perception that tells the truth."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest
from msgspec.structs import replace

from benchmarks.control import oracle
from benchmarks.control.cut_truth import true_cut, wanted_cuts
from benchmarks.control.row import sim_config
from benchmarks.control.vine import one_vine
from bridge.sim.build import simulated_bridge
from bridge.sim.robot import trace
from bridge.sim.robot.robot import SimulatedRobot
from bridge.sim.vineyard.config import VineyardConfig
from bridge.sim.world.config import CALM, WorldConfig
from controller.config import ControllerConfig
from controller.core import Controller
from controller.planning.cuts import CutPlanner
from rolling_panda import commands as intents
from rolling_panda import messages as m
from rolling_panda.config import RobotConfig, load_section
from rolling_panda.messages.perception import CloseUpResult, Obstacles, point_digest
from rolling_panda.messages.robot import CameraFrame
from rolling_panda.messages.supervision import Person, Presence
from rolling_panda.model.wire_values import vector3
from rolling_panda.transport.inbox import Inbox
from tests.support.worlds.world import RobotWorld


class Truth:
    """Perception that tells the right cuts of a Guyot vine, all wood, and in close-ups whether a cut still stands."""

    def __init__(self, robot: SimulatedRobot) -> None:
        self.robot, self.before, self._frame, self._beats = robot, robot.row, 0, 0
        search = oracle.Oracle(guyot=True)
        self.wanted = {each.kind: each for each in wanted_cuts(self.before, guyot=True) if each.cut is not None}
        self.points: dict[str, m.PruningPoint] = {}
        for kind, each in self.wanted.items():
            assert each.cut is not None
            plan, why = search.search(self.before, each, each.cut)
            assert plan is not None, why
            point = replace(
                oracle.point_of(self.before, each, each.cut, guyot=True),
                point_id=kind.replace(" ", "-"),
                position=vector3(plan.poses.cut.translation),
            )
            self.points[point.point_id] = replace(point, digest=point_digest(point))

    def step(self, inbox: Inbox, now: float) -> list[object]:
        """What it says now."""
        self._beats += 1
        out: list[object] = [m.Heartbeat(process="perception", sequence=self._beats)]
        if self._beats % 10 == 1:
            points, lines = tuple(self.points.values()), oracle.cane_lines(self.robot.row)
            header = m.Header(now, "map")
            out += [
                m.PruningPoints(header=header, segmenter="truth", frames=self._beats, points=points, canes=lines),
                Obstacles(header=header, capsules=self._obstacles()),
            ]
        frame = inbox.newest(CameraFrame)
        if frame is not None and frame.message.sequence != self._frame:
            self._frame = frame.message.sequence
            if (point := self.points.get(frame.message.point_id)) is not None:
                out.append(self._look(frame.message, point))
        return out

    def end(self) -> Sequence[object]:
        """Nothing."""
        return ()

    def stands(self, point: m.PruningPoint) -> bool:
        """Whether the wood just beyond a point is there."""
        cut = self.wanted[point.kind].cut
        assert cut is not None
        rod = self.robot.row.rods[cut.rod]
        beyond = np.array(point.position) + 0.01 * cut.tangent
        return rod is not None and float((rod.end - beyond) @ cut.tangent) > 0.0

    def _obstacles(self) -> tuple[m.Capsule, ...]:
        told = oracle.obstacles_of(self.before, guyot=True).capsules
        gone = not self.stands(self.points["removal"])
        return tuple(each for each in told if not (gone and each.kind == "cordon"))

    def _look(self, frame: CameraFrame, point: m.PruningPoint) -> CloseUpResult:
        there = self.stands(point)
        return CloseUpResult(
            header=m.Header(frame.header.stamp, "odom"),
            point_id=point.point_id,
            number=frame.number,
            finding="seen" if there else "severed",
            position=point.position if there else None,
            tangent=point.tangent if there else None,
        )


class Vine(RobotWorld):
    """A simulated robot in front of one Guyot vine. An operator is connected all the time."""

    def __init__(self, seed: int, folder: Path, world: WorldConfig) -> None:
        settings = one_vine("guyot", VineyardConfig().vine_spacing, "standard")
        path = sim_config(folder / "vine.toml", 2.0, world, settings)
        limits, config = load_section(path, "robot", RobotConfig), load_section(path, "controller", ControllerConfig)
        bridge = simulated_bridge(path, seed, folder / "trace")
        super().__init__(bridge, Controller(config, limits), config.rate_hz, CutPlanner(config, limits).plan, seed)
        assert isinstance(bridge.robot, SimulatedRobot)
        self.robot = bridge.robot
        self.truth = Truth(self.robot)
        self.add("perception", self.truth, 0.02)
        self.state: m.ControllerState | None = None

    def tick(self) -> None:
        if self.ticks % 20 == 0:
            self.say(Presence(sequence=self.ticks, people=(Person("test", "test", "supervisor", 0.0, 0.0),)))
            self.say(m.Heartbeat(process="server", sequence=self.ticks))
        super().tick()

    def say(self, message: m.Message) -> None:
        super().say(message)
        if isinstance(message, m.ControllerState):
            self.state = message

    def states(self) -> dict[str, str]:
        """State of each point."""
        return {} if self.state is None else {entry.point_id: entry.state for entry in self.state.queue}


@pytest.mark.long
def test_both_canes_are_shortened_and_last_years_cane_is_taken_off_with_all_that_grows_on_it(tmp_path: Path) -> None:
    vine = Vine(3706, tmp_path, CALM)
    points = vine.truth.points
    assert vine.run_until(lambda: len(vine.states()) == len(points) == 3, 5.0)
    for asked in (intents.Arm(user="test"), intents.AcceptAll(user="test")):
        answer = vine.command(asked)
        assert answer.ok, answer.reason
    # Until the plan is made.
    vine.run(4.0)
    answer = vine.command(intents.Start(user="test"))
    assert answer.ok, answer.reason
    assert vine.run_until(lambda: vine.controller.mode == "AUTO", 1.0)
    assert vine.run_until(lambda: vine.controller.mode != "AUTO", 60.0), vine.state
    assert vine.states() == dict.fromkeys(points, "DONE")
    vine.robot.close()
    record = trace.read(tmp_path / "trace")
    bites = [event for event in record.events if event["event"] == "cut"]
    assert sorted(bite["point_id"] for bite in bites) == sorted(points), "one bite for each cut, in whatever order"
    pieces = [piece for bite in bites for piece in bite["severed"]]
    assert all(true_cut([each], pieces).right for each in vine.truth.wanted.values())
    assert not record.rows["contacts"].any(), "the robot touches no rigid wood"
    left = [rod for _, rod in vine.robot.row.standing() if rod.vine == 0]
    assert len([rod for rod in left if rod.last_years]) == 1 and not [rod for rod in left if rod.spur > 0]
