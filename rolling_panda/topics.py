"""The one table of what is on the wire: publishers, subscribers, staleness and `docs/wire.md` derive from it.

A key is `rp/<robot_id>/v1/<topic>`.
"""

from dataclasses import dataclass
from typing import Any, Generic, Literal, TypeVar

from msgspec import Struct

from rolling_panda import (
    camera_messages,
    control_messages,
    crop_messages,
    intents,
    look_messages,
    plan_messages,
    plant_requests,
    preview_messages,
    replay_messages,
    report_messages,
    row_messages,
    teleop_messages,
)
from rolling_panda import messages as m

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
    rate_hz: float
    priority: Priority
    congestion: Congestion
    about: str
    express: bool = False
    latched: bool = False

    def said_by(self, process: m.Process) -> bool:
        """Whether this process may publish it."""
        return self.sender == "any" or process in self.sender.split(", ")


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
    "command/motion", m.MotionCommand, "controller", 100, "REAL_TIME", "DROP",
    "velocity of every actuator, newest wins", express=True,
)
CUT = Topic(
    "command/cut", m.CutCommand, "controller", 0, "REAL_TIME", "BLOCK",
    "close the blades once, repeated until seen", express=True,
)
PICTURE = Topic(
    "command/picture", look_messages.PictureRequest, "controller", 0, "REAL_TIME", "DROP",
    "take a picture of a point now, repeated until taken", express=True,
)
STOP = Topic(
    "command/stop", m.StopRequest, "any", 0, "REAL_TIME", "BLOCK",
    "software stop, sent several times", express=True,
)
TELEOP = Topic(
    "operator/teleop", teleop_messages.TeleopTarget, "server", 30, "REAL_TIME", "DROP",
    "where the held gizmo is", express=True,
)
JOINTS = Topic(
    "state/joints", m.JointState, "bridge", 100, "INTERACTIVE_HIGH", "DROP",
    "measured wheels and arm", express=True,
)
ODOMETRY = Topic(
    "state/odometry", m.Odometry, "bridge", 50, "INTERACTIVE_HIGH", "DROP",
    "base pose and twist from the wheels", express=True,
)
BRIDGE = Topic(
    "state/bridge", m.BridgeState, "bridge", 20, "INTERACTIVE_HIGH", "DROP",
    "latch, watchdog, cutter, refusals",
)
CONTROLLER = Topic(
    "state/controller", m.ControllerState, "controller", 20, "INTERACTIVE_HIGH", "DROP",
    "mode, queue, tracking",
)
PRESENCE = Topic(
    "operator/presence", control_messages.Presence, "server", 5, "REAL_TIME", "DROP",
    "who is there; it renews the lease", express=True,
)
CONTROL = Topic(
    "state/control", control_messages.ControlState, "controller", 20, "INTERACTIVE_HIGH", "DROP",
    "who holds control of the robot's motion",
)
STOPS = Topic(
    "state/stops", control_messages.StopState, "bridge, controller", 2, "INTERACTIVE_HIGH", "DROP",
    "stops latched by the bridge and by the controller, at once when they change", latched=True,
)
HARDWARE_STOP = Topic(
    "simulation/hardware-stop", control_messages.HardwareStop, "any", 0, "INTERACTIVE_HIGH", "BLOCK",
    "the emergency stop button of the simulated robot",
)
PLAN = Topic(
    "controller/plan", plan_messages.SessionPlan, "controller", 0.2, "DATA_LOW", "DROP",
    "the session's plan, at once when it changes", latched=True,
)
PREVIEW = Topic(
    "controller/preview", preview_messages.PreviewState, "controller", 2, "DATA_LOW", "DROP",
    "whether there is a preview of the work, and who has approved it, at once when it changes", latched=True,
)
PREVIEW_MOTION = Topic(
    "controller/preview-motion", preview_messages.PreviewMotion, "controller", 0.2, "DATA_LOW", "DROP",
    "the motion of the preview, at once when it is made", latched=True,
)
REPORT = Topic(
    "controller/report", report_messages.SessionReport, "controller", 0.2, "BACKGROUND", "DROP",
    "what was cut, refused and who held control since the controller started", latched=True,
)
HEARTBEAT = Topic(
    "heartbeat", m.Heartbeat, "any", 20, "INTERACTIVE_HIGH", "DROP",
    "a process's loop is turning",
)
EVENT = Topic(
    "event", m.LogEvent, "any", 0, "DATA_LOW", "BLOCK",
    "what happened, and why something was refused",
)
CAMERA = Topic(
    "camera/frame", camera_messages.CameraFrame, "bridge", 2, "DATA_LOW", "DROP",
    "RGB-D frame with the posture it was taken in",
)
POINTS = Topic(
    "perception/points", m.PruningPoints, "perception", 2, "DATA_LOW", "DROP",
    "every pruning point held true now", latched=True,
)
CROPS = Topic(
    "perception/crops", crop_messages.PointCrop, "perception", 2, "BACKGROUND", "DROP",
    "a point's picture, at once when it is new, then one after the other", latched=True,
)
LOOK = Topic(
    "perception/look", look_messages.CloseLook, "perception", 0, "INTERACTIVE_HIGH", "DROP",
    "what a picture that was asked for shows of its point", express=True,
)
OBSTACLES = Topic(
    "perception/obstacles", row_messages.Obstacles, "perception", 1, "DATA_LOW", "DROP",
    "posts, trunks, cordons and wires seen so far", latched=True,
)
SCENERY = Topic(
    "scenery", row_messages.Scenery, "bridge", 0.5, "BACKGROUND", "DROP",
    "the simulated row, for display only", latched=True,
)
REPLAY = Topic(
    "replay/state", replay_messages.ReplayState, "controller", 10, "INTERACTIVE_HIGH", "DROP",
    "a recording is played in the robot's place", latched=True,
)

TOPICS: tuple[Topic[Any], ...] = (
    MOTION, CUT, PICTURE, STOP, TELEOP, JOINTS, ODOMETRY, BRIDGE, CONTROLLER, PLAN, REPORT, HEARTBEAT, EVENT, CAMERA,
    PREVIEW, PREVIEW_MOTION, POINTS, CROPS, LOOK, OBSTACLES, SCENERY, PRESENCE, CONTROL, STOPS, HARDWARE_STOP,
    REPLAY,
)


INTENT: Service[intents.Intent] = Service(
    "service/intent",
    (
        intents.Arm, intents.AcceptPoint, intents.RejectPoint, intents.ReconsiderPoint, intents.ResolvePoint,
        intents.AcceptAll, intents.MoveInQueue, intents.PlannersOrder, intents.TurnApproach,
        intents.AskPreview, intents.ApprovePreview, intents.RequirePreview, intents.Start, intents.Survey,
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
    (plant_requests.SetRule, plant_requests.AddPoint, plant_requests.AddPointInImage, plant_requests.MovePoint),
    "perception", 2.0, "another pruning rule, or a point by hand, or moved by hand",
)
SEEK: Service[replay_messages.SeekReplay] = Service(
    "service/seek", (replay_messages.SeekReplay,), "controller", 1.0, "another place in the recording that is played",
)
SERVICES: tuple[Service[Any], ...] = (INTENT, RELEASE, PLANT, SEEK)
# fmt: on


def key(robot_id: str, name: str) -> str:
    """Zenoh key of a topic, service or liveliness token of one robot."""
    return f"rp/{robot_id}/v{m.SCHEMA_VERSION}/{name}"
