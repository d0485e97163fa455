"""The whole robot in one thread: the simulator, perception and the planner beside bridge and controller."""

from collections import deque
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path

from bridge.sim.build import simulated_bridge
from bridge.sim.robot.robot import SimulatedRobot
from controller.config import ControllerConfig
from controller.core import Controller
from controller.motion.body import BaseEstimate
from controller.motion.follower import Tracking
from controller.planning.cuts import CutPlanner
from perception.config import PerceptionConfig
from perception.pipeline import Perception
from perception.segmentation.segmenter import choose_segmenter
from rolling_panda import commands as intents
from rolling_panda import messages as m
from rolling_panda.closing import Closing
from rolling_panda.config import RobotConfig, load_section
from rolling_panda.messages.perception import ON_THE_WAY, Obstacles
from rolling_panda.messages.robot import CameraFrame
from rolling_panda.messages.supervision import Person, Presence, SessionPlan
from rolling_panda.model.differential_drive import Array
from rolling_panda.model.robot import RobotModel
from rolling_panda.resources import resource
from rolling_panda.transport.inbox import Inbox, Received
from tests.support.controller_config import controller_config
from tests.support.worlds.world import RobotWorld

# A frame takes perception about this long, so its points come later by as much.
_PERCEPTION_S = 0.15
# A closer look is at a part of a frame, and comes before the rest of it. On the way to a cut it is all.
_LOOK_S, _SIGHT_S = 0.08, 0.04
# Period of perception's loop.
_PERCEPTION_PERIOD_S = 0.01


class PerceptionInTime:
    """Perception as a process whose frames take their time."""

    def __init__(self, perception: Perception) -> None:
        """Bind the pipeline."""
        self._perception = perception
        self._frame: Received[CameraFrame] | None = None
        self._made: deque[tuple[float, m.Message]] = deque()
        self._busy_until = 0.0
        self._told = perception.robot_calibration
        self._beats = 0

    def step(self, inbox: Inbox, now: float) -> list[object]:
        """Take the newest frame, and say what earlier ones have given by now."""
        frame = inbox.newest(CameraFrame)
        if frame is not None and frame is not self._frame:
            self._frame = frame
            if frame.message.point_id.startswith(ON_THE_WAY):
                self._busy_until = max(now, self._busy_until) + _SIGHT_S
                self._made.append((self._busy_until, self._perception.see_cut(frame.message)))
                return self._due(now)
            self._busy_until = now + _PERCEPTION_S
            if frame.message.point_id:
                self._made.append((now + _LOOK_S, self._perception.check_close_up(frame.message)))
            points = self._perception.process(frame.message)
            obstacles = Obstacles(header=points.header, capsules=self._perception.obstacles)
            for message in (points, obstacles, self._perception.localisation):
                self._made.append((now + _PERCEPTION_S, message))
            if (calibration := self._perception.robot_calibration) != self._told:
                self._told = calibration
                self._made.append((now + _PERCEPTION_S, calibration))
        return self._due(now)

    def _due(self, now: float) -> list[object]:
        self._beats += 1
        out: list[object] = [m.Heartbeat(process="perception", sequence=self._beats)]
        out += [message for due, message in self._made if now >= due]
        self._made = deque(each for each in self._made if now < each[0])
        return out

    def end(self) -> Sequence[object]:
        """Nothing."""
        return ()


class ClosedLoop(RobotWorld, Closing):
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
            config = controller_config(config, whole_body__method=method)
        if not looks:
            config = controller_config(config, work__pre_cut_check=False, work__post_cut_check=False)
        plan = CutPlanner(config, robot).plan if plans else None
        super().__init__(simulated_bridge(path, seed, trace), Controller(config, robot), config.rate_hz, plan, seed)
        self._drive = RobotModel(robot).drive
        self._control_ticks = round(1.0 / (config.rate_hz * self.tick_s))
        self._people: tuple[str, ...] = ()
        self._watch = watch
        seeing = load_section(path, "perception", PerceptionConfig)
        weights = Path(seeing.weights) if seeing.weights else None
        self.perception = Perception(seeing, choose_segmenter(segmenter or seeing.segmenter, weights))
        self.add("perception", PerceptionInTime(self.perception), _PERCEPTION_PERIOD_S)
        self.state: m.ControllerState | None = None
        self.session_plan: SessionPlan | None = None
        self.events: list[m.LogEvent] = []

    def tick(self) -> None:
        """Advance one tick, in which everybody is there."""
        if (self.ticks + 1) % self._control_ticks == 0:
            people = tuple(Person(name, name, "supervisor", 0.0, 0.0) for name in self._people)
            self.say(Presence(sequence=self.ticks, people=people))
            self.say(m.Heartbeat(process="server", sequence=self.ticks))
        super().tick()
        if self.ticks % self._control_ticks == 0:
            tracking = self.controller.tracking
            if self._watch is not None and tracking is not None and tracking.desired is not None:
                self._watch(self, tracking)

    def say(self, message: m.Message) -> None:
        """Send a message; the controller's state, its plan and all events are kept."""
        super().say(message)
        if isinstance(message, m.ControllerState):
            self.state = message
        elif isinstance(message, SessionPlan):
            self.session_plan = message
        elif isinstance(message, m.LogEvent):
            self.events.append(message)

    def command(self, intent: intents.Intent) -> m.Answer:
        """What an operator asks for."""
        if intent.user not in self._people:
            # Who asks is there, which the controller hears in its next period.
            self._people = (*self._people, intent.user)
            self.run(self._control_ticks * self.tick_s)
        return super().command(intent)

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
