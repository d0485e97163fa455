"""The topic table. Publishers, subscribers, access control and `docs/wire.md` derive from it.

A key is `rp/<robot_id>/v3/<topic>`.
"""

from dataclasses import dataclass
from typing import Any, Generic, Literal, TypeVar

from msgspec import Struct

from rolling_panda import commands
from rolling_panda import messages as m
from rolling_panda.messages import perception, robot, supervision

#: The default robot id.
ROBOT_ID = "rp1"

Priority = Literal["REAL_TIME", "INTERACTIVE_HIGH", "DATA_LOW", "BACKGROUND"]
Congestion = Literal["DROP", "BLOCK"]
Msg = TypeVar("Msg", bound=m.Message)
Req = TypeVar("Req", bound=Struct)


@dataclass(frozen=True)
class Topic(Generic[Msg]):
    """A topic: message type, sender, readers, rate and transport options.

    Attributes:
        name: Last part of the key.
        message: The only type accepted on it.
        sender: Publishing processes, separated by commas, or "any".
        readers: Processes and other programs that receive it. A recorder receives every topic.
        rate_hz: Nominal rate; 0 = on event.
        priority: Zenoh priority.
        congestion: Zenoh congestion control: whether a message is dropped or blocks when the connection is full.
        express: Sent at once, never batched.
        latched: The sender repeats the newest message at `rate_hz`, so that late joiners get it.
        queue: Messages that a reader's inbox keeps in order; 0 = the newest only.
        wakes: A message wakes its reader's loop at once.
        ordered: A message with an older stamp, which arrives late, is dropped.
        about: Description for the documentation.
    """

    name: str
    message: type[Msg]
    sender: str
    readers: str
    rate_hz: float
    priority: Priority
    congestion: Congestion
    about: str
    express: bool = False
    latched: bool = False
    queue: int = 0
    wakes: bool = False
    ordered: bool = False

    def said_by(self, process: m.Process) -> bool:
        """Whether this process may publish it."""
        return self.sender == "any" or process in self.sender.split(", ")

    def read_by(self, name: str) -> bool:
        """Whether this process or program receives it."""
        return name == "recorder" or name in self.readers.split(", ")


@dataclass(frozen=True)
class Service(Generic[Req]):
    """A request-reply service; the reply is always `Answer`.

    Attributes:
        name: Last part of the key.
        requests: The accepted types, distinguished by their tag.
        server: Process that answers.
        timeout_s: Time limit for the reply, at the caller.
        about: Description for the documentation.
    """

    name: str
    requests: tuple[type[Req], ...]
    server: str
    timeout_s: float
    about: str


