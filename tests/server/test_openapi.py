"""The server's description of its requests is true: schemathesis tries everything with all of its checks."""

import time

import pytest
import schemathesis
from schemathesis.engine import events, from_schema

from rolling_panda import topics
from rolling_panda.messages.perception import CameraState, DrawnCut, RobotCalibration, SpurDrawing, SpurPicture
from rolling_panda.messages.robot import CameraFrame, Intrinsics
from rolling_panda.messages.supervision import (
    ControlState,
    PreviewMotion,
    PreviewState,
    ReplayState,
    SessionPlan,
    SessionReport,
    StopRecord,
    StopState,
    Timeline,
)
from rolling_panda.messages.types import PlanarPose
from tests.support.fake_wire import (
    HEADER,
    FakePublisher,
    FakeWire,
    bridge_state,
    controller_state,
    joints,
    pruning_point,
    pruning_points,
    telling,
)
from tests.support.running_server import running_server

# Warnings of hypothesis about the strategies of schemathesis: `random` in them, and large values in messages.
pytestmark = [
    pytest.mark.filterwarnings("ignore:Do not use the `random` module"),
    pytest.mark.filterwarnings("ignore:Generating overly large repr"),
]
DRAWING = SpurDrawing(
    vine=1, spur=1, image="ab" * 16, sequence=9, frame=(848, 480), window=(0, 0, 240, 180), size=(240, 180),
    cuts=(DrawnCut(point_id="p1", revision=3, position=(9.0, 8.0), axis=((9.0, 8.0, 0.0),)),),
)  # fmt: skip
FRAME = CameraFrame(
    header=HEADER, sequence=7, intrinsics=Intrinsics(64, 48, 60.0, 60.0, 31.5, 23.5), base=PlanarPose(0.0, 0.0, 0.0),
    position=joints().position, color_jpeg=b"jpeg", depth_zlib=b"", depth_unit=0.001,
)  # fmt: skip


class Latching(FakePublisher):
    def __init__(self, wire, topic):
        super().__init__(topic, wire.sent[topic.name])
        self._wire = wire

    def put(self, message):
        super().put(message)
        for process in ("bridge", "controller"):
            latched = StopRecord(message.stop_id, message.source, message.user, message.reason, 1.0)
            self._wire.deliver(topics.STOPS, StopState(process=process, stops=(latched,)))


class Answering(FakeWire):
    """A robot of which everything is known, and which latches each stop."""

    def publisher(self, topic):
        return Latching(self, topic) if topic is topics.STOP else super().publisher(topic)

    def say_all(self):
        self.deliver(topics.BRIDGE, bridge_state("s"))
        self.deliver(topics.CONTROLLER, controller_state())
        self.deliver(topics.POINTS, pruning_points(pruning_point()))
        self.deliver(topics.PICTURES, SpurPicture(drawing=DRAWING, jpeg=b"jpeg"))
        self.deliver(topics.CAMERA, FRAME)
        self.deliver(topics.CAMERA_STATE, CameraState(header=HEADER))
        self.deliver(topics.ROBOT_CALIBRATION, RobotCalibration(header=HEADER))
        self.deliver(topics.PLAN, SessionPlan(header=HEADER, state="planning"))
        self.deliver(topics.REPORT, SessionReport(began_at=1.0, written_at=2.0))
        self.deliver(topics.TIMELINE, Timeline(began_at=1.0, ended_at=2.0))
        self.deliver(topics.REPLAY, ReplayState(name="x", begins_at=1.0, duration_s=2.0, position_s=1.0, playing=False))
        self.deliver(topics.PREVIEW, PreviewState(header=HEADER, required=False, phase="ready", preview_hash="0f",
                     start=PlanarPose(0.0, 0.0, 0.0), position=joints().position))  # fmt: skip
        self.deliver(topics.PREVIEW_MOTION, PreviewMotion(header=HEADER, preview_hash="0f"))
        self.deliver(topics.CONTROL, ControlState(holder="", user="", expires_s=0.0, requested_by="",
                     requested_key="", next_user="", notice=None, notice_number=0, supervised=True))  # fmt: skip


def wrong(server, path, examples):
    """What schemathesis has against the description at `path`, and how many requests it made."""
    with server.visitor() as visitor:
        schema = schemathesis.openapi.from_dict(visitor.get(path + "/api/openapi.json").json())
    schema.config.update(base_url=server.address + path, headers={"Origin": server.address})
    schema.config.generation.update(max_examples=examples)
    (cookie,) = schema.raw_schema["components"]["securitySchemes"].values()

    @schema.auth(refresh_interval=None)
    class _Signed:
        """A session of its own for each request, as one of them signs out."""

        def get(self, case, context):
            return server.sessions.open("fuzz", "supervisor", time.monotonic()).session_id

        def set(self, case, data, context):
            case.cookies = {**(case.cookies or {}), cookie["name"]: data}

    found, made, checks = [], 0, set()
    for event in from_schema(schema).execute():
        if isinstance(event, events.NonFatalError):
            found.append(f"{event.label}: {event.value}")
        if isinstance(event, events.FatalError):
            raise event.exception
        if isinstance(event, events.ScenarioFinished):
            made += len(event.recorder.interactions)
            for case, results in event.recorder.checks.items():
                checks |= {result.name for result in results}
                request = event.recorder.interactions[case].request
                found += [
                    f"{request.method} {request.uri} {request.body!r}: {result.failure_info.failure}"
                    for result in results
                    if result.failure_info is not None
                ]
    assert checks >= {"not_a_server_error", "status_code_conformance", "response_schema_conformance", "ignored_auth"}
    assert checks >= {"negative_data_rejection", "positive_data_acceptance", "unsupported_method"}
    return found, made


@pytest.mark.long
@pytest.mark.parametrize("examples", [3, pytest.param(300, marks=pytest.mark.slow)])
def test_everything_is_answered_as_it_is_described(examples):
    wire = Answering()
    with running_server(wire) as server, telling(wire):
        wire.say_all()
        found, made = wrong(server, "", examples)
    assert not found, "\n\n".join(sorted(found)[:20])
    assert made > 50 * examples


@pytest.mark.long
def test_so_are_several_robots_and_each_description_says_where_its_robot_is():
    wires = Answering(), Answering()
    with running_server(wires[0], rp2=wires[1]) as server, telling(wires[0]), telling(wires[1]):
        for wire in wires:
            wire.say_all()
        found, _ = wrong(server, "", 4)
        with server.visitor() as visitor:
            (there,) = visitor.get("/robots/rp2/api/openapi.json").json()["servers"]
    assert not found, "\n\n".join(sorted(found)[:20])
    assert there["url"] == "/robots/rp2"
