"""The whole robot in one thread: the simulator, perception and the planner beside bridge and controller."""

from collections.abc import Callable, Iterator
from pathlib import Path

import msgspec

from bridge.core.bridge import BridgeOutputs
from bridge.sim.build import simulated_bridge
from bridge.sim.robot.robot import SimulatedRobot
from controller.config import ControllerConfig
from controller.core import Controller
from controller.motion.base_estimate import BaseEstimate
from controller.motion.follower import Tracking
from controller.planning.cuts import CutPlanner
from controller.planning.work_plan import PlanRequest, WorkPlan
from perception.config import PerceptionConfig
from perception.pipeline import Perception
from perception.segmentation.segmenter import choose_segmenter
from rolling_panda import commands as intents
from rolling_panda import messages as m
from rolling_panda.closing import Closing
from rolling_panda.config import RobotConfig, load_section
from rolling_panda.messages.perception import CloseUpResult, Obstacles
from rolling_panda.messages.supervision import Person, Presence
from rolling_panda.model.differential_drive import Array
from rolling_panda.model.robot import RobotModel
from rolling_panda.resources import resource
from tests.support.sent import every, newest
from tests.support.worlds.world import World

# A frame takes perception about this long, so its points come later by as much.
_PERCEPTION_S = 0.15
# A closer look is at a part of a frame, and comes before the rest of it.
_LOOK_S = 0.08
# A plan of some points takes about this long.
_PLANNING_S = 1.0
_BEATING: tuple[m.Process, ...] = ("server", "perception")


class ClosedLoop(World, Closing):
    """A simulated robot with an operator who is always present. `now` is simulated time (s)."""

    def __init__(
        self,
        seed: int,
        trace: Path | None = None,
        config_path: Path | None = None,
        method: str | None = None,
        watch: Callable[["ClosedLoop", Tracking], None] | None = None,
        plans: bool = True,
        looks: bool = True,
        segmenter: str = "",
    ) -> None:
        """Grow the row and stand the robot beside it.

        Args:
            seed: Of the row and of the camera's noise.
            trace: File for the record of what was actuated.
            config_path: TOML configuration; None takes the simulation's.
            method: Whole-body method; None takes the configured one.
            plans: False leaves the session's plan away.
            looks: False cuts without a closer look before, and takes the cutter's word afterwards.
            segmenter: Name of the segmenter; empty takes the configured one.
            watch: Called after each control period in which the tool follows a trajectory.
        """
        path = config_path or resource("assets/config/sim.toml")
        robot = load_section(path, "robot", RobotConfig)
        config = load_section(path, "controller", ControllerConfig)
        if method is not None:
            config = msgspec.structs.replace(config, method=method)
        if not looks:
            config = msgspec.structs.replace(config, pre_cut_check=False, post_cut_check=False)
        super().__init__(simulated_bridge(path, seed, trace), Controller(config, robot), config.rate_hz)
        self._drive = RobotModel(robot).drive
        self._control_hz = config.rate_hz
        self._people: tuple[str, ...] = ()
        self._watch = watch
        self._planner = CutPlanner(config, robot) if plans else None
        self._planned: tuple[float, WorkPlan] | None = None
        seeing = load_section(path, "perception", PerceptionConfig)
        weights = Path(seeing.weights) if seeing.weights else None
        self.perception = Perception(seeing, choose_segmenter(segmenter or seeing.segmenter, weights))
        self.state: m.ControllerState | None = None
        self.events: list[m.LogEvent] = []
        self._looked: tuple[float, CloseUpResult] | None = None
        self._seen: tuple[float, m.PruningPoints] | None = None

    def control(self) -> None:
        """One control period, for which everybody is there."""
        people = tuple(Person(name, name, "supervisor", 0.0, 0.0) for name in self._people)
        beats = (m.Heartbeat(process=process, sequence=self.ticks) for process in _BEATING)
        self.hear(Presence(sequence=self.ticks, people=people), *beats)
        super().control()
        tracking = self.controller.tracking
        if self._watch is not None and tracking is not None and tracking.desired is not None:
            self._watch(self, tracking)

    def ask(self, intent: intents.Intent) -> m.Answer:
        """What an operator asks for, answered at once."""
        if intent.user not in self._people:
            # Who asks is there, which the controller hears in its next period.
            self._people = (*self._people, intent.user)
            self.run(1.0 / self._control_hz)
        return self.controller.answer(intent, self.now)

    def queue(self, *states: m.PointState) -> Iterator[m.QueueEntry]:
        """Entries of the queue in these states, in the order of work; all without states."""
        entries = () if self.state is None else self.state.queue
        return (entry for entry in entries if not states or entry.state in states)

    def true_tool(self) -> Array:
        """Where the simulated tool really is (3, m, world): ground truth, for judging alone."""
        robot = self.bridge.robot
        assert isinstance(robot, SimulatedRobot)
        position: Array = robot.true_tool()[:3, 3]
        return position

    def configuration(self) -> Array:
        """Configuration (12) as measured now; needs a joint state and an odometry."""
        joints, odometry = self.inbox.newest(m.JointState), self.inbox.newest(m.Odometry)
        assert joints is not None and odometry is not None
        return BaseEstimate(self._drive).configuration(joints.message, odometry.message)

    def close(self) -> None:
        """Close the trace."""
        self.bridge.robot.close()

    def receive(self, outputs: BridgeOutputs) -> None:
        """What the bridge sends, and what perception makes of its pictures."""
        super().receive(outputs)
        if outputs.frame is not None and outputs.frame.point_id:
            self._looked = self.now + _LOOK_S, self.perception.check_close_up(outputs.frame)
        if self._looked is not None and self.now >= self._looked[0]:
            self.hear(self._looked[1])
            self._looked = None
        if outputs.frame is not None:
            self._seen = self.now + _PERCEPTION_S, self.perception.process(outputs.frame)
        if self._seen is not None and self.now >= self._seen[0]:
            points = self._seen[1]
            obstacles = Obstacles(header=points.header, capsules=self.perception.obstacles)
            self.hear(points, obstacles)
            self._seen = None
        self.events.extend(outputs.events)

    def send(self, out: list[object]) -> None:
        """What the controller sends, and what the planner answers."""
        super().send(out)
        self.state = newest(out, m.ControllerState) or self.state
        request = newest(out, PlanRequest)
        if request is not None and self._planner is not None:
            self._planned = self.now + _PLANNING_S, self._planner.plan(request)
        if self._planned is not None and self.now >= self._planned[0]:
            self.hear(self._planned[1])
            self._planned = None
        self.events += every(out, m.LogEvent)
