import threading
import time
from types import SimpleNamespace

import msgspec
import pytest

from perception.config import PerceptionConfig
from perception.localisation.row_frame import RowFrame
from perception.loop import PerceptionProcess, Worker
from perception.segmentation.frame import CorruptFrameError
from rolling_panda import messages as m
from rolling_panda import reasons
from rolling_panda.commands import SetRule
from rolling_panda.errors import RollingPandaError
from rolling_panda.messages.perception import (
    ON_THE_WAY,
    CameraState,
    Capsule,
    CloseUpResult,
    CutSight,
    RobotCalibration,
    SpurDrawing,
    SpurPicture,
)
from rolling_panda.messages.robot import CameraFrame, Intrinsics
from rolling_panda.reasons import severity_of
from rolling_panda.topics import (
    CAMERA,
    CAMERA_STATE,
    CLOSE_UP,
    CUT_SIGHT,
    EVENT,
    HEARTBEAT,
    LOCALISATION,
    OBSTACLES,
    PICTURES,
    PLANT,
    POINTS,
    ROBOT_CALIBRATION,
)
from rolling_panda.transport.runner import Runner
from tests.support.fake_wire import FakeWire
from tests.support.points import point

pytestmark = pytest.mark.processes


def frame(what, point_id=""):
    """A frame that says what is to become of it."""
    lens = Intrinsics(4, 4, 1.0, 1.0, 2.0, 2.0)
    return CameraFrame(
        header=m.Header(0.0, what), sequence=1, intrinsics=lens, base=m.PlanarPose(), position=(0.0,) * 9,
        color_jpeg=b"", depth_zlib=b"", depth_unit=1e-3, point_id=point_id,
    )  # fmt: skip


class Turned:
    """The process on a wire, stepped by the test."""

    def __init__(self, perception):
        self.wire = FakeWire("perception")
        process = PerceptionProcess(PerceptionConfig(frame_timeout_s=1.0), perception)
        self.runner, self.woken = Runner(process, self.wire, 0.05, clock=lambda: 0.0), threading.Event()
        process.wake = self.woken.set

    def step(self, now):
        self.runner.turn(now)

    def see(self, what, now=0.0, point_id=""):
        self.wire.deliver(CAMERA, frame(what, point_id), now)


class FakePerception:
    """Perception that does what its frames say."""

    withdrawn = ()
    pictures = ()
    rejected_wood = ()
    familiarity_unknown = False
    obstacles = (Capsule("wire", (0.0, 0.75, 1.2), (2.0, 0.75, 1.2), 0.004, 0.004),)

    def __init__(self):
        self.release, self.noted, self.newest, self.processed = threading.Event(), [], None, 0
        self.camera = SimpleNamespace(state=CameraState(header=m.Header()))
        self.localisation = RowFrame(True).message(0.0)
        self.robot_calibration = RobotCalibration(header=m.Header())
        self.camera_rays = SimpleNamespace(add=lambda frame: self.noted.append(frame.header.frame_id))

    def answer(self, request):
        return m.Answer(ok=True, reason=reasons.said(f"kept {request.rule.nodes_kept}"))

    def check_close_up(self, frame):
        return CloseUpResult(header=m.Header(), point_id=frame.point_id, number=1, finding="unseen")

    def see_cut(self, frame):
        point_id = frame.point_id.removeprefix(ON_THE_WAY)
        return CutSight(header=m.Header(), point_id=point_id, number=1, reason=reasons.no_cane_at_place())

    def points(self):
        return m.PruningPoints(header=m.Header(), segmenter="s", frames=7, points=())

    def process(self, frame):
        what = frame.header.frame_id
        self.processed += 1
        if what == "hang":
            self.release.wait(10.0)
        if what == "corrupt":
            raise CorruptFrameError(reasons.frame_image_corrupt(frame.sequence, "depth", "it ends"))
        if what == "singular":
            raise RollingPandaError("no line fits")
        self.newest = m.PruningPoints(header=m.Header(), segmenter="s", frames=self.processed, points=())
        return self.newest