# fmt: off
MOTION = Topic(
    "command/motion", m.MotionCommand, "controller", "bridge", 100, "REAL_TIME", "DROP",
    "velocity of every actuator; newest wins", express=True, wakes=True,
)
TOKEN = Topic(
    "command/token", m.TokenRequest, "controller", "bridge", 5, "REAL_TIME", "DROP",
    "request for the fencing token, repeated while the controller wants to command the robot", express=True, queue=32,
)
CUT = Topic(
    "command/cut", m.CutCommand, "controller", "bridge", 0, "REAL_TIME", "BLOCK",
    "close the blades once; repeated until the bridge reports it", express=True, queue=32,
)
CLOSE_UP_REQUEST = Topic(
    "command/close-up", perception.CloseUpRequest, "controller", "bridge", 0, "REAL_TIME", "DROP",
    "take a close-up of a point now; repeated until it was taken", express=True, queue=8,
)
STOP = Topic(
    "command/stop", m.StopRequest, "any", "bridge, controller", 0, "REAL_TIME", "BLOCK",
    "software stop; sent several times", express=True, queue=32,
)
TELEOP = Topic(
    "operator/teleop", supervision.TeleopTarget, "server", "controller", 30, "REAL_TIME", "DROP",
    "target of motion by hand while the operator holds", express=True,
)
JOINTS = Topic(
    "state/joints", m.JointState, "bridge", "controller, server", 100, "INTERACTIVE_HIGH", "DROP",
    "measured position and velocity of wheels and arm joints", express=True, ordered=True,
)
ODOMETRY = Topic(
    "state/odometry", m.Odometry, "bridge", "controller, server", 50, "INTERACTIVE_HIGH", "DROP",
    "base pose in odom and twist, from the wheels", express=True, ordered=True,
)
BRIDGE = Topic(
    "state/bridge", m.BridgeState, "bridge", "controller, server, onlooker", 20, "INTERACTIVE_HIGH", "DROP",
    "stop latch, watchdog, cutter, refused messages", ordered=True,
)
CONTROLLER = Topic(
    "state/controller", m.ControllerState, "controller", "server, onlooker", 20, "INTERACTIVE_HIGH", "DROP",
    "mode, queue, tracking error",
)
PRESENCE = Topic(
    "operator/presence", supervision.Presence, "server", "controller", 5, "REAL_TIME", "DROP",
    "people whose page or script is heard; renews the lease", express=True,
)
CONTROL = Topic(
    "state/control", supervision.ControlState, "controller", "server", 20, "INTERACTIVE_HIGH", "DROP",
    "holder of control of the robot's motion",
)
STOPS = Topic(
    "state/stops", supervision.StopState, "bridge, controller", "server", 2, "INTERACTIVE_HIGH", "DROP",
    "stops latched by bridge and controller; also at once on change", latched=True,
)
HARDWARE_STOP = Topic(
    "simulation/hardware-stop", supervision.HardwareStop, "any", "bridge, devices", 0, "INTERACTIVE_HIGH", "BLOCK",
    "emergency stop button of the simulated robot", queue=8,
)
PLAN = Topic(
    "controller/plan", supervision.SessionPlan, "controller", "server", 0.2, "DATA_LOW", "DROP",
    "plan of the work; also at once on change", latched=True,
)
PREVIEW = Topic(
    "controller/preview", supervision.PreviewState, "controller", "server", 2, "DATA_LOW", "DROP",
    "state and approval of the preview; also at once on change",
)
PREVIEW_MOTION = Topic(
    "controller/preview-motion", supervision.PreviewMotion, "controller", "server", 0.2, "DATA_LOW", "DROP",
    "motion of the preview; also at once on change",
)
REPORT = Topic(
    "controller/report", supervision.SessionReport, "controller", "server", 0.2, "BACKGROUND", "DROP",
    "cuts, refusals and changes of control since the controller started", latched=True,
)
TIMELINE = Topic(
    "controller/timeline", supervision.Timeline, "controller", "server", 0.2, "BACKGROUND", "DROP",
    "changes of mode, cuts and refusals since the controller started, or of a whole recording", latched=True,
)
PROGRAM = Topic(
    "program", m.Program, "any", "server", 0.2, "BACKGROUND", "DROP",
    "version and start of a process", latched=True,
)
HEARTBEAT = Topic(
    "heartbeat", m.Heartbeat, "any", "controller, server, onlooker", 20, "INTERACTIVE_HIGH", "DROP",
    "the loop of a process runs", queue=64,
)
EVENT = Topic(
    "event", m.LogEvent, "any", "controller, server", 0, "DATA_LOW", "BLOCK",
    "log line: an event, or a refusal with its reason", queue=1000,
)
CAMERA = Topic(
    "camera/frame", robot.CameraFrame, "bridge", "perception, server", 2, "DATA_LOW", "DROP",
    "RGB-D frame with the measured posture at exposure",
)
POINTS = Topic(
    "perception/points", m.PruningPoints, "perception", "controller, server", 2, "DATA_LOW", "DROP",
    "all current pruning points", latched=True,
)
PICTURES = Topic(
    "perception/pictures", perception.SpurPicture, "perception", "server", 2, "BACKGROUND", "DROP",
    "picture of a spur with the cuts drawn on it: at once when new, then one after the other",
)
CLOSE_UP = Topic(
    "perception/close-up", perception.CloseUpResult, "perception", "controller", 0, "INTERACTIVE_HIGH", "DROP",
    "result of a close-up", express=True,
)
CUT_SIGHT = Topic(
    "perception/cut-sight", perception.CutSight, "perception", "controller", 0, "INTERACTIVE_HIGH", "DROP",
    "where the cut is, on the last way to it", express=True,
)
OBSTACLES = Topic(
    "perception/obstacles", perception.Obstacles, "perception", "controller, server", 1, "DATA_LOW", "DROP",
    "posts, trunks, cordons, wires and retained canes seen so far",
)
CAMERA_STATE = Topic(
    "perception/camera", perception.CameraState, "perception", "server", 0.5, "DATA_LOW", "DROP",
    "calibration of the camera, and the monitor's estimate of its error; also at once on change", latched=True,
)
LOCALISATION = Topic(
    "perception/localisation", perception.Localisation, "perception", "controller, server", 1, "DATA_LOW", "DROP",
    "odom in map with its covariance, and whether the robot is lost; also at once on change", latched=True,
)
ROBOT_CALIBRATION = Topic(
    "perception/calibration", perception.RobotCalibration, "perception", "controller, server", 0.5, "DATA_LOW", "DROP",
    "what pictures of the board tell of the base; also at once on change", latched=True,
)
SCENERY = Topic(
    "scenery", perception.Scenery, "bridge", "server", 0.5, "BACKGROUND", "DROP",
    "the simulated row; for display only", latched=True,
)
SCENERY_MOTION = Topic(
    "scenery/motion", perception.SceneryMotion, "bridge", "server", 5, "BACKGROUND", "DROP",
    "simulated canes near the tool, as wind and arm displace them; when they have moved, for display only",
)
REPLAY = Topic(
    "replay/state", supervision.ReplayState, "controller", "server", 10, "INTERACTIVE_HIGH", "DROP",
    "position in the recording that is replayed", latched=True,
)

