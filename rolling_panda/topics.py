"""The one table of what is on the wire: publishers, subscribers, staleness and `docs/wire.md` derive from it.

A key is `rp/<robot_id>/v2/<topic>`.
"""

from dataclasses import dataclass
from typing import Any, Generic, Literal, TypeVar

from msgspec import Struct

from rolling_panda import messages as m
from rolling_panda.messages import commands as commands_messages
from rolling_panda.messages import commands as intents
from rolling_panda.messages import commands as plant_requests
from rolling_panda.messages import perception as close_up_messages
from rolling_panda.messages import perception as crop_messages
from rolling_panda.messages import perception as row_messages
from rolling_panda.messages import robot as camera_messages
from rolling_panda.messages import supervision as control_messages
from rolling_panda.messages import supervision as plan_messages
from rolling_panda.messages import supervision as preview_messages
from rolling_panda.messages import supervision as report_messages
from rolling_panda.messages import supervision as supervision_messages
from rolling_panda.messages import supervision as teleop_messages

#: A robot that nobody has named otherwise.
ROBOT_ID = "rp1"

Priority = Literal["REAL_TIME", "INTERACTIVE_HIGH", "DATA_LOW", "BACKGROUND"]
Congestion = Literal["DROP", "BLOCK"]
Msg = TypeVar("Msg", bound=m.Message)
Req = TypeVar("Req", bound=Struct)