@pytest.fixture
def parts():
    perception = FakePerception()
    loop = Turned(perception)
    yield loop.wire, perception, loop
    perception.release.set()


def step_until(loop, done, now=0.0):
    deadline = time.monotonic() + 5.0
    while not done():
        loop.step(now)
        assert time.monotonic() < deadline
        time.sleep(0.001)


def test_points_are_sent_when_they_are_new_and_again_at_two_hertz(parts):
    wire, _, loop = parts
    points = wire.sent[POINTS.name]
    loop.see("frame", 0.0)
    step_until(loop, lambda: points)
    for tick in range(1, 41):
        loop.step(tick / 20.0)
    assert 4 <= len(points) - 1 <= 5
    assert len({message.frames for message in points}) == 1


def test_obstacles_are_sent_once_a_second_from_the_first_frame_on(parts):
    wire, perception, loop = parts
    obstacles = wire.sent[OBSTACLES.name]
    loop.step(0.0)
    assert not obstacles
    loop.see("frame", 0.0)
    step_until(loop, lambda: obstacles)
    for tick in range(1, 62):
        loop.step(tick / 20.0)
    assert len(obstacles) == 4
    assert obstacles[-1].capsules == perception.obstacles


def test_the_camera_is_told_when_it_changes_and_a_warning_of_each_kind_is_logged_once(parts):
    wire, perception, loop = parts
    told, events = wire.sent[CAMERA_STATE.name], wire.sent[EVENT.name]
    loop.step(0.0)
    assert [state.warning for state in told] == [None]
    old, turned, more = reasons.calibration_old(91.0), *(reasons.camera_looks_left(angle, 0.2) for angle in (0.6, 0.7))
    for second, now in enumerate((old, turned, more, more), 1):
        perception.camera.state = CameraState(header=m.Header(float(second)), warning=now)
        loop.see(str(second), float(second))
        step_until(loop, lambda count=second: perception.processed == count, float(second))
        step_until(loop, lambda now=now: told[-1].warning == now, float(second))
    kinds = (old.code, turned.code)
    assert [event.reason for event in events if event.reason.code in kinds] == [old, turned]
    assert len({state.header.stamp for state in told}) == 4, "another stamp alone is no news"


def test_the_place_in_the_row_is_told_once_a_second_and_at_once_when_the_robot_is_lost(parts):
    wire, perception, loop = parts
    told, events = wire.sent[LOCALISATION.name], wire.sent[EVENT.name]
    loop.see("frame", 0.0)
    step_until(loop, lambda: told)
    for tick in range(1, 22):
        loop.step(tick / 20.0)
    assert len(told) == 2 and told[-1].state == "odometry"
    lost = reasons.lost_in_row(reasons.lost_among_others())
    perception.localisation = msgspec.structs.replace(perception.localisation, state="lost", reason=lost)
    for second in (1.06, 1.12):
        loop.see(str(second), second)
        count = perception.processed + 1
        step_until(loop, lambda count=count: perception.processed == count, second)
        step_until(loop, lambda: told[-1].reason == lost, second)
    assert len(told) == 3
    assert [event.reason for event in events].count(lost) == 1


def test_what_pictures_of_the_board_tell_is_sent_when_it_changes(parts):
    wire, perception, loop = parts
    told = wire.sent[ROBOT_CALIBRATION.name]
    loop.step(0.0)
    loop.step(0.1)
    assert [state.base_views for state in told] == [0]
    perception.robot_calibration = RobotCalibration(header=m.Header(1.0), base_views=4)
    loop.see("frame", 1.0)
    step_until(loop, lambda: told[-1].base_views == 4, 1.0)
    # Each frame computes it anew; the same one is not sent again.
    perception.robot_calibration = RobotCalibration(header=m.Header(1.0), base_views=4)
    loop.see("another", 2.0)
    step_until(loop, lambda: perception.processed == 2, 2.0)
    loop.step(2.5)
    assert [state.base_views for state in told] == [0, 4]