TOPICS: tuple[Topic[Any], ...] = (
    MOTION, TOKEN, CUT, CLOSE_UP_REQUEST, STOP, TELEOP, JOINTS, ODOMETRY, BRIDGE, CONTROLLER, PLAN, REPORT, TIMELINE,
    PROGRAM, HEARTBEAT, EVENT, CAMERA, PREVIEW, PREVIEW_MOTION, POINTS, PICTURES, CLOSE_UP, CUT_SIGHT, OBSTACLES,
    CAMERA_STATE, LOCALISATION, ROBOT_CALIBRATION, SCENERY, SCENERY_MOTION, PRESENCE, CONTROL, STOPS, HARDWARE_STOP,
    REPLAY,
)
#: The topic of each type of message.
TOPIC_OF: dict[type[Any], Topic[Any]] = {topic.message: topic for topic in TOPICS}


INTENT: Service[commands.Intent] = Service(
    "service/intent", commands.INTENTS,
    "controller", 1.0, "command of an operator",
)
RELEASE: Service[m.ReleaseStop] = Service(
    "service/release", (m.ReleaseStop,), "bridge", 0.5, "release a latched stop",
)
PLANT: Service[commands.PlantRequest] = Service(
    "service/plant",
    (
        commands.SetRule, commands.EvaluateRule, commands.UndoRule, commands.AddPoint,
        commands.AddPointInImage, commands.MovePoint, commands.LeaveSite, commands.UseCamera,
    ),
    "perception", 2.0, "pruning rules, points by hand, places that are left, and the calibration of the camera",
)
CALIBRATION: Service[m.UseCalibration] = Service(
    "service/calibration", (m.UseCalibration,), "bridge", 0.5, "use a calibration of the robot",
)
SEEK: Service[commands.SeekReplay] = Service(
    "service/seek", (commands.SeekReplay,), "controller", 1.0, "jump in, play or pause the recording, or set its speed",
)
SERVICES: tuple[Service[Any], ...] = (INTENT, RELEASE, PLANT, CALIBRATION, SEEK)
# fmt: on


def key(robot_id: str, name: str) -> str:
    """Zenoh key of a topic, service or liveliness token of one robot."""
    return f"rp/{robot_id}/v{m.SCHEMA_VERSION}/{name}"