@dataclass(frozen=True)
class Topic(Generic[Msg]):
    """One row: what is published where, how often, and how it is carried.

    Attributes:
        name: Last part of the key.
        message: The only type accepted on it.
        sender: Process that publishes, several with commas between, or "any".
        readers: Processes and other programs that it is carried to. A recorder is sent every topic.
        rate_hz: Nominal rate; 0 = when something happens.
        priority: Zenoh priority.
        congestion: What happens to a message when the wire is full.
        express: Sent at once, never batched.
        latched: The sender repeats the newest one at `rate_hz`, so that late joiners get it.
        about: One line for people.
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

    def said_by(self, process: m.Process) -> bool:
        """Whether this process may publish it."""
        return self.sender == "any" or process in self.sender.split(", ")

    def read_by(self, name: str) -> bool:
        """Whether it is carried to this process or program."""
        return name == "recorder" or name in self.readers.split(", ")


@dataclass(frozen=True)
class Service(Generic[Req]):
    """One row of the request table; the reply is always `Answer`.

    Attributes:
        name: Last part of the key.
        requests: The types accepted, told apart by their tag.
        server: Process that answers.
        timeout_s: How long a caller waits.
        about: One line for people.
    """

    name: str
    requests: tuple[type[Req], ...]
    server: str
    timeout_s: float
    about: str


# fmt: off
MOTION = Topic(
    "command/motion", m.MotionCommand, "controller", "bridge", 100, "REAL_TIME", "DROP",
    "velocity of every actuator, newest wins", express=True,
)
TOKEN = Topic(
    "command/token", m.TokenRequest, "controller", "bridge", 5, "REAL_TIME", "DROP",
    "who wants to command the robot, repeated for as long as it does", express=True,
)
CUT = Topic(
    "command/cut", m.CutCommand, "controller", "bridge", 0, "REAL_TIME", "BLOCK",
    "close the blades once, repeated until seen", express=True,
)
CLOSE_UP_REQUEST = Topic(
    "command/close-up", close_up_messages.CloseUpRequest, "controller", "bridge", 0, "REAL_TIME", "DROP",
    "take a close-up of a point now, repeated until taken", express=True,
)
STOP = Topic(
    "command/stop", m.StopRequest, "any", "bridge, controller", 0, "REAL_TIME", "BLOCK",
    "software stop, sent several times", express=True,
)
TELEOP = Topic(
    "operator/teleop", teleop_messages.TeleopTarget, "server", "controller", 30, "REAL_TIME", "DROP",
    "where the held gizmo is", express=True,
)
JOINTS = Topic(
    "state/joints", m.JointState, "bridge", "controller, server", 100, "INTERACTIVE_HIGH", "DROP",
    "measured wheels and arm", express=True,
)
ODOMETRY = Topic(
    "state/odometry", m.Odometry, "bridge", "controller, server", 50, "INTERACTIVE_HIGH", "DROP",
    "base pose and twist from the wheels", express=True,
)
BRIDGE = Topic(
    "state/bridge", m.BridgeState, "bridge", "controller, server, onlooker", 20, "INTERACTIVE_HIGH", "DROP",
    "latch, watchdog, cutter, refusals",
)
CONTROLLER = Topic(
    "state/controller", m.ControllerState, "controller", "bridge, server, onlooker", 20, "INTERACTIVE_HIGH", "DROP",
    "mode, queue, tracking",
)
PRESENCE = Topic(
    "operator/presence", control_messages.Presence, "server", "controller", 5, "REAL_TIME", "DROP",
    "who is there; it renews the lease", express=True,
)
CONTROL = Topic(
    "state/control", control_messages.ControlState, "controller", "server", 20, "INTERACTIVE_HIGH", "DROP",
    "who holds control of the robot's motion",
)
STOPS = Topic(
    "state/stops", control_messages.StopState, "bridge, controller", "server", 2, "INTERACTIVE_HIGH", "DROP",
    "stops latched by the bridge and by the controller, at once when they change", latched=True,
)
HARDWARE_STOP = Topic(
    "simulation/hardware-stop", control_messages.HardwareStop, "any", "bridge, devices", 0, "INTERACTIVE_HIGH", "BLOCK",
    "the emergency stop button of the simulated robot",
)
PLAN = Topic(
    "controller/plan", plan_messages.SessionPlan, "controller", "server", 0.2, "DATA_LOW", "DROP",
    "the session's plan, at once when it changes", latched=True,
)
PREVIEW = Topic(
    "controller/preview", preview_messages.PreviewState, "controller", "server", 2, "DATA_LOW", "DROP",
    "whether there is a preview of the work, and who has approved it, at once when it changes", latched=True,
)
PREVIEW_MOTION = Topic(
    "controller/preview-motion", preview_messages.PreviewMotion, "controller", "server", 0.2, "DATA_LOW", "DROP",
    "the motion of the preview, at once when it is made", latched=True,
)
REPORT = Topic(
    "controller/report", report_messages.SessionReport, "controller", "server", 0.2, "BACKGROUND", "DROP",
    "what was cut, refused and who held control since the controller started", latched=True,
)
HEARTBEAT = Topic(
    "heartbeat", m.Heartbeat, "any", "controller, server, onlooker", 20, "INTERACTIVE_HIGH", "DROP",
    "a process's loop is turning",
)
EVENT = Topic(
    "event", m.LogEvent, "any", "controller, server", 0, "DATA_LOW", "BLOCK",
    "what happened, and why something was refused",
)
CAMERA = Topic(
    "camera/frame", camera_messages.CameraFrame, "bridge", "perception, server", 2, "DATA_LOW", "DROP",
    "RGB-D frame with the posture it was taken in",
)
POINTS = Topic(
    "perception/points", m.PruningPoints, "perception", "controller, server", 2, "DATA_LOW", "DROP",
    "every pruning point held true now", latched=True,
)
CROPS = Topic(
    "perception/crops", crop_messages.PointCrop, "perception", "server", 2, "BACKGROUND", "DROP",
    "a point's picture, at once when it is new, then one after the other", latched=True,
)
CLOSE_UP = Topic(
    "perception/close-up", close_up_messages.CloseUpResult, "perception", "controller", 0, "INTERACTIVE_HIGH", "DROP",
    "what a close-up shows of its point", express=True,
)
OBSTACLES = Topic(
    "perception/obstacles", row_messages.Obstacles, "perception", "controller, server", 1, "DATA_LOW", "DROP",
    "posts, trunks, cordons and wires seen so far", latched=True,
)
SCENERY = Topic(
    "scenery", row_messages.Scenery, "bridge", "server", 0.5, "BACKGROUND", "DROP",
    "the simulated row, for display only", latched=True,
)
REPLAY = Topic(
    "replay/state", supervision_messages.ReplayState, "controller", "server", 10, "INTERACTIVE_HIGH", "DROP",
    "a recording is played in the robot's place", latched=True,
)

TOPICS: tuple[Topic[Any], ...] = (
    MOTION, TOKEN, CUT, CLOSE_UP_REQUEST, STOP, TELEOP, JOINTS, ODOMETRY, BRIDGE, CONTROLLER, PLAN, REPORT, HEARTBEAT,
    EVENT, CAMERA, PREVIEW, PREVIEW_MOTION, POINTS, CROPS, CLOSE_UP, OBSTACLES, SCENERY, PRESENCE, CONTROL, STOPS,
    HARDWARE_STOP, REPLAY,
)


INTENT: Service[intents.Intent] = Service(
    "service/intent",
    (
        intents.Arm, intents.AcceptPoint, intents.RejectPoint, intents.ReconsiderPoint,
        intents.RestoreAccepted, intents.ResolvePoint,
        intents.AcceptAll, intents.MoveInQueue, intents.ResetOrder, intents.SetApproach,
        intents.RequestPreview, intents.ApprovePreview, intents.RequirePreview, intents.Start, intents.Survey,
        intents.Pause, intents.Resume, intents.Home, intents.Acknowledge, intents.Reset, intents.TakeControl,
        intents.RequestControl, intents.GrantControl, intents.ReturnControl,
    ),
    "controller", 1.0, "what an operator asks for",
)
RELEASE: Service[m.ReleaseStop] = Service(
    "service/release", (m.ReleaseStop,), "bridge", 0.5, "release a latched stop",
)
PLANT: Service[plant_requests.PlantRequest] = Service(
    "service/plant",
    (
        plant_requests.SetRule, plant_requests.EvaluateRule, plant_requests.UndoRule, plant_requests.AddPoint,
        plant_requests.AddPointInImage, plant_requests.MovePoint,
    ),
    "perception", 2.0, "another pruning rule, what one would change, or a point by hand, or moved by hand",
)
SEEK: Service[commands_messages.SeekReplay] = Service(
    "service/seek", (commands_messages.SeekReplay,), "controller", 1.0, "another place in the recording that is played",
)
SERVICES: tuple[Service[Any], ...] = (INTENT, RELEASE, PLANT, SEEK)
# fmt: on


def key(robot_id: str, name: str) -> str:
    """Zenoh key of a topic, service or liveliness token of one robot."""
    return f"rp/{robot_id}/v{m.SCHEMA_VERSION}/{name}"