def test_what_was_left_out_is_told_when_it_changes_and_at_most_once_a_minute(parts):
    wire, perception, loop = parts

    def told(second, *rejected_wood):
        perception.rejected_wood = rejected_wood
        before = perception.newest
        loop.see(str(second), float(second))
        sent = wire.sent[POINTS.name]
        step_until(
            loop, lambda: sent and perception.newest is not before and sent[-1] == perception.newest, float(second)
        )
        return [e.reason for e in wire.sent[EVENT.name] if e.reason.code.startswith("wood_")]

    first = [reasons.wood_leaning(1, "trunk"), reasons.wood_too_thick(1, "post")]
    assert told(0, *first) == first
    for second in range(2, 130, 2):
        rejected = told(second, reasons.wood_off_row(second, "wire"))
    assert len(rejected) == 4
    same = rejected[-1]
    assert told(200, same) == told(270, same) == rejected


def test_the_heartbeat_counts_turns_and_stops_counting_when_a_frame_hangs(parts):
    wire, perception, loop = parts
    beats = wire.sent[HEARTBEAT.name]
    loop.see("hang", 0.0)
    for tick in range(60):
        loop.step(tick / 20.0)
    counted = [beat.sequence for beat in beats]
    assert counted[:21] == list(range(1, 22))
    assert counted[-1] == counted[22]
    assert reasons.frame_overdue(1.0) in [event.reason for event in wire.sent[EVENT.name]]
    perception.release.set()
    step_until(loop, lambda: beats[-1].sequence > counted[-1], now=3.1)


def test_a_corrupt_frame_is_told_once_and_sends_no_points(parts):
    wire, _, loop = parts
    events = wire.sent[EVENT.name]
    loop.see("corrupt", 0.0)
    step_until(loop, lambda: len(events) == 2)
    loop.see("corrupt", 0.1)
    for _ in range(20):
        loop.step(0.2)
        time.sleep(0.001)
    refused = reasons.frame_refused(reasons.frame_image_corrupt(1, "depth", "it ends"))
    assert [event.reason for event in events] == [reasons.perception_started(), refused]
    assert severity_of(refused) == "error"
    assert not wire.sent[POINTS.name]


def test_an_error_in_the_processing_of_a_frame_is_told_with_its_text(parts):
    wire, _, loop = parts
    events = wire.sent[EVENT.name]
    loop.see("singular", 0.0)
    step_until(loop, lambda: len(events) == 2)
    assert events[-1].reason == reasons.frame_refused(reasons.frame_failed("no line fits"))


def test_new_points_and_points_that_were_cut_are_no_warnings(parts):
    wire, perception, loop = parts
    events = wire.sent[EVENT.name]
    shown = m.PruningPoints(header=m.Header(), segmenter="s", frames=1, points=(point("p1", (0.3, 0.8, 1.0)),))
    perception.process = lambda frame: shown
    perception.withdrawn = (reasons.withdrawn_as_cut("p2", 1, 2, 3),)
    loop.see("frame", 0.0)
    step_until(loop, lambda: len(events) == 3)
    assert [event.reason for event in events[1:]] == [reasons.new_point(1), *perception.withdrawn]
    assert {severity_of(event.reason) for event in events} == {"info"}


def test_a_worker_hands_a_bug_to_its_owner():
    worker = Worker(lambda job: 1 / job)
    assert worker.submit(0, 0.0)
    with pytest.raises(ZeroDivisionError):
        deadline = time.monotonic() + 5.0
        while time.monotonic() < deadline:
            worker.poll()
            time.sleep(0.001)


def test_a_worker_takes_one_job_at_a_time():
    go = threading.Event()
    worker = Worker(lambda job: go.wait(5.0))
    assert worker.submit(1, 10.0) and not worker.submit(2, 11.0)
    assert worker.busy_for(11.5) == 1.5
    go.set()
    deadline = time.monotonic() + 5.0
    while (done := worker.poll()) is None:
        assert time.monotonic() < deadline
    assert done is True and worker.busy_for(12.0) == 0.0


def turns(loop, until, start=0.0):
    """Turn the loop until something holds, for at most five seconds."""
    limit = time.monotonic() + 5.0
    while not until() and time.monotonic() < limit:
        loop.step(start)
        time.sleep(0.005)
    assert until()


def test_a_close_up_wakes_the_loop_and_is_sent_before_the_rest_of_its_frame(parts):
    wire, _, loop = parts
    loop.see("hang", point_id="p1")
    loop.step(0.0)
    assert loop.woken.wait(5.0)
    loop.step(0.1)
    assert [check.point_id for check in wire.sent[CLOSE_UP.name]] == ["p1"]
    assert wire.sent[POINTS.name] == []


def test_a_request_is_answered_between_frames_and_its_points_are_sent_at_once(parts):
    wire, _, loop = parts
    said = []
    asking = threading.Thread(
        target=lambda: said.append(wire.services[PLANT.name](SetRule(user="Ada", rule=m.PruningRule(nodes_kept=3))))
    )
    asking.start()
    turns(loop, lambda: wire.sent[POINTS.name])
    asking.join(5.0)
    assert said == [m.Answer(ok=True, reason=reasons.said("kept 3"))]
    assert wire.sent[POINTS.name][-1].frames == 7


def test_a_request_that_waits_too_long_is_not_done_later(parts, monkeypatch):
    wire, perception, loop = parts
    monkeypatch.setattr("rolling_panda.transport.runner._ANSWER_MARGIN_S", PLANT.timeout_s - 0.05)
    done = []
    monkeypatch.setattr(perception, "answer", lambda request: done.append(request) or m.Answer(ok=True))
    assert not wire.services[PLANT.name](SetRule(user="Ada")).ok
    loop.see("frame")
    turns(loop, lambda: wire.sent[POINTS.name])
    assert done == []


def picture(spur, sequence=1):
    drawing = SpurDrawing(
        vine=1, spur=spur, image="ab", sequence=sequence, frame=(848, 480), window=(0, 0, 240, 180), size=(240, 180)
    )
    return SpurPicture(drawing=drawing, jpeg=b"x")


def test_a_picture_is_sent_when_it_is_new_and_again_now_and_then(parts):
    wire, perception, loop = parts
    sent = wire.sent[PICTURES.name]
    first, second = picture(1), picture(2)
    perception.pictures = (first, second)
    loop.see("frame", 0.0)
    turns(loop, lambda: len(sent) >= 2)
    for tick in range(21):
        loop.step(tick / 20.0)
    assert sent[:2] == [first, second]
    assert {each.drawing.spur for each in sent[2:]} == {1, 2} and len(sent) <= 6
    newer = picture(2, sequence=5)
    perception.pictures = (newer,)
    before = len(sent)
    loop.see("frame", 2.0)
    turns(loop, lambda: len(sent) > before, start=1.05)
    for tick in range(21):
        loop.step(2.0 + tick / 20.0)
    assert all(each == newer for each in sent[before:])


def test_a_frame_that_is_never_worked_on_can_be_clicked_all_the_same(parts):
    wire, perception, loop = parts
    noted = perception.noted
    loop.see("hang", 0.0)
    turns(loop, lambda: noted)
    loop.see("shown", 0.1)
    loop.step(0.2)
    loop.see("newer", 0.3)
    loop.step(0.4)
    assert noted == ["hang", "shown", "newer"]
    perception.release.set()


def test_a_picture_on_the_way_to_a_cut_is_answered_at_once_and_is_no_close_up(parts):
    wire, _, loop = parts
    loop.see("good", point_id=f"{ON_THE_WAY}p3")
    loop.step(0.0)
    assert loop.woken.wait(5.0)
    loop.step(0.05)
    assert [sight.point_id for sight in wire.sent[CUT_SIGHT.name]] == ["p3"] and not wire.sent[CLOSE_UP.name]
